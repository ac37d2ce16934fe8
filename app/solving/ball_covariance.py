"""Ball covariance: how certain a ball is, from the noise of clicks and the covariance of calibrations."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Lock
from typing import TypeVar

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.resection import PARAMETERS, projection_jacobians
from app.soccer.frames import ImageSize
from app.soccer.picture import camera_aspect
from app.soccer.policy import Policy
from app.soccer.solution import Calibration
from app.solving.facts import STEP_PX, GroupFacts
from app.solving.triangulate import WHOLE, BallObservation, UncertainCameraParameters

CLICK_DIAGONAL = float(np.hypot(1920, 1080))
"""The policy's click sigma holds for 1920 x 1080 and grows with the diagonal."""
_BITS = 62
"""Pairs of a group whose validity fits into one integer, a bit for each."""
_ROUNDING = 1e-9
"""Sums this close to a limit, relatively, are computed once more the exact way."""


Pixels = TypeVar("Pixels", float, FloatArray)


def given_camera_sigma_px(diagonal: Pixels, policy: Policy) -> Pixels:
    """How far a given camera of which nothing is known is off at the ball, pixels."""
    return policy.given_sigma_px * diagonal / CLICK_DIAGONAL


def ball_click_variance(
    diagonal: FloatArray,
    ball_px: FloatArray,
    policy: Policy,
    bare: BoolArray | None = None,
    noise: FloatArray | float = 1.0,
) -> FloatArray:
    """Variance of each coordinate of annotated ball centres, square pixels, shape (N,).

    The noise of a click grows with the picture and with the size of the ball.

    Args:
        diagonal: Of the images, pixels, shape (N,).
        ball_px: Diameter of the annotated boxes, 0 without one, pixels, shape (N,).
        policy: Holds the noises.
        bare: Whether their camera is given, of unknown exactness, shape (N,); none by default.
        noise: Sigma beside that of the dataset's balls, shape (N,) or one for all.
    """
    click = policy.click_sigma_px * diagonal / CLICK_DIAGONAL
    sigma = np.hypot(click, policy.box_sigma_share * ball_px)
    if bare is not None and policy.given_sigma_px:
        given = given_camera_sigma_px(diagonal, policy)
        sigma = np.where(bare, np.hypot(sigma, given), sigma)
    # As Python squares a float; the square of an array differs in the last bit now and then.
    return np.float_power(noise * sigma, 2)


def project_calibration_covariances(
    parameters: FloatArray, covariances: FloatArray, points: FloatArray, diagonals: FloatArray
) -> FloatArray:
    """Covariance of the projected points due to that of the calibrations, square pixels, (N, 2, 2).

    Args:
        parameters: Of the cameras, shape (N, 8).
        covariances: Of the parameters, shape (N, 8, 8).
        points: One in front of each camera, pitch frame, metres, shape (N, 3).
        diagonals: Of the images, pixels, shape (N,).
    """
    jacobians = projection_jacobians(parameters, points, diagonals / 2)
    carried: FloatArray = jacobians @ covariances @ jacobians.transpose(0, 2, 1)
    return carried


def project_picture_covariances(
    parameters: FloatArray,
    covariances: FloatArray,
    points: FloatArray,
    diagonals: FloatArray,
    pictures: FloatArray,
    stretches: FloatArray,
) -> FloatArray:
    """``project_calibration_covariances`` where pictures may have been stretched or cropped, (N, 2, 2).

    A wider picture moves what is beside the axis, another axis moves everything: both go together
    with the camera, so neither is known as badly as it would be alone.

    Args:
        parameters: Of the cameras as the pictures were taken, shape (N, 8).
        covariances: Of the parameters, shape (N, 8, 8).
        points: As in ``project_calibration_covariances``.
        diagonals: As there.
        pictures: Covariances of aspect and shifts with all eleven numbers, shape (N, 3, 11).
        stretches: Aspect, and how far right of the axis the point is seen, pixels, shape (N, 2).
    """
    half = diagonals / 2
    jacobians = np.zeros((len(points), 2, WHOLE))
    jacobians[:, :, :PARAMETERS] = projection_jacobians(parameters, points, half)
    jacobians[:, 0, :PARAMETERS] *= stretches[:, :1]
    jacobians[:, 0, PARAMETERS] = stretches[:, 1]
    jacobians[:, 0, PARAMETERS + 1] = jacobians[:, 1, PARAMETERS + 2] = half
    whole = np.zeros((len(points), WHOLE, WHOLE))
    whole[:, :PARAMETERS, :PARAMETERS] = covariances
    whole[:, PARAMETERS:] = pictures
    whole[:, :PARAMETERS, PARAMETERS:] = pictures[:, :, :PARAMETERS].transpose(0, 2, 1)
    found: FloatArray = jacobians @ whole @ jacobians.transpose(0, 2, 1)
    return found


