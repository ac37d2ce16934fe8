"""Findings: what a person should look at in a group, each with number, limit and sentence."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from app.soccer.finding import UNUSABLE_SIGMA_M, Finding, SuggestedFix
from app.soccer.group import Group, View, make_view_letter
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import Ball3D, TriangulatedPair, ViewSolution
from app.solving.ball_3d import explain_implausible_position
from app.solving.calibration_findings import find_calibration_findings, find_paint_findings
from app.solving.chi_square import LOW_P_VALUE
from app.solving.contradiction import SPEEDS, TYPICAL_SPEED, Contradiction
from app.solving.gate_sentences import (
    describe_odds,
    describe_open_cameras,
    find_larger_error_in_tau,
    join_with_and,
)
from app.solving.sides import SwappedView, find_swapped_views
from app.solving.triangulate import BallObservation
from app.wording import format_degrees, format_metres, format_pixels, plural

MAX_SIZE_RATIO = 2.0
"""A ball box may be so many times larger or smaller than the 3D point implies."""
HIGH_SIGMA_M = 0.25
"""Beyond it more than one ball in twenty is half a metre off or more."""

_BY_WEIGHT = (
    "implausible_ball",
    "camera_size",
    "sides_swapped",
    "wrong_label",
    "several_balls",
    "not_synchronous",
    "view_disagrees",
    "views_contradict",
    "implausible_camera",
    "picture_geometry",
    "pitch_size",
    "under_constrained",
    "paint_disagrees",
    "bad_point",
    "high_uncertainty",
    "low_parallax",
    "ball_size",
    "visible_not_annotated",
    "no_paint",
)
"""What makes the ball unusable comes first, then what explains the most."""


def find_group_findings(
    group: Group,
    views: Sequence[ViewSolution],
    observations: Sequence[BallObservation],
    pairs: Sequence[TriangulatedPair],
    ball: Ball3D | None,
    policy: Policy,
    contradicted: Contradiction | None = None,
) -> tuple[Finding, ...]:
    """All findings of a group: what makes its ball unusable first, then what explains most."""
    swaps = {swap.view: swap for swap in _find_swapped_views(group, views, observations, policy)}
    tau_px = {view.key: policy.tau_px(view.size.diagonal) for view in group.views}
    found: list[Finding] = []
    for view, solved in zip(group.views, views, strict=True):
        # Of a view that a person left out nobody has to look at anything.
        if not view.included:
            continue
        noticed = find_calibration_findings(solved.calibration, view.size, view.key)
        # A static camera would say in every frame what nobody annotated in any.
        found.extend(
            item
            for item in noticed
            if not (view.station.shared and item.kind == "visible_not_annotated")
        )
        found.extend(find_paint_findings(group, view, solved, policy.calibration))
        found.extend(_find_several_balls(view))
        if view.key in swaps:
            found.append(_make_sides_swapped_finding(swaps[view.key]))
        else:
            found.extend(_find_view_disagreement(group, view, solved, pairs, tau_px))
            found.extend(_find_missed_ball(solved, tau_px[view.key]))
        found.extend(_find_wrong_ball_size(solved))
    if ball is None and not swaps:
        found.extend(_find_unsynchronised_views(pairs, tau_px, group))
    if contradicted is not None and not swaps:
        found.append(_make_contradiction_finding(contradicted, group, ball))
    if ball is not None:
        found.extend(_find_low_parallax(ball, policy))
        letters = [
            make_view_letter(place)
            for place, solved in enumerate(views)
            if solved.view in ball.views and solved.calibration.is_left_open
        ]
        found.extend(_find_high_uncertainty(ball, contradicted, letters))
        found.extend(_find_implausible_ball(ball, group.pitch, policy))
    return tuple(sorted(found, key=_finding_sort_key))


def _finding_sort_key(finding: Finding) -> tuple[bool, int, float]:
    """What comes first; of views that disagree the one that is farther off, in units of tau."""
    far = 0.0
    if finding.kind == "view_disagrees" and finding.number and finding.threshold:
        far = finding.number / finding.threshold
    return not finding.is_unusable_ball, _BY_WEIGHT.index(finding.kind), -far


def _find_swapped_views(
    group: Group,
    views: Sequence[ViewSolution],
    observations: Sequence[BallObservation],
    policy: Policy,
) -> tuple[SwappedView, ...]:
    left = {solved.view for solved in views if solved.failed is None}
    first = next(
        (observation for observation in observations if observation.view == group.views[0].key),
        None,
    )
    usable = [observation for observation in observations if observation.view in left]
    badly = {solved.view for solved in views if solved.failed == "jac"}
    doubtful = [observation for observation in observations if observation.view in badly]
    is_static = bool(group.views) and group.views[0].station.shared
    return find_swapped_views(first, usable, group.pitch, policy, doubtful, is_static=is_static)


def _find_several_balls(view: View) -> Iterator[Finding]:
    count = sum(not ball.out_of_view for ball in view.balls)
    if count > 1:
        yield Finding(
            "several_balls",
            f"{count} balls are annotated in this view, so none of them is used. Keep the one in "
            "play.",
            view.key,
            number=float(count),
            threshold=1.0,
            fix=SuggestedFix("pick_ball", view.key),
        )


def _make_sides_swapped_finding(swap: SwappedView) -> Finding:
    if swap.turned_error_px is None:
        sentence = (
            "The lines put the main camera on the far side of the pitch, where no main camera "
            "stands: left and right are swapped here, and in every view that agrees with it."
        )
    else:
        sentence = (
            "The lines are labelled from the other end of the pitch: with left and right swapped "
            f"this view agrees with the rest about the ball, within {format_pixels(swap.turned_error_px)}."
        )
    return Finding(
        "sides_swapped",
        sentence,
        swap.view,
        number=swap.error_px,
        threshold=swap.turned_error_px,
        confidence=swap.confidence,
        fix=SuggestedFix("swap_sides", swap.view),
    )


def _find_view_disagreement(
    group: Group,
    view: View,
    solved: ViewSolution,
    pairs: Sequence[TriangulatedPair],
    tau_px: Mapping[str, float],
) -> Iterator[Finding]:
    """A view in no valid pair, though it was judged and others agree."""
    judged = [
        pair for pair in pairs if pair.failed == "reprojection" and view.key in (pair.a, pair.b)
    ]
    if solved.included or not judged or not any(pair.valid for pair in pairs):
        return
    letters = {other.key: make_view_letter(place) for place, other in enumerate(group.views)}
    best = find_closest_pair(judged, tau_px)
    yield make_view_disagrees_finding(view.key, best, letters, tau_px)


def make_view_disagrees_finding(
    view: str, best: TriangulatedPair, letters: Mapping[str, str], tau_px: Mapping[str, float]
) -> Finding:
    """The finding about a view that misses the others' ball in its closest pair.

    Rays may also meet behind a camera, and the pixels there be as near as is allowed.

    Args:
        view: Key of the view.
        best: The pair that it comes closest in.
        letters: What people call the views, by key.
        tau_px: Largest error of a valid pair by view, pixels.
    """
    fix = SuggestedFix("exclude_view", view)
    _, apart_px, limit_px = find_larger_error_in_tau(best, tau_px)
    if apart_px <= limit_px:
        return Finding(
            "view_disagrees",
            "The ray of this view meets those of the others only behind a camera, where no ball "
            "can be. Check the sides of its lines and its ball, or leave the view out.",
            view,
            fix=fix,
        )
    other = best.b if best.a == view else best.a
    here, there = best.errors_px if best.a == view else best.errors_px[::-1]
    allowed = f"at most {format_pixels(tau_px[view])} is allowed"
    if tau_px[other] != tau_px[view]:
        allowed = (
            f"at most {format_pixels(tau_px[view])} and {format_pixels(tau_px[other])} are allowed"
        )
    return Finding(
        "view_disagrees",
        f"This view does not see the ball where another view sees it: at best {format_pixels(here)} apart "
        f"here and {format_pixels(there)} in {letters[other]}; {allowed}. Correct its "
        "ball, or leave the view out.",
        view,
        number=apart_px,
        threshold=limit_px,
        fix=fix,
    )


def _find_missed_ball(solved: ViewSolution, tau_px: float) -> Iterator[Finding]:
    """A view in a valid pair that the 3D ball does not fit: it is the mean of several pairs."""
    error_px = solved.ball.error_px if solved.ball is not None and solved.included else None
    if error_px is not None and error_px > tau_px:
        yield make_misses_ball_finding(solved.view, error_px, tau_px)


def make_misses_ball_finding(view: str, error_px: float, tau_px: float) -> Finding:
    """What is said of a view that counts and that the 3D ball misses by so many pixels."""
    return Finding(
        "view_disagrees",
        f"The 3D ball is {format_pixels(error_px)} from the ball of this view; at most {format_pixels(tau_px)} is "
        "allowed. Each valid pair fits, but the pairs contradict each other. Correct "
        "the ball of a view, or leave a view out.",
        view,
        number=error_px,
        threshold=tau_px,
        fix=SuggestedFix("exclude_view", view),
    )


def _find_wrong_ball_size(solved: ViewSolution) -> Iterator[Finding]:
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


def _find_unsynchronised_views(
    pairs: Sequence[TriangulatedPair], tau_px: Mapping[str, float], group: Group
) -> Iterator[Finding]:
    """Well calibrated views whose balls do not meet, from either side: another instant.

    Static cameras run on one clock; there the failed gate says enough.
    """
    judged = [pair for pair in pairs if pair.failed == "reprojection"]
    if not judged or all(view.station.shared for view in group.views):
        return
    best = find_closest_pair(judged, tau_px)
    _, error_px, limit_px = find_larger_error_in_tau(best, tau_px)
    apart = f"{format_pixels(best.errors_px[0])} and {format_pixels(best.errors_px[1])} apart"
    sentence = (
        f"The two views do not see the ball in the same place ({apart})"
        if len(group.views) == 2
        else f"No two views see the ball in the same place (the closest are {apart})"
    )
    if error_px <= limit_px:
        sentence = "The rays of no two views meet in front of their cameras"
    yield Finding(
        "not_synchronous",
        f"{sentence}. First check that each ball is drawn on the ball. If so, compare "
        "players and clock: if they differ, the pictures show different instants.",
        number=error_px if error_px > limit_px else None,
        threshold=limit_px if error_px > limit_px else None,
    )


def find_closest_pair(
    pairs: Sequence[TriangulatedPair], tau_px: Mapping[str, float]
) -> TriangulatedPair:
    """The pair whose larger error, in units of tau, is the smallest.

    Args:
        pairs: At least one.
        tau_px: Largest error of a valid pair by view, pixels.
    """
    return min(pairs, key=lambda pair: find_larger_error_in_tau(pair, tau_px)[0])


def _make_contradiction_finding(item: Contradiction, group: Group, ball: Ball3D | None) -> Finding:
    """Views that pass tau and are still farther apart than their uncertainty lets them be."""
    found = item.chi_square
    one = "The two views do" if len(found.views) == 2 else "The views do"
    if ball is not None and len(found.views) < len(ball.views):
        letters = [
            make_view_letter(place)
            for place, view in enumerate(group.views)
            if view.key in found.views
        ]
        one = f"Views {join_with_and(letters)} do"
    sentences = [
        f"{one} not agree on one ball: consistent views have residuals as large as these "
        f"(χ² {found.value:,.1f}, {plural(found.freedom, 'degree')} of freedom) in "
        f"{describe_odds(found.p_value)}."
    ]
    if ball is not None and item.widening > 1 and math.isfinite(ball.sigma_m):
        sentences.append(
            f"Because of this, sigma is {item.widening:.1f} times larger: {format_metres(ball.sigma_m)}."
        )
    if not item.is_known:
        sentences.append(
            "The accuracy of the given cameras is not known: “Annotation noise” under Statistics "
            "estimates it."
        )
    if item.view is not None:
        sentences.append("Without this view the others agree.")
    if item.gap_m is not None and item.may_be_motion and not _has_common_clock(group):
        sentences.append(_describe_time_gap(item.gap_m, item.moved_m))
    if item.view is not None:
        sentences.append("If its ball is drawn on the ball, leave the view out.")
    elif item.is_known:
        sentences.append(
            "If each ball is drawn on the ball, a camera is wrong or the instants differ."
        )
    return Finding(
        "views_contradict",
        " ".join(sentences),
        item.view,
        number=found.p_value,
        threshold=LOW_P_VALUE,
        confidence=item.confidence,
        fix=None if item.view is None else SuggestedFix("exclude_view", item.view),
    )


def _describe_time_gap(gap_m: float, moved_m: float | None) -> str:
    """How far apart in time the pictures would be, if the ball moved in between."""
    slow, fast = SPEEDS
    least = _round_milliseconds(gap_m / fast)
    if moved_m is None:
        return (
            f"The rays miss each other by {gap_m:.2f} m: perhaps the pictures were taken "
            f"at least {least} ms apart."
        )
    most = _round_milliseconds(moved_m / slow)
    return (
        f"The rays miss each other by {gap_m:.2f} m: perhaps the pictures were taken about "
        f"{_round_milliseconds(moved_m / TYPICAL_SPEED)} ms apart ({least} to {most}), for a ball at "
        f"{TYPICAL_SPEED:.0f} m/s ({slow:.0f} to {fast:.0f})."
    )


def _round_milliseconds(seconds: float) -> int:
    """To two digits: nobody knows the speed of the ball."""
    return int(float(f"{1000 * seconds:.2g}"))


def _has_common_clock(group: Group) -> bool:
    """Static cameras run on one clock."""
    return all(view.station.shared for view in group.views)


def _find_low_parallax(ball: Ball3D, policy: Policy) -> Iterator[Finding]:
    if ball.parallax_degrees < policy.low_parallax_degrees:
        known = math.isfinite(ball.sigma_m)
        about = f": about ± {format_metres(ball.sigma_m)}" if known else ""
        yield Finding(
            "low_parallax",
            f"The rays meet at only {format_degrees(ball.parallax_degrees)}, so the distance of the ball is "
            f"uncertain{about}. A view from another direction would help.",
            number=ball.parallax_degrees,
            threshold=policy.low_parallax_degrees,
        )


def _find_high_uncertainty(
    ball: Ball3D, contradicted: Contradiction | None, left_open: Sequence[str]
) -> Iterator[Finding]:
    """Above ``UNUSABLE_SIGMA_M`` with that as the threshold: nobody can use such a ball.

    Args:
        ball: The 3D ball.
        contradicted: Whether its views contradict each other.
        left_open: Letters of its views whose lines leave their camera open.
    """
    if not ball.sigma_m > HIGH_SIGMA_M:
        return
    if not math.isfinite(ball.sigma_m):
        why = (
            describe_open_cameras(left_open)
            if left_open
            else f"its rays meet at {format_degrees(ball.parallax_degrees)}"
        )
        help_ = "Draw lines of other directions there, or leave the view out." if left_open else ""
        sentence = f"How far off the 3D ball may be is not known: {why}. {help_}".rstrip()
        # Without a number: infinity is none in JSON.
        yield Finding("high_uncertainty", sentence, threshold=UNUSABLE_SIGMA_M)
        return
    why = (
        "although the views agree"
        if contradicted is None
        else "because the views contradict each other"
    )
    limit, sentence = (
        HIGH_SIGMA_M,
        f"The position of the ball is uncertain, about ± {format_metres(ball.sigma_m)}, {why}. Decide "
        "whether that is good enough.",
    )
    if ball.sigma_m > UNUSABLE_SIGMA_M:
        limit, sentence = (
            UNUSABLE_SIGMA_M,
            f"The ball is known only to ± {format_metres(ball.sigma_m)}, {why}; its rays meet at "
            f"{format_degrees(ball.parallax_degrees)}. Above ± {UNUSABLE_SIGMA_M:.0f} m a ball cannot be used.",
        )
    yield Finding("high_uncertainty", sentence, number=ball.sigma_m, threshold=limit)


def _describe_sigma(ball: Ball3D) -> str:
    """Words for a place of which nothing is known."""
    if not ball.sigma_m > UNUSABLE_SIGMA_M:
        return ""
    if not math.isfinite(ball.sigma_m):
        return ", and nothing says how exactly it is known"
    return (
        f", known only to ± {format_metres(ball.sigma_m)}, with rays that meet at "
        f"{format_degrees(ball.parallax_degrees)}"
    )


def _find_implausible_ball(ball: Ball3D, pitch: Pitch, policy: Policy) -> Iterator[Finding]:
    """One finding, with the number of what is wrong first."""
    wrong = explain_implausible_position(ball.point, pitch, policy)
    if wrong:
        number, threshold, _ = wrong[0]
        sentence = (
            f"The 3D ball {' and '.join(words for _, _, words in wrong)}{_describe_sigma(ball)}. Check the "
            "sides of the views and the ball in each."
        )
        yield Finding("implausible_ball", sentence, number=number, threshold=threshold)
