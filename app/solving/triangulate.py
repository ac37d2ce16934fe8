"""Triangulate: the ball from every pair of calibrated views, and their mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray
from app.geometry.camera import MIN_DEPTH, Camera
from app.geometry.resection import (
    PARAMETERS,
    parameters_from_camera,
    projection_jacobian,
)
from app.geometry.triangulation import parallax_angle, triangulate_pairs
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.policy import Policy
from app.soccer.solution import Ball3D, Calibration, Pair

CLICK_DIAGONAL = float(np.hypot(1920, 1080))
"""The policy's click sigma holds for 1920 x 1080 and grows with the diagonal."""
_STEP_PX = 0.5


@dataclass(frozen=True)
class Sight:
    """The ball in one calibrated view.

    Attributes:
        view: Key of the view.
        calibration: Its calibration, with a camera.
        center: Annotated centre, pixels as the image shows them.
        diameter_px: Of the annotated box, 0 for a point.
        size: Annotated size.
        failed: First gate that dropped the view, or None.
    """

    view: str
    calibration: Calibration
    center: ImagePoint
    diameter_px: float
    size: ImageSize
    failed: str | None

    @property
    def camera(self) -> Camera:
        """The camera of the view."""
        assert self.calibration.camera is not None
        return self.calibration.camera

    @cached_property
    def ideal_center(self) -> FloatArray:
        """The centre as the pinhole without distortion shows it, pixels, shape (2,)."""
        center: FloatArray = self.camera.undistort(np.array([self.center]))[0]
        return center

    def tau_px(self, policy: Policy) -> float:
        """Largest reprojection error of a valid pair, pixels."""
        return policy.tau_percent / 100 * self.size.diagonal


def triangulate(sights: Sequence[Sight], policy: Policy) -> tuple[Pair, ...]:
    """Every pair of views with its point, whatever the gates say of it.

    Source: SoccerNet-v3D (arXiv 2504.10106), triangulation of ball annotations.
    """
    couples = [
        (a, b) for a, b in combinations(sights, 2) if not np.array_equal(a.camera.P, b.camera.P)
    ]
    try:
        points = [*_meet(couples)] if couples else []
    except DegenerateGeometryError:
        # A picture twice in a group: rays that are parallel meet nowhere, the others do.
        couples = [couple for couple in couples if _can_meet(couple)]
        points = [*_meet(couples)] if couples else []
    return tuple(_pair(a, b, point, policy) for (a, b), point in zip(couples, points, strict=True))


def _meet(couples: Sequence[tuple[Sight, Sight]]) -> FloatArray:
    return triangulate_pairs(
        np.array([a.camera.P for a, _ in couples]),
        np.array([b.camera.P for _, b in couples]),
        np.array([a.ideal_center for a, _ in couples]),
        np.array([b.ideal_center for _, b in couples]),
    )


def _can_meet(couple: tuple[Sight, Sight]) -> bool:
    try:
        _meet([couple])
    except DegenerateGeometryError:
        return False
    return True


def mean_ball(pairs: Sequence[Pair], sights: Sequence[Sight], policy: Policy) -> Ball3D | None:
    """The mean of the valid pairs with its uncertainty; None without a valid pair."""
    valid = [pair for pair in pairs if pair.valid]
    if not valid:
        return None
    point = np.mean([pair.point for pair in valid], axis=0)
    used = {pair.a for pair in valid} | {pair.b for pair in valid}
    seen = {sight.view: sight for sight in sights if sight.view in used}
    spread = mean_covariance(valid, seen, point, policy)
    return Ball3D(
        point=_triple(point),
        covariance=tuple(spread.ravel().tolist()),
        sigma_m=float(np.sqrt(np.linalg.eigvalsh(spread)[-1])),
        parallax_degrees=max(_parallax(seen, pair, point) for pair in valid),
        views=tuple(seen),
    )


