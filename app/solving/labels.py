"""Labels: markings annotated under the wrong class.

A wrong label pulls the whole camera away, so that nothing fits. Markings are left out in turn
and the rest is resected from scratch; the one to suspect is the one without which everything
else falls into place. Where its points then lie on the projection of another marking, that is
what it should have been called.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import X, Z
from app.soccer.pitch import CIRCLES, MARKINGS
from app.soccer.solution import SuspectLabel
from app.solving.camera_positions import is_possible_position
from app.solving.observations import Observations
from app.solving.resect import (
    Resection,
    ResectionProblem,
    count_measurements,
    has_few_measurements,
)

GAMMA_SHARE = 0.005
"""Gamma as a share of the diagonal; the distances below are in units of it."""
MISFIT = 1.5
"""A marking is off when a point of it lies farther than this."""
NAMELESS_MISFIT = 4.0
"""The same for a marking that fits no other class either."""
FITS = 2.0
"""Without the suspects every other marking lies within this."""
SETTLES = 3.0
"""The same where the cost falls decisively."""
RELABELLED = 1.5
"""The points of a relabelled marking lie within this, which counts as evidence."""
NEAREST = 8.0
"""A class is proposed without being evidence when the points lie within this and only half as
far as from any other class, the present one too: what is left out is extrapolated, circles above all."""
DECISIVE = 0.35
"""Without a class that fits, the cost must fall to this share to suspect a marking."""
MAX_SUSPECTS = 3
MIN_MEASUREMENTS_LEFT = 8


@dataclass(frozen=True)
class _SuspectMarking:
    """A marking left out: how far off it is, and the class that its points fit best, if any."""

    marking: str
    error: float
    suggested: str | None
    suggested_error: float

    @property
    def is_outlier(self) -> bool:
        return self.error > (MISFIT if self.has_fitting_label else NAMELESS_MISFIT)

    @property
    def has_fitting_label(self) -> bool:
        """Whether the class that it is nearest to fits."""
        return self.suggested is not None and self.suggested_error <= RELABELLED


@dataclass(frozen=True)
class _RemovalTrial:
    """What happens without some markings: the camera, and the largest distance of the others."""

    doubts: tuple[_SuspectMarking, ...]
    rest: Observations
    fit: Resection
    worst: float

    @property
    def removes_only_outliers(self) -> bool:
        """Whether all that was left out is off."""
        return all(doubt.is_outlier for doubt in self.doubts)

    @property
    def explains_all_points(self) -> bool:
        """Whether all others fit, and what was left out fits another class."""
        return self.worst <= FITS and all(doubt.has_fitting_label for doubt in self.doubts)


def find_suspects(
    problem: ResectionProblem, observations: Observations, fit: Resection
) -> tuple[Resection, Observations, tuple[SuspectLabel, ...]]:
    """The camera, the observations it rests on, and the markings left out of them.

    Args:
        problem: The image.
        observations: All annotated points.
        fit: The camera from all of them.

    Returns:
        The arguments themselves and no suspect where every marking fits.
    """
    search = _LabelSearch(problem, GAMMA_SHARE * problem.size.diagonal)
    if search.has_no_outliers(observations, fit):
        return fit, observations, ()
    found = search.find_explanation(observations, fit)
    if found is None:
        return fit, observations, ()
    trial, names = found
    # Only now is it known which classes are free (two posts may have been swapped), and whether
    # what was left out on the way there is off at all.
    final = [
        search.compare_with_other_labels(observations, trial.rest, trial.fit, name)
        for name in names
    ]
    suspects = [doubt for doubt in final if doubt.is_outlier]
    fit, rest = trial.fit, trial.rest
    if len(suspects) < len(final):
        rest = observations.without(*(doubt.marking for doubt in suspects))
        fit = problem.refine(rest, fit.parameters[None])
    return fit, rest, tuple(search.to_suspect(doubt) for doubt in suspects)


def measure_mirrored_lines(
    problem: ResectionProblem, fit: Resection, observations: Observations
) -> float | None:
    """Largest distance of the points, pixels, once left and right are exchanged in all labels.

    Args:
        problem: The image.
        fit: The camera from the labels as they are.
        observations: All annotated points.

    Returns:
        None where the camera can stand where it does, and where they fit no better then.
    """
    if is_possible_position(fit.parameters[X : Z + 1]) or has_few_measurements(observations):
        return None
    mirrored = observations.mirrored()
    found = problem.resect(mirrored)
    worst = float(problem.distances(found.parameters, mirrored).max())
    fits = worst <= FITS * GAMMA_SHARE * problem.size.diagonal and found.cost < fit.cost
    return worst if fits and is_possible_position(found.parameters[X : Z + 1]) else None


@dataclass(frozen=True)
class _LabelSearch:
    """Trials on one image; distances are in units of ``gamma`` (pixels)."""

    problem: ResectionProblem
    gamma: float

    def has_no_outliers(self, observations: Observations, fit: Resection) -> bool:
        """Whether no marking is off."""
        return (
            max(self.measure_largest_distances(observations, fit).values(), default=0.0) <= MISFIT
        )

    def find_explanation(
        self, observations: Observations, fit: Resection
    ) -> tuple[_RemovalTrial, list[str]] | None:
        """The trial to believe with all that is left out on the way to it, or None."""
        trial = self.try_without_minority_half(observations)
        if trial is not None and self.is_convincing(trial, fit.cost):
            return trial, [doubt.marking for doubt in trial.doubts]
        names: list[str] = []
        rest, now = observations, fit
        for _ in range(MAX_SUSPECTS):
            trial = self.find_best_single_removal(rest, now)
            if trial is None:
                return None
            names += [doubt.marking for doubt in trial.doubts]
            if self.is_convincing(trial, fit.cost):
                return trial, names
            rest, now = trial.rest, trial.fit
        return None

    def is_convincing(self, trial: _RemovalTrial, cost: float) -> bool:
        """Whether a trial is good enough to believe, against the cost with all markings."""
        return trial.explains_all_points or (
            trial.fit.cost < DECISIVE * cost and trial.worst <= SETTLES
        )

    def try_without_minority_half(self, observations: Observations) -> _RemovalTrial | None:
        """The trial without the few markings of the other side, if that settles everything."""
        minority = _find_markings_on_minority_half(observations.markings)
        if not 2 <= len(minority) <= MAX_SUSPECTS:
            return None
        trial = self.try_without_markings(observations, minority)
        return (
            trial
            if trial is not None and trial.removes_only_outliers and trial.worst <= FITS
            else None
        )

    def find_best_single_removal(
        self, observations: Observations, fit: Resection
    ) -> _RemovalTrial | None:
        """The first marking whose removal explains everything, else the one that helps most."""
        trials = []
        for marking in _order_by_suspicion(self.measure_largest_distances(observations, fit)):
            trial = self.try_without_markings(observations, [marking])
            if trial is None or not trial.removes_only_outliers:
                continue
            if trial.explains_all_points:
                return trial
            trials.append(trial)
        return min(trials, key=lambda item: item.fit.cost, default=None)

    def try_without_markings(
        self, observations: Observations, markings: Sequence[str]
    ) -> _RemovalTrial | None:
        """The camera without some markings; None when too little would be left."""
        rest = observations.without(*markings)
        if count_measurements(rest) < MIN_MEASUREMENTS_LEFT:
            return None
        fit = self.problem.search(rest)
        doubts = tuple(
            self.compare_with_other_labels(observations, rest, fit, marking) for marking in markings
        )
        return _RemovalTrial(
            doubts, rest, fit, max(self.measure_largest_distances(rest, fit).values())
        )

    def compare_with_other_labels(
        self, observations: Observations, rest: Observations, fit: Resection, marking: str
    ) -> _SuspectMarking:
        """A marking against the camera from the rest, under its label and those not in use."""
        error = self.measure_largest_distance(fit.parameters, observations.only(marking))
        taken = {*rest.markings, marking}
        ranked = sorted(
            (
                self.measure_largest_distance(fit.parameters, observations.only(marking, other)),
                other,
            )
            for other in MARKINGS
            if other not in taken and (other in CIRCLES) == (marking in CIRCLES)
        )
        if not ranked:
            return _SuspectMarking(marking, error, None, np.inf)
        nearest, best = ranked[0]
        rival = ranked[1][0] if len(ranked) > 1 else np.inf
        fits = nearest <= RELABELLED and nearest < error
        plausible = fits or (nearest <= NEAREST and 2 * nearest < min(rival, error))
        return _SuspectMarking(marking, error, best if plausible else None, nearest)

    def measure_largest_distances(
        self, observations: Observations, fit: Resection
    ) -> dict[str, float]:
        """Largest distance of each marking's points."""
        apart = self.problem.distances(fit.parameters, observations) / self.gamma
        return {
            MARKINGS[index]: float(apart[observations.marking == index].max())
            for index in np.unique(observations.marking)
        }

    def measure_largest_distance(self, parameters: FloatArray, observations: Observations) -> float:
        """Largest distance of all points."""
        return float(self.problem.distances(parameters, observations).max()) / self.gamma

    def to_suspect(self, doubt: _SuspectMarking) -> SuspectLabel:
        """The doubt as people are told of it; a class that fits as badly is worth nothing."""
        named = doubt.suggested is not None
        return SuspectLabel(
            marking=doubt.marking,
            suggested=doubt.suggested,
            confidence=1 - doubt.suggested_error / doubt.error if named else 0.5,
            error_px=doubt.error * self.gamma,
            suggested_error_px=doubt.suggested_error * self.gamma if named else None,
        )


def _order_by_suspicion(largest: dict[str, float]) -> list[str]:
    """Markings in the order in which they are tried.

    Those on the other side of the pitch than most come first, then what fits worst.
    """
    minority = _find_markings_on_minority_half(tuple(largest))
    return sorted(largest, key=lambda name: (name not in minority, -largest[name], name))


def _find_markings_on_minority_half(markings: Sequence[str]) -> list[str]:
    """The markings of that half of the pitch which fewer of them belong to."""
    halves = (
        [name for name in markings if _pitch_half(name) == half] for half in ("left", "right")
    )
    return min(halves, key=len)


def _pitch_half(marking: str) -> str | None:
    """``left`` or ``right`` of the pitch; None for what belongs to both."""
    return next((word for word in marking.split(" ")[1:3] if word in ("left", "right")), None)
