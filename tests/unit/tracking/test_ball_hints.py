from __future__ import annotations

import numpy as np

from app.tracking.ball_hints import LinkedBall, predicted_places
from tests.bench.link import film
from tests.cameras import looking

TIMES = np.arange(0, 2, 0.04)
PLACES = np.column_stack([8 * TIMES - 8, 3 * TIMES, -np.abs(3 * np.sin(3 * TIMES)) - 0.11])
OTHER = film(PLACES, TIMES, (0.0, 62.0, -16.0), 1900.0)
HERE = looking((20.0, -60.0, -12.0), (0.0, 0.0, 0.0), 1500.0)
BALL = LinkedBall.of(TIMES.tolist(), OTHER.pixels.tolist(), OTHER.cameras)


def off(time: float, sigma_s: float = 0.0) -> tuple[float, float]:
    """How far a place is from the ball, in its standard deviations, and across its segment, pixels."""
    place = predicted_places(BALL, {7: (time, HERE)}, sigma_s)[7]
    truth = [np.interp(time, TIMES, PLACES[:, axis]) for axis in range(3)]
    beside = HERE.project(np.array([truth]))[0] - (place.x, place.y)
    _, axes = np.linalg.eigh(place.covariance)
    away = float(np.sqrt(beside @ np.linalg.solve(place.covariance, beside)))
    return away, abs(float(beside @ axes[:, 0]))


class TestPredictedPlaces:
    def test_the_ball_is_on_the_segment_of_likely_heights(self) -> None:
        found = np.array([off(time) for time in np.arange(0.1, 1.9, 0.07)])
        assert found[:, 0].max() < 1.5 and found[:, 1].max() < 2.0

    def test_what_the_times_are_apart_widens_it_along_the_motion(self) -> None:
        sure, unsure = (
            predicted_places(BALL, {7: (1.0, HERE)}, sigma)[7].covariance for sigma in (0.0, 0.1)
        )
        moved = HERE.project(np.array([[0.0, 3.0, -1.0], [0.8, 3.3, -1.0]]))
        far = float(np.linalg.norm(moved[1] - moved[0]))
        along = (moved[1] - moved[0]) / far
        assert along @ (unsure - sure) @ along > 0.5 * far**2
        assert np.linalg.eigvalsh(unsure - sure)[0] > -1e-6

    def test_nothing_is_said_beyond_what_the_other_view_shows(self) -> None:
        frames = {0: (-0.1, HERE), 1: (2.1, HERE), 2: (1.0, HERE), 3: (0.0, HERE)}
        assert set(predicted_places(BALL, frames, 0.0)) == {2, 3}
        part = np.flatnonzero((TIMES < 0.8) | (TIMES > 1.2)).tolist()
        holed = LinkedBall(TIMES[part], BALL.positions[part], BALL.rays[part])
        assert set(predicted_places(holed, frames, 0.0)) == {3}

    def test_a_camera_that_looks_away_shows_nothing(self) -> None:
        away = looking((20.0, -60.0, -12.0), (20.0, -200.0, 0.0), 1500.0)
        assert predicted_places(BALL, {0: (1.0, away)}, 0.0) == {}
