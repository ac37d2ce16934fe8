"""Solve: from what people said of a group to everything that follows from it; and the same under another tau.

``solve_group`` is one pure function: no clock, no database, no memory, the same bits every time. The
edit in the browser, the preview, the batch and the export all call it.

``rethreshold_solution`` calibrates and triangulates nothing. Of what ``solve_group`` computes, tau decides which pairs are
valid; where those stay as they were, it is told in one gate and two findings, and in which views
look turned. The last needs the cameras again, but never under a smaller tau: a turned view must
meet the others within tau, so one that did not before does not now.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from types import MappingProxyType

import numpy as np

from app.geometry.arrays import BoolArray
from app.geometry.camera import Camera
from app.geometry.lens import COEFFICIENTS
from app.geometry.likely_point import CameraTable, find_most_likely_points
from app.soccer.annotation import make_lines
from app.soccer.finding import Finding
from app.soccer.frames import ImageSize
from app.soccer.group import Group, View, make_view_letter
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy, Policy
from app.soccer.solution import (
    GATES,
    SOLVER_VERSION,
    Ball3D,
    Calibration,
    Solution,
    ViewSolution,
)
from app.solving.ball_3d import choose_exported_ball, compute_mean_ball, find_best_ball, judge_pairs
from app.solving.ball_box import measure_ball_fit, predict_ball_in_view
from app.solving.ball_covariance import CovarianceOfMeanBall
from app.solving.calibrate import calibrate, calibrate_view, compute_view_calibration_key
from app.solving.contradiction import compute_chi_square, find_contradiction
from app.solving.facts import GroupFacts, collect_facts
from app.solving.findings import (
    find_closest_pair,
    find_group_findings,
    make_misses_ball_finding,
    make_view_disagrees_finding,
)
from app.solving.gate_sentences import (
    JudgedView,
    describe_gates,
    find_larger_error_in_tau,
    make_reprojection_gate,
)
from app.solving.judgement import (
    PASSES,
    Judgement,
    compute_view_jac,
    find_first_failed_gates,
    judge_groups,
)
from app.solving.triangulate import collect_ball_observations, triangulate_observation_pairs

NO_CALIBRATIONS: Mapping[str, Calibration] = MappingProxyType({})
LEFT_OUT = "excluded"
"""What a view that a person left out failed at."""


def solve_group(
    group: Group, policy: Policy, calibrations: Mapping[str, Calibration] = NO_CALIBRATIONS
) -> Solution:
    """The solution of a group under a policy.

    Args:
        group: What was said.
        policy: Every threshold.
        calibrations: Calibrations known from before under their ``compute_calibration_key``; they save
            time and change nothing.
    """
    return solve_and_collect_facts(group, policy, calibrations)[0]


def solve_and_collect_facts(
    group: Group, policy: Policy, calibrations: Mapping[str, Calibration]
) -> tuple[Solution, GroupFacts]:
    """``solve_group``, and the facts that its gates were judged by."""
    known = dict(calibrations)
    keys = [_calibrate_view_unless_known(view, group, policy, known) for view in group.views]
    found = [known[key] for key in keys]
    observations = collect_ball_observations(group.views, found)
    pair_points = triangulate_observation_pairs(combinations(observations, 2))
    facts = collect_facts(group.views, found, observations, pair_points)
    uncertainty = CovarianceOfMeanBall(facts)
    judgement = judge_groups(facts, policy, uncertainty)
    pairs = judge_pairs(pair_points, judgement)
    names = [view.key for view in group.views]
    failed = _list_failed_gate_names(group, judgement)
    left = {name for name, gate in zip(names, failed, strict=True) if gate is None}
    usable = [observation for observation in observations if observation.view in left]
    chi_square = compute_chi_square(names, facts, judgement, policy)
    mean = compute_mean_ball(names, facts, judgement, uncertainty, policy, chi_square)
    best = find_best_ball(pairs, usable, policy)
    ball = choose_exported_ball(mean, best, policy)
    contradicted = find_contradiction(chi_square, names, facts, judgement, observations, policy)
    views = tuple(
        _add_ball_to_view(view, ViewSolution(view.key, known[key], key, False, gate), ball, policy)
        for view, key, gate in zip(group.views, keys, failed, strict=True)
    )
    judged, left_out = (
        _make_judged_views(group, views, facts, judgement, policy),
        _list_excluded_view_letters(group),
    )
    solution = Solution(
        views=views,
        pairs=pairs,
        ball=ball,
        best_ball=best,
        mean_ball=None if ball is mean else mean,
        chi_square=chi_square,
        gates=describe_gates(judged, left_out, pairs, mean, judgement, policy, chi_square),
        findings=find_group_findings(group, views, observations, pairs, ball, policy, contradicted),
        policy_hash=policy.hash,
        solver_version=SOLVER_VERSION,
    )
    return solution, facts


def _calibrate_view_unless_known(
    view: View, group: Group, policy: Policy, known: dict[str, Calibration]
) -> str:
    """Key of a view's calibration, which is known then."""
    key = compute_view_calibration_key(group, view, policy.calibration)
    if key not in known:
        known[key] = calibrate_view(group, view, policy.calibration, known)
    return key


