"""The 3D ball of a group: the mean of its valid pairs (the paper's), the best of all its pixels, and where none can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeVar

import numpy as np
from scipy.special import chdtrc

from app.geometry.arrays import BoolArray, FloatArray, IntArray, flatten_covariance
from app.geometry.likely_point import CameraTable, find_most_likely_points
from app.soccer.frames import height_above_grass
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import GATES, Ball3D, BestBall, ChiSquare, TriangulatedPair
from app.solving.ball_covariance import (
    CovarianceOfMeanBall,
    major_axis_sigma,
    observation_pixel_covariances,
)
from app.solving.chi_square import group_sigma_widening
from app.solving.facts import GroupFacts
from app.solving.judgement import PASSES, Judgement
from app.solving.triangulate import BallObservation, PairPoint
from app.wording import format_metres

Metres = TypeVar("Metres", float, FloatArray)

LOW_BALL_M = 2.0
"""Up to this height beside the pitch a ball counts as one that lies there."""


def is_plausible_position(point: tuple[float, float, float], pitch: Pitch, policy: Policy) -> bool:
    """Whether a ball can be there: on or near the pitch, not below it, not sky-high.

    Args:
        point: Pitch frame, metres.
        pitch: The pitch.
        policy: Holds the limits.
    """
    places, size = np.array([point], float), np.array([[pitch.length, pitch.width]], float)
    return not find_implausible_positions(places, size, policy)[0]


def find_implausible_positions(points: FloatArray, sizes: FloatArray, policy: Policy) -> BoolArray:
    """Where a ball cannot be, as ``explain_implausible_position`` says; not where a place is NaN.

    Args:
        points: Pitch frame, metres, shape (N, 3).
        sizes: Length and width of the pitch of each, metres, shape (N, 2).
        policy: Holds the limits.
    """
    x, y, z = points.T
    height = height_above_grass(z)
    outside = np.maximum(np.abs(x) - sizes[:, 0] / 2, np.abs(y) - sizes[:, 1] / 2)
    reach = _reach_outside_pitch(height, policy)
    wrong: BoolArray = (
        (z > policy.below_grass_m)
        | (height > policy.max_height_m)
        | (outside > policy.outside_pitch_m)
        | ((height > LOW_BALL_M) & (outside > reach))
    )
    return wrong


def _reach_outside_pitch(height: Metres, policy: Policy) -> Metres:
    """How far outside the pitch a ball may fly at a height, metres."""
    return policy.outside_pitch_m * (1 - height / policy.max_height_m)


def explain_implausible_position(
    point: tuple[float, float, float], pitch: Pitch, policy: Policy
) -> list[tuple[float, float, str]]:
    """What is wrong with a place: number and limit, metres, and the words for it.

    Beside the pitch balls lie and roll, and high balls fly over it: the higher a ball, the less far
    outside may it be, down to nothing at the largest height.
    """
    x, y, z = point
    height = height_above_grass(z)
    outside = max(abs(x) - pitch.length / 2, abs(y) - pitch.width / 2)
    reach = _reach_outside_pitch(height, policy)
    if LOW_BALL_M < height <= policy.max_height_m and reach < outside <= policy.outside_pitch_m:
        words = f"is {outside:.0f} m outside the pitch at a height of {format_metres(height)}"
        return [(outside, reach, words)]
    return [
        (number, limit, words)
        for number, limit, words in (
            (z, policy.below_grass_m, f"lies {format_metres(z)} below the grass"),
            (height, policy.max_height_m, f"flies {format_metres(height)} above the grass"),
            (outside, policy.outside_pitch_m, f"is {outside:.0f} m outside the pitch"),
        )
        if number > limit
    ]


def judge_pairs(
    pair_points: Sequence[PairPoint], judgement: Judgement
) -> tuple[TriangulatedPair, ...]:
    """Every pair of views with its point, and the gate that makes it invalid."""
    return tuple(
        TriangulatedPair(
            a=item.a.view,
            b=item.b.view,
            point=item.point_as_tuple,
            errors_px=item.errors_px,
            baseline_m=item.baseline_m,
            parallax_degrees=item.parallax_degrees,
            valid=gate == PASSES,
            failed=None if gate == PASSES else GATES[gate],
        )
        for item, gate in zip(pair_points, judgement.pair_failed.tolist(), strict=True)
    )


def compute_mean_ball(
    keys: Sequence[str],
    facts: GroupFacts,
    judgement: Judgement,
    uncertainty: CovarianceOfMeanBall,
    policy: Policy,
    chi_square: ChiSquare | None = None,
) -> Ball3D | None:
    """The mean of the valid pairs with its uncertainty; None without a valid pair.

    Where the views contradict each other its sigma is multiplied by ``group_sigma_widening``.

    Args:
        keys: Of the views.
        facts: Of the one group.
        judgement: What the policy makes of them.
        uncertainty: Of the same facts.
        policy: How noisy a click is.
        chi_square: The test of the views, or None.
    """
    if not judgement.valid.any():
        return None
    covariance = uncertainty.covariances(judgement.valid, np.array([0]), judgement.point, policy)
    covariance = covariance * group_sigma_widening(chi_square) ** 2
    x, y, z = judgement.point[0].tolist()
    return Ball3D(
        point=(x, y, z),
        covariance=flatten_covariance(covariance[0]),
        sigma_m=float(major_axis_sigma(covariance)[0]),
        parallax_degrees=float(judgement.parallax[0]),
        views=tuple(keys[place] for place in np.unique(facts.pair_view[judgement.valid]).tolist()),
    )


def choose_exported_ball(
    mean: Ball3D | None, best: BestBall | None, policy: Policy
) -> Ball3D | None:
    """The ball that leaves: the mean of pairs, or the most likely point where the policy says so.

    Its views and its parallax are those of the valid pairs in either case: they are what the
    gates judge.

    Args:
        mean: Of the valid pairs; without it no ball leaves.
        best: The most likely ball.
        policy: Says which.
    """
    if mean is None or best is None or policy.point == "mean":
        return mean
    return replace(mean, point=best.point, covariance=best.covariance, sigma_m=best.sigma_m)


MAX_MAHALANOBIS = 13.8
"""Squared, of two coordinates: one honest view in a thousand lies beyond."""


MAX_EXHAUSTIVE_VIEWS = 10
"""Up to so many views each set of them is tried."""
NEAR_PERCENT = 1.0
"""Of the diagonal: a view that is farther from the point of a pair says nothing for it."""
GROWN_PAIRS = 5
"""Of more views so many pairs are grown: one that contradicts itself little may still be wrong."""


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


def find_best_ball(
    pairs: Sequence[TriangulatedPair], usable: Sequence[BallObservation], policy: Policy
) -> BestBall | None:
    """The point that explains the most views best; None where no two views see the ball.

    All views count, weighted by the uncertainty of click and calibration, but for those whose lines
    leave their camera open. Where they contradict
    each other the largest set of views that does not is taken, so that one bad view does no
    harm; where those that stay contradict each other, as two views may, its covariance is widened.

    Args:
        pairs: Of the group.
        usable: Of the views that no gate drops.
        policy: How noisy a click is.

    Source: Hartley & Zisserman, sec. 12.5 (minimum reprojection error), with covariances.
    """
    usable = [item for item in usable if not item.calibration.is_left_open]
    names = {item.view for item in usable}
    starts = {
        frozenset((pair.a, pair.b)): np.array(pair.point)
        for pair in pairs
        if pair.failed in (None, "reprojection") and {pair.a, pair.b} <= names
        if not _is_behind_a_camera(pair, usable)
    }
    if not starts:
        return None
    views = _ViewSubsets(usable, policy)
    estimate = _find_most_consistent_estimate(views, starts)
    if estimate is None:
        return None
    freedom, total = 2 * len(estimate.numbers) - 3, float(estimate.distances.sum())
    test = ChiSquare(total, freedom, float(chdtrc(freedom, total)), ())
    covariance = group_sigma_widening(test) ** 2 * estimate.covariance
    used = tuple(views.observations[number].view for number in estimate.numbers)
    x, y, z = estimate.point.tolist()
    return BestBall(
        point=(x, y, z),
        covariance=flatten_covariance(covariance),
        sigma_m=float(np.sqrt(np.linalg.eigvalsh(covariance)[-1])),
        views=used,
        contradicting=tuple(
            observation.view for observation in usable if observation.view not in used
        ),
        influence_m=_compute_leave_one_out_shifts(views, estimate),
    )


def _find_most_consistent_estimate(
    views: _ViewSubsets, starts: dict[frozenset[str], FloatArray]
) -> _BallEstimate | None:
    """The estimate from the largest set of views that agree, else from the best pair.

    Of many views not each set is tried, for their number doubles with a view.
    """
    if len(views.observations) > MAX_EXHAUSTIVE_VIEWS:
        return _grow_most_consistent_estimate(views, starts)
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


def _grow_most_consistent_estimate(
    views: _ViewSubsets, starts: dict[frozenset[str], FloatArray]
) -> _BallEstimate | None:
    """The same for many views: pairs to which most views are near grow by one view after another."""
    numbers = {observation.view: row for row, observation in enumerate(views.observations)}
    chosen = [
        tuple(sorted(numbers[key] for key in pair)) for pair in starts if pair <= numbers.keys()
    ]
    origins = [point for pair, point in starts.items() if pair <= numbers.keys()]
    pairs = [pair for pair in views.estimate_subsets(chosen, origins) if pair is not None]
    agreeing = [pair for pair in pairs if pair.is_consistent]
    if not agreeing:
        return min(pairs, key=lambda pair: float(pair.distances.sum()), default=None)
    # A view that is far away counts no more than one that just is not near.
    errors = np.minimum(views.relative_errors(np.array([pair.point for pair in agreeing])), 1.0)
    order = np.argsort((errors**2).sum(axis=1), kind="stable")[:GROWN_PAIRS].tolist()
    grown = [_grow_estimate(views, agreeing[place]) for place in order]
    return min(grown, key=lambda item: (-len(item.numbers), float(item.distances.sum())))


def _grow_estimate(views: _ViewSubsets, estimate: _BallEstimate) -> _BallEstimate:
    """An estimate with every further view that agrees, the nearest to its point first."""
    left = set(range(len(views.observations))) - set(estimate.numbers)
    while left:
        errors = views.relative_errors(estimate.point[None])[0]
        nearest = min(left, key=lambda number: (errors[number], number))
        left.remove(nearest)
        numbers = tuple(sorted((*estimate.numbers, nearest)))
        (found,) = views.estimate_subsets([numbers], [estimate.point])
        if found is not None and found.is_consistent:
            estimate = found
    return estimate


def _compute_leave_one_out_shifts(
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
        made = find_most_likely_points(
            self._cameras,
            self._centers,
            views,
            points,
            self._compute_click_covariances(views, points),
        )
        return [
            _BallEstimate(
                tuple(numbers), made.points[row], made.covariances[row], made.distances[row]
            )
            if made.found[row]
            else None
            for row, numbers in enumerate(chosen)
        ]

    def relative_errors(self, points: FloatArray) -> FloatArray:
        """How far each view's pixel lies from points, as a share of ``NEAR_PERCENT``, shape (N, V).

        Infinite where the view does not see the point.
        """
        errors = np.empty((len(points), len(self.observations)))
        for column, observation in enumerate(self.observations):
            apart = observation.camera.project(points) - self._centers[column]
            errors[:, column] = 100 / NEAR_PERCENT * np.hypot(*apart.T) / observation.size.diagonal
        errors[np.isnan(errors)] = np.inf
        return errors

    def _compute_click_covariances(self, chosen: IntArray, points: FloatArray) -> FloatArray:
        """Covariance of each click at its start, square pixels, shape (E, V, 2, 2)."""
        observations = [self.observations[view] for view in chosen.ravel().tolist()]
        places = np.repeat(points, chosen.shape[1], axis=0)
        return observation_pixel_covariances(observations, places, self._policy).reshape(
            *chosen.shape, 2, 2
        )


def _is_behind_a_camera(pair: TriangulatedPair, observations: Sequence[BallObservation]) -> bool:
    point = np.array([pair.point])
    return any(
        observation.camera.pitch_to_camera(point)[0, 2] <= 0
        for observation in observations
        if observation.view in (pair.a, pair.b)
    )
