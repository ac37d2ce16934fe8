from __future__ import annotations

import numpy as np
import pytest

from app.geometry.resection import KAPPA, LOG_FOCAL, ROLL, X, Z, camera_from_parameters
from app.solving.camera_positions import FOCAL_RANGE, STANDS, make_starts_at_typical_positions
from app.solving.observations import make_observations, principal_point
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import PITCH, click


@pytest.fixture(scope="module")
def observations():
    camera = looking((0.0, 60.0, -20.0), (34.0, -4.0, 0.0), 2400.0)
    return make_observations(click(camera, 0.0), PITCH, SIZE)


class TestStandStarts:
    def test_every_stand_is_level_and_without_a_bend(self, observations):
        starts = make_starts_at_typical_positions(observations, SIZE.diagonal)
        assert np.array_equal(starts[:, X : Z + 1], STANDS)
        assert not starts[:, [ROLL, KAPPA]].any()

    def test_a_start_where_the_camera_stands_is_the_camera_but_for_a_few_degrees_and_its_zoom(
        self, observations
    ):
        starts = make_starts_at_typical_positions(observations, SIZE.diagonal)
        nearest = np.linalg.norm(STANDS - (0.0, 60.0, -20.0), axis=1).argmin()
        assert np.allclose(STANDS[nearest], (0.0, 60.0, -20.0))
        start = camera_from_parameters(starts[nearest], principal_point(SIZE), SIZE.diagonal / 2)
        aim = np.array([[34.0, -4.0, 0.0]])
        assert np.linalg.norm(start.project(aim)[0] - principal_point(SIZE)) < 0.2 * SIZE.diagonal
        assert 1200 < np.exp(starts[nearest, LOG_FOCAL]) < 4800

    def test_focal_lengths_are_plausible_whatever_is_seen(self, observations):
        low, high = (share * SIZE.diagonal for share in FOCAL_RANGE)
        near = observations.pixels * 1e-6
        for pixels in (near, observations.pixels * 1e6):
            seen = type(observations)(observations.curves, pixels, observations.marking)
            focal = np.exp(make_starts_at_typical_positions(seen, SIZE.diagonal)[:, LOG_FOCAL])
            assert (focal >= low * (1 - 1e-12)).all()
            assert (focal <= high * (1 + 1e-12)).all()

    def test_what_is_seen_to_the_right_is_aimed_at_from_further_left(self, observations):
        moved = observations.pixels + np.array([200.0, 0.0])
        seen = type(observations)(observations.curves, moved, observations.marking)
        before = make_starts_at_typical_positions(observations, SIZE.diagonal)[:, 0]
        after = make_starts_at_typical_positions(seen, SIZE.diagonal)[:, 0]
        assert (after < before).all()