def _list_failed_gate_names(group: Group, judgement: Judgement) -> list[str | None]:
    """What each view failed at, or None."""
    return [
        LEFT_OUT if not view.included else None if gate == PASSES else GATES[gate]
        for view, gate in zip(group.views, judgement.view_failed.tolist(), strict=True)
    ]


def _add_ball_to_view(
    view: View, solved: ViewSolution, ball: Ball3D | None, policy: Policy
) -> ViewSolution:
    if ball is None:
        return solved
    solved = replace(
        solved,
        included=view.key in ball.views,
        expected=predict_ball_in_view(solved.calibration, view.size, ball, policy),
    )
    if solved.calibration.camera is None or view.ball is None:
        return solved
    fit = measure_ball_fit(
        solved.calibration.camera,
        view.size,
        view.ball,
        np.array(ball.point),
        policy.ball_diameter_m,
        solved.expected,
    )
    return replace(solved, ball=fit)


def _explain_missing_ball(view: View) -> str:
    """Why a view has no ball that counts, with a place for letters."""
    seen = [ball for ball in view.balls if not ball.out_of_view]
    if len(seen) > 1:
        return "several in {}"
    if not seen:
        return "none in {}"
    if seen[0].inferred:
        return "placed in {} (not counted)"
    return "no ray goes through it: it lies beyond what the lens of view {} shows"


def _make_judged_views(
    group: Group,
    views: Sequence[ViewSolution],
    facts: GroupFacts,
    judgement: Judgement,
    policy: Policy,
) -> tuple[JudgedView, ...]:
    return tuple(
        JudgedView(
            key=view.key,
            letter=make_view_letter(index),
            calibration=solved.calibration,
            jac=None if np.isnan(jac) else jac,
            tau_px=policy.tau_px(view.size.diagonal),
            has_ball=has_ball,
            failed=solved.failed,
            no_ball=_explain_missing_ball(view),
        )
        for index, (view, solved, jac, has_ball) in enumerate(
            zip(group.views, views, judgement.jac.tolist(), facts.view_ball.tolist(), strict=True)
        )
        if view.included
    )


def _list_excluded_view_letters(group: Group) -> tuple[str, ...]:
    """Letters of the views that a person left out."""
    return tuple(make_view_letter(i) for i, view in enumerate(group.views) if not view.included)


_SQUARE = {
    "Big rect. right main": [(300.0, 150.0), (500.0, 400.0)],
    "Big rect. right top": [(300.0, 150.0), (700.0, 170.0)],
    "Big rect. right bottom": [(500.0, 400.0), (900.0, 380.0)],
    "Side line right": [(700.0, 170.0), (900.0, 380.0)],
    "Circle right": [(350.0, 260.0), (340.0, 280.0), (380.0, 330.0)],
}


