from dataclasses import replace

import numpy as np
import pytest

from app.soccer.policy import PAPER
from app.soccer.solution import Ball3D, Calibration
from app.solving.ball_covariance import CLICK_DIAGONAL
from app.solving.ball_noise import (
    LIMIT,
    TRIMMED,
    RayResidual,
    compute_ray_residuals,
    estimate_ball_noise,
)
from app.solving.triangulate import BallObservation
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE

UNIT = SIZE.diagonal / CLICK_DIAGONAL
POINT = (30.0, 3.0, -1.0)
SHARP = tuple((1e-20 * np.eye(8)).ravel().tolist())
VIEWS = {"main": MAIN, "goal": BEHIND_GOAL, "opposite": OPPOSITE}


def sights(noise_px, rng, source="lines", diameter=0.0):
    """A ball in three views, clicked with noise."""
    covariance = SHARP if source == "lines" else None
    for key, camera in VIEWS.items():
        x, y = camera.project(np.array([POINT]))[0] + rng.normal(0, noise_px, 2)
        calibration = Calibration(source, camera, covariance=covariance)
        yield BallObservation(key, calibration, (x, y), diameter, SIZE)


def ball_in(views):
    return Ball3D(POINT, (0.0,) * 9, 0.0, 90.0, tuple(views))


def dataset(noise_px, groups=120, seed=0, source="lines", views=tuple(VIEWS)):
    rng = np.random.default_rng(seed)
    return [
        miss
        for _ in range(groups)
        for miss in compute_ray_residuals(ball_in(views), list(sights(noise_px, rng, source)))
    ]


def blurred(rng, sigma, share, numbers=600):
    """Misses by clicks of that sigma, of balls of 5 to 40 pixels."""
    for diameter in rng.uniform(5, 40, numbers):
        variance = sigma**2 + share**2 * diameter**2
        yield RayResidual(rng.normal(0, np.sqrt(variance)), 1.0, diameter**2, 0.0, 0.0)


class TestMissesOf:
    @pytest.mark.parametrize(("views", "numbers"), [(("main", "goal"), 1), (tuple(VIEWS), 3)])
    def test_views_leave_twice_their_number_less_three(self, views, numbers):
        assert len(dataset(1.0, groups=1, views=views)) == numbers

    def test_a_view_outside_the_valid_pairs_says_nothing(self):
        assert dataset(1.0, groups=1, views=("main",)) == []

    def test_a_camera_that_its_lines_leave_open_says_nothing(self):
        seen = list(sights(1.0, np.random.default_rng(0)))
        seen[0] = replace(seen[0], calibration=Calibration("lines", MAIN))
        assert len(compute_ray_residuals(ball_in(VIEWS), seen)) == 1

    def test_exact_clicks_leave_nothing(self):
        assert max(abs(item.miss) for item in dataset(0.0, groups=1)) < 1e-9

    def test_a_click_counts_in_pixels_at_full_hd(self):
        assert [item.click for item in dataset(1.0, groups=1)] == pytest.approx([UNIT**2] * 3)

    def test_a_given_camera_is_told_from_one_of_lines(self):
        assert {item.given for item in dataset(1.0, groups=1)} == {0.0}
        assert min(item.given for item in dataset(1.0, groups=1, source="given")) > 0


