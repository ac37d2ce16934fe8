import numpy as np
import pytest

from app.geometry import least_squares
from app.geometry.curve_residuals import residual_rows
from app.geometry.least_squares import CONVERGED, OUT_OF_STEPS, levenberg_marquardt
from app.geometry.resection import (
    KAPPA,
    PARAMETERS,
    CurvePoints,
    Curves,
    GaussianPrior,
    camera_from_parameters,
    curve_distances,
    fit_camera_to_curves,
    normal_equations,
    parameters_from_camera,
    projection_jacobians,
)

HALF_DIAGONAL = 550.0
CENTER = (479.5, 269.5)
# pan, tilt, roll, x, y, z, log focal length, kappa
TRUTH = np.array([0.6, 1.34, 0.01, 3.0, 60.0, -15.0, np.log(2000.0), 0.03])
CURVES = Curves(
    np.array([0, 0, 1, 1]),
    np.array(
        [
            [36.0, -20.16, 0.0, 36.0, 20.16, 0.0],
            [52.5, -3.66, -2.44, 52.5, 3.66, -2.44],
            [41.5, 0.0, 9.15, np.pi - 0.926, np.pi + 0.926, 0.0],
            [0.0, 0.0, 9.15, 0.0, 2 * np.pi, 0.0],
        ]
    ),
)


def curve_points(noise: float, parameters=TRUTH) -> CurvePoints:
    camera = camera_from_parameters(parameters, CENTER, HALF_DIAGONAL)
    shares = np.linspace(0.1, 0.9, 6)[:, None]
    pixels, curve = [], []
    for index, shape in enumerate(CURVES.shapes):
        if CURVES.kinds[index] == 0:
            points = shape[:3] + shares * (shape[3:] - shape[:3])
        else:
            angles = shape[3] + shares[:, 0] * (shape[4] - shape[3])
            circle = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
            points = np.array([*shape[:2], 0.0]) + shape[2] * circle
        pixels.append(camera.project(points) - CENTER)
        curve.extend([index] * len(points))
    exact = np.vstack(pixels)
    generator = np.random.default_rng(1)
    return CurvePoints(
        exact + generator.normal(0, noise, exact.shape), np.array(curve), np.ones(len(exact))
    )


def rows(parameters, seen):
    offsets, jacobians = np.empty((len(seen.pixels), 2)), np.empty((len(seen.pixels), 2, 8))
    residual_rows(
        parameters,
        CURVES.kinds,
        CURVES.shapes,
        seen.pixels,
        seen.curve,
        HALF_DIAGONAL,
        offsets,
        jacobians,
    )
    return offsets, jacobians


def test_compiled_rounds_are_those_of_least_squares_bit_for_bit(monkeypatch) -> None:
    seen, prior = (
        curve_points(1.5),
        GaussianPrior(np.zeros(8), np.array([9.0, 9, 9, 99, 99, 99, 99, 0.1])),
    )
    starts = TRUTH + np.random.default_rng(2).normal(0, 1, (9, 8)) * [
        0.3, 0.1, 0.02, 9, 9, 4, 0.2, 0.02,
    ]  # fmt: skip
    starts[-1, 3:6] = [900.0, -900.0, 90.0]
    problem = (CURVES, seen, prior, 8.0, HALF_DIAGONAL)
    reasons = set()
    monkeypatch.setattr(least_squares, "TOLERANCE", 1e-4)
    for steps, damping in ((4, 1e-2), (30, 1e-3)):
        monkeypatch.setattr(least_squares, "_FIRST_DAMPING", damping)
        fit = fit_camera_to_curves(starts, *problem, steps, tolerance=1e-4, damping=damping)
        slow = levenberg_marquardt(
            lambda parameters: normal_equations(parameters, *problem), starts, steps
        )
        assert fit.reasons == slow.reasons
        for name in ("parameters", "cost", "information", "accepted", "rejected"):
            assert getattr(fit, name).tobytes() == getattr(slow, name).tobytes(), name
        reasons.update(fit.reasons)
    assert reasons >= {CONVERGED, OUT_OF_STEPS}


class TestCameraFromParameters:
    def test_gives_back_its_parameters(self):
        camera = camera_from_parameters(TRUTH, CENTER, HALF_DIAGONAL)
        assert np.allclose(parameters_from_camera(camera, HALF_DIAGONAL), TRUTH, atol=1e-12)

    def test_kappa_is_the_displacement_at_half_the_diagonal(self):
        camera = camera_from_parameters(TRUTH, CENTER, HALF_DIAGONAL)
        ideal = np.array([[HALF_DIAGONAL / camera.focal_length[0], 0.0]])
        far = camera.rotation.T @ np.append(ideal[0], 1.0) * 50 + camera.position
        seen = camera.project(far[None])[0, 0] - CENTER[0]
        kappa = TRUTH[KAPPA]
        assert seen == pytest.approx(HALF_DIAGONAL * (1 + kappa + kappa**2 / 2))


