from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.geometry.camera import Camera
from app.geometry.resection import camera_from_parameters, parameters_from_camera
from app.geometry.triangulation import triangulate_pairs
from app.soccer.frames import ImagePoint
from app.soccer.picture import PictureGeometry
from app.soccer.policy import PAPER
from app.soccer.solution import Calibration
from app.solving.ball_covariance import (
    CLICK_DIAGONAL,
    CovarianceOfMeanBall,
    ball_click_variance,
    calibration_pixel_covariance,
    calibration_pixel_covariances,
    is_covariance_within,
    major_axis_sigma,
    pixel_covariance,
)
from app.solving.facts import collect_facts_of_views, facts_from_bytes, facts_to_bytes, join_facts
from app.solving.judgement import judge_groups
from app.solving.observations import principal_point
from app.solving.picture_camera import picture_to_warp, warp_to_picture
from app.solving.triangulate import BallObservation
from tests.cameras import SIZE, WIDE_LENSES, looking, wide
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, given_view
from tests.unit.solving.random_groups import random_policy, random_views

BALL = (38.0, 2.0, -1.4)
MIDDLE = principal_point(SIZE)
DIAGONAL = np.array([CLICK_DIAGONAL])


class TestClickVariance:
    def test_is_the_policys_value_at_the_diagonal_of_full_hd(self):
        policy = replace(PAPER, click_sigma_px=3.0, box_sigma_share=0.5)
        assert ball_click_variance(DIAGONAL, np.array([0.0]), policy) == pytest.approx(9.0)
        assert ball_click_variance(DIAGONAL / 2, np.array([0.0]), policy) == pytest.approx(2.25)
        assert ball_click_variance(DIAGONAL, np.array([8.0]), policy) == pytest.approx(9.0 + 16.0)

    @given(st.floats(0.01, 9.0), st.floats(0.0, 60.0))
    def test_a_single_value_has_the_bits_of_a_python_float(self, click, diameter):
        policy = replace(PAPER, click_sigma_px=click)
        sigma = float(np.hypot(click * CLICK_DIAGONAL / CLICK_DIAGONAL, 0.04 * diameter))
        assert ball_click_variance(DIAGONAL, np.array([diameter]), policy).tolist() == [sigma**2]

    def test_given_cameras_add_theirs_where_nobody_says_how_exact_they_are(self):
        policy = replace(PAPER, click_sigma_px=3.0, given_sigma_px=4.0)
        bare = np.array([True, False])
        found = ball_click_variance(np.repeat(DIAGONAL, 2), np.zeros(2), policy, bare)
        assert found == pytest.approx([25.0, 9.0])


class TestCalibrationSpread:
    def test_a_camera_that_may_stand_aside_moves_the_pixel_by_as_much(self):
        camera = looking((0.0, 20.0, 0.0), (0.0, 0.0, 0.0), 1000.0)
        covariance = np.zeros((8, 8))
        covariance[3, 3] = 0.04
        calibration = Calibration("lines", camera, covariance=tuple(covariance.ravel()))
        spread = calibration_pixel_covariance(calibration, SIZE, np.zeros(3))
        # 20 cm at 20 m are 10 px for 1000 px a radian.
        assert np.allclose(spread, [[100.0, 0.0], [0.0, 0.0]])
        sight = BallObservation("a", calibration, ImagePoint(639.5, 359.5), 0.0, SIZE)
        noise = (SIZE.diagonal / CLICK_DIAGONAL) ** 2
        assert np.allclose(pixel_covariance(sight, np.zeros(3), PAPER), spread + noise * np.eye(2))

    def test_a_given_camera_counts_as_exact_until_the_policy_knows_better(self):
        sight = BallObservation(
            "a", Calibration("given", MAIN), ImagePoint(639.5, 359.5), 0.0, SIZE
        )
        noise = (SIZE.diagonal / CLICK_DIAGONAL) ** 2
        blurred = replace(PAPER, given_sigma_px=7.0)
        assert np.allclose(pixel_covariance(sight, np.array(BALL), PAPER), noise * np.eye(2))
        assert np.allclose(pixel_covariance(sight, np.array(BALL), blurred), 50 * noise * np.eye(2))

    def test_of_a_given_camera_nothing_is_known(self):
        assert not calibration_pixel_covariance(
            Calibration("given", MAIN), SIZE, np.array(BALL)
        ).any()


