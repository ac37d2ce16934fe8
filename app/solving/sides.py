"""Sides: does a view fit the others once its labels are turned by 180 degrees?

The pitch looks the same from the other side, so a replay that is labelled for the wrong half
calibrates as well as a right one. Only other views can tell: the ball of the turned camera
meets theirs, that of the camera as labelled does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.sphere import sphere_image_scale
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.solving.ball_3d import is_plausible_position
from app.solving.ball_covariance import pixel_covariance
from app.solving.camera_positions import is_main_position
from app.solving.triangulate import BallObservation, PairPoint, triangulate_observation_pairs

_HALF_TURN = np.diag([-1.0, -1.0, 1.0])
LOOSE, SIZE_SIGMA = 0.15, 0.35
"""Logarithm of how much larger than the ball people draw its box, and the spread of that."""
WORST = 60.0
"""Of the cost of one pair: beyond it no pair says more."""
CLEARLY = 8.0
"""By so much the turned view must fit better: the likelihood is then fifty times larger."""
MAX_COST = 30.0
"""Of the best pair, once it is turned: a view that fits neither way shows something else."""
MAIN_WEIGHT = 1.5
SURE = 0.99


@dataclass(frozen=True)
class SwappedView:
    """A view that fits once turned.

    Attributes:
        view: Key of the view.
        error_px: Larger reprojection error of its best pair as labelled; None where its ball
            meets no other in front of both cameras and near the pitch.
        turned_error_px: The same once it is turned, below tau; None for a main camera on the
            far side with which the others agree: they are labelled from the other end as well.
        confidence: Between 0.5 and 1.
    """

    view: str
    error_px: float | None
    turned_error_px: float | None
    confidence: float


def turn_camera(camera: Camera) -> Camera:
    """The camera that sees the pitch turned by 180 degrees about the centre mark."""
    return replace(
        camera, rotation=camera.rotation @ _HALF_TURN, position=_HALF_TURN @ camera.position
    )


def find_swapped_views(
    first: BallObservation | None,
    usable: Sequence[BallObservation],
    pitch: Pitch,
    policy: Policy,
    doubtful: Sequence[BallObservation] = (),
    *,
    is_static: bool = False,
) -> tuple[SwappedView, ...]:
    """Views whose ball meets that of the others only after a half turn.

    The main camera is believed; it stands on the near side by definition, so where it does not
    (y < 0) it is the one to turn. That others agree with it then says only that they are
    labelled from the same wrong end, if main cameras stand where it comes to stand. The first of
    static cameras is no main camera, and stands anywhere. A given camera rests on no labels and is
    never turned.

    Args:
        first: Of the main camera, or None.
        usable: Of the views that no gate drops.
        pitch: Tells which meeting points are plausible.
        policy: Holds tau.
        doubtful: Views whose lines fit too badly to be used: they take no part in what is said of
            others, but that they are labelled from the other end the others can still tell.
        is_static: Whether the first is a static camera.
    """
    swap = None if first is None or is_static else _test_main_camera(first, usable, pitch, policy)
    if swap is not None:
        return (swap,)
    swaps = (
        _test_half_turn(replay, others, first, pitch, policy)
        for replay in (*usable, *doubtful)
        if replay is not first and _is_calibrated_from_lines(replay)
        if (others := _exclude_observation(replay, usable))
    )
    return tuple(swap for swap in swaps if swap is not None)


def _test_main_camera(
    first: BallObservation, usable: Sequence[BallObservation], pitch: Pitch, policy: Policy
) -> SwappedView | None:
    """The main camera if it is the one to turn."""
    if first.camera.position[1] >= 0 or not _is_calibrated_from_lines(first):
        return None
    if first in usable:
        others = _exclude_observation(first, usable)
        swap = _test_half_turn(first, others, first, pitch, policy)
        if swap is not None:
            return swap
    if not is_main_position(turn_camera(first.camera).position):
        return None
    return SwappedView(first.view, None, None, confidence=0.9)


def _is_calibrated_from_lines(observation: BallObservation) -> bool:
    return observation.calibration.source != "given"


def _exclude_observation(
    observation: BallObservation, observations: Sequence[BallObservation]
) -> list[BallObservation]:
    return [other for other in observations if other is not observation]


def _test_half_turn(
    observation: BallObservation,
    others: Sequence[BallObservation],
    first: BallObservation | None,
    pitch: Pitch,
    policy: Policy,
) -> SwappedView | None:
    turned = _find_meeting_points(_turn_observation(observation), others, policy)
    after = _find_smallest_pair_error(turned, pitch, policy)
    # So it is with nearly every view that is labelled as it should be: nothing more is asked.
    if after >= 1:
        return None
    labelled = _find_meeting_points(observation, others, policy)
    costs = _compute_pair_costs(observation, turned, True, pitch, policy)
    better = _sum_weighted_costs(
        _compute_pair_costs(observation, labelled, False, pitch, policy), labelled, first
    )
    better -= _sum_weighted_costs(costs, turned, first)
    if min(costs) > MAX_COST or better < CLEARLY:
        return None
    before, tau = _find_smallest_pair_error(labelled, pitch, policy), observation.tau_px(policy)
    return SwappedView(
        observation.view,
        None if np.isinf(before) else before * tau,
        after * tau,
        confidence=min(SURE, 1.0 / (1.0 + float(np.exp(-better / 2)))),
    )


def _turn_observation(observation: BallObservation) -> BallObservation:
    calibration = replace(
        observation.calibration, camera=turn_camera(observation.camera), covariance=None
    )
    return replace(observation, calibration=calibration)


def _find_meeting_points(
    observation: BallObservation, others: Sequence[BallObservation], policy: Policy
) -> list[PairPoint]:
    """Where the observation meets the others, except from beside it."""
    return [
        item
        for item in triangulate_observation_pairs((observation, other) for other in others)
        if item.baseline_m >= policy.min_baseline_m
    ]


def _find_smallest_pair_error(
    pair_points: Sequence[PairPoint], pitch: Pitch, policy: Policy
) -> float:
    """Larger error of the best pair, in units of tau; infinite where none says anything."""
    errors = [
        max(item.errors_px[0] / item.a.tau_px(policy), item.errors_px[1] / item.b.tau_px(policy))
        for item in pair_points
        if _is_informative_pair(item, pitch, policy)
    ]
    return min(errors, default=np.inf)


def _sum_weighted_costs(
    costs: Sequence[float], pair_points: Sequence[PairPoint], first: BallObservation | None
) -> float:
    """Sum of costs; the main camera counts more than a replay, which may be turned itself."""
    return sum(
        cost * (MAIN_WEIGHT if item.b is first else 1.0)
        for cost, item in zip(costs, pair_points, strict=True)
    )


def _compute_pair_costs(
    observation: BallObservation,
    pair_points: Sequence[PairPoint],
    turned: bool,
    pitch: Pitch,
    policy: Policy,
) -> list[float]:
    """How badly a view fits each of the others: minus twice the logarithm of the likelihood, robustly.

    Two rays can meet by accident within tau, but seldom within their uncertainty, seldom where a
    ball can be, and seldom as far away as both boxes say.

    Args:
        observation: As labelled.
        pair_points: Of the observation, or of the turned one, with others.
        turned: Whether the points are those of the turned observation.
        pitch: Tells which meeting points are plausible.
        policy: How noisy a click is.
    """
    costs = []
    for item in pair_points:
        cost = WORST
        if _is_informative_pair(item, pitch, policy):
            back = _HALF_TURN @ item.point if turned else item.point
            cost = _squared_residuals(observation, back, policy) + _squared_residuals(
                item.b, item.point, policy
            )
        costs.append(min(cost, WORST))
    return costs


def _squared_residuals(observation: BallObservation, point: FloatArray, policy: Policy) -> float:
    """Squared residuals of a ball's place and size in a view, each in units of its sigma."""
    offset = np.array(observation.center) - observation.camera.project(point[None])[0]
    if np.isnan(offset).any():
        return WORST
    place = float(offset @ np.linalg.solve(pixel_covariance(observation, point, policy), offset))
    if not observation.diameter_px:
        return place
    expected = _expected_ball_diameter_px(observation.camera, point, policy.ball_diameter_m)
    size = (np.log(observation.diameter_px / expected) - LOOSE) / SIZE_SIGMA
    return place + min(float(size) ** 2, WORST / 4)


def _expected_ball_diameter_px(camera: Camera, point: FloatArray, diameter_m: float) -> float:
    """How large a ball at a point in front of a camera looks, pixels."""
    in_camera = camera.pitch_to_camera(point[None])[0]
    depth = float(in_camera[2])
    if camera.is_wide:
        scale = sphere_image_scale(camera, in_camera[:2] / depth)
        return diameter_m * scale / float(np.linalg.norm(in_camera))
    return diameter_m * camera.focal_length[1] / depth


def _is_informative_pair(item: PairPoint, pitch: Pitch, policy: Policy) -> bool:
    """Two rays can meet by accident, far from any pitch: such a pair says nothing."""
    return not _is_behind_a_camera(item) and is_plausible_position(
        item.point_as_tuple, pitch, policy
    )


def _is_behind_a_camera(pair_point: PairPoint) -> bool:
    place = pair_point.point[None]
    return any(
        observation.camera.pitch_to_camera(place)[0, 2] <= 0
        for observation in (pair_point.a, pair_point.b)
    )
