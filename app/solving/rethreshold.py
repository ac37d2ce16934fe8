"""Another tau: a solution retold under it from numbers that are kept, where it decides nothing new.

Nothing is calibrated or triangulated. Of what ``solve`` computes, tau decides which pairs are
valid; where those stay as they were, it is told in one gate and two findings, and in which views
look turned. The last needs the cameras again, but never under a smaller tau: a turned view must
meet the others within tau, so one that did not before does not now.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.geometry.arrays import BoolArray
from app.soccer.finding import Finding
from app.soccer.group import view_letter
from app.soccer.policy import Policy
from app.soccer.solution import Solution
from app.solving.facts import Facts
from app.solving.findings import closest_pair, misses_ball_finding, view_disagrees_finding
from app.solving.gates import reprojection_gate_of_pairs
from app.solving.judgement import first_failed_gates, view_jac


def differs_in_smaller_tau(policy: Policy, before: Policy) -> bool:
    """Whether a policy differs from another in its name and a smaller tau alone."""
    alike = replace(before, name=policy.name, tau_percent=policy.tau_percent)
    return alike == policy and policy.tau_percent < before.tau_percent


def has_unchanged_pairs(facts: Facts, before: Policy, policy: Policy) -> BoolArray:
    """Groups in which no pair fails another gate than under the policy before, shape (G,).

    Args:
        facts: The groups.
        before: A policy.
        policy: The same with another tau.
    """
    jac = view_jac(facts, policy.jac_gamma_percent)
    _, then = first_failed_gates(facts, jac, before)
    _, now = first_failed_gates(facts, jac, policy)
    same = np.ones(facts.groups, bool)
    same[facts.pair_group[then != now]] = False
    return same


def rethreshold(solution: Solution, diagonals: Sequence[float], policy: Policy) -> Solution | None:
    """What ``solve`` says under a smaller tau, bit for bit; None where it has to be asked.

    Args:
        solution: Under a policy that this one ``differs_in_smaller_tau`` than, of a group that is
            ``has_unchanged_pairs``; its calibrations are not read.
        diagonals: Of the pictures of its views, pixels.
        policy: The policy with that tau.
    """
    if any(item.kind == "sides_swapped" or _is_behind(item) for item in solution.findings):
        return None
    keys = [view.view for view in solution.views]
    tau_px = {key: policy.tau_px(diagonal) for key, diagonal in zip(keys, diagonals, strict=True)}
    missed = {
        view.view
        for view in solution.views
        if view.included and view.ball is not None and (view.ball.error_px or 0) > tau_px[view.view]
    }
    reported = {item.view for item in solution.findings if item.kind == "view_disagrees"}
    if not missed <= reported:
        return None
    letters = {key: view_letter(place) for place, key in enumerate(keys)}
    gate = reprojection_gate_of_pairs(solution.pairs, letters, tau_px, policy.tau_percent)
    return replace(
        solution,
        gates=tuple(gate if item.name == gate.name else item for item in solution.gates),
        findings=tuple(
            _rethreshold_finding(item, solution, letters, tau_px) for item in solution.findings
        ),
        policy_hash=policy.hash,
    )


def _is_behind(found: Finding) -> bool:
    """Whether rays meet behind a camera: how far apart the pixels are was not told."""
    return found.kind in ("view_disagrees", "not_synchronous") and found.number is None


def _rethreshold_finding(
    found: Finding, solution: Solution, letters: Mapping[str, str], tau_px: Mapping[str, float]
) -> Finding:
    judged = [pair for pair in solution.pairs if pair.failed == "reprojection"]
    if found.kind == "view_disagrees" and found.view is not None and found.number is not None:
        view = solution.view(found.view)
        if view is not None and view.included:
            return misses_ball_finding(found.view, found.number, tau_px[found.view])
        own = closest_pair([pair for pair in judged if found.view in (pair.a, pair.b)])
        return view_disagrees_finding(found.view, own, letters, tau_px[found.view])
    if found.kind == "not_synchronous":
        best = closest_pair(judged)
        return replace(found, threshold=max(tau_px[best.a], tau_px[best.b]))
    return found