class TestDistances:
    def test_points_on_their_curve_have_distance_zero(self):
        assert curve_distances(TRUTH, CURVES, curve_points(0.0), HALF_DIAGONAL).max() < 1e-6

    def test_a_point_aside_has_its_offset(self):
        seen = curve_points(0.0)
        camera = camera_from_parameters(TRUTH, CENTER, HALF_DIAGONAL)
        ends = camera.project(CURVES.shapes[0].reshape(2, 3))
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        moved = seen.pixels.copy()
        moved[2] += 5.0 * np.array([-along[1], along[0]])
        apart = curve_distances(
            TRUTH, CURVES, CurvePoints(moved, seen.curve, seen.weight), HALF_DIAGONAL
        )
        assert apart[2] == pytest.approx(5.0, abs=0.01)

    def test_beyond_the_end_of_a_segment_it_is_the_distance_to_the_end(self):
        camera = camera_from_parameters(TRUTH, CENTER, HALF_DIAGONAL)
        start, end = camera.project(CURVES.shapes[1].reshape(2, 3)) - CENTER
        beyond = end + 7.0 * (end - start) / np.linalg.norm(end - start)
        seen = CurvePoints(beyond[None], np.array([1]), np.ones(1))
        assert curve_distances(TRUTH, CURVES, seen, HALF_DIAGONAL)[0] == pytest.approx(
            7.0, abs=0.01
        )

    def test_a_curve_behind_the_camera_is_far_from_everything(self):
        turned = TRUTH + np.pi * np.eye(8)[0]
        assert (curve_distances(turned, CURVES, curve_points(0.0), HALF_DIAGONAL) > 1000).all()


class TestResidualRows:
    @pytest.mark.parametrize("parameter", range(PARAMETERS))
    def test_the_jacobian_equals_its_finite_difference(self, parameter):
        # Without noise the place on the curve is eliminated exactly: the twin must agree.
        seen, step = curve_points(0.0), 1e-6
        ahead, behind = TRUTH.copy(), TRUTH.copy()
        ahead[parameter] += step
        behind[parameter] -= step
        numeric = (rows(ahead, seen)[0] - rows(behind, seen)[0]) / (2 * step)
        analytic = rows(TRUTH, seen)[1][:, :, parameter]
        scale = np.abs(analytic).max()
        assert np.allclose(analytic[:, 0], numeric[:, 0], atol=2e-4 * scale)


class TestNormalEquations:
    def test_the_gradient_is_the_slope_of_the_cost(self):
        seen = curve_points(2.0)
        prior = GaussianPrior(TRUTH + 0.1, np.full(PARAMETERS, 0.5))
        cost_at = lambda row: normal_equations(  # noqa: E731
            row[None], CURVES, seen, prior, 2.0, HALF_DIAGONAL
        )
        gradient = cost_at(TRUTH)[1][0]
        for parameter in range(PARAMETERS):
            step = np.zeros(PARAMETERS)
            step[parameter] = 1e-6
            slope = (cost_at(TRUTH + step)[0][0] - cost_at(TRUTH - step)[0][0]) / 2e-6
            assert slope == pytest.approx(gradient[parameter], rel=1e-3)

    def test_rows_are_independent(self):
        seen, prior = curve_points(1.0), GaussianPrior(np.zeros(8), np.full(8, np.inf))
        both = np.stack([TRUTH, TRUTH + 0.001])
        together = normal_equations(both, CURVES, seen, prior, 2.0, HALF_DIAGONAL)
        alone = normal_equations(both[1:], CURVES, seen, prior, 2.0, HALF_DIAGONAL)
        assert all(np.array_equal(a[1], b[0]) for a, b in zip(together, alone, strict=True))


class TestProjectionJacobian:
    def test_equals_its_finite_difference(self):
        point = np.array([40.0, -5.0, -2.0])
        (analytic,) = projection_jacobians(TRUTH[None], point[None], np.array([HALF_DIAGONAL]))
        for parameter in range(PARAMETERS):
            step = np.zeros(PARAMETERS)
            step[parameter] = 1e-6
            pixel = [
                camera_from_parameters(row, CENTER, HALF_DIAGONAL).project(point[None])[0]
                for row in (TRUTH + step, TRUTH - step)
            ]
            numeric = (pixel[0] - pixel[1]) / 2e-6
            assert np.allclose(analytic[:, parameter], numeric, rtol=1e-4, atol=1e-3)
