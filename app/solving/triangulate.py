"""Triangulate: where the rays of every two views that see the ball meet."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import MIN_DEPTH, Camera
from app.geometry.resection import PARAMETERS, parameters_from_camera
from app.geometry.triangulation import parallax_angle, triangulate_pairs
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.group import View
from app.soccer.picture import camera_of_original_picture
from app.soccer.policy import Policy
from app.soccer.solution import Calibration

WHOLE = PARAMETERS + 3
"""The camera's numbers, and those of its picture."""


@dataclass(frozen=True)
class UncertainCameraParameters:
    """The numbers of a camera, those of the picture as it was taken where it has been changed.

    Attributes:
        parameters: Shape (8,).
        covariance: Of the parameters, shape (8, 8).
        picture: Covariances of aspect and shifts with all eleven numbers, shape (3, 11); None
            where the picture is as it was taken.
    """

    parameters: FloatArray
    covariance: FloatArray
    picture: FloatArray | None = None

    @staticmethod
    def of(calibration: Calibration, diagonal: float) -> UncertainCameraParameters | None:
        """None without a camera, and where nothing says how exact it is: a given camera without
        covariance counts as exact, one that ``is_left_open`` makes its ball unknown.

        Args:
            calibration: Of a view.
            diagonal: Of its image, pixels.
        """
        camera = calibration.camera
        if camera is None or calibration.covariance is None:
            return None
        if calibration.picture_covariance is None:
            covariance = np.reshape(calibration.covariance, (PARAMETERS, PARAMETERS))
            return UncertainCameraParameters(
                parameters_from_camera(camera, diagonal / 2), covariance
            )
        whole = np.reshape(calibration.picture_covariance, (WHOLE, WHOLE))
        parameters = parameters_from_camera(camera_of_original_picture(camera), diagonal / 2)
        return UncertainCameraParameters(
            parameters, whole[:PARAMETERS, :PARAMETERS], whole[PARAMETERS:]
        )


@dataclass(frozen=True)
class BallObservation:
    """The ball in one calibrated view.

    Attributes:
        view: Key of the view.
        calibration: Its calibration, with a camera.
        center: Annotated centre, pixels as the image shows them.
        diameter_px: Of the annotated box, 0 for a point.
        size: Annotated size.
        noise: Sigma of the click beside that of the dataset's.
    """

    view: str
    calibration: Calibration
    center: ImagePoint
    diameter_px: float
    size: ImageSize
    noise: float = 1.0

    @property
    def camera(self) -> Camera:
        """The camera of the view."""
        assert self.calibration.camera is not None
        return self.calibration.camera

    @property
    def is_given_without_uncertainty(self) -> bool:
        """Whether its camera came with the data and nobody says how exact it is."""
        return self.calibration.is_given_without_uncertainty

    @cached_property
    def P(self) -> FloatArray:
        """Projection matrix of the camera, shape (3, 4)."""
        return self.camera.P

    @cached_property
    def ideal_center(self) -> FloatArray:
        """The centre as the pinhole without distortion shows it, pixels, shape (2,)."""
        center: FloatArray = self.camera.undistort(np.array([self.center]))[0]
        return center

    @cached_property
    def undistortion_jacobian(self) -> FloatArray:
        """How far ``ideal_center`` moves with the centre, shape (2, 2).

        One to one but through a wide lens: what other lenses add lies below the noise of a click.
        """
        if not self.camera.is_wide:
            return np.eye(2)
        return self.camera.undistort_jacobian(np.array(self.center))

    @cached_property
    def uncertain_camera_parameters(self) -> UncertainCameraParameters | None:
        """The camera as numbers; None where nobody says how exact it is."""
        return UncertainCameraParameters.of(self.calibration, self.size.diagonal)

    def tau_px(self, policy: Policy) -> float:
        """Largest reprojection error of a valid pair, pixels."""
        return policy.tau_px(self.size.diagonal)


@dataclass(frozen=True)
class PairPoint:
    """Where the rays of two observations meet, whatever the gates say of it.

    Attributes:
        a: The first observation; ``b`` the second.
        point: Pitch frame, metres, shape (3,).
        errors_px: Reprojection error in both.
        in_front: The point lies in front of both cameras.
        baseline_m: Between the cameras.
        parallax_degrees: Between the rays.
    """

    a: BallObservation
    b: BallObservation
    point: FloatArray
    errors_px: tuple[float, float]
    in_front: bool
    baseline_m: float
    parallax_degrees: float

    @property
    def point_as_tuple(self) -> tuple[float, float, float]:
        """The point as plain numbers."""
        x, y, z = self.point.tolist()
        return x, y, z


