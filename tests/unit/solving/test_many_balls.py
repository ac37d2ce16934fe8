import numpy as np
import pytest

from app.soccer.policy import PAPER
from app.solving.many_balls import ManyViews, solve_many
from app.solving.solve import solve
from tests.unit.solving.conftest import (
    BEHIND_GOAL,
    MAIN,
    OPPOSITE,
    SIZE,
    given_view,
    group,
    looking,
)

CAMERAS = {
    "a": MAIN,
    "b": BEHIND_GOAL,
    "c": OPPOSITE,
    "d": looking((3.4, 62.2, -16.0), (34.0, -4.0, 0.0), 2300.0, kappa=0.0),
}


def make_groups(count=40):
    """Groups of two to four views, some of whose balls are moved far away."""
    generator = np.random.default_rng(4)
    groups = []
    for index in range(count):
        ball = generator.uniform([36, -3, -2], [41, 5, -0.1])
        names = sorted(generator.choice(list(CAMERAS), generator.integers(2, 5), replace=False))
        views = [
            given_view(
                name, CAMERAS[name], ball + generator.normal(0, 0.02 + 0.8 * (index % 5 == 0), 3)
            )
            for name in names
        ]
        groups.append(group(*views, key=str(index)))
    return groups


def as_arrays(groups) -> ManyViews:
    views = [(number, view) for number, item in enumerate(groups) for view in item.views]
    cameras = [view.station.given for _, view in views]
    pixels = [
        camera.undistort(np.array([view.ball.center]))[0]
        for camera, (_, view) in zip(cameras, views, strict=True)
    ]
    return ManyViews(
        group=np.array([number for number, _ in views]),
        rotation=np.array([camera.rotation for camera in cameras]),
        position=np.array([camera.position for camera in cameras]),
        K=np.array([camera.K for camera in cameras]),
        pixels=np.array(pixels),
        tau_px=np.full(len(views), 0.01 * SIZE.diagonal),
    )


@pytest.fixture(scope="module")
def solved():
    groups = make_groups()
    return [solve(item, PAPER) for item in groups], solve_many(as_arrays(groups), 0.226, 1.0)


class TestSolveMany:
    def test_every_pair_is_that_of_the_single_solution(self, solved):
        single, many = solved
        points = [pair.point for solution in single for pair in solution.pairs]
        assert np.allclose(many.points, points, atol=1e-9)

    def test_the_same_pairs_are_valid_as_near_as_distortion_lets(self, solved):
        single, many = solved
        valid = [pair.valid for solution in single for pair in solution.pairs]
        assert np.mean(many.valid == valid) > 0.98
        assert 0.2 < np.mean(valid) < 0.95

    def test_balls_are_the_means_and_missing_where_no_pair_is_valid(self, solved):
        single, many = solved
        for solution, ball in zip(single, many.balls, strict=True):
            if solution.ball is None:
                assert np.isnan(ball).all()
            else:
                assert np.allclose(ball, solution.ball.point, atol=1e-9)

    def test_diameters_are_those_of_the_boxes(self, solved):
        single, many = solved
        expected = [
            view.ball.optimized_diameter_px if view.ball is not None else np.nan
            for solution in single
            for view in solution.views
        ]
        # The square of a distorted picture is measured there, a few per mille larger.
        assert np.allclose(many.diameters_px, expected, rtol=0.03, equal_nan=True)