def calibration_pixel_covariances(
    facts: GroupFacts, views: IntArray, points: FloatArray
) -> FloatArray:
    """Covariance of balls' pixels due to calibrations whose covariance is known, (N, 2, 2).

    Args:
        facts: The groups.
        views: Rows of the views, shape (N,).
        points: The ball of each of them, pitch frame, metres, shape (N, 3).
    """
    numbers = facts.rows("view_parameters", views), facts.rows("view_covariance", views)
    diagonals = facts.view_diagonal[views]
    found = project_calibration_covariances(*numbers, points, diagonals)
    rows = np.flatnonzero(facts.view_changed[views])
    if len(rows):
        found[rows] = project_picture_covariances(
            numbers[0][rows],
            numbers[1][rows],
            points[rows],
            diagonals[rows],
            facts.rows("view_picture", views[rows]),
            facts.rows("view_stretch", views[rows]),
        )
    return found


def click_pixel_covariances(facts: GroupFacts, views: IntArray, policy: Policy) -> FloatArray:
    """Covariance of the ball's pixel by the click and by given cameras, square pixels, (N, 2, 2).

    Args:
        facts: The groups.
        views: Rows of the views, shape (N,).
        policy: Holds the noises.
    """
    noise = ball_click_variance(
        facts.view_diagonal[views],
        facts.view_ball_px[views],
        policy,
        facts.view_bare[views],
        facts.view_noise[views],
    )
    found: FloatArray = noise[:, None, None] * np.eye(2)
    return found


def pixel_covariances(
    facts: GroupFacts, views: IntArray, points: FloatArray, policy: Policy
) -> FloatArray:
    """``pixel_covariance`` of many views, square pixels, shape (N, 2, 2).

    Args:
        facts: The groups.
        views: Rows of the views, shape (N,).
        points: The ball of each of them, pitch frame, metres, shape (N, 3).
        policy: Holds the noises.
    """
    found = click_pixel_covariances(facts, views, policy)
    known = np.flatnonzero(facts.view_known[views])
    rows = views[known]
    found[known] += calibration_pixel_covariances(facts, rows, points[known])
    return found


def calibration_pixel_covariance(
    calibration: Calibration, size: ImageSize, point: FloatArray
) -> FloatArray:
    """Covariance of the projected point due to that of the calibration, square pixels, (2, 2).

    Args:
        calibration: With a camera; zeros for a given one of whose uncertainty nothing is known.
        size: Annotated size.
        point: In front of the camera, pitch frame, metres, shape (3,).
    """
    numbers, camera = UncertainCameraParameters.of(calibration, size.diagonal), calibration.camera
    if numbers is None or camera is None:
        return np.zeros((2, 2))
    known = numbers.parameters[None], numbers.covariance[None]
    where = point[None], np.array([size.diagonal])
    if numbers.picture is None:
        found = project_calibration_covariances(*known, *where)
    else:
        right = camera.project(point[None])[0, 0] - camera.principal_point[0]
        stretch = np.array([[camera_aspect(camera), right]])
        found = project_picture_covariances(*known, *where, numbers.picture[None], stretch)
    alone: FloatArray = found[0]
    return alone


def pixel_covariance(observation: BallObservation, point: FloatArray, policy: Policy) -> FloatArray:
    """Covariance of the ball's pixel in a view, square pixels, shape (2, 2).

    The noise of the click, that of a given camera, and, where the camera comes from lines, the
    covariance of its calibration carried to the ball.
    """
    found: FloatArray = observation_pixel_covariances([observation], point[None], policy)[0]
    return found


