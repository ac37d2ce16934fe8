from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.tracking.ball_track import BallMeasurements, BallTrack
from tests.cameras import looking


def measured(count: int = 4) -> BallMeasurements:
    camera = looking((0.0, 60.0, -15.0), (0.0, 0.0, 0.0), 1500.0)
    frames = np.arange(count)
    return BallMeasurements(
        frames, frames / 25, ("b", "a") * (count // 2), np.zeros((count, 2)), np.ones(count),
        (camera,) * count,
    )  # fmt: skip


class TestBallMeasurements:
    def test_a_part_keeps_what_belongs_together(self) -> None:
        part = measured().part(np.array([False, True, True, False]))
        assert part.frames.tolist() == [1, 2] and part.views == ("a", "b")
        assert len(part.cameras) == len(part.sizes) == len(part) == 2

    def test_sizes_are_unknown_unless_given(self) -> None:
        assert np.isnan(measured().sizes).all()
        assert measured().view_names == ("a", "b")


class TestBallTrack:
    def test_no_track_says_why_in_every_frame(self) -> None:
        track = BallTrack.make_empty_track(np.arange(3), np.arange(3) / 25, "Nothing was measured.")
        assert track.state == ("gap",) * 3 and track.reason == "Nothing was measured."
        assert np.isnan(track.sigma).all() and np.isnan(track.position).all()

    def test_sigma_is_the_largest_of_the_position(self) -> None:
        track = BallTrack.make_empty_track(np.arange(1), np.zeros(1), "")
        covariance = np.diag([0.01, 0.09, 0.04, 9.0, 9.0, 9.0])[None]
        known = replace(track, position=np.zeros((1, 3)), covariance=covariance)
        assert np.isclose(known.sigma, 0.3).all()