class TestEstimateBallNoise:
    @pytest.mark.parametrize("sigma", [0.5, 1.0, 2.0, 3.0])
    def test_the_noise_is_found_and_lies_in_its_interval(self, sigma):
        found = estimate_ball_noise(dataset(sigma * UNIT), PAPER).click
        assert found.value == pytest.approx(sigma, rel=0.15)
        assert found.low < sigma < found.high

    def test_one_wrong_ball_in_ten_does_no_harm(self):
        misses = dataset(UNIT, seed=1)
        wrong = [replace(item, miss=25.0) if n % 10 == 0 else item for n, item in enumerate(misses)]
        found = estimate_ball_noise(wrong, PAPER).click
        assert found.value == pytest.approx(1.0, rel=0.15)
        assert found.left_out == len(misses) // 10

    def test_what_the_diameter_adds_is_told_from_the_click(self):
        rng = np.random.default_rng(3)
        found = estimate_ball_noise(list(blurred(rng, 0.5, 0.06)), PAPER)
        assert found.share == pytest.approx(0.06, abs=0.011)
        assert found.click.value == pytest.approx(0.5, abs=0.2)

    def test_what_cameras_explain_is_not_blamed_on_clicks(self):
        rng = np.random.default_rng(4)
        misses = [RayResidual(rng.normal(0, 2.0), 1.0, 0.0, 0.0, 3.0) for _ in range(400)]
        assert estimate_ball_noise(misses, PAPER).click.value == pytest.approx(1.0, rel=0.25)

    def test_of_given_cameras_the_rest_is_theirs(self):
        found = estimate_ball_noise(dataset(1.5 * UNIT, source="given"), PAPER)
        assert found.click is None
        # Clicks of 1 px, as the policy thinks, and cameras make 1.5 px together.
        assert found.given.value == pytest.approx(np.sqrt(1.25), rel=0.2)

    def test_neighbours_that_err_alike_widen_the_interval(self):
        rng = np.random.default_rng(5)
        alike = [
            RayResidual(scale * rng.normal(), 1.0, 0.0, 0.0, 0.0)
            for scale in rng.choice([0.6, 1.5], 10).repeat(60)
        ]
        alone = [alike[at] for at in rng.permutation(len(alike))]
        wide, narrow = (estimate_ball_noise(item, PAPER).click for item in (alike, alone))
        assert wide.high / wide.low > 1.5 * narrow.high / narrow.low

    def test_no_groups_say_nothing(self):
        found = estimate_ball_noise([], PAPER)
        assert (found.click, found.share, found.given) == (None, None, None)

    def test_each_further_group_says_more(self):
        """No number of groups is the first that counts."""
        off = [
            np.log(
                [
                    estimate_ball_noise(dataset(3.0 * UNIT, groups=groups, seed=seed)).click.value
                    / 3
                    for seed in range(12)
                ]
            )
            for groups in (1, 4, 16)
        ]
        one, four, many = (np.sqrt((logs**2).mean()) for logs in off)
        assert one > four > many and many < 0.15

    @pytest.mark.parametrize("miss", [0.0, 2.0, 40.0])
    def test_one_number_is_enough_to_be_told(self, miss):
        found = estimate_ball_noise([RayResidual(miss, 1.0, 100.0, 0.0, 0.1)]).click
        assert found.low < found.value < found.high and found.high > 3 * found.low

    def test_of_few_numbers_it_is_wider_and_so_is_its_interval(self):
        """Ellipsoids must hold though nobody knows their size exactly."""
        few = estimate_ball_noise([RayResidual(1.0, 1.0, 0.0, 0.0, 0.0)] * 3).click
        many = estimate_ball_noise([RayResidual(1.0, 1.0, 0.0, 0.0, 0.0)] * 300).click
        assert few.value > 1.15 * many.value
        assert few.low < 0.5 * many.low and few.high > 1.5 * many.high

    def test_what_the_policy_has_plays_no_part_where_clicks_can_be_told(self):
        """So what is estimated once it is used is the same."""
        misses = dataset(2.0 * UNIT, groups=8)
        other = replace(PAPER, click_sigma_px=5.0, box_sigma_share=0.2)
        assert estimate_ball_noise(misses, other) == estimate_ball_noise(misses, PAPER)

    def test_what_is_no_noise_is_none(self):
        rng = np.random.default_rng(6)
        alike = [RayResidual(rng.normal(0, 500.0), 1.0, 0.0, 0.0, 1.0) for _ in range(100)]
        found = estimate_ball_noise(alike, PAPER)
        assert (found.click, found.share) == (None, None)
        rest = [replace(item, given=1.0) for item in alike]
        assert estimate_ball_noise(rest, PAPER).given is None

    def test_clicks_that_cannot_be_told_from_none_are_small(self):
        exact = [RayResidual(0.0, 1.0, 0.0, 0.0, 1.0)] * 100
        assert estimate_ball_noise(exact, PAPER).click.value < 0.5

    def test_the_estimate_moves_by_less_than_the_steps_that_are_tried(self):
        rng = np.random.default_rng(8)
        misses = [RayResidual(miss, 1.0, 0.0, 0.0, 0.0) for miss in rng.normal(0, 1.0, 400)]
        larger = [replace(item, miss=1.01 * item.miss) for item in misses]
        one, other = (estimate_ball_noise(item, PAPER).click.value for item in (misses, larger))
        assert other / one == pytest.approx(1.01, abs=0.001)

    def test_numbers_within_the_limit_have_the_variance_that_makes_up_for_the_others(self):
        numbers = np.linspace(-np.sqrt(LIMIT), np.sqrt(LIMIT), 200_001)
        density = np.exp(-(numbers**2) / 2)
        assert pytest.approx((numbers**2 * density).sum() / density.sum(), abs=1e-5) == TRIMMED


class TestRigs:
    """Given cameras with a covariance, which is mostly common to all of a rig."""

    def test_they_say_nothing_of_clicks(self):
        rng = np.random.default_rng(0)
        vague = tuple(np.diag([0.0, 0.0, 0.0, 0.01, 0.01, 0.01, 0.0, 0.0]).ravel().tolist())
        rig = [
            replace(sight, calibration=replace(sight.calibration, covariance=vague))
            for sight in sights(2.0, rng, "given")
        ]
        assert compute_ray_residuals(ball_in(VIEWS), rig) == ()
        one = [*sights(2.0, rng, "given")][:2] + rig[2:]
        assert len(compute_ray_residuals(ball_in(VIEWS), one)) == 1
