"""Findings: what a person should look at in a group, each with number, limit and sentence."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from app.soccer.frames import height_above_grass
from app.soccer.group import Group, View
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import Ball3D, Finding, Fix, Pair, ViewSolution
from app.solving.calibration_findings import calibration_findings
from app.solving.sides import Swap, find_swaps
from app.solving.triangulate import Sight

MAX_SIZE_RATIO = 2.0
"""A ball box may be so many times larger or smaller than the 3D point implies."""
HIGH_SIGMA_M = 1.0

_BY_WEIGHT = (
    "sides_swapped",
    "wrong_label",
    "several_balls",
    "not_synchronous",
    "view_disagrees",
    "implausible_ball",
    "implausible_camera",
    "under_constrained",
    "bad_point",
    "high_uncertainty",
    "low_parallax",
    "ball_size",
    "visible_not_annotated",
)
"""What explains the most comes first."""


def find(
    group: Group,
    views: Sequence[ViewSolution],
    sights: Sequence[Sight],
    pairs: Sequence[Pair],
    ball: Ball3D | None,
    policy: Policy,
) -> tuple[Finding, ...]:
    """All findings of a group, those that explain most first, then by view."""
    swaps = {swap.view: swap for swap in find_swaps(sights, policy)}
    found: list[Finding] = []
    for view, solved in zip(group.views, views, strict=True):
        said = calibration_findings(solved.calibration, view.size, view.key)
        # A static camera would say in every frame what nobody annotated in any.
        found.extend(
            item
            for item in said
            if not (view.station.shared and item.kind == "visible_not_annotated")
        )
        found.extend(_several_balls(view))
        if view.key in swaps:
            found.append(_sides_swapped(swaps[view.key]))
        else:
            found.extend(_view_disagrees(view, solved, pairs, policy))
        found.extend(_ball_size(solved))
    if ball is None and not swaps:
        found.extend(_not_synchronous(pairs, policy, group))
    if ball is not None:
        found.extend(_low_parallax(ball, policy))
        found.extend(_high_uncertainty(ball))
        found.extend(_implausible_ball(ball, group.pitch, policy))
    return tuple(sorted(found, key=lambda finding: _BY_WEIGHT.index(finding.kind)))


def _several_balls(view: View) -> Iterator[Finding]:
    count = sum(not ball.out_of_view for ball in view.balls)
    if count > 1:
        yield Finding(
            "several_balls",
            f"{count} balls are annotated here and none is used; keep the one in play.",
            view.key,
            number=float(count),
            threshold=1.0,
            fix=Fix("pick_ball", view.key),
        )


def _sides_swapped(swap: Swap) -> Finding:
    # As labelled the rays may meet behind a camera: then there is no error to tell.
    measured = math.isfinite(swap.error_px)
    now = f"misses the others by {swap.error_px:.1f} px" if measured else "meets no other"
    return Finding(
        "sides_swapped",
        f"Labelled for the other side: as labelled its ball {now}; turned by 180° it meets the "
        f"others within {swap.turned_error_px:.1f} px.",
        swap.view,
        number=swap.error_px if measured else None,
        threshold=swap.turned_error_px,
        confidence=swap.confidence,
        fix=Fix("swap_sides", swap.view),
    )


def _view_disagrees(
    view: View, solved: ViewSolution, pairs: Sequence[Pair], policy: Policy
) -> Iterator[Finding]:
    """A view in no valid pair, though it was judged and others agree."""
    judged = [
        pair for pair in pairs if pair.failed == "reprojection" and view.key in (pair.a, pair.b)
    ]
    if solved.included or not judged or not any(pair.valid for pair in pairs):
        return
    tau = policy.tau_percent / 100 * view.size.diagonal
    apart = min(max(pair.errors_px) for pair in judged)
    yield Finding(
        "view_disagrees",
        f"The ball of this view meets that of no other: {apart:.1f} px apart at best, "
        f"{tau:.1f} px are allowed.",
        view.key,
        number=apart,
        threshold=tau,
        fix=Fix("exclude_view", view.key),
    )


def _ball_size(solved: ViewSolution) -> Iterator[Finding]:
    ratio = solved.ball.size_ratio if solved.ball is not None and solved.included else None
    if ratio is None or 1 / MAX_SIZE_RATIO <= ratio <= MAX_SIZE_RATIO:
        return
    yield Finding(
        "ball_size",
        f"The ball's box is {ratio:.2f} times as large as its distance implies.",
        solved.view,
        number=ratio,
        threshold=MAX_SIZE_RATIO if ratio > 1 else 1 / MAX_SIZE_RATIO,
    )


def _not_synchronous(pairs: Sequence[Pair], policy: Policy, group: Group) -> Iterator[Finding]:
    """Well calibrated views whose balls do not meet, from either side: another instant.

    Static cameras run on one clock; there the failed gate says enough.
    """
    judged = [pair for pair in pairs if pair.failed == "reprojection"]
    if not judged or all(view.station.shared for view in group.views):
        return
    best = min(judged, key=lambda pair: max(pair.errors_px))
    sizes = [view.size.diagonal for view in group.views if view.key in (best.a, best.b)]
    yield Finding(
        "not_synchronous",
        f"The balls of no two views meet ({max(best.errors_px):.0f} px apart at best): the views "
        "may show different instants.",
        number=max(best.errors_px),
        threshold=policy.tau_percent / 100 * max(sizes),
    )


def _low_parallax(ball: Ball3D, policy: Policy) -> Iterator[Finding]:
    if ball.parallax_degrees < policy.low_parallax_degrees:
        yield Finding(
            "low_parallax",
            f"The rays meet at {ball.parallax_degrees:.1f}°: depth is known to "
            f"{ball.sigma_m:.1f} m only.",
            number=ball.parallax_degrees,
            threshold=policy.low_parallax_degrees,
        )


def _high_uncertainty(ball: Ball3D) -> Iterator[Finding]:
    if ball.sigma_m > HIGH_SIGMA_M:
        yield Finding(
            "high_uncertainty",
            f"The ball's place is known to {ball.sigma_m:.1f} m only, however small its "
            "reprojection error.",
            number=ball.sigma_m,
            threshold=HIGH_SIGMA_M,
        )


def _implausible_ball(ball: Ball3D, pitch: Pitch, policy: Policy) -> Iterator[Finding]:
    """One finding, with the number of what is wrong first."""
    x, y, z = ball.point
    height = height_above_grass(z)
    outside = max(abs(x) - pitch.length / 2, abs(y) - pitch.width / 2)
    wrong = [
        (number, threshold, words)
        for number, threshold, words in (
            (z, policy.below_grass_m, f"lies {z:.1f} m below the grass"),
            (height, policy.max_height_m, f"flies {height:.0f} m high"),
            (outside, policy.outside_pitch_m, f"is {outside:.0f} m outside the pitch"),
        )
        if number > threshold
    ]
    if wrong:
        number, threshold, _ = wrong[0]
        sentence = f"The ball {' and '.join(words for _, _, words in wrong)}."
        yield Finding("implausible_ball", sentence, number=number, threshold=threshold)
