"""Solve: from what people said of a group to everything that follows from it.

``solve`` is one pure function: no clock, no database, no memory, the same bits every time. The
edit in the browser, the preview, the batch and the export all call it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from app.soccer.group import Group, View
from app.soccer.policy import Policy
from app.soccer.solution import SOLVER_VERSION, Ball3D, Calibration, Solution, ViewSolution
from app.solving.ball_box import expect_ball, fit_ball
from app.solving.best_ball import best_ball
from app.solving.calibrate import calibrate_station, calibration_key
from app.solving.findings import find
from app.solving.gates import JudgedView, judge, view_failure
from app.solving.jaccard import jac_at
from app.solving.triangulate import Sight, mean_ball, triangulate

NO_CALIBRATIONS: Mapping[str, Calibration] = MappingProxyType({})
LEFT_OUT = "excluded"
"""What a view that a person left out failed at."""


def solve(
    group: Group, policy: Policy, calibrations: Mapping[str, Calibration] = NO_CALIBRATIONS
) -> Solution:
    """The solution of a group under a policy.

    Args:
        group: What was said.
        policy: Every threshold.
        calibrations: Calibrations known from before under their ``calibration_key``; they save
            time and change nothing.
    """
    known = dict(calibrations)
    views = tuple(_calibrated(view, group, policy, known) for view in group.views)
    sights = [
        sight
        for view, solved in zip(group.views, views, strict=True)
        if (sight := _sight(view, solved)) is not None
    ]
    pairs = triangulate(sights, policy)
    ball = mean_ball(pairs, sights, policy)
    views = tuple(
        _with_ball(view, solved, ball, policy)
        for view, solved in zip(group.views, views, strict=True)
    )
    return Solution(
        views=views,
        pairs=pairs,
        ball=ball,
        best_ball=best_ball(pairs, sights, policy),
        gates=judge(_judged(group, views, policy), _left_out(group), pairs, ball, policy),
        findings=find(group, views, sights, pairs, ball, policy),
        policy_hash=policy.hash,
        solver_version=SOLVER_VERSION,
    )


def view_letter(index: int) -> str:
    """What people call the view at that place of its group: A, B, C, ..."""
    return chr(ord("A") + index) if index < 26 else f"V{index + 1}"


def _calibrated(
    view: View, group: Group, policy: Policy, known: dict[str, Calibration]
) -> ViewSolution:
    key = calibration_key(view.station, group.pitch, policy.calibration)
    if key not in known:
        known[key] = calibrate_station(view.station, group.pitch, policy.calibration)
    failed: str | None = LEFT_OUT
    if view.included:
        failed = view_failure(known[key], _jac(known[key], view, policy), policy)
    return ViewSolution(view.key, known[key], key, included=False, failed=failed)


def _jac(calibration: Calibration, view: View, policy: Policy) -> float | None:
    return jac_at(calibration, policy.jac_gamma_percent / 100 * view.size.diagonal)


def _sight(view: View, solved: ViewSolution) -> Sight | None:
    """The ball as this view sees it; None without camera, ball or inclusion.

    A ball that was put where the others see it is no sight: it would confirm itself.
    """
    ball = view.ball
    if solved.calibration.camera is None or ball is None or not view.included or ball.inferred:
        return None
    assert ball.center is not None
    diameter = ball.box.diameter if ball.box is not None else 0.0
    sight = Sight(view.key, solved.calibration, ball.center, diameter, view.size, solved.failed)
    return sight if np.isfinite(sight.ideal_center).all() else None


def _with_ball(
    view: View, solved: ViewSolution, ball: Ball3D | None, policy: Policy
) -> ViewSolution:
    if ball is None:
        return solved
    solved = replace(
        solved,
        included=view.key in ball.views,
        expected=expect_ball(solved.calibration, view.size, ball, policy.ball_diameter_m),
    )
    if solved.calibration.camera is None or view.ball is None:
        return solved
    fit = fit_ball(
        solved.calibration.camera,
        view.size,
        view.ball,
        np.array(ball.point),
        policy.ball_diameter_m,
    )
    return replace(solved, ball=fit)


def _judged(group: Group, views: Sequence[ViewSolution], policy: Policy) -> tuple[JudgedView, ...]:
    return tuple(
        JudgedView(
            key=view.key,
            letter=view_letter(index),
            calibration=solved.calibration,
            jac=_jac(solved.calibration, view, policy),
            tau_px=policy.tau_percent / 100 * view.size.diagonal,
            has_ball=view.ball is not None and not view.ball.inferred,
            failed=solved.failed,
        )
        for index, (view, solved) in enumerate(zip(group.views, views, strict=True))
        if view.included
    )


def _left_out(group: Group) -> tuple[str, ...]:
    """Letters of the views that a person left out."""
    return tuple(view_letter(i) for i, view in enumerate(group.views) if not view.included)