def mean_covariance(
    pairs: Sequence[Pair], seen: Mapping[str, Sight], point: FloatArray, policy: Policy
) -> FloatArray:
    """Covariance of the mean of pairs, square metres, shape (3, 3).

    The uncertainty of each view's pixel is carried through the estimator itself, by central
    differences: pairs that share a view move together, and a pair of small parallax, which the
    mean trusts like any other, makes the mean as uncertain as it is.

    Source: Hartley & Zisserman, result 5.6.
    """
    steps = [
        (view, axis, sign) for view in seen for axis in (0, 1) for sign in (_STEP_PX, -_STEP_PX)
    ]
    pixels = {
        view: np.repeat(sight.ideal_center[None], len(steps), axis=0)
        for view, sight in seen.items()
    }
    for row, (view, axis, step) in enumerate(steps):
        pixels[view][row, axis] += step
    moved = np.mean(
        [
            triangulate_pairs(
                np.repeat(seen[pair.a].camera.P[None], len(steps), axis=0),
                np.repeat(seen[pair.b].camera.P[None], len(steps), axis=0),
                pixels[pair.a],
                pixels[pair.b],
            )
            for pair in pairs
        ],
        axis=0,
    ).reshape(len(seen), 2, 2, 3)
    slopes = (moved[:, :, 0] - moved[:, :, 1]) / (2 * _STEP_PX)
    spread = np.zeros((3, 3))
    for slope, sight in zip(slopes, seen.values(), strict=True):
        spread += slope.T @ pixel_spread(sight, point, policy) @ slope
    return spread


def pixel_spread(sight: Sight, point: FloatArray, policy: Policy) -> FloatArray:
    """Covariance of the ball's pixel in a view, square pixels, shape (2, 2).

    The noise of the click, which grows with the size of the ball, and, where the camera comes
    from lines, the covariance of its calibration carried to the ball.
    """
    click = policy.click_sigma_px * sight.size.diagonal / CLICK_DIAGONAL
    click = float(np.hypot(click, policy.box_sigma_share * sight.diameter_px))
    return click**2 * np.eye(2) + calibration_spread(sight.calibration, sight.size, point)


def _pair(a: Sight, b: Sight, point: FloatArray, policy: Policy) -> Pair:
    errors = tuple(_reprojection_error(sight, point) for sight in (a, b))
    baseline = float(np.linalg.norm(a.camera.position - b.camera.position))
    in_front = all(sight.camera.pitch_to_camera(point[None])[0, 2] > MIN_DEPTH for sight in (a, b))
    failed = a.failed or b.failed
    if failed is None and baseline < policy.min_baseline_m:
        failed = "baseline"
    close = errors[0] < a.tau_px(policy) and errors[1] < b.tau_px(policy)
    if failed is None and not (close and in_front):
        failed = "reprojection"
    angle = parallax_angle(a.camera.position, b.camera.position, point[None])[0]
    return Pair(
        a=a.view,
        b=b.view,
        point=_triple(point),
        errors_px=(errors[0], errors[1]),
        baseline_m=baseline,
        parallax_degrees=float(np.degrees(angle)),
        valid=failed is None,
        failed=failed,
    )


def _reprojection_error(sight: Sight, point: FloatArray) -> float:
    """Distance of the annotated centre from the image of a point, pixels.

    A point behind the camera has no image; it is measured by the pinhole's formula, so that
    the number stays finite, and is refused by its depth.
    """
    pixel = sight.camera.project(point[None])[0]
    if np.isnan(pixel[0]):
        homogeneous = sight.camera.P @ np.append(point, 1.0)
        pixel = homogeneous[:2] / homogeneous[2]
    return float(np.hypot(*(pixel - sight.center)))


def _parallax(seen: Mapping[str, Sight], pair: Pair, point: FloatArray) -> float:
    positions = (seen[pair.a].camera.position, seen[pair.b].camera.position)
    return float(np.degrees(parallax_angle(*positions, point[None])[0]))


def calibration_spread(calibration: Calibration, size: ImageSize, point: FloatArray) -> FloatArray:
    """Covariance that the calibration brings to the pixel of a point, square pixels, (2, 2).

    Args:
        calibration: With a camera; nothing is known of the uncertainty of a given one: zeros.
        size: Annotated size.
        point: In front of the camera, pitch frame, metres, shape (3,).
    """
    if calibration.covariance is None or calibration.camera is None:
        return np.zeros((2, 2))
    spread = np.array(calibration.covariance).reshape(PARAMETERS, PARAMETERS)
    half_diagonal = size.diagonal / 2
    parameters = parameters_from_camera(calibration.camera, half_diagonal)
    jacobian = projection_jacobian(parameters, point, half_diagonal)
    carried: FloatArray = jacobian @ spread @ jacobian.T
    return carried


def _triple(point: FloatArray) -> tuple[float, float, float]:
    return float(point[0]), float(point[1]), float(point[2])
