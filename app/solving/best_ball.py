"""Best ball: the maximum-likelihood point over all views, beside the paper's mean of pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray
from app.geometry.triangulation import point_covariance
from app.soccer.policy import Policy
from app.soccer.solution import BestBall, Pair
from app.solving.spread import pixel_spread
from app.solving.triangulate import Sight

MAX_MAHALANOBIS = 13.8
"""Squared, of two coordinates: one honest view in a thousand lies beyond."""
_STEPS = 8
_ARRIVED_M = 1e-6


@dataclass(frozen=True)
class _Estimate:
    """A point from some views, its covariance, and each view's squared Mahalanobis distance."""

    sights: tuple[Sight, ...]
    point: FloatArray
    covariance: FloatArray
    distances: FloatArray

    @property
    def is_consistent(self) -> bool:
        """Whether every view agrees within its uncertainty."""
        return bool((self.distances <= MAX_MAHALANOBIS).all())


def best_ball(pairs: Sequence[Pair], usable: Sequence[Sight], policy: Policy) -> BestBall | None:
    """The point that explains the most views best; None where no two views see the ball.

    All views count, weighted by the uncertainty of click and calibration. Where they contradict
    each other the largest set of views that does not is taken, so that one bad view does no
    harm; two views that contradict each other stay, with their covariance widened accordingly.

    Args:
        pairs: Of the group.
        usable: Of the views that no gate drops.
        policy: How noisy a click is.

    Source: Hartley & Zisserman, sec. 12.5 (minimum reprojection error), with covariances.
    """
    starts = {
        frozenset((pair.a, pair.b)): np.array(pair.point)
        for pair in pairs
        if pair.failed in (None, "reprojection") and not _is_behind(pair, usable)
    }
    estimate = _most_consistent(tuple(usable), starts, policy)
    if estimate is None:
        return None
    freedom = 2 * len(estimate.sights) - 3
    excess = max(1.0, float(estimate.distances.sum()) / freedom)
    if estimate.is_consistent:
        excess = 1.0
    spread = excess * estimate.covariance
    used = tuple(sight.view for sight in estimate.sights)
    x, y, z = estimate.point.tolist()
    return BestBall(
        point=(x, y, z),
        covariance=tuple(spread.ravel().tolist()),
        sigma_m=float(np.sqrt(np.linalg.eigvalsh(spread)[-1])),
        views=used,
        contradicting=tuple(sight.view for sight in usable if sight.view not in used),
        influence_m=_influence(estimate, policy),
    )


def _most_consistent(
    sights: tuple[Sight, ...], starts: dict[frozenset[str], FloatArray], policy: Policy
) -> _Estimate | None:
    """The estimate from the largest set of views that agree, else from the best pair."""
    fallback: list[_Estimate] = []
    for count in range(len(sights), 1, -1):
        found = [
            estimate
            for chosen in combinations(sights, count)
            if (estimate := _estimate(chosen, starts, policy)) is not None
        ]
        agreeing = [estimate for estimate in found if estimate.is_consistent]
        if agreeing:
            return min(agreeing, key=lambda item: float(item.distances.sum()))
        fallback = found or fallback
    return min(fallback, key=lambda item: float(item.distances.sum()), default=None)


def _estimate(
    sights: tuple[Sight, ...], starts: dict[frozenset[str], FloatArray], policy: Policy
) -> _Estimate | None:
    """Gauss-Newton from the pairs' points; None where it does not settle in front of all."""
    views = {sight.view for sight in sights}
    origins = [point for pair, point in starts.items() if pair <= views]
    if not origins:
        return None
    point = np.mean(origins, axis=0)
    # The uncertainties hardly change on the way.
    spreads = np.array([pixel_spread(sight, point, policy) for sight in sights])
    try:
        for _ in range(_STEPS):
            offsets, jacobians = _linearized(sights, point)
            covariance = point_covariance(jacobians, spreads)
            pull = sum(
                jacobian.T @ weighted
                for jacobian, weighted in zip(jacobians, _weighed(spreads, offsets), strict=True)
            )
            step = covariance @ pull
            point = point + step
            if not np.isfinite(point).all():
                return None
            if np.linalg.norm(step) < _ARRIVED_M:
                break
        offsets, jacobians = _linearized(sights, point)
        covariance = point_covariance(jacobians, spreads)
    except (DegenerateGeometryError, np.linalg.LinAlgError):
        return None
    distances = [
        float(offset @ weighted)
        for offset, weighted in zip(offsets, _weighed(spreads, offsets), strict=True)
    ]
    return _Estimate(sights, point, covariance, np.array(distances))


def _weighed(spreads: FloatArray, offsets: Sequence[FloatArray]) -> FloatArray:
    """Offsets over their covariances (V, 2, 2), in one call for all views, shape (V, 2)."""
    weighed = np.linalg.solve(spreads, np.array(offsets)[..., None])[..., 0]
    return np.asarray(weighed, dtype=np.float64)


def _linearized(
    sights: tuple[Sight, ...], point: FloatArray
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Offsets of the clicks and Jacobians at a point, view by view."""
    pixels = [sight.camera.project(point[None])[0] for sight in sights]
    if np.isnan(pixels).any():
        raise DegenerateGeometryError("the point is not in front of every camera")
    offsets = [np.array(sight.center) - pixel for sight, pixel in zip(sights, pixels, strict=True)]
    return offsets, [sight.camera.jacobian(point) for sight in sights]


def _influence(estimate: _Estimate, policy: Policy) -> tuple[tuple[str, float], ...]:
    """How far the point moves when one view is left out, metres; with three views or more."""
    if len(estimate.sights) < 3:
        return ()
    everyone = frozenset(sight.view for sight in estimate.sights)
    moved = []
    for sight in estimate.sights:
        rest = tuple(other for other in estimate.sights if other is not sight)
        start = {frozenset(everyone - {sight.view}): estimate.point}
        without = _estimate(rest, start, policy)
        if without is not None:
            distance = float(np.linalg.norm(without.point - estimate.point))
            moved.append((sight.view, distance))
    return tuple(moved)


def _is_behind(pair: Pair, sights: Sequence[Sight]) -> bool:
    point = np.array([pair.point])
    return any(
        sight.camera.pitch_to_camera(point)[0, 2] <= 0
        for sight in sights
        if sight.view in (pair.a, pair.b)
    )
