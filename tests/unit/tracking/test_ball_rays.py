from __future__ import annotations

import numpy as np
import pytest

from app.geometry.camera import Camera
from app.tracking.ball_rays import BallRays, build_ball_rays, estimate_ray_velocities
from tests.cameras import looking

CAMERA = looking((0.0, 62.0, -16.0), (0.0, 0.0, 0.0), 2000.0, bend=0.01)
TIMES = np.arange(0.0, 6.0, 0.04)


def seen(places: np.ndarray, noise_px: float, camera: Camera = CAMERA, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, noise_px, (len(places), 2))
    return camera.project(places) + noise


def flight(times: np.ndarray) -> np.ndarray:
    """A ball kicked at 3 s, and rolling before."""
    after = np.maximum(times - 3, 0)
    return np.column_stack(
        [-8 + 3 * times + 12 * after, 2 * times, -0.11 - 9 * after + 4.905 * after**2]
    )


def rays_of(pixels: np.ndarray, times: np.ndarray = TIMES, camera: Camera = CAMERA) -> BallRays:
    return build_ball_rays(times.tolist(), pixels.tolist(), [camera] * len(times))


class TestBallRays:
    def test_rays_lead_to_the_ball(self) -> None:
        places = flight(TIMES)
        rays = rays_of(seen(places, 0.0))
        to_ball = places - CAMERA.position
        to_ball /= np.linalg.norm(to_ball, axis=1, keepdims=True)
        assert np.allclose(rays.directions, to_ball, atol=1e-6)
        assert rays.gross == 0

    @pytest.mark.parametrize("noise_px", [0.5, 1.0, 2.0])
    def test_the_path_says_how_noisy_it_is(self, noise_px: float) -> None:
        rays = rays_of(seen(flight(TIMES), noise_px))
        assert rays.sigma_px == pytest.approx(noise_px, rel=0.15)
        # A pixel far from the middle of the picture turns the ray by less.
        assert (rays.sigma * 2000 <= rays.sigma_px * 1.001).all()
        assert rays.sigma.max() * 2000 == pytest.approx(rays.sigma_px, rel=0.02)

    def test_gross_errors_are_left_out_and_counted(self) -> None:
        pixels = seen(flight(TIMES), 1.0)
        pixels[[20, 21, 70, 120]] += [(60.0, 0.0), (-50.0, 20.0), (0.0, 90.0), (25.0, 25.0)]
        rays = rays_of(pixels)
        assert rays.gross == pytest.approx(4, abs=1)
        assert not np.isin(TIMES[[20, 21, 70, 120]], rays.times).any()

    def test_a_kick_is_none(self) -> None:
        rays = rays_of(seen(flight(TIMES), 0.5))
        near = (TIMES > 2.8) & (TIMES < 3.2)
        assert np.isin(TIMES[near], rays.times).all()

    def test_a_pixel_without_a_ray_is_left_out(self) -> None:
        folding = looking((0.0, 62.0, -16.0), (0.0, 0.0, 0.0), 2000.0, bend=-0.12)
        pixels = seen(flight(TIMES), 0.5, folding)
        pixels[5] = (1e5, 1e5)
        assert rays_of(pixels, camera=folding).gross >= 1


class TestSlopesOf:
    def test_they_are_those_of_the_path(self) -> None:
        times = TIMES[TIMES < 2.9]
        rays = rays_of(seen(flight(times), 0.0), times)
        moved, turned, _ = estimate_ray_velocities(rays)
        assert np.allclose(moved, 0.0)
        expected = np.gradient(rays.directions, times, axis=0)
        assert np.allclose(turned[5:-5], expected[5:-5], rtol=0.02, atol=1e-5)

    def test_their_variance_is_that_of_noise(self) -> None:
        times = np.arange(0, 40, 0.04)
        still = np.tile((3.0, 2.0, -0.11), (len(times), 1))
        rays = rays_of(seen(still, 1.0), times)
        _, turned, variance = estimate_ray_velocities(rays)
        assert np.mean(turned**2) * 3 == pytest.approx(2 * np.mean(variance), rel=0.25)

    def test_nothing_is_said_across_a_gap(self) -> None:
        times = np.array([0.0, 1.0, 2.0])
        rays = rays_of(seen(flight(times), 0.0), times)
        assert not estimate_ray_velocities(rays)[1].any()
