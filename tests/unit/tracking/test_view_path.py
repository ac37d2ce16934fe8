from __future__ import annotations

import numpy as np
import pytest

from app.geometry.camera import Camera
from app.solving.sides import turn_camera
from app.tracking.view_path import ViewPath, compare_paths, compute_view_path
from tests.bench.link import at_times, film, made_ball

BALL = made_ball(30.0, seed=7)
LIVE_STAND, OPPOSITE = (0.0, 62.0, -16.0), (10.0, -66.0, -14.0)


def shown(
    first: float, last: float, stand: tuple[float, float, float], speed: float = 1.0
) -> ViewPath:
    """The path of a camera that follows play from one time to another, at the speed of a replay."""
    times = np.arange(0, (last - first) / speed, 0.04)
    filmed = film(
        at_times(BALL, first + speed * times), times, stand, 1900.0, lag=round(12 / speed)
    )
    return compute_view_path(times.tolist(), filmed.cameras)


class TestViewPath:
    def test_it_is_where_the_middle_of_the_picture_lies_five_times_a_second(self) -> None:
        times = np.arange(0, 2, 0.04)
        cameras: list[Camera | None] = list(
            film(at_times(BALL, times), times, LIVE_STAND, 1900.0).cameras
        )
        cameras[10:20] = [None] * 10
        path = compute_view_path(times.tolist(), cameras)
        assert np.diff(path.times).min() >= 0.2 - 1e-9
        assert not ((path.times > 0.39) & (path.times < 0.79)).any()
        first = cameras[0]
        assert first is not None
        assert first.project(np.array([[*path.places[0], 0.0]]))[0] == pytest.approx(
            first.principal_point, abs=1e-6
        )

    def test_of_no_camera_there_is_none(self) -> None:
        assert len(compute_view_path([0.0, 1.0], [None, None])) == 0


class TestLiken:
    @pytest.mark.parametrize("speed", [1.0, 0.5, 0.25])
    def test_a_replay_is_like_the_play_that_it_shows(self, speed: float) -> None:
        live, other = shown(2, 14, LIVE_STAND), shown(16, 28, LIVE_STAND)
        replay = shown(7, 10, OPPOSITE, speed)
        found, unlike = compare_paths(live, replay), compare_paths(other, replay)
        assert found is not None and unlike is not None
        assert found.apart_m < 3 and found.apart_m < unlike.apart_m / 2
        assert not found.turned
        assert found.speed == speed and found.offset == pytest.approx(5, abs=0.4)

    def test_one_that_was_tracked_turned_is_like_it_once_it_is_turned(self) -> None:
        times = np.arange(0, 6, 0.04)
        filmed = film(at_times(BALL, 7 + 0.5 * times), times, OPPOSITE, 1900.0, lag=24)
        replay = compute_view_path(times.tolist(), [turn_camera(one) for one in filmed.cameras])
        found = compare_paths(shown(2, 14, LIVE_STAND), replay)
        assert found is not None and found.turned and found.apart_m < 3

    def test_too_little_is_like_nothing(self) -> None:
        live = shown(2, 14, LIVE_STAND)
        assert compare_paths(live, compute_view_path([], [])) is None
        assert compare_paths(shown(2, 2.5, LIVE_STAND), live) is None
        assert compare_paths(live, shown(7, 7.6, OPPOSITE)) is None