class TestPictureSpreads:
    """Of a picture that was stretched and cropped since it was taken."""

    DONE = PictureGeometry(1.2, (0.2, -0.1))
    WHOLE = np.diag(np.array([1e-3, 2e-3, 1e-3, 0.3, 0.2, 0.1, 5e-3, 5e-3, 0.02, 0.03, 0.04]) ** 2)
    HALF = SIZE.diagonal / 2

    def calibration(self, whole):
        camera = self.DONE.camera_of_annotated_picture(
            camera_from_parameters(self.taken(), MIDDLE, self.HALF), SIZE
        )
        covariance = tuple(whole[:8, :8].ravel().tolist())
        whole_ = tuple(whole.ravel().tolist())
        return Calibration("lines", camera, covariance=covariance, picture_covariance=whole_)

    def taken(self):
        return parameters_from_camera(BEHIND_GOAL, self.HALF)

    def pixel(self, unknowns):
        camera = camera_from_parameters(unknowns[:8], MIDDLE, self.HALF)
        return (
            warp_to_picture(unknowns[8:], (0, 0, 0))
            .camera_of_annotated_picture(camera, SIZE)
            .project(np.array([BALL]))[0]
        )

    def test_are_those_of_camera_and_picture_together(self):
        rng = np.random.default_rng(3)
        mixed = np.eye(11) + 0.3 * rng.normal(size=(11, 11))
        scale = np.sqrt(np.diag(self.WHOLE))
        whole = mixed @ mixed.T * np.outer(scale, scale)
        at = np.append(self.taken(), picture_to_warp(self.DONE))
        steps = 1e-6 * np.eye(11)
        slopes = (
            np.array([self.pixel(at + step) - self.pixel(at - step) for step in steps]).T / 2e-6
        )
        expected = slopes @ whole @ slopes.T
        found = calibration_pixel_covariance(self.calibration(whole), SIZE, np.array(BALL))
        np.testing.assert_allclose(found, expected, rtol=1e-4)

    def test_facts_say_the_same_once_they_were_kept(self):
        calibration = self.calibration(self.WHOLE)
        views = [
            given_view("a", calibration.camera, BALL),
            given_view("b", MAIN, BALL),
        ]
        other = Calibration("lines", MAIN, covariance=tuple((1e-6 * np.eye(8)).ravel().tolist()))
        facts = collect_facts_of_views(views, [calibration, other])
        found = facts_from_bytes([facts_to_bytes(facts)])
        points = np.array([BALL, BALL])
        spreads = calibration_pixel_covariances(found, np.arange(2), points)
        for at, one in enumerate((calibration, other)):
            alone = calibration_pixel_covariance(one, SIZE, points[at])
            np.testing.assert_allclose(spreads[at], alone, rtol=2e-3)


class TestLongestSigma:
    def test_is_along_the_longest_axis(self):
        turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
        spread = turn @ np.diag([9.0, 1.0, 4.0]) @ turn.T
        assert major_axis_sigma(spread[None]) == pytest.approx([3.0])

    def test_an_unknown_covariance_has_an_infinite_sigma(self):
        spreads = np.stack([np.full((3, 3), np.nan), np.eye(3)])
        assert major_axis_sigma(spreads).tolist() == [np.inf, 1.0]
        assert is_covariance_within(spreads, 2.0).tolist() == [False, True]


class TestIsWithin:
    @given(st.integers(0, 10_000), st.floats(0.2, 1.8))
    def test_says_what_the_eigenvalues_say(self, seed, share):
        root = np.random.default_rng(seed).normal(size=(20, 3, 3)) * [1.0, 0.3, 0.1]
        spreads = root @ root.transpose(0, 2, 1)
        limit = share * float(np.median(major_axis_sigma(spreads)))
        assert np.array_equal(
            is_covariance_within(spreads, limit), major_axis_sigma(spreads) <= limit
        )

    def test_a_limit_equal_to_the_sigma_is_met(self):
        root = np.random.default_rng(4).normal(size=(50, 3, 3))
        for spread in (root @ root.transpose(0, 2, 1))[:, None]:
            (sigma,) = major_axis_sigma(spread)
            assert is_covariance_within(spread, float(sigma)).all()
            assert not is_covariance_within(spread, float(np.nextafter(sigma, 0.0))).any()

    def test_a_threshold_of_zero_lets_nothing_through(self):
        assert is_covariance_within(np.eye(3)[None], 0.0).tolist() == [False]


