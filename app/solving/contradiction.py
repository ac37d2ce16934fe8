"""Contradiction: which view does not fit the others, and what instant it might show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray
from app.soccer.frames import height_above_grass
from app.soccer.policy import Policy
from app.soccer.solution import ChiSquare
from app.solving.chi_square import (
    LOW_P_VALUE,
    compute_leave_one_out_chi_square,
    find_untestable_groups,
    fit_balls_and_test_residuals,
    group_sigma_widening,
)
from app.solving.facts import GroupFacts
from app.solving.judgement import Judgement, find_views_in_pairs
from app.solving.triangulate import BallObservation

SURE = 0.9
"""How sure the solver must be of a view to name it."""
TYPICAL_SPEED = 15.0
"""Of a ball in play that was passed or shot, metres a second."""
SPEEDS = (7.0, 35.0)
"""Between a slow pass and the hardest shot."""
LOW_BALL_M = 1.0
"""Up to this height above the grass a ball is taken to move along the ground."""
LONGEST_S = 1.0
"""Longer than this after the others no picture was taken for the same."""
STEEP = 0.05
"""Sine of the angle to the grass above which a ray says where it meets a level."""


@dataclass(frozen=True)
class Contradiction:
    """Views whose residuals are larger than their uncertainty.

    Attributes:
        chi_square: The test that they fail.
        view: The one without which the others agree, or None.
        confidence: That it is this one; None without it.
        gap_m: How far the rays miss each other: so far at least did the ball move, metres; None
            where it is not clear between which views to measure.
        moved_m: How far it moved if it moved level, metres; None where that is not known.
        is_known: Whether it is known how exact each of the cameras is.
    """

    chi_square: ChiSquare
    view: str | None
    confidence: float | None
    gap_m: float | None = None
    moved_m: float | None = None
    is_known: bool = True

    @property
    def widening(self) -> float:
        """By what the sigma of the ball is multiplied for it."""
        return group_sigma_widening(self.chi_square)

    @property
    def may_be_motion(self) -> bool:
        """Whether a ball in play moves as far within a second."""
        least = self.gap_m if self.moved_m is None else self.moved_m
        return least is not None and least <= SPEEDS[1] * LONGEST_S


def compute_chi_square(
    keys: Sequence[str], facts: GroupFacts, judgement: Judgement, policy: Policy
) -> ChiSquare | None:
    """The test of a group's residuals; None where no ball lies in front of all views, and where fewer
    than two of them have a camera that its lines do not leave open.

    Args:
        keys: Of the views.
        facts: Of the one group.
        judgement: What the policy makes of them.
        policy: How noisy a click is.
    """
    used = find_views_in_pairs(facts, judgement.valid) & ~facts.view_open
    found = fit_balls_and_test_residuals(facts, used, judgement.point, policy)
    if not np.isfinite(found.p_value[0]):
        return None
    return ChiSquare(
        value=float(found.chi_square[0]),
        freedom=int(found.freedom[0]),
        p_value=float(found.p_value[0]),
        views=tuple(keys[place] for place in np.flatnonzero(used).tolist()),
    )


def find_contradiction(
    chi_square: ChiSquare | None,
    keys: Sequence[str],
    facts: GroupFacts,
    judgement: Judgement,
    observations: Sequence[BallObservation],
    policy: Policy,
) -> Contradiction | None:
    """Where the views of the ball contradict each other; None where they do not.

    Where nobody says how far a given camera is off, that is one more thing that may be wrong.

    Args:
        chi_square: Of the group.
        keys: Of its views.
        facts: Of the one group.
        judgement: What the policy makes of them.
        observations: Of its views.
        policy: How noisy a click is.
    """
    if chi_square is None or chi_square.p_value >= LOW_P_VALUE:
        return None
    used = np.array([key in chi_square.views for key in keys])
    known = not find_untestable_groups(facts, used, policy)[0]
    chosen = [observation for observation in observations if observation.view in chi_square.views]
    if len(chosen) == 2:
        one, other = chosen
        gap, moved = _measure_ray_and_ball_distance(one, other, judgement.point[0], policy)
        return Contradiction(chi_square, None, None, gap, moved, known)
    view, confidence, point = _find_outlier_view(keys, facts, used, judgement.point, policy)
    if view is None:
        return Contradiction(chi_square, None, None, is_known=known)
    observation = next(observation for observation in chosen if observation.view == view)
    place = _intersect_ray_with_height(observation, float(point[2]))
    level = None if place is None else float(np.linalg.norm(place - point))
    return Contradiction(
        chi_square, view, confidence, _distance_from_ray(observation, point), level, known
    )


def _find_outlier_view(
    keys: Sequence[str], facts: GroupFacts, used: BoolArray, start: FloatArray, policy: Policy
) -> tuple[str | None, float, FloatArray]:
    """The view without which the others agree, how sure that is, and their ball, shape (3,)."""
    places = np.flatnonzero(used)
    left = compute_leave_one_out_chi_square(facts, used, start, policy)
    squares = np.where(np.isnan(left.chi_square), np.inf, left.chi_square)
    best = int(squares.argmin())
    confidence = 1.0 / float(np.exp((squares[best] - squares) / 2).sum())
    agree = left.p_value[best] >= LOW_P_VALUE and confidence >= SURE
    return keys[places[best]] if agree else None, confidence, left.point[best]


def _measure_ray_and_ball_distance(
    a: BallObservation, b: BallObservation, point: FloatArray, policy: Policy
) -> tuple[float, float | None]:
    """How far two rays miss each other, and their balls if both lie on the grass, metres."""
    gap = _smallest_ray_distance(a, b)
    grass = -policy.ball_diameter_m / 2
    ends = _intersect_ray_with_height(a, grass), _intersect_ray_with_height(b, grass)
    if height_above_grass(float(point[2])) > LOW_BALL_M or ends[0] is None or ends[1] is None:
        return gap, None
    return gap, float(np.linalg.norm(ends[0] - ends[1]))


def _intersect_ray_with_height(observation: BallObservation, z: float) -> FloatArray | None:
    """Where a ray meets a level of the pitch frame, shape (3,); None where it is nearly level."""
    direction, position = _ray_direction(observation), observation.camera.position
    if direction[2] < STEEP or z < position[2]:
        return None
    place: FloatArray = position + (z - position[2]) / direction[2] * direction
    return place


def _smallest_ray_distance(a: BallObservation, b: BallObservation) -> float:
    """Smallest distance of the rays of two observations, metres."""
    across = np.cross(_ray_direction(a), _ray_direction(b))
    length = float(np.linalg.norm(across))
    between = b.camera.position - a.camera.position
    if length < 1e-9:
        return float(np.linalg.norm(np.cross(between, _ray_direction(a))))
    return abs(float(between @ across)) / length


def _distance_from_ray(observation: BallObservation, point: FloatArray) -> float:
    """Distance of a point from the ray of an observation, metres."""
    return float(
        np.linalg.norm(np.cross(point - observation.camera.position, _ray_direction(observation)))
    )


def _ray_direction(observation: BallObservation) -> FloatArray:
    ray = observation.camera.rays(np.array([observation.center]))[0]
    direction: FloatArray = ray / np.linalg.norm(ray)
    return direction
