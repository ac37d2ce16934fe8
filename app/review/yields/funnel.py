"""Yields: what a policy lets through, gate by gate, and what another one would."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from app.geometry.arrays import BoolArray, IntArray
from app.review.yields.store import Snapshot, YieldStore
from app.soccer.policy import BOXES, CALIBRATION, PITCH, THRESHOLDS, Policy
from app.soccer.solution import GAMMAS_PERCENT, GATES
from app.solving.verdict import Verdict, judge

UNSOLVED = "unsolved"
"""Step of the funnel before the gates: groups that nobody has solved yet."""
WITHOUT_EFFECT = frozenset({BOXES, PITCH})
"""Subjects of thresholds that decide about boxes and new imports, and about no gate."""
ANSWERED = tuple(
    threshold for threshold in THRESHOLDS if threshold.subject not in WITHOUT_EFFECT | {CALIBRATION}
)
"""Thresholds that the table answers for: gates and the findings about the ball."""
JAC_STEPS = tuple((np.arange(101) / 100).tolist())
"""Where the curves are counted: JaC from 0 to 1."""
DISTANCES = (0.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 100.0)
"""Where the bins of distance begin, metres; the last one has no end."""


@dataclass(frozen=True)
class Step:
    """One step of the funnel: how many groups are left after it, and how many it dropped."""

    gate: str
    left: int
    dropped: int


@dataclass(frozen=True)
class Curve:
    """Groups with the ball in two views or more that qualify, against the JaC threshold."""

    gamma_percent: float
    groups: tuple[int, ...]
    thresholds: ClassVar = JAC_STEPS


@dataclass(frozen=True)
class Part:
    """Groups of one split, one bin of distance or with one finding, and how many pass."""

    name: str
    groups: int
    passing: int
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Leak:
    """A match that lies in several splits, with the number of groups in each."""

    match: str
    splits: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Yield:
    """What a policy lets through.

    Attributes:
        funnel: Every group by its first failing gate; the steps lead from all to passing.
        given_not_measured: Groups whose cameras are given and have no lines to measure JaC.
        gained: Groups that pass and do not under the present policy; ``lost`` the reverse.
        needs_solving: Fields whose effect only solving again can tell; they are as before here.
    """

    policy: Policy
    groups: int
    passing: int
    unsolved: int
    funnel: tuple[Step, ...]
    given_not_measured: int
    curves: tuple[Curve, ...]
    splits: tuple[Part, ...]
    distances: tuple[Part, ...]
    findings: tuple[Part, ...]
    leakage: tuple[Leak, ...]
    gained: int
    lost: int
    needs_solving: tuple[str, ...]


def get_yield(
    yields: YieldStore, dataset_id: int, values: Mapping[str, Any] | None = None
) -> Yield:
    """What a dataset's policy lets through, or what it would with other values.

    Args:
        yields: The tables.
        dataset_id: The dataset.
        values: Fields of ``Policy`` that shall differ; ``calibration`` is a mapping of its own.

    Raises:
        NotFoundError: There is no such dataset.
    """
    snapshot = yields.snapshot(dataset_id)
    policy = _changed(snapshot.policy, values or {})
    unanswered = needs_solving(snapshot.policy, policy)
    same = all(item.value(policy) == item.value(snapshot.policy) for item in ANSWERED)
    verdict = snapshot.present if same else judge(snapshot.table.facts, policy, snapshot.spread)
    return _answer(snapshot, policy, verdict, unanswered)


def needs_solving(present: Policy, asked: Policy) -> tuple[str, ...]:
    """Names of thresholds that differ and that the table cannot answer for."""
    return tuple(
        item.name
        for item in THRESHOLDS
        if item.subject == CALIBRATION and item.value(present) != item.value(asked)
    )


def _changed(policy: Policy, values: Mapping[str, Any]) -> Policy:
    values = dict(values)
    calibration = replace(policy.calibration, **values.pop("calibration", {}))
    return replace(policy, **{**values, "calibration": calibration})


def _answer(
    snapshot: Snapshot, policy: Policy, verdict: Verdict, unanswered: tuple[str, ...]
) -> Yield:
    passes, before = verdict.passes, snapshot.present.passes
    return Yield(
        policy=policy,
        groups=snapshot.table.groups + snapshot.unsolved,
        passing=int(passes.sum()),
        unsolved=snapshot.unsolved,
        funnel=_funnel(snapshot, verdict.first, policy),
        given_not_measured=snapshot.unmeasured,
        curves=_curves(snapshot),
        splits=_splits(snapshot, passes),
        distances=_distances(snapshot, verdict),
        findings=_findings(snapshot, policy, verdict),
        leakage=tuple(Leak(match, splits) for match, splits in snapshot.leaks),
        gained=int((passes & ~before).sum()),
        lost=int((before & ~passes).sum()),
        needs_solving=unanswered,
    )


def _funnel(snapshot: Snapshot, first: IntArray, policy: Policy) -> tuple[Step, ...]:
    """Gates that the policy asks for, in order, after the groups that are not solved."""
    inactive = {
        "agreement": policy.min_agreement is None,
        "parallax": policy.min_parallax_degrees is None,
        "sigma": policy.max_sigma_m is None,
        "chi_square": policy.min_p_value is None,
    }
    dropped = np.bincount(first, minlength=len(GATES) + 1)
    left, steps = snapshot.table.groups, []
    if snapshot.unsolved:
        steps.append(Step(UNSOLVED, left, snapshot.unsolved))
    for place, gate in enumerate(GATES):
        if not inactive.get(gate, False):
            left -= int(dropped[place])
            steps.append(Step(gate, left, int(dropped[place])))
    return tuple(steps)


def _curves(snapshot: Snapshot) -> tuple[Curve, ...]:
    """A group qualifies at every threshold strictly below the JaC of its second best view."""
    return tuple(
        Curve(gamma, tuple((len(jac) - np.searchsorted(jac, JAC_STEPS, "right")).tolist()))
        for gamma, jac in zip(GAMMAS_PERCENT, snapshot.qualifying, strict=True)
    )


def _splits(snapshot: Snapshot, passes: BoolArray) -> tuple[Part, ...]:
    heads = snapshot.heads
    everyone = np.bincount(heads.split, minlength=len(heads.splits))
    inside = heads.split[: snapshot.table.groups]
    passing = np.bincount(inside[passes], minlength=len(heads.splits))
    return tuple(
        Part(name, int(groups), int(count))
        for name, groups, count in zip(heads.splits, everyone, passing, strict=True)
    )


def _distances(snapshot: Snapshot, verdict: Verdict) -> tuple[Part, ...]:
    """By distance of the ball; groups that have none under the policy stand apart, last."""
    place = np.digitize(verdict.distance, DISTANCES) - 1
    place[np.isnan(verdict.distance)] = len(DISTANCES)
    groups = np.bincount(place, minlength=len(DISTANCES) + 1)
    groups[-1] += snapshot.unsolved
    passing = np.bincount(place[verdict.passes], minlength=len(DISTANCES) + 1)
    ends: list[float | None] = [*DISTANCES[1:], None, None]
    return tuple(
        Part("", int(groups[bin_]), int(passing[bin_]), low, ends[bin_])
        for bin_, low in enumerate([*DISTANCES, None])
    )


def _findings(snapshot: Snapshot, policy: Policy, verdict: Verdict) -> tuple[Part, ...]:
    """Findings about the ball that follow from thresholds, though they are no gates."""
    x, y, z = verdict.point.T
    half = snapshot.heads.pitch[: snapshot.table.groups].T / 2
    outside = np.maximum(np.abs(x) - half[0], np.abs(y) - half[1])
    implausible = (
        (z > policy.below_grass_m) | (-z > policy.max_height_m) | (outside > policy.outside_pitch_m)
    )
    low = verdict.parallax < policy.low_parallax_degrees
    return tuple(
        Part(kind, int(found.sum()), int((found & verdict.passes).sum()))
        for kind, found in (("implausible_ball", implausible), ("low_parallax", low))
    )