def observation_pixel_covariances(
    observations: Sequence[BallObservation], points: FloatArray, policy: Policy
) -> FloatArray:
    """``pixel_covariance`` of several observations at a point each, square pixels, shape (N, 2, 2).

    Args:
        observations: One for each point.
        points: Pitch frame, metres, shape (N, 3).
        policy: Holds the noises.
    """
    diagonals = np.array([observation.size.diagonal for observation in observations])
    noise = ball_click_variance(
        diagonals,
        np.array([observation.diameter_px for observation in observations]),
        policy,
        np.array([observation.is_given_without_uncertainty for observation in observations]),
        np.array([observation.noise for observation in observations]),
    )
    found: FloatArray = noise[:, None, None] * np.eye(2)
    plain: dict[int, UncertainCameraParameters] = {}
    for row, observation in enumerate(observations):
        if (
            observation.uncertain_camera_parameters is not None
            and observation.uncertain_camera_parameters.picture is None
        ):
            plain[row] = observation.uncertain_camera_parameters
        else:
            found[row] += calibration_pixel_covariance(
                observation.calibration, observation.size, points[row]
            )
    if plain:
        rows = [*plain]
        parameters = np.array([item.parameters for item in plain.values()])
        covariances = np.array([item.covariance for item in plain.values()])
        found[rows] += project_calibration_covariances(
            parameters, covariances, points[rows], diagonals[rows]
        )
    return found


def major_axis_sigma(covariances: FloatArray) -> FloatArray:
    """Standard deviation along the longest axis, metres, infinite where nothing is known, (N,).

    Args:
        covariances: Square metres, shape (N, 3, 3).
    """
    sigma = np.full(len(covariances), np.inf)
    known = np.isfinite(covariances).all(axis=(1, 2))
    sigma[known] = np.sqrt(np.linalg.eigvalsh(covariances[known])[:, -1])
    return sigma


def is_sigma_within(sigma: FloatArray, limit_m: float) -> BoolArray:
    """Whether standard deviations along the longest axis are at most so many metres, NaN is not, (N,)."""
    certain: BoolArray = limit_m - sigma >= 0
    return certain


def is_covariance_within(covariances: FloatArray, sigma_m: float) -> BoolArray:
    """Whether the standard deviation along the longest axis is at most so many metres, (N,).

    Args:
        covariances: Square metres, shape (N, 3, 3).
        sigma_m: The limit, metres.
    """
    variances = covariances.diagonal(axis1=1, axis2=2)
    limit = sigma_m * abs(sigma_m)
    # The longest lies between the largest of the three and their sum: few need eigenvalues.
    within: BoolArray = variances.sum(axis=1) * (1 + _ROUNDING) < limit
    near = np.flatnonzero(~within & ~(variances.max(axis=1) * (1 - _ROUNDING) > limit))
    within[near] = is_sigma_within(major_axis_sigma(covariances[near]), sigma_m)
    return within


