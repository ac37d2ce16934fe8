"""Sides: does a view fit the others once its labels are turned by 180 degrees?

The pitch looks the same from the other side, so a replay that is labelled for the wrong half
calibrates as well as a right one. Only other views can tell: the ball of the turned camera
meets theirs, that of the camera as labelled does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.geometry.camera import Camera
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.solving.plausible import is_plausible
from app.solving.triangulate import Meeting, Sight, meet

_HALF_TURN = np.diag([-1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Swap:
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


def turned_camera(camera: Camera) -> Camera:
    """The camera that sees the pitch turned by 180 degrees about the centre mark."""
    return replace(
        camera, rotation=camera.rotation @ _HALF_TURN, position=_HALF_TURN @ camera.position
    )


def find_swaps(
    first: Sight | None, usable: Sequence[Sight], pitch: Pitch, policy: Policy
) -> tuple[Swap, ...]:
    """Views whose ball meets that of the others only after a half turn.

    The main camera is believed; it stands on the near side by definition, so where it does not
    (y < 0) it is the one to turn. That others agree with it then says only that they are
    labelled from the same wrong end. A given camera rests on no labels and is never turned.

    Args:
        first: Of the main camera, or None.
        usable: Of the views that no gate drops.
        pitch: Tells which meeting points are plausible.
        policy: Holds tau.
    """
    if first is not None and first.camera.position[1] < 0 and _from_lines(first):
        swap = _swap(first, _others(first, usable), pitch, policy) if first in usable else None
        return (swap or Swap(first.view, None, None, confidence=0.9),)
    if len(usable) < 2:
        return ()
    swaps = (
        _swap(replay, _others(replay, usable), pitch, policy)
        for replay in usable
        if replay is not first and _from_lines(replay)
    )
    return tuple(swap for swap in swaps if swap is not None)


def _from_lines(sight: Sight) -> bool:
    return sight.calibration.source == "lines"


def _others(sight: Sight, sights: Sequence[Sight]) -> list[Sight]:
    return [other for other in sights if other is not sight]


def _swap(sight: Sight, others: Sequence[Sight], pitch: Pitch, policy: Policy) -> Swap | None:
    before = _best_error(sight, others, pitch, policy)
    if before <= 1:
        return None
    after = _best_error(_turn(sight), others, pitch, policy)
    if after >= 1:
        return None
    tau = sight.tau_px(policy)
    if np.isinf(before):
        return Swap(sight.view, None, after * tau, confidence=1.0)
    return Swap(sight.view, before * tau, after * tau, confidence=before / (before + after))


def _turn(sight: Sight) -> Sight:
    calibration = replace(sight.calibration, camera=turned_camera(sight.camera), covariance=None)
    return replace(sight, calibration=calibration)


def _best_error(sight: Sight, others: Sequence[Sight], pitch: Pitch, policy: Policy) -> float:
    """Larger error of the best pair with one of the others, in units of tau.

    Two rays can meet by accident, far from any pitch: such a pair says nothing.
    """
    errors = [
        max(item.errors_px[0] / item.a.tau_px(policy), item.errors_px[1] / item.b.tau_px(policy))
        for item in meet((sight, other) for other in others)
        if item.baseline_m >= policy.min_baseline_m
        and not _is_behind(item)
        and is_plausible(item.place, pitch, policy)
    ]
    return min(errors, default=np.inf)


def _is_behind(meeting: Meeting) -> bool:
    place = meeting.point[None]
    return any(sight.camera.pitch_to_camera(place)[0, 2] <= 0 for sight in (meeting.a, meeting.b))