def collect_ball_observations(
    views: Sequence[View], calibrations: Sequence[Calibration]
) -> list[BallObservation]:
    """The views that take part: included, calibrated, and with one ball.

    A ball that was put where the others see it is no observation: it would confirm itself. Nor is one
    beyond the radius where the lens folds the picture.

    Args:
        views: Of a group.
        calibrations: Of each view.
    """
    return [
        observation
        for observation in collect_clicked_balls(views, calibrations)
        if np.isfinite(observation.ideal_center).all()
    ]


def find_views_without_ray(
    views: Sequence[View],
    calibrations: Sequence[Calibration],
    observations: Iterable[BallObservation],
) -> set[str]:
    """Keys of the views through whose ball no ray goes: it lies beyond what their lens shows.

    Args:
        views: Of a group.
        calibrations: Of each view.
        observations: ``collect_ball_observations`` of them.
    """
    clicked = {item.view for item in collect_clicked_balls(views, calibrations)}
    return clicked - {item.view for item in observations}


def collect_clicked_balls(
    views: Sequence[View], calibrations: Sequence[Calibration]
) -> list[BallObservation]:
    """``collect_ball_observations`` with those through which no ray goes.

    Args:
        views: Of a group.
        calibrations: Of each view.
    """
    return [
        BallObservation(
            view.key,
            calibration,
            center,
            ball.box.diameter if ball.box else 0.0,
            view.size,
            view.noise,
        )
        for view, calibration in zip(views, calibrations, strict=True)
        if view.included and calibration.camera is not None
        if (ball := view.ball) is not None and not ball.inferred
        if (center := ball.center) is not None
    ]


def triangulate_observation_pairs(
    couples: Iterable[tuple[BallObservation, BallObservation]],
) -> list[PairPoint]:
    """Where the rays of each couple meet; one camera twice, and parallel rays, meet nowhere.

    Source: SoccerNet-v3D (arXiv 2504.10106), triangulation of ball annotations.
    """
    couples = [(a, b) for a, b in couples if not np.array_equal(a.P, b.P)]
    if not couples:
        return []
    points = triangulate_pairs(*stack_pair_arrays([a for a, _ in couples], [b for _, b in couples]))
    return [
        _make_pair_point(a, b, point)
        for (a, b), point in zip(couples, points, strict=True)
        if np.isfinite(point).all()
    ]


def stack_pair_arrays(
    a: Sequence[BallObservation], b: Sequence[BallObservation]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Couples of observations as ``triangulate_pairs`` takes them."""
    return (
        np.array([observation.P for observation in a]),
        np.array([observation.P for observation in b]),
        np.array([observation.ideal_center for observation in a]),
        np.array([observation.ideal_center for observation in b]),
    )


def _make_pair_point(a: BallObservation, b: BallObservation, point: FloatArray) -> PairPoint:
    positions = a.camera.position, b.camera.position
    angle = parallax_angle(positions[0][None], positions[1][None], point[None])[0]
    return PairPoint(
        a=a,
        b=b,
        point=point,
        errors_px=(_reprojection_error(a, point), _reprojection_error(b, point)),
        in_front=all(
            observation.camera.pitch_to_camera(point[None])[0, 2] > MIN_DEPTH
            for observation in (a, b)
        ),
        baseline_m=float(np.linalg.norm(positions[0] - positions[1])),
        parallax_degrees=float(np.degrees(angle)),
    )


def _reprojection_error(observation: BallObservation, point: FloatArray) -> float:
    """Distance of the annotated centre from the image of a point, pixels.

    A point behind the camera has no image; it is measured by the pinhole's formula, so that
    the number stays finite, and is refused by its depth.
    """
    pixel = observation.camera.project(point[None])[0]
    if np.isnan(pixel[0]):
        homogeneous = observation.P @ np.append(point, 1.0)
        pixel = homogeneous[:2] / homogeneous[2]
    return float(np.hypot(*(pixel - observation.center)))
