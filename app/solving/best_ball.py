"""Best ball: the maximum-likelihood point over all views, beside the paper's mean of pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import chdtrc

from app.geometry.arrays import FloatArray, IntArray, row_by_row
from app.geometry.likely_point import CameraTable, likely_points
from app.soccer.policy import Policy
from app.soccer.solution import BestBall, ChiSquare, Pair
from app.solving.ball_covariance import ray_covariances
from app.solving.chi_square import group_sigma_widening
from app.solving.triangulate import BallObservation

MAX_MAHALANOBIS = 13.8
"""Squared, of two coordinates: one honest view in a thousand lies beyond."""


@dataclass(frozen=True)
class _BallEstimate:
    """A point from some views, its covariance, and each view's squared Mahalanobis distance."""

    numbers: tuple[int, ...]
    point: FloatArray
    covariance: FloatArray
    distances: FloatArray

    @property
    def is_consistent(self) -> bool:
        """Whether every view agrees within its uncertainty."""
        return bool((self.distances <= MAX_MAHALANOBIS).all())


def best_ball(
    pairs: Sequence[Pair], usable: Sequence[BallObservation], policy: Policy
) -> BestBall | None:
    """The point that explains the most views best; None where no two views see the ball.

    All views count, weighted by the uncertainty of click and calibration. Where they contradict
    each other the largest set of views that does not is taken, so that one bad view does no
    harm; where those that stay contradict each other, as two views may, its covariance is widened.

    Args:
        pairs: Of the group.
        usable: Of the views that no gate drops.
        policy: How noisy a click is.

    Source: Hartley & Zisserman, sec. 12.5 (minimum reprojection error), with covariances.
    """
    starts = {
        frozenset((pair.a, pair.b)): np.array(pair.point)
        for pair in pairs
        if pair.failed in (None, "reprojection") and not _is_behind_a_camera(pair, usable)
    }
    if not starts:
        return None
    views = _ViewSubsets(usable, policy)
    estimate = _most_consistent(views, starts)
    if estimate is None:
        return None
    freedom, total = 2 * len(estimate.numbers) - 3, float(estimate.distances.sum())
    test = ChiSquare(total, freedom, float(chdtrc(freedom, total)), ())
    covariance = group_sigma_widening(test) ** 2 * estimate.covariance
    used = tuple(views.observations[number].view for number in estimate.numbers)
    x, y, z = estimate.point.tolist()
    return BestBall(
        point=(x, y, z),
        covariance=row_by_row(covariance),
        sigma_m=float(np.sqrt(np.linalg.eigvalsh(covariance)[-1])),
        views=used,
        contradicting=tuple(
            observation.view for observation in usable if observation.view not in used
        ),
        influence_m=_leave_one_out_shifts(views, estimate),
    )


def _most_consistent(
    views: _ViewSubsets, starts: dict[frozenset[str], FloatArray]
) -> _BallEstimate | None:
    """The estimate from the largest set of views that agree, else from the best pair."""
    fallback: list[_BallEstimate] = []
    for count in range(len(views.observations), 1, -1):
        chosen, origins = [], []
        for numbers in combinations(range(len(views.observations)), count):
            names = {views.observations[number].view for number in numbers}
            inside = [point for pair, point in starts.items() if pair <= names]
            if inside:
                chosen.append(numbers)
                origins.append(np.mean(inside, axis=0))
        found = [item for item in views.estimate_subsets(chosen, origins) if item is not None]
        agreeing = [estimate for estimate in found if estimate.is_consistent]
        if agreeing:
            return min(agreeing, key=lambda item: float(item.distances.sum()))
        fallback = found or fallback
    return min(fallback, key=lambda item: float(item.distances.sum()), default=None)


def _leave_one_out_shifts(
    views: _ViewSubsets, estimate: _BallEstimate
) -> tuple[tuple[str, float], ...]:
    """How far the point moves when one view is left out, metres; with three views or more."""
    if len(estimate.numbers) < 3:
        return ()
    numbers = estimate.numbers
    rest = [[other for other in numbers if other != left] for left in numbers]
    without = views.estimate_subsets(rest, [estimate.point] * len(rest))
    return tuple(
        (views.observations[left].view, float(np.linalg.norm(found.point - estimate.point)))
        for left, found in zip(numbers, without, strict=True)
        if found is not None
    )


class _ViewSubsets:
    """The views of a group, and the most likely point of any of their subsets."""

    def __init__(self, observations: Sequence[BallObservation], policy: Policy):
        self.observations = tuple(observations)
        self._policy = policy
        self._centers = np.array([observation.center for observation in observations])
        self._cameras = CameraTable.of([observation.camera for observation in observations])

    def estimate_subsets(
        self, chosen: Sequence[Sequence[int]], starts: Sequence[FloatArray]
    ) -> list[_BallEstimate | None]:
        """Gauss-Newton from a start each; None where it does not settle in front of all.

        Args:
            chosen: Numbers of the views of each subset, all of one size.
            starts: Pitch frame, metres, shape (3,) each.
        """
        if not chosen:
            return []
        views, points = np.array(chosen), np.array(starts)
        # The uncertainties hardly change on the way.
        made = likely_points(
            self._cameras, self._centers, views, points, self._click_covariances(views, points)
        )
        return [
            _BallEstimate(
                tuple(numbers), made.points[row], made.covariances[row], made.distances[row]
            )
            if made.found[row]
            else None
            for row, numbers in enumerate(chosen)
        ]

    def _click_covariances(self, chosen: IntArray, points: FloatArray) -> FloatArray:
        """Covariance of each click at its start, square pixels, shape (E, V, 2, 2)."""
        observations = [self.observations[view] for view in chosen.ravel().tolist()]
        places = np.repeat(points, chosen.shape[1], axis=0)
        return ray_covariances(observations, places, self._policy).reshape(*chosen.shape, 2, 2)


def _is_behind_a_camera(pair: Pair, observations: Sequence[BallObservation]) -> bool:
    point = np.array([pair.point])
    return any(
        observation.camera.pitch_to_camera(point)[0, 2] <= 0
        for observation in observations
        if observation.view in (pair.a, pair.b)
    )
