"""Findings: what a person should look at in a group, each with number, limit and sentence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from app.soccer.finding import Finding, Fix
from app.soccer.group import Group, View
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import Ball3D, Pair, ViewSolution
from app.solving.calibration_findings import calibration_findings
from app.solving.contradiction import LOW_P_VALUE, SPEEDS, TYPICAL_SPEED, Contradiction
from app.solving.gates import chance
from app.solving.paint_findings import paint_findings
from app.solving.plausible import implausible
from app.solving.sides import Swap, find_swaps
from app.solving.triangulate import Sighting

MAX_SIZE_RATIO = 2.0
"""A ball box may be so many times larger or smaller than the 3D point implies."""
HIGH_SIGMA_M = 0.25
"""Beyond it more than one ball in twenty is half a metre off or more."""

_BY_WEIGHT = (
    "camera_size",
    "sides_swapped",
    "wrong_label",
    "several_balls",
    "not_synchronous",
    "view_disagrees",
    "views_contradict",
    "implausible_ball",
    "implausible_camera",
    "picture_geometry",
    "under_constrained",
    "paint_disagrees",
    "bad_point",
    "high_uncertainty",
    "low_parallax",
    "ball_size",
    "visible_not_annotated",
    "no_paint",
)
"""What explains the most comes first."""


def find(
    group: Group,
    views: Sequence[ViewSolution],
    sights: Sequence[Sighting],
    pairs: Sequence[Pair],
    ball: Ball3D | None,
    policy: Policy,
    contradicted: Contradiction | None = None,
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
        found.extend(paint_findings(group, view, solved, policy.calibration))
        found.extend(_several_balls(view))
        if view.key in swaps:
            found.append(_sides_swapped(swaps[view.key]))
        else:
            found.extend(_view_disagrees(view, solved, pairs, policy))
        found.extend(_ball_size(solved))
    if ball is None and not swaps:
        found.extend(_not_synchronous(pairs, policy, group))
    if contradicted is not None and not swaps:
        found.append(_views_contradict(contradicted, group))
    if ball is not None:
        found.extend(_low_parallax(ball, policy))
        found.extend(_high_uncertainty(ball))
        found.extend(_implausible_ball(ball, group.pitch, policy))
    return tuple(sorted(found, key=lambda finding: _BY_WEIGHT.index(finding.kind)))


def _swaps(
    group: Group, views: Sequence[ViewSolution], sights: Sequence[Sighting], policy: Policy
) -> tuple[Swap, ...]:
    left = {solved.view for solved in views if solved.failed is None}
    first = next((sight for sight in sights if sight.view == group.views[0].key), None)
    usable = [sight for sight in sights if sight.view in left]
    badly = {solved.view for solved in views if solved.failed == "jac"}
    doubtful = [sight for sight in sights if sight.view in badly]
    return find_swaps(first, usable, group.pitch, policy, doubtful)


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
    tau_px = policy.tau_px(view.size.diagonal)
    yield view_disagrees(view.key, min(max(pair.errors_px) for pair in judged), tau_px)


def view_disagrees(view: str, apart_px: float, tau_px: float) -> Finding:
    """What is said of a view that misses the others' ball by so many pixels."""
    return Finding(
        "view_disagrees",
        f"This view does not see the ball where another view sees it: {apart_px:.1f} px apart at "
        f"best, {tau_px:.1f} px are allowed. Correct its ball, or leave the view out.",
        view,
        number=apart_px,
        threshold=tau_px,
        fix=Fix("exclude_view", view),
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
    best = closest(judged)
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
        threshold=policy.tau_px(max(sizes)),
    )


def closest(pairs: Sequence[Pair]) -> Pair:
    """The pair whose larger error is the smallest."""
    return min(pairs, key=lambda pair: max(pair.errors_px))


def _views_contradict(item: Contradiction, group: Group) -> Finding:
    """Views that pass tau and are still farther apart than their uncertainty lets them be."""
    found = item.chi_square
    one = "The two views do" if len(found.views) == 2 else "The views do"
    sentences = [
        f"{one} not show one ball: consistent views have residuals as large as these in only "
        f"{chance(found.p_value)}."
    ]
    if item.view is not None:
        sentences.append("Without this view the others agree.")
    if item.gap_m is not None and item.is_motion and not _one_clock(group):
        sentences.append(_another_instant(item.gap_m, item.moved_m))
    sentences.append(
        "If its ball is drawn on the ball, leave the view out."
        if item.view is not None
        else "If each ball is drawn on the ball, a camera is wrong or the instants differ."
    )
    return Finding(
        "views_contradict",
        " ".join(sentences),
        item.view,
        number=found.p_value,
        threshold=LOW_P_VALUE,
        confidence=item.confidence,
        fix=None if item.view is None else Fix("exclude_view", item.view),
    )


def _another_instant(gap_m: float, moved_m: float | None) -> str:
    """How far apart in time the pictures would be, if the ball moved in between."""
    slow, fast = SPEEDS
    least = _milliseconds(gap_m / fast)
    if moved_m is None:
        return (
            f"The rays miss each other by {gap_m:.2f} m: perhaps another instant, by at least "
            f"{least} ms."
        )
    most = _milliseconds(moved_m / slow)
    return (
        f"The rays miss each other by {gap_m:.2f} m: perhaps another instant, about "
        f"{_milliseconds(moved_m / TYPICAL_SPEED)} ms ({least} to {most}) for a ball at "
        f"{TYPICAL_SPEED:.0f} m/s ({slow:.0f} to {fast:.0f})."
    )


def _milliseconds(seconds: float) -> int:
    """To two digits: nobody knows the speed of the ball."""
    return int(float(f"{1000 * seconds:.2g}"))


def _one_clock(group: Group) -> bool:
    """Static cameras run on one clock."""
    return all(view.station.shared for view in group.views)


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
            f"The position of the ball is uncertain, about ± {ball.sigma_m:.2f} m, although the "
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
