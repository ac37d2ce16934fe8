"""Real balls over time: ISSIA's clicks predicted, and a minute of a match seen by its cameras."""

from __future__ import annotations

import numpy as np
import pytest

from app.soccer.pitch import Pitch
from app.tracking.ball_solve import track_ball
from tests.bench.ball_track import clicked, issia, judged, left_out_of, main, replays, through
from tests.bench.link import DATA, hawkeye

BALL = hawkeye()
pytestmark = pytest.mark.skipif(
    BALL is None or not (DATA / "issia").is_dir(), reason=f"no real ball or rig in {DATA}"
)


@pytest.fixture(scope="module")
def rig():
    clicks, given, bundled = issia(DATA)
    return clicks, given, bundled


class TestIssia:
    @pytest.mark.parametrize(("run", "of", "px"), [(1, 5, 1.0), (5, 25, 1.7), (10, 40, 2.5)])
    def test_frames_left_out_are_predicted(self, rig, run: int, of: int, px: float) -> None:
        clicks, _, bundled = rig
        off, _, asked, _, seconds = left_out_of(clicked(clicks, bundled), run, of)
        assert np.median(off) <= px and len(off) > 0.98 * asked
        assert seconds < 10

    def test_given_cameras_contradict_each_other_and_make_a_track_all_the_same(self, rig) -> None:
        clicks, given, _ = rig
        off, _, asked, against, _ = left_out_of(clicked(clicks, given), 5, 25)
        assert np.median(off) < 4.0 and len(off) > 0.8 * asked and against < 200

    def test_given_cameras_that_are_inexact_are_not_told_to_be_late(self, rig) -> None:
        clicks, given, _ = rig
        measured = clicked(clicks, given)
        frames = np.arange(measured.frames.min(), measured.frames.max() + 1)
        track = track_ball(measured, frames, frames / 25, pitch=Pitch())
        assert track.offsets == ()
        assert len(track.contradicted) < 100


class TestHawkEyeMinute:
    def test_six_cameras_with_runs_missing(self, rig) -> None:
        found = judged(BALL, [through(BALL, rig[2], seed, 0.0, 0.3) for seed in range(3)])
        assert found.known > 0.99 and found.median <= 0.1 and found.p95 <= 0.5
        assert 0.93 <= found.inside <= 0.97
        assert found.events >= 0.9

    def test_a_panning_camera_and_slow_replays(self) -> None:
        found = judged(BALL, [replays(BALL, 0)])
        assert found.median <= 0.25 and found.all_inside > 0.9

    def test_one_camera_alone(self) -> None:
        found = judged(BALL, [main(BALL, seed) for seed in range(3)])
        assert found.within >= 0.66 and found.placed > 0.4
        assert found.all_inside > 0.85
