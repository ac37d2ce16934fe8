import numpy as np
import pytest

from app.geometry.bundle import (
    RayPixels,
    bundle_equations,
    linearize,
    optimize_points,
    ray_pair_distances_px,
    triangulate_nearest_points,
)
from app.geometry.camera import Camera
from app.geometry.resection import X, Z, camera_from_parameters, parameters_from_camera
from tests.cameras import looking

HALF_DIAGONAL = 734.0
CAMERAS = (
    looking((-20.0, 80.0, -20.0), (0.0, 5.0, 0.0), 1800.0, bend=0.02),
    looking((15.0, -75.0, -18.0), (2.0, -3.0, 0.0), 1700.0, bend=-0.01),
    looking((70.0, 10.0, -15.0), (0.0, 0.0, 0.0), 1500.0, bend=0.01),
)
TRUTH = np.array([parameters_from_camera(camera, HALF_DIAGONAL) for camera in CAMERAS])
POINTS = np.random.default_rng(3).uniform((-15, -12, -6), (15, 12, 0), (12, 3))


def rays_of(noise_px: float = 0.0, views: int = 3, sigma: float = 1.0) -> RayPixels:
    generator = np.random.default_rng(5)
    camera, point = (part.ravel() for part in np.meshgrid(range(views), range(len(POINTS))))
    pixels = np.empty((len(camera), 2))
    for row in range(views):
        plain: Camera = camera_from_parameters(TRUTH[row], (0.0, 0.0), HALF_DIAGONAL)
        pixels[camera == row] = plain.project(POINTS[point[camera == row]])
    pixels += generator.normal(0, noise_px, pixels.shape)
    return RayPixels(
        pixels, camera, point, np.full(len(camera), sigma), np.full(views, HALF_DIAGONAL)
    )


class TestRays:
    def test_only_some_points_keep_their_order(self):
        rays = rays_of()
        kept = np.zeros(len(POINTS), bool)
        kept[[2, 7]] = True
        some = rays.select_rays_of_points(kept)
        assert some.point_count == 2
        assert np.array_equal(some.pixels[some.point == 1], rays.pixels[rays.point == 7])

    def test_of_two_cameras_leaves_out_points_that_one_does_not_show(self):
        rays = rays_of()
        hidden = (rays.camera == 1) & (rays.point == 4)
        less = RayPixels(
            rays.pixels[~hidden],
            rays.camera[~hidden],
            rays.point[~hidden],
            rays.sigma[~hidden],
            rays.half_diagonals,
        )
        pair, rows = less.select_common_points(0, 1)
        assert rows.tolist() == [row for row in range(len(POINTS)) if row != 4]
        assert sorted(pair.camera.tolist()) == [0] * 11 + [1] * 11


class TestLinearize:
    def test_nothing_is_left_at_the_truth(self):
        assert np.abs(linearize(TRUTH, POINTS, rays_of()).residuals).max() < 1e-9

    def test_residuals_are_in_sigmas(self):
        one, two = (linearize(TRUTH, POINTS, rays_of(1.0, sigma=size)) for size in (1.0, 2.0))
        assert np.allclose(one.residuals, 2 * two.residuals)
        assert np.allclose(one.by_camera, 2 * two.by_camera)

    def test_derivatives_match_finite_differences(self):
        rays = rays_of(1.0)
        at = linearize(TRUTH, POINTS, rays)
        for parameter in range(8):
            step = 1e-6 * max(1.0, abs(TRUTH[0, parameter]))
            moved = [TRUTH.copy(), TRUTH.copy()]
            moved[0][:, parameter] += step
            moved[1][:, parameter] -= step
            ahead, back = (linearize(item, POINTS, rays).residuals for item in moved)
            slope = (ahead - back) / (2 * step)
            assert np.allclose(at.by_camera[:, :, parameter], slope, rtol=1e-5, atol=1e-4)
        for axis in range(3):
            step_m = 1e-5 * np.eye(3)[axis]
            ahead, back = (
                linearize(TRUTH, POINTS + way * step_m, rays).residuals for way in (1, -1)
            )
            assert np.allclose(at.by_point[:, :, axis], (ahead - back) / 2e-5, atol=1e-4)

    def test_a_point_behind_a_camera_pulls_nothing(self):
        behind = POINTS.copy()
        behind[3] = (0.0, 200.0, -20.0)
        at = linearize(TRUTH, behind, rays_of())
        mine = (rays_of().point == 3) & (rays_of().camera == 0)
        assert not at.by_camera[mine].any()
        assert np.isfinite(at.residuals).all()


