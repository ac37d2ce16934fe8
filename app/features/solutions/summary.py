"""Summary: the few numbers of a solution by which groups are listed, filtered and sorted."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from app.soccer.frames import height_above_grass
from app.soccer.group import Group
from app.soccer.solution import BallFit, Gate, Solution, ViewSolution


@dataclass(frozen=True)
class SolutionSummary:
    """What a list shows of a solution; None where there is no such number.

    Attributes:
        margin: Of the first failing gate, or of the gate nearest to failing: a share of its
            threshold (``solution.margin_of``), negative when it fails.
        value: The margin without its sign: how close the group is to passing, or to failing.
            Where it is small, a small mistake decides.
        min_jac: The lowest JaC of the views at 0.5 %.
        parallax_degrees: Of the ball, like ``sigma_m`` and ``height_m``.
        error_px: The larger reprojection error of the best pair, which the gate of that name judges;
            ``error_percent`` the same in per cent of the diagonal.
        size_ratio: Annotated over optimised diameter, the one farthest from 1.
        findings: Kinds, each once.
        distance_m: Of the ball from the camera of the first view that it comes from.
        box_px: Diameter of the ball in that view, as annotated, else (a point) as optimised;
            without a ball that of the first view that has an annotated box.
        x_m: Of the ball in the pitch frame, like ``y_m``.
        agreement: The lowest of the views in use whose paint was read.
    """

    passes: bool
    gate: str | None
    gate_view: str | None
    gate_sentence: str | None
    margin: float | None
    value: float | None
    min_jac: float | None
    error_px: float | None
    error_percent: float | None
    sigma_m: float | None
    parallax_degrees: float | None
    size_ratio: float | None
    height_m: float | None
    findings: tuple[str, ...]
    distance_m: float | None = None
    box_px: float | None = None
    x_m: float | None = None
    y_m: float | None = None
    agreement: float | None = None


def summarize(group: Group, solution: Solution) -> SolutionSummary:
    """The summary of a group's solution."""
    ball = solution.ball
    error_px, error_percent = _reprojection_error(group, solution)
    return SolutionSummary(
        **_gate_columns(solution),
        min_jac=_smallest_jac(solution),
        error_px=error_px,
        error_percent=error_percent,
        sigma_m=_finite_or_none(ball.sigma_m) if ball else None,
        parallax_degrees=ball.parallax_degrees if ball else None,
        size_ratio=_worst_size_ratio(solution),
        height_m=height_above_grass(ball.point[2]) if ball else None,
        findings=tuple(dict.fromkeys(finding.kind for finding in solution.findings)),
        distance_m=_ball_distance(solution),
        box_px=_box_diameter(group, solution),
        x_m=ball.point[0] if ball else None,
        y_m=ball.point[1] if ball else None,
        agreement=_paint_agreement(group, solution),
    )


def summarize_gates(before: SolutionSummary, solution: Solution) -> SolutionSummary:
    """The summary of a solution that is that of ``before`` but for what its gates say."""
    return replace(before, **_gate_columns(solution))


def _gate_columns(solution: Solution) -> dict[str, Any]:
    """What a summary says of gates."""
    failing = solution.first_failing
    decisive = failing or _gate_nearest_to_failing(solution.gates)
    margin = decisive.margin if decisive else None
    return {
        "passes": solution.passes,
        "gate": failing.name if failing else None,
        "gate_view": failing.view if failing else None,
        "gate_sentence": failing.sentence if failing else None,
        "margin": margin,
        "value": None if margin is None else abs(margin),
    }


COUNTED = frozenset({"calibratable", "two_views", "ball"})
"""Gates that count views."""


def _finite_or_none(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _gate_nearest_to_failing(gates: tuple[Gate, ...]) -> Gate | None:
    """Of gates that pass, the one nearest to failing; two views of two are enough, not near."""
    measured = [
        gate
        for gate in gates
        if gate.active and gate.margin is not None and gate.name not in COUNTED
    ]
    return min(measured, key=lambda gate: gate.margin or 0.0, default=None)


def _smallest_jac(solution: Solution) -> float | None:
    # The first of GAMMAS_PERCENT is the one that curation speaks of.
    measured = (view.calibration.jac for view in solution.views)
    return min((jac[0] for jac in measured if jac), default=None)


def _paint_agreement(group: Group, solution: Solution) -> float | None:
    used = {view.key for view in group.views if view.included}
    found = (view.calibration.agreement for view in solution.views if view.view in used)
    return min((value for value in found if value is not None), default=None)


def _reprojection_error(group: Group, solution: Solution) -> tuple[float | None, float | None]:
    """What the gate of the reprojection judges, in pixels and in per cent of its view's diagonal."""
    judged = (gate.value for gate in solution.gates if gate.name == "reprojection")
    error = next(judged, None)
    for pair in solution.pairs:
        for key, apart in zip((pair.a, pair.b), pair.errors_px, strict=True):
            view = group.view(key)
            if apart == error and view is not None:
                return error, 100.0 * apart / view.size.diagonal
    return _finite_or_none(error), None


def _ball_fits(solution: Solution) -> list[BallFit]:
    """Fits of the views that the ball comes from."""
    if solution.ball is None:
        return []
    views = (view for view in solution.views if view.view in solution.ball.views)
    return [view.ball for view in views if view.ball is not None]


def _worst_size_ratio(solution: Solution) -> float | None:
    ratios = [fit.size_ratio for fit in _ball_fits(solution) if fit.size_ratio]
    return max(ratios, key=lambda ratio: abs(math.log(ratio)), default=None)


def _first_ball_view(solution: Solution) -> ViewSolution | None:
    """The first view that the ball comes from, most often the main camera's."""
    return solution.view(solution.ball.views[0]) if solution.ball is not None else None


def _ball_distance(solution: Solution) -> float | None:
    first, ball = _first_ball_view(solution), solution.ball
    if first is None or ball is None or first.calibration.camera is None:
        return None
    return math.dist(ball.point, first.calibration.camera.position.tolist())


def _box_diameter(group: Group, solution: Solution) -> float | None:
    annotated = {
        view.key: view.ball.box.diameter if view.ball.box is not None else None
        for view in group.views
        if view.included and view.ball is not None
    }
    first = _first_ball_view(solution)
    if first is None:
        return next((diameter for diameter in annotated.values() if diameter is not None), None)
    optimized = first.ball.optimized_diameter_px if first.ball is not None else None
    return annotated.get(first.view) or optimized
