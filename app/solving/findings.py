"""Findings: what a person should look at, each with its number, its limit and one sentence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from app.soccer.frames import height_above_grass
from app.soccer.group import Group, View
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import Ball3D, Calibration, Finding, Fix, Pair, ViewSolution

MAX_CAMERA_HEIGHT_M = 100.0
MAX_CAMERA_DISTANCE_M = 250.0


def find(
    group: Group,
    views: Sequence[ViewSolution],
    pairs: Sequence[Pair],
    ball: Ball3D | None,
    policy: Policy,
) -> tuple[Finding, ...]:
    """All findings of a group: first of its views in their order, then of its ball."""
    found: list[Finding] = []
    for view, solved in zip(group.views, views, strict=True):
        found.extend(calibration_findings(solved.calibration, view.key))
        found.extend(_several_balls(view))
        found.extend(_view_disagrees(view, solved, pairs, policy))
    if ball is not None:
        found.extend(_low_parallax(ball, policy))
        found.extend(_implausible_ball(ball, group.pitch, policy))
    return tuple(found)


def calibration_findings(calibration: Calibration, view: str | None) -> Iterator[Finding]:
    """What the calibration of one view (or line file) has to say."""
    yield from _wrong_labels(calibration, view)
    yield from _under_constrained(calibration, view)
    yield from _implausible_camera(calibration, view)


def _wrong_labels(calibration: Calibration, view: str | None) -> Iterator[Finding]:
    for suspect in calibration.suspects:
        text = f"“{suspect.marking}” misses by {suspect.error_px:.1f} px"
        if suspect.suggested is None:
            yield Finding(
                "wrong_label",
                f"{text} and fits no other marking.",
                view,
                suspect.marking,
                number=suspect.error_px,
                confidence=suspect.confidence,
                fix=Fix("drop_marking", view, suspect.marking),
            )
            continue
        yield Finding(
            "wrong_label",
            f"{text}; as “{suspect.suggested}” it fits within {suspect.suggested_error_px:.1f} px.",
            view,
            suspect.marking,
            suspect.suggested,
            number=suspect.error_px,
            threshold=suspect.suggested_error_px,
            confidence=suspect.confidence,
            fix=Fix("relabel", view, suspect.marking, to=suspect.suggested),
        )


def _under_constrained(calibration: Calibration, view: str | None) -> Iterator[Finding]:
    if calibration.camera is None and calibration.source == "lines":
        yield Finding("under_constrained", f"No camera: {calibration.reason}.", view)
    elif calibration.unobservable:
        words = " and ".join(calibration.unobservable)
        verb = "are" if len(calibration.unobservable) > 1 else "is"
        yield Finding(
            "under_constrained",
            f"The annotated lines do not determine the camera: its {words} {verb} a guess.",
            view,
            number=calibration.position_sigma_m,
        )


def _implausible_camera(calibration: Calibration, view: str | None) -> Iterator[Finding]:
    if calibration.camera is None:
        return
    x, y, z = calibration.camera.position.tolist()
    height = height_above_grass(z)
    distance = (x * x + y * y) ** 0.5
    for wrong, number, threshold, sentence in (
        (height <= 0, height, 0.0, f"The camera stands {-height:.1f} m below the grass."),
        (
            height > MAX_CAMERA_HEIGHT_M,
            height,
            MAX_CAMERA_HEIGHT_M,
            f"The camera hangs {height:.0f} m above the grass.",
        ),
        (
            distance > MAX_CAMERA_DISTANCE_M,
            distance,
            MAX_CAMERA_DISTANCE_M,
            f"The camera stands {distance:.0f} m from the centre mark.",
        ),
    ):
        if wrong:
            yield Finding("implausible_camera", sentence, view, number=number, threshold=threshold)


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


def _low_parallax(ball: Ball3D, policy: Policy) -> Iterator[Finding]:
    if ball.parallax_degrees < policy.low_parallax_degrees:
        yield Finding(
            "low_parallax",
            f"The rays meet at {ball.parallax_degrees:.1f}°: depth is known to "
            f"{ball.sigma_m:.1f} m only.",
            number=ball.parallax_degrees,
            threshold=policy.low_parallax_degrees,
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