def warm_up_solver() -> None:
    """Calibrate a made-up picture and look for a point once; the first time on a machine this compiles for seconds."""
    calibrate(make_lines(_SQUARE), Pitch(), ImageSize(960, 540), CalibrationPolicy())
    lens = np.array([0.01, *np.zeros(COEFFICIENTS - 1)])
    upright = Camera(np.eye(3), np.zeros(3), (1000.0, 1000.0), (480.0, 270.0), distortion=lens)
    upright.undistort(np.zeros((1, 2)))
    find_most_likely_points(
        CameraTable.of([upright]),
        np.zeros((1, 2)),
        np.zeros((1, 1), int),
        np.zeros((1, 3)),
        np.ones((1, 1, 2, 2)),
    )


def differs_only_in_smaller_tau(policy: Policy, before: Policy) -> bool:
    """Whether a policy differs from another in its name and a smaller tau alone."""
    alike = replace(before, name=policy.name, tau_percent=policy.tau_percent)
    return alike == policy and policy.tau_percent < before.tau_percent


def has_unchanged_pairs(facts: GroupFacts, before: Policy, policy: Policy) -> BoolArray:
    """Groups in which no pair fails another gate than under the policy before, shape (G,).

    Args:
        facts: The groups.
        before: A policy.
        policy: The same with another tau.
    """
    jac = compute_view_jac(facts, policy.jac_gamma_percent)
    _, then = find_first_failed_gates(facts, jac, before)
    _, now = find_first_failed_gates(facts, jac, policy)
    same = np.ones(facts.groups, bool)
    same[facts.pair_group[then != now]] = False
    return same


def rethreshold_solution(
    solution: Solution, diagonals: Sequence[float], policy: Policy
) -> Solution | None:
    """What ``solve_group`` says under a smaller tau, bit for bit; None where it has to be asked.

    Args:
        solution: Under a policy that this one ``differs_only_in_smaller_tau`` than, of a group that is
            ``has_unchanged_pairs``; its calibrations are not read.
        diagonals: Of the pictures of its views, pixels.
        policy: The policy with that tau.
    """
    if any(item.kind == "sides_swapped" or _is_behind_camera(item) for item in solution.findings):
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
    letters = {key: make_view_letter(place) for place, key in enumerate(keys)}
    gate = make_reprojection_gate(solution.pairs, letters, tau_px, policy.tau_percent)
    return replace(
        solution,
        gates=tuple(gate if item.name == gate.name else item for item in solution.gates),
        findings=tuple(
            _rethreshold_finding(item, solution, letters, tau_px) for item in solution.findings
        ),
        policy_hash=policy.hash,
    )


def _is_behind_camera(found: Finding) -> bool:
    """Whether rays meet behind a camera: how far apart the pixels are was not told."""
    return found.kind in ("view_disagrees", "not_synchronous") and found.number is None


def _rethreshold_finding(
    found: Finding, solution: Solution, letters: Mapping[str, str], tau_px: Mapping[str, float]
) -> Finding:
    judged = [pair for pair in solution.pairs if pair.failed == "reprojection"]
    if found.kind == "view_disagrees" and found.view is not None and found.number is not None:
        view = solution.view(found.view)
        if view is not None and view.included:
            return make_misses_ball_finding(found.view, found.number, tau_px[found.view])
        of_view = [pair for pair in judged if found.view in (pair.a, pair.b)]
        own = find_closest_pair(of_view, tau_px)
        return make_view_disagrees_finding(found.view, own, letters, tau_px)
    if found.kind == "not_synchronous":
        best = find_closest_pair(judged, tau_px)
        return replace(found, threshold=find_larger_error_in_tau(best, tau_px)[2])
    return found
