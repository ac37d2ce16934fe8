"""Best ball: the maximum-likelihood point over all views, beside the paper's mean of pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.camera_stack import CameraStack
from app.geometry.triangulation import point_covariances, summed
from app.soccer.policy import Policy
from app.soccer.solution import BestBall, Pair
from app.solving.spread import sight_spreads
from app.solving.triangulate import Sight

MAX_MAHALANOBIS = 13.8
"""Squared, of two coordinates: one honest view in a thousand lies beyond."""
_STEPS = 8
_ARRIVED_M = 1e-6


@dataclass(frozen=True)
class _Estimate:
    """A point from some views, its covariance, and each view's squared Mahalanobis distance."""

    numbers: tuple[int, ...]
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
    if not starts:
        return None
    views = _Views(usable, policy)
    estimate = _most_consistent(views, starts)
    if estimate is None:
        return None
    freedom = 2 * len(estimate.numbers) - 3
    excess = max(1.0, float(estimate.distances.sum()) / freedom)
    if estimate.is_consistent:
        excess = 1.0
    spread = excess * estimate.covariance
    used = tuple(views.sights[number].view for number in estimate.numbers)
    x, y, z = estimate.point.tolist()
    return BestBall(
        point=(x, y, z),
        covariance=tuple(spread.ravel().tolist()),
        sigma_m=float(np.sqrt(np.linalg.eigvalsh(spread)[-1])),
        views=used,
        contradicting=tuple(sight.view for sight in usable if sight.view not in used),
        influence_m=_influence(views, estimate),
    )


def _most_consistent(views: _Views, starts: dict[frozenset[str], FloatArray]) -> _Estimate | None:
    """The estimate from the largest set of views that agree, else from the best pair."""
    fallback: list[_Estimate] = []
    for count in range(len(views.sights), 1, -1):
        chosen, origins = [], []
        for numbers in combinations(range(len(views.sights)), count):
            names = {views.sights[number].view for number in numbers}
            inside = [point for pair, point in starts.items() if pair <= names]
            if inside:
                chosen.append(numbers)
                origins.append(np.mean(inside, axis=0))
        found = [item for item in views.estimates(chosen, origins) if item is not None]
        agreeing = [estimate for estimate in found if estimate.is_consistent]
        if agreeing:
            return min(agreeing, key=lambda item: float(item.distances.sum()))
        fallback = found or fallback
    return min(fallback, key=lambda item: float(item.distances.sum()), default=None)


def _influence(views: _Views, estimate: _Estimate) -> tuple[tuple[str, float], ...]:
    """How far the point moves when one view is left out, metres; with three views or more."""
    if len(estimate.numbers) < 3:
        return ()
    numbers = estimate.numbers
    rest = [[other for other in numbers if other != left] for left in numbers]
    without = views.estimates(rest, [estimate.point] * len(rest))
    return tuple(
        (views.sights[left].view, float(np.linalg.norm(found.point - estimate.point)))
        for left, found in zip(numbers, without, strict=True)
        if found is not None
    )


class _Views:
    """The views of a group, and the most likely point of any of their subsets.

    Subsets of one size are computed together, for each call costs more than what it computes;
    each has the bits that it has by itself.
    """

    def __init__(self, sights: Sequence[Sight], policy: Policy):
        self.sights = tuple(sights)
        self._policy = policy
        self._centers = np.array([sight.center for sight in sights])
        self._cameras = CameraStack([sight.camera for sight in sights])

    def estimates(
        self, chosen: Sequence[Sequence[int]], starts: Sequence[FloatArray]
    ) -> list[_Estimate | None]:
        """Gauss-Newton from a start each; None where it does not settle in front of all.

        Args:
            chosen: Numbers of the views of each subset, all of one size.
            starts: Pitch frame, metres, shape (3,) each.
        """
        if not chosen:
            return []
        try:
            return self._fitted(np.array(chosen), np.array(starts))
        except np.linalg.LinAlgError:
            if len(chosen) == 1:
                return [None]
            # One of them has no solution; the others have.
            alone = zip(chosen, starts, strict=True)
            return [self.estimates([views], [start])[0] for views, start in alone]

    def _fitted(self, chosen: IntArray, points: FloatArray) -> list[_Estimate | None]:
        # The uncertainties hardly change on the way.
        spreads = self._spreads(chosen, points)
        settled, on_the_way = np.ones(len(chosen), bool), np.arange(len(chosen))
        for _ in range(_STEPS):
            now = self._linearized(chosen[on_the_way], points[on_the_way], spreads[on_the_way])
            settled[on_the_way[~now.is_sound]] = False
            step = (now.covariance @ now.pull[..., None])[..., 0]
            points[on_the_way] += step
            arrived = np.sqrt((step[:, None] @ step[:, :, None])[:, 0, 0]) < _ARRIVED_M
            finite = np.isfinite(points[on_the_way]).all(axis=1)
            settled[on_the_way[~finite]] = False
            on_the_way = on_the_way[now.is_sound & finite & ~arrived]
            if not len(on_the_way):
                break
        left = np.flatnonzero(settled)
        last = self._linearized(chosen[left], points[left], spreads[left])
        found: list[_Estimate | None] = [None] * len(chosen)
        for row, number in enumerate(left.tolist()):
            if last.is_sound[row]:
                found[number] = _Estimate(
                    tuple(chosen[number].tolist()),
                    points[number],
                    last.covariance[row],
                    last.distances[row],
                )
        return found

    def _spreads(self, chosen: IntArray, points: FloatArray) -> FloatArray:
        """Covariance of each click at its start, square pixels, shape (E, V, 2, 2)."""
        sights = [self.sights[view] for view in chosen.ravel().tolist()]
        places = np.repeat(points, chosen.shape[1], axis=0)
        return sight_spreads(sights, places, self._policy).reshape(*chosen.shape, 2, 2)

    def _linearized(self, chosen: IntArray, points: FloatArray, spreads: FloatArray) -> _Linear:
        pixels, jacobians = self._cameras.linearize(points, chosen)
        offsets = self._centers[chosen] - pixels
        # In front of every camera; what is not is left out of what follows.
        is_sound = ~np.isnan(pixels).any(axis=(1, 2))
        offsets[~is_sound], jacobians[~is_sound] = 0.0, 0.0
        weighed = np.linalg.solve(spreads, offsets[..., None])
        pulls = jacobians.swapaxes(-1, -2) @ weighed
        covariance, known = point_covariances(jacobians, spreads)
        distances = (offsets[..., None, :] @ weighed)[..., 0, 0]
        return _Linear(summed(pulls)[..., 0], covariance, distances, is_sound & known)


@dataclass(frozen=True)
class _Linear:
    """Subsets of views around a point each: which way it should move, shape (E, 3), its covariance,
    (E, 3, 3), each view's squared distance, (E, V), and whether all of that is known, (E,)."""

    pull: FloatArray
    covariance: FloatArray
    distances: FloatArray
    is_sound: BoolArray


def _is_behind(pair: Pair, sights: Sequence[Sight]) -> bool:
    point = np.array([pair.point])
    return any(
        sight.camera.pitch_to_camera(point)[0, 2] <= 0
        for sight in sights
        if sight.view in (pair.a, pair.b)
    )
