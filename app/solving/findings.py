"""Findings: what a person should look at in a group, each with number, limit and sentence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from app.soccer.group import Group, View
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import Ball3D, Finding, Fix, Pair, ViewSolution
from app.solving.calibration_findings import calibration_findings
from app.solving.plausible import implausible
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
    "picture_geometry",
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
    swaps = {swap.view: swap for swap in _swaps(group, views, sights, policy)}
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


def _swaps(
    group: Group, views: Sequence[ViewSolution], sights: Sequence[Sight], policy: Policy
) -> tuple[Swap, ...]:
    left = {solved.view for solved in views if solved.failed is None}
    first = next((sight for sight in sights if sight.view == group.views[0].key), None)
    usable = [sight for sight in sights if sight.view in left]
    return find_swaps(first, usable, group.pitch, policy)


def _several_balls(view: View) -> Iterator[Finding]:
    count = sum(not ball.out_of_view for ball in view.balls)
    if count > 1:
        yield Finding(
            "several_balls",
            f"{count} balls are annotated in this view, so none of them is used. Keep the one in "
            "play.",
            view.key,
            number=float(count),
            threshold=1.0,
            fix=Fix("pick_ball", view.key),
        )


def _sides_swapped(swap: Swap) -> Finding:
    if swap.turned_error_px is None:
        sentence = (
            "The lines put the main camera on the far side of the pitch, where no main camera "
            "stands: left and right are swapped here, and in every view that agrees with it."
        )
    else:
        sentence = (
            "The lines are labelled from the other end of the pitch: with left and right swapped "
            f"this view agrees with the rest about the ball, within {swap.turned_error_px:.1f} px."
        )
    return Finding(
        "sides_swapped",
        sentence,
        swap.view,
        number=swap.error_px,
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
        f"This view does not see the ball where another view sees it: {apart:.1f} px apart at "
        f"best, {tau:.1f} px are allowed. Correct its ball, or leave the view out.",
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
        f"The ball's box is {ratio:.2f} times as large as a ball looks at this distance. Check "
        "that it is the ball, and correct the size of its box.",
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
    apart = f"{max(best.errors_px):.0f} px apart"
    sentence = (
        f"The two views do not see the ball in the same place ({apart})"
        if len(group.views) == 2
        else f"No two views see the ball in the same place (the closest are {apart})"
    )
    yield Finding(
        "not_synchronous",
        f"{sentence}. Look first whether each ball is drawn on the ball. If they are, compare "
        "players and clock: the pictures show different instants where these differ.",
        number=max(best.errors_px),
        threshold=policy.tau_percent / 100 * max(sizes),
    )


def _low_parallax(ball: Ball3D, policy: Policy) -> Iterator[Finding]:
    if ball.parallax_degrees < policy.low_parallax_degrees:
        yield Finding(
            "low_parallax",
            f"The rays meet at {ball.parallax_degrees:.1f}° only, so the distance of the ball is "
            f"uncertain: about ± {ball.sigma_m:.1f} m. A view from another side would settle it.",
            number=ball.parallax_degrees,
            threshold=policy.low_parallax_degrees,
        )


def _high_uncertainty(ball: Ball3D) -> Iterator[Finding]:
    if ball.sigma_m > HIGH_SIGMA_M:
        yield Finding(
            "high_uncertainty",
            f"The position of the ball is uncertain, about ± {ball.sigma_m:.1f} m, although the "
            "views agree. Decide whether that is good enough.",
            number=ball.sigma_m,
            threshold=HIGH_SIGMA_M,
        )


def _implausible_ball(ball: Ball3D, pitch: Pitch, policy: Policy) -> Iterator[Finding]:
    """One finding, with the number of what is wrong first."""
    wrong = implausible(ball.point, pitch, policy)
    if wrong:
        number, threshold, _ = wrong[0]
        sentence = (
            f"The 3D ball {' and '.join(words for _, _, words in wrong)}. Check the sides of the "
            "views and the ball in each."
        )
        yield Finding("implausible_ball", sentence, number=number, threshold=threshold)