class CovarianceOfMeanBall:
    """Covariances of the mean of valid pairs, for each group of some facts.

    The uncertainty of each view's pixel is carried through the estimator itself, by central
    differences: pairs that share a view move together, and a pair of small parallax, which the
    mean trusts like any other, makes the mean as uncertain as it is. What does not depend on
    the policy is kept: while somebody moves a threshold, few groups change their pairs.

    Source: Hartley & Zisserman, result 5.6.
    """

    def __init__(self, facts: GroupFacts):
        self._facts, self._lock = facts, Lock()
        starts = np.searchsorted(facts.pair_group, np.arange(facts.groups))
        place = np.arange(len(facts.pair_group)) - starts[facts.pair_group]
        # Which pairs of a group were valid last is kept as the bits of an integer. A group of twelve
        # views has more pairs than that has bits: it is computed anew each time.
        self._bit = np.where(place < _BITS, np.int64(1) << np.minimum(place, _BITS), 0)
        self._long = np.isin(np.arange(facts.groups), facts.pair_group[place >= _BITS])
        self._pairs = np.zeros(facts.groups, np.int64)
        self._used = np.zeros(len(facts.view_group), bool)
        self._slope = np.zeros((len(facts.view_group), 2, 3))
        self._carried = np.zeros((len(facts.view_group), 2, 2))

    @property
    def nbytes(self) -> int:
        """Memory of what is kept."""
        arrays = (self._bit, self._long, self._pairs, self._used, self._slope, self._carried)
        return sum(array.nbytes for array in arrays)

    def covariances(
        self, valid: BoolArray, groups: IntArray, points: FloatArray, policy: Policy
    ) -> FloatArray:
        """Covariance of the mean of the valid pairs of each group, square metres, shape (N, 3, 3).

        Infinite where the lines of one of their views leave its camera open.

        Args:
            valid: Pairs that count, shape (P,).
            groups: Rows of groups that have any, increasing, shape (N,).
            points: Their mean points, pitch frame, metres, shape (N, 3).
            policy: How noisy a click is.
        """
        facts = self._facts
        with self._lock, np.errstate(invalid="ignore"):
            self._update_slopes(valid, groups, points)
            wanted = np.zeros(facts.groups, bool)
            wanted[groups] = True
            views = np.flatnonzero(self._used & wanted[facts.view_group])
            slopes, pixels = self._slope[views], self._carried[views]
            pixels = click_pixel_covariances(facts, views, policy) + pixels
            parts = (slopes.transpose(0, 2, 1) @ pixels @ slopes).reshape(-1, 9)
        owner = np.searchsorted(groups, facts.view_group[views])
        total = [np.bincount(owner, part, minlength=len(groups)) for part in parts.T]
        found = np.array(total, float).T.reshape(-1, 3, 3)
        found[owner[facts.view_open[views]]] = np.inf
        return found

    def _update_slopes(self, valid: BoolArray, groups: IntArray, points: FloatArray) -> None:
        """Compute slopes and carried covariances anew where the valid pairs are others."""
        facts = self._facts
        pairs = np.zeros(facts.groups, np.int64)
        np.add.at(pairs, facts.pair_group[valid], self._bit[valid])
        new = (pairs != self._pairs)[groups] | self._long[groups]
        if not new.any():
            return
        fresh = np.zeros(facts.groups, bool)
        fresh[groups[new]] = True
        place = np.zeros((facts.groups, 3))
        place[groups] = points
        views, slopes = _mean_point_derivatives(
            facts, np.flatnonzero(valid & fresh[facts.pair_group])
        )
        self._pairs[fresh] = pairs[fresh]
        self._used[fresh[facts.view_group]] = False
        self._used[views], self._slope[views] = True, slopes
        known = views[facts.view_known[views]]
        self._carried[known] = calibration_pixel_covariances(
            facts, known, place[facts.view_group[known]]
        )


def _mean_point_derivatives(facts: GroupFacts, pairs: IntArray) -> tuple[IntArray, FloatArray]:
    """How far the mean of pairs moves with the pixel of each of their views.

    Args:
        facts: The groups.
        pairs: Rows of the pairs that count, increasing.

    Returns:
        Rows of the views, increasing, shape (N,), and metres by pixel axis and coordinate,
        shape (N, 2, 3).
    """
    views = np.unique(facts.pair_view[pairs])
    owner = facts.pair_group[pairs]
    first = np.searchsorted(owner, facts.view_group[views])
    count = np.searchsorted(owner, facts.view_group[views], "right") - first
    total = np.zeros((len(views), 2, 2, 3))
    for place in range(count.max(initial=0)):
        rows = np.flatnonzero(place < count)
        chosen = pairs[first[rows] + place]
        points, moved = facts.rows("pair_point", chosen), facts.rows("pair_moved", chosen)
        sides = facts.pair_view[chosen] == views[rows, None]
        # A pair without the view stays where it is.
        still = ~sides.any(axis=1)
        by = moved[np.arange(len(chosen)), sides[:, 1].astype(int)]
        by[still] = points[still, None, None]
        total[rows] += by
    means = total / count[:, None, None, None]
    return views, (means[:, :, 0] - means[:, :, 1]) / (2 * STEP_PX)