class TestMeanSpread:
    def covariance(self, *cameras: Camera, policy=PAPER) -> np.ndarray:
        views = [given_view(str(place), camera, BALL) for place, camera in enumerate(cameras)]
        facts = collect_facts_of_views(views, [Calibration("given", camera) for camera in cameras])
        spread = CovarianceOfMeanBall(facts)
        judgement = judge_groups(facts, policy, spread)
        return spread.covariances(judgement.valid, np.array([0]), judgement.point, policy)[0]

    def test_is_the_scatter_of_noisy_clicks(self):
        policy = replace(PAPER, box_sigma_share=0.0, click_sigma_px=1.5)
        rng, cameras = np.random.default_rng(1), (MAIN, BEHIND_GOAL, OPPOSITE)
        bare = [replace(camera, distortion=np.zeros(12)) for camera in cameras]
        sigma = 1.5 * SIZE.diagonal / CLICK_DIAGONAL
        seen = [
            camera.project(np.array([BALL])) + rng.normal(0, sigma, (4000, 2)) for camera in bare
        ]
        P = [np.stack([camera.P] * 4000) for camera in bare]
        pairs = [
            triangulate_pairs(P[a], P[b], seen[a], seen[b]) for a, b in ((0, 1), (0, 2), (1, 2))
        ]
        scattered = np.cov(np.mean(pairs, axis=0).T)
        found = self.covariance(*cameras, policy=policy)
        assert np.allclose(found, scattered, atol=0.08 * np.abs(scattered).max())

    @pytest.mark.parametrize("lens", WIDE_LENSES)
    def test_is_the_scatter_of_noisy_clicks_through_wide_lenses(self, lens):
        policy = replace(PAPER, box_sigma_share=0.0, click_sigma_px=1.0)
        focal = 400.0 if lens == "fisheye" else 600.0
        # Both look past the ball, which lies far out in their pictures.
        cameras = [
            wide((30.0, 40.0, -9.0), (5.0, 22.0, 0.0), lens, focal=focal),
            wide((60.0, -20.0, -9.0), (38.0, -33.0, 0.0), lens, focal=focal),
        ]
        ideal = [camera.pitch_to_camera(np.array([BALL]))[0] for camera in cameras]
        assert min(np.hypot(x, y) / z for x, y, z in ideal) > np.tan(np.radians(50))
        rng = np.random.default_rng(1)
        sigma = SIZE.diagonal / CLICK_DIAGONAL
        seen = [
            camera.undistort(camera.project(np.array([BALL])) + rng.normal(0, sigma, (20_000, 2)))
            for camera in cameras
        ]
        points = triangulate_pairs(*(np.stack([c.P] * 20_000) for c in cameras), *seen)
        scattered = np.cov(points.T)
        found = self.covariance(*cameras, policy=policy)
        assert np.allclose(found, scattered, atol=0.06 * np.abs(scattered).max())

    def test_grows_with_the_square_of_what_given_cameras_add(self):
        plain, wide = (
            self.covariance(
                MAIN,
                OPPOSITE,
                policy=replace(
                    PAPER, box_sigma_share=0.0, click_sigma_px=1.0, given_sigma_px=sigma
                ),
            )
            for sigma in (0.0, np.sqrt(3.0))
        )
        assert np.allclose(wide, 4 * plain)

    def test_grows_with_the_square_of_the_click(self):
        one, two = (
            self.covariance(
                MAIN, OPPOSITE, policy=replace(PAPER, box_sigma_share=0.0, click_sigma_px=click)
            )
            for click in (1.0, 2.0)
        )
        assert np.allclose(two, 4 * one)

    @given(st.lists(st.integers(0, 1000), min_size=2, max_size=6))
    @settings(max_examples=30, deadline=None)
    def test_results_kept_for_other_policies_change_no_bit(self, seeds):
        facts = join_facts([collect_facts_of_views(*random_views(seed)) for seed in range(60)])
        kept = CovarianceOfMeanBall(facts)
        for seed in seeds:
            policy = replace(random_policy(seed), max_sigma_m=0.1)
            judgement, groups = judge_groups(facts, policy, kept), np.arange(facts.groups)
            there = groups[~np.isnan(judgement.point[:, 0])]
            asked = (judgement.valid, there, judgement.point[there], policy)
            fresh = CovarianceOfMeanBall(facts).covariances(*asked)
            assert np.array_equal(kept.covariances(*asked), fresh, equal_nan=True)

    def test_a_group_of_thirteen_views_has_more_pairs_than_are_kept(self):
        rng = np.random.default_rng(8)
        cameras = [
            replace(MAIN, position=MAIN.position + rng.normal(0, 9, 3), distortion=np.zeros(12))
            for _ in range(13)
        ]
        views = [given_view(str(place), camera, BALL) for place, camera in enumerate(cameras)]
        facts = collect_facts_of_views(views, [Calibration("given", camera) for camera in cameras])
        kept, zero = CovarianceOfMeanBall(facts), np.array([0])
        for last in (70, 71):
            valid = np.arange(len(facts.pair_group)) <= last
            point = facts.pair_point[valid].mean(axis=0)[None]
            fresh = CovarianceOfMeanBall(facts).covariances(valid, zero, point, PAPER)
            assert np.array_equal(kept.covariances(valid, zero, point, PAPER), fresh)
