"""Sides: does a view fit the others once its labels are turned by 180 degrees?

The pitch looks the same from the other side, so a replay that is labelled for the wrong half
calibrates as well as a right one. Only other views can tell: the ball of the turned camera
meets theirs, that of the camera as labelled does not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.geometry.camera import Camera
from app.soccer.policy import Policy
from app.solving.triangulate import Sight, triangulate

_HALF_TURN = np.diag([-1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Swap:
    """A view that fits once turned.

    Attributes:
        view: Key of the view.
        error_px: Larger reprojection error of its best pair as labelled; infinite where the
            rays meet behind a camera or the pair cannot be judged.
        turned_error_px: The same once it is turned; below tau.
        confidence: Between 0.5 and 1.
    """

    view: str
    error_px: float
    turned_error_px: float
    confidence: float


def turned_camera(camera: Camera) -> Camera:
    """The camera that sees the pitch turned by 180 degrees about the centre mark."""
    return replace(
        camera, rotation=camera.rotation @ _HALF_TURN, position=_HALF_TURN @ camera.position
    )


def find_swaps(sights: Sequence[Sight], policy: Policy) -> tuple[Swap, ...]:
    """Views whose ball meets that of the others only after a half turn.

    The first view, the main camera, is believed; it stands on the near side by definition, so
    where it does not (y < 0) it is the one to turn. A given camera rests on no labels and is
    never turned.

    Args:
        sights: Views with camera and ball, the main camera first.
        policy: Holds tau.
    """
    usable = [sight for sight in sights if sight.failed is None]
    if len(usable) < 2:
        return ()
    main, *replays = usable
    if main.camera.position[1] < 0 and _from_lines(main):
        swap = _swap(main, replays, policy)
        return () if swap is None else (swap,)
    swaps = (
        _swap(replay, _others(replay, usable), policy) for replay in replays if _from_lines(replay)
    )
    return tuple(swap for swap in swaps if swap is not None)


def _from_lines(sight: Sight) -> bool:
    return sight.calibration.source == "lines"


def _others(sight: Sight, sights: Sequence[Sight]) -> list[Sight]:
    return [other for other in sights if other is not sight]


def _swap(sight: Sight, others: Sequence[Sight], policy: Policy) -> Swap | None:
    before = _best_error(sight, others, policy)
    if before <= 1:
        return None
    after = _best_error(_turn(sight), others, policy)
    if after >= 1:
        return None
    tau = sight.tau_px(policy)
    # As labelled, the balls may meet behind a camera: no error at all, and no doubt about it.
    confidence = before / (before + after) if math.isfinite(before) else 1.0
    return Swap(sight.view, before * tau, after * tau, confidence)


def _turn(sight: Sight) -> Sight:
    calibration = replace(sight.calibration, camera=turned_camera(sight.camera), covariance=None)
    return replace(sight, calibration=calibration)


def _best_error(sight: Sight, others: Sequence[Sight], policy: Policy) -> float:
    """Larger error of the best pair with one of the others, in units of tau."""
    tau = {item.view: item.tau_px(policy) for item in (sight, *others)}
    errors = [
        np.inf
        if pair.failed not in (None, "reprojection") or _behind(pair.point, sight, other)
        else max(pair.errors_px[0] / tau[pair.a], pair.errors_px[1] / tau[pair.b])
        for other in others
        for pair in triangulate((sight, other), policy)
    ]
    return min(errors, default=np.inf)


def _behind(point: tuple[float, float, float], *sights: Sight) -> bool:
    place = np.array([point])
    return any(sight.camera.pitch_to_camera(place)[0, 2] <= 0 for sight in sights)