class TestBestPoints:
    def test_rays_that_meet_give_their_point(self):
        assert np.allclose(triangulate_nearest_points(TRUTH, rays_of()), POINTS, atol=1e-6)

    def test_no_point_nearby_costs_less(self):
        rays = rays_of(2.0)
        points = optimize_points(TRUTH, rays, np.inf)
        least = (linearize(TRUTH, points, rays).residuals ** 2).sum()
        for step in 0.01 * np.vstack([np.eye(3), -np.eye(3)]):
            assert (linearize(TRUTH, points + step, rays).residuals ** 2).sum() > least


class TestBundleEquations:
    def test_the_gradient_is_that_of_the_cost_with_points_at_their_best(self):
        rays = rays_of(2.0)
        _, gradient, _ = bundle_equations(TRUTH, rays, 8.0)
        for place in range(TRUTH.size):
            step = 1e-5 if place % 8 in (X, X + 1, Z) else 1e-7
            moved = [TRUTH.copy().ravel(), TRUTH.copy().ravel()]
            moved[0][place] += step
            moved[1][place] -= step
            ahead, back = (bundle_equations(item.reshape(-1, 8), rays, 8.0)[0] for item in moved)
            expected = (ahead - back) / (2 * step)
            assert gradient[place] == pytest.approx(expected, rel=1e-4)

    def test_the_curvature_is_that_of_the_cost_where_rays_meet(self):
        rays = rays_of()
        _, _, information = bundle_equations(TRUTH, rays, np.inf)
        generator = np.random.default_rng(0)
        way = generator.normal(size=TRUTH.shape) * (1e-5, 1e-5, 1e-5, 1e-3, 1e-3, 1e-3, 1e-5, 1e-5)
        squares = linearize(TRUTH + way, optimize_points(TRUTH + way, rays, np.inf), rays).residuals
        expected = 0.5 * (squares**2).sum()
        assert 0.5 * way.ravel() @ information @ way.ravel() == pytest.approx(expected, rel=1e-3)

    def test_balls_alone_cannot_tell_where_the_pitch_lies(self):
        _, _, information = bundle_equations(TRUTH, rays_of(), np.inf)
        together = np.zeros_like(TRUTH)
        together[:, X] = 1.0
        alone = together.copy()
        alone[1:] = 0.0
        assert alone.ravel() @ information @ alone.ravel() > 1.0
        assert together.ravel() @ information @ together.ravel() < 1e-6


class TestRayGaps:
    def test_rays_that_meet_have_none(self):
        pair, _ = rays_of().select_common_points(0, 1)
        gaps, signed, _ = ray_pair_distances_px(TRUTH, pair)
        assert gaps.max() < 1e-6
        assert np.abs(signed).max() < 1e-6

    def test_both_errors_count(self):
        rays = rays_of(3.0, sigma=2.0)
        pair, _ = rays.select_common_points(0, 1)
        gaps, signed, free = ray_pair_distances_px(TRUTH, pair)
        at = linearize(TRUTH, optimize_points(TRUTH, pair, np.inf), pair)
        apart = 2.0 * np.hypot(*at.residuals.T)
        assert gaps[5] == pytest.approx(apart[pair.point == 5].sum())
        # Two rays leave one number over: the signed gap says all there is.
        assert np.allclose(signed**2, np.bincount(pair.point, (at.residuals**2).sum(axis=1)))
        assert np.allclose(np.linalg.norm(free, axis=1), 1)
