"""Ball box: the triangulated ball seen again in a view, where it is to be seen and how large."""

from __future__ import annotations

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray, flatten_covariance
from app.geometry.camera import Camera
from app.geometry.sphere import optimal_diameter, position_from_diameter, tight_box
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.policy import Policy
from app.soccer.solution import Ball3D, BallFit, Calibration, ExpectedBall
from app.solving.ball_covariance import calibration_pixel_covariance, given_camera_sigma_px


def measure_ball_fit(
    camera: Camera,
    size: ImageSize,
    ball: BallAnnotation,
    point: FloatArray,
    diameter_m: float,
    expected: ExpectedBall | None = None,
) -> BallFit:
    """How the 3D ball and the annotation of one view agree.

    Args:
        camera: The view's camera.
        size: Annotated size.
        ball: The ball of the view, in view.
        point: The triangulated ball, pitch frame, metres, shape (3,).
        diameter_m: True diameter, metres.
        expected: What ``predict_ball_in_view`` says of the same, so that its box is not fitted twice.

    Returns:
        The parts that do not exist are None: no box for a point behind the camera, no size
        ratio for a point annotation.
    """
    center = ball.center
    assert center is not None
    pixel = camera.project(point[None])[0]
    seen = not np.isnan(pixel[0])
    error = float(np.hypot(*(pixel - center))) if seen else None
    diameter, off_ray = _optimal_diameter_or_none(camera, center, point, diameter_m)
    annotated = ball.box.diameter if ball.box is not None else None
    depth = float(camera.pitch_to_camera(point[None])[0, 2])
    alone = _compute_position_from_box(camera, ball, diameter_m)
    return BallFit(
        reprojected=ImagePoint(float(pixel[0]), float(pixel[1])) if seen else None,
        error_px=error,
        error_percent=100 * error / size.diagonal if error is not None else None,
        optimized_diameter_px=diameter,
        optimized_box=Box.square(center, diameter) if diameter is not None else None,
        optimized_error_m=off_ray,
        exact_box=expected.box if expected else _compute_tight_box(camera, point, diameter_m),
        size_ratio=annotated / diameter if annotated and diameter else None,
        depth_m=depth,
        monocular=(float(alone[0]), float(alone[1]), float(alone[2]))
        if alone is not None
        else None,
        monocular_error_m=float(np.linalg.norm(alone - point)) if alone is not None else None,
        # Depth times diameter is constant, so the slope is depth over diameter.
        depth_per_px_m=depth / diameter if diameter else None,
    )


def predict_ball_in_view(
    calibration: Calibration, size: ImageSize, ball: Ball3D, policy: Policy
) -> ExpectedBall | None:
    """Where a view should show the 3D ball; None where it has no camera or the ball is behind it.

    The covariance of the place is infinite where that of the ball is, and where the lines of the
    view leave its camera open.

    Args:
        calibration: The view's calibration.
        size: Annotated size.
        ball: The triangulated ball.
        policy: Its diameter, and how far a given camera is off of which nothing is known.
    """
    if calibration.camera is None:
        return None
    point = np.array(ball.point)
    x, y = calibration.camera.project(point[None])[0].tolist()
    if not np.isfinite((x, y)).all():
        return None
    jacobian, known = calibration.camera.jacobian(point), np.reshape(ball.covariance, (3, 3))
    if calibration.is_left_open or not np.isfinite(known).all():
        covariance = np.full((2, 2), np.inf)
    else:
        covariance = jacobian @ known @ jacobian.T
        covariance = covariance + calibration_pixel_covariance(calibration, size, point)
    if calibration.is_given_without_uncertainty:
        covariance = covariance + given_camera_sigma_px(size.diagonal, policy) ** 2 * np.eye(2)
    return ExpectedBall(
        place=ImagePoint(x, y),
        covariance=flatten_covariance(covariance),
        box=_compute_tight_box(calibration.camera, point, policy.ball_diameter_m),
    )


def _compute_position_from_box(
    camera: Camera, ball: BallAnnotation, diameter_m: float
) -> FloatArray | None:
    if ball.box is None or ball.box.diameter <= 0:
        return None
    found = position_from_diameter(camera, np.array(ball.box.center), ball.box.diameter, diameter_m)
    return found if np.isfinite(found).all() else None


def _optimal_diameter_or_none(
    camera: Camera, center: ImagePoint, point: FloatArray, diameter_m: float
) -> tuple[float | None, float | None]:
    try:
        return optimal_diameter(camera, np.array(center), point, diameter_m)
    except DegenerateGeometryError:
        return None, None


def _compute_tight_box(camera: Camera, point: FloatArray, diameter_m: float) -> Box | None:
    try:
        left, top, right, bottom = tight_box(camera, point, diameter_m / 2).tolist()
    except DegenerateGeometryError:
        return None
    return Box(left, top, right - left, bottom - top)
