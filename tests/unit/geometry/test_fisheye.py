"""Lenses for strong wide angle; cv2.fisheye and the published formula are the strangers."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from app.errors import DegenerateGeometryError
from app.geometry.camera import Camera
from app.geometry.fisheye import WIDEST, arctan_polynomial, kannala_brandt
from app.geometry.lens import ARCTAN_POLYNOMIAL, FISHEYE, LENSES
from app.soccer.frames import ImageSize
from tests.cameras import looking

WIDE = (0.021, -0.017, 0.006, -0.0011)
FOLDING = (-0.12, 0.01, -0.02, 0.0)
POLYNOMIAL = (0.0, 0.769, -0.119, 0.251, -0.408, 0.037, 0.268, -0.181, 0.037)
WITH_CONSTANT = (-7.1e-4, *POLYNOMIAL[1:])
LENS = {FISHEYE: WIDE, ARCTAN_POLYNOMIAL: WITH_CONSTANT}
SIZE = ImageSize(1920, 1080)
EVERY = pytest.mark.parametrize("lens", LENS)


def ideal_points(largest_degrees: float, count: int = 400) -> np.ndarray:
    """Ideal coordinates in every direction, up to an angle off the axis."""
    random = np.random.default_rng(3)
    angle = np.radians(random.uniform(0.0, largest_degrees, count))
    around = random.uniform(0.0, 2 * np.pi, count)
    return np.tan(angle)[:, None] * np.column_stack([np.cos(around), np.sin(around)])


def wide_camera(lens: str = FISHEYE, **changes) -> Camera:
    """Above the near touchline, looking steeply down: much of the pitch, to 80 degrees off axis."""
    focal = 640.0 if lens == FISHEYE else 1920.0 / 2.2
    camera = looking((0.0, 42.0, -12.0), (0.0, 18.0, 0.0), focal, size=SIZE)
    return replace(camera, **{"lens": lens, "distortion": np.array(LENS[lens]), **changes})


class TestAgainstOpenCV:
    @pytest.mark.parametrize("k", [WIDE, (0.0, 0.0, 0.0, 0.0), (-0.04, 0.01, 0.0, 0.0)])
    def test_points_are_where_cv2_fisheye_puts_them(self, k):
        camera = wide_camera(distortion=np.array(k), skew=3.0, focal_length=(640.0, 633.0))
        points = np.random.default_rng(1).uniform((-52, -34, -8), (52, 34, 0), (300, 3))
        pixels = camera.project(points)
        seen = ~np.isnan(pixels[:, 0])
        shift = -camera.rotation @ camera.position
        vector, _ = cv2.Rodrigues(camera.rotation)
        expected, _ = cv2.fisheye.projectPoints(
            points[seen][:, None], vector, shift, camera.K, np.array(k), alpha=3.0 / 640.0
        )
        assert seen.sum() > 250
        # 15 degrees from the edge of the forward half: the lens is truly used.
        in_camera = camera.pitch_to_camera(points[seen])
        assert np.degrees(np.arctan2(np.hypot(*in_camera[:, :2].T), in_camera[:, 2])).max() > 75
        assert np.abs(pixels[seen] - expected[:, 0]).max() < 1e-9

    def test_pixels_come_back_as_cv2_fisheye_undistorts_them(self):
        camera = wide_camera()
        pixels = np.random.default_rng(2).uniform((0, 0), (1920, 1080), (300, 2))
        expected = cv2.fisheye.undistortPoints(
            pixels[:, None],
            camera.K,
            np.array(WIDE),
            criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-15),
        )[:, 0]
        found = camera.pixel_to_ideal(pixels)
        angles = np.degrees(np.arctan(np.hypot(*found.T)))
        assert np.nanmax(angles) > 80
        # The corners of the picture look back past the side of the camera.
        forward = np.hypot(*(pixels - camera.principal_point).T) < 640 * kannala_brandt(WIDE).edge
        assert np.array_equal(forward, ~np.isnan(angles))
        assert np.allclose(found[forward], expected[forward], rtol=1e-7, atol=1e-10)


class TestArctanPolynomial:
    @pytest.mark.parametrize("terms", [POLYNOMIAL, WITH_CONSTANT])
    def test_is_the_published_formula_away_from_the_axis(self, terms):
        points = ideal_points(75.0)
        points = points[np.hypot(*points.T) > 0.02]
        radius = np.hypot(*points.T)
        # The files give the highest term first.
        expected = points * (np.polyval(terms[::-1], np.arctan(radius)) / radius)[:, None]
        assert np.allclose(
            LENSES[ARCTAN_POLYNOMIAL].distort(points, np.array(terms)), expected, atol=1e-14
        )

    def test_of_odd_terms_is_the_fisheye_of_the_same(self):
        odd = np.array([0.0, 1.0, 0.0, WIDE[0], 0.0, WIDE[1], 0.0, WIDE[2], 0.0])
        points = ideal_points(80.0)
        same = LENSES[FISHEYE].distort(points, np.array([*WIDE[:3], 0.0]))
        assert np.allclose(LENSES[ARCTAN_POLYNOMIAL].distort(points, odd), same, atol=1e-14)

    def test_a_constant_does_not_tear_the_picture_at_the_axis(self):
        profile = arctan_polynomial(WITH_CONSTANT)
        angles = np.linspace(0.0, 3 * profile.inner, 2000)
        radius = profile.radius(angles)
        assert radius[0] == 0.0
        assert (np.diff(radius) > 0).all()
        assert np.diff(radius).max() < 2 * np.diff(radius).min()
        # No farther off than the constant itself.
        formula = np.polyval(WITH_CONSTANT[::-1], angles)
        assert np.abs(radius - formula).max() <= abs(WITH_CONSTANT[0]) * (1 + 1e-9)

    @pytest.mark.parametrize(
        "terms", [(0.1, *POLYNOMIAL[1:]), (0.0, -0.769, *POLYNOMIAL[2:]), POLYNOMIAL[::-1]]
    )
    def test_that_does_not_grow_from_the_axis_is_refused(self, terms):
        with pytest.raises(DegenerateGeometryError, match="axis"):
            wide_camera(ARCTAN_POLYNOMIAL, distortion=np.array(terms))


class TestDomain:
    @EVERY
    def test_every_ray_up_to_the_edge_comes_back(self, lens):
        model, numbers = LENSES[lens], np.array(LENS[lens])
        edge = np.degrees(np.arctan(model.fold_radius(numbers)))
        points = ideal_points(edge * 0.999)
        back = model.undistort(model.distort(points, numbers), numbers)
        angles = np.arctan(np.hypot(*points.T))
        assert np.abs(np.arctan(np.hypot(*back.T)) - angles).max() < 1e-9

    def test_a_lens_that_never_folds_ends_at_the_side(self):
        assert kannala_brandt((0.0, 0.0, 0.0, 0.0)).widest == WIDEST

    def test_a_lens_folds_where_its_radius_stops_growing(self):
        profile = kannala_brandt(FOLDING)
        step = 1e-6
        assert 0.5 < profile.widest < 1.5
        before, at = profile.radius(np.array([profile.widest - step, profile.widest]))
        assert before < at
        assert abs(profile.radius_derivative(np.array([profile.widest]))[0]) < 1e-9
        # cv2 has no such edge and folds far points back into the picture.
        far = np.array([[np.tan(profile.widest + 0.2), 0.0]])
        folded = cv2.fisheye.distortPoints(far[:, None], np.eye(3), np.array(FOLDING))[0, 0, 0]
        assert folded < profile.edge
        assert np.isnan(LENSES[FISHEYE].distort(far, np.array(FOLDING))).all()

    def test_a_pixel_beyond_the_edge_has_no_ray(self):
        camera = wide_camera(distortion=np.array(FOLDING))
        reach = kannala_brandt(FOLDING).edge * 640.0
        x, y = camera.principal_point
        inside, outside = camera.rays(np.array([[x + 0.999 * reach, y], [x + 1.001 * reach, y]]))
        assert np.isfinite(inside).all()
        assert np.isnan(outside).all()

    @EVERY
    def test_what_lies_behind_has_no_pixel_even_where_folds_are_asked_for(self, lens):
        camera = wide_camera(lens)
        behind = camera.position - 5.0 * camera.rotation[2]
        beside = camera.position + 5.0 * camera.rotation[0] + 1e-3 * camera.rotation[2]
        assert np.isnan(camera.project(np.array([behind, beside]), folded=True)).all()

    def test_a_lens_that_folds_next_to_the_axis_is_refused(self):
        with pytest.raises(DegenerateGeometryError, match="folds"):
            wide_camera(distortion=np.array([-500.0, 0.0, 0.0, 0.0]))

    def test_the_axis_is_its_own_image(self):
        for lens, numbers in LENS.items():
            axis = np.zeros((1, 2))
            assert np.array_equal(LENSES[lens].distort(axis, np.array(numbers)), axis)
            assert np.array_equal(LENSES[lens].undistort(axis, np.array(numbers)), axis)


class TestDerivatives:
    @EVERY
    def test_of_the_lens_equals_its_finite_difference_up_to_the_edge(self, lens):
        model, numbers = LENSES[lens], np.array(LENS[lens])
        points = np.vstack([np.zeros((1, 2)), ideal_points(78.0, 200)])
        # The profile has a kink where the constant is taken out.
        inner = model.check(LENS[lens]).inner
        points = points[np.abs(np.arctan(np.hypot(*points.T)) - inner) > 1e-3]
        jacobian = model.jacobian(points, numbers)
        for axis in (0, 1):
            move = np.zeros(2)
            move[axis] = 1e-6
            ahead, behind = (model.distort(points + way * move, numbers) for way in (1, -1))
            assert np.allclose(jacobian[:, :, axis], (ahead - behind) / 2e-6, atol=2e-9)

    @EVERY
    def test_of_a_pixel_by_its_point_equals_its_finite_difference(self, lens):
        camera = wide_camera(lens)
        for point in ((0.0, 20.0, 0.0), (-45.0, 30.0, -2.0), (30.0, -30.0, 0.0)):
            steps = 1e-4 * np.vstack([np.eye(3), -np.eye(3)])
            pixels = camera.project(np.array(point) + steps)
            numeric = (pixels[:3] - pixels[3:]).T / 2e-4
            assert np.allclose(camera.jacobian(np.array(point)), numeric, rtol=1e-5, atol=1e-5)

    @EVERY
    def test_of_undistortion_carries_the_noise_of_a_click(self, lens):
        camera = wide_camera(lens)
        center = camera.project(np.array([[-45.0, 30.0, -2.0]]))[0]
        clicks = center + np.random.default_rng(5).normal(0.0, 0.2, (20_000, 2))
        spread = np.cov(camera.undistort(clicks).T)
        slope = camera.undistort_jacobian(center)
        expected = 0.2**2 * slope @ slope.T
        assert np.allclose(spread, expected, rtol=0.05, atol=0.02 * np.abs(expected).max())
        # Far from the axis the pinhole stretches the picture: a pixel is no pixel there.
        assert np.sqrt(np.linalg.eigvalsh(expected)[-1]) > 3 * 0.2

    def test_a_pixel_without_a_ray_has_no_derivative(self):
        camera = wide_camera(distortion=np.array(FOLDING))
        assert np.isnan(camera.undistort_jacobian(np.array([5000.0, 540.0]))).all()


class TestOnePoint:
    @EVERY
    def test_is_the_same_bits_alone_and_among_others(self, lens):
        camera = wide_camera(lens)
        points = np.random.default_rng(1).uniform((-52, -34, -8), (52, 44, 0), (60, 3))
        alone = np.vstack([camera.project(point[None]) for point in points])
        np.testing.assert_array_equal(alone, camera.project(points))
        pixels = alone[~np.isnan(alone[:, 0])]
        single = np.vstack([camera.undistort(pixel[None]) for pixel in pixels])
        np.testing.assert_array_equal(single, camera.undistort(pixels))


class TestCameras:
    def test_of_another_lens_are_other_cameras(self):
        assert wide_camera() == wide_camera()
        assert wide_camera() != wide_camera(distortion=np.zeros(4))
        assert wide_camera(ARCTAN_POLYNOMIAL) != wide_camera()

    def test_an_unknown_lens_is_refused(self):
        with pytest.raises(DegenerateGeometryError, match="not a known lens"):
            replace(wide_camera(), lens="bottle")

    def test_a_camera_resized_shows_the_same(self):
        camera, point = wide_camera(), np.array([[12.0, 4.0, 0.0]])
        small, large = camera.project(point)[0], camera.scaled(2.0, 2.0).project(point)[0]
        assert np.allclose(large, (small + 0.5) * 2 - 0.5)
