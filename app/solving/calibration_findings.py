"""Findings of one calibration: wrong labels, bad points, what the lines leave open."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from app.soccer.frames import ImageSize, height_above_grass
from app.soccer.solution import Calibration, Finding, Fix, MarkingFit
from app.solving.calibrate import MAX_POSITION_SIGMA_M

MAX_CAMERA_HEIGHT_M = 100.0
MAX_CAMERA_DISTANCE_M = 250.0
BAD_POINT_GAMMA = 2.0
"""A point is bad when it lies farther than this from its marking, in units of gamma ..."""
GOOD_POINT_GAMMA = 1.0
"""... while all others of the marking lie within this."""
GAMMA_PERCENT = 0.5
UNANNOTATED_PERCENT = 5.0
"""A marking that nobody annotated is worth a word when it is seen over this length, in per cent
of the diagonal."""


def calibration_findings(
    calibration: Calibration, size: ImageSize, view: str | None = None
) -> Iterator[Finding]:
    """What the calibration of one view (or line file) has to say.

    Args:
        calibration: The calibration, measured against its lines.
        size: Annotated size.
        view: Key of the view, for findings of a group.
    """
    yield from _wrong_labels(calibration, view)
    yield from _bad_points(calibration, size, view)
    yield from _not_annotated(calibration, size, view)
    yield from _under_constrained(calibration, view)
    yield from _implausible_camera(calibration, view)


def _wrong_labels(calibration: Calibration, view: str | None) -> Iterator[Finding]:
    for suspect in calibration.suspects:
        if suspect.suggested is None:
            sentence = (
                f"“{suspect.marking}” contradicts all other lines and fits no other marking. Drop "
                "it, or draw it anew."
            )
            fix = Fix("drop_marking", view, suspect.marking)
        else:
            sentence = (
                f"“{suspect.marking}” has the wrong label: its points lie on “{suspect.suggested}”."
            )
            fix = Fix("relabel", view, suspect.marking, to=suspect.suggested)
        yield Finding(
            "wrong_label",
            sentence,
            view,
            suspect.marking,
            suspect.suggested,
            number=suspect.error_px,
            threshold=suspect.suggested_error_px,
            confidence=suspect.confidence,
            fix=fix,
        )


def _bad_points(calibration: Calibration, size: ImageSize, view: str | None) -> Iterator[Finding]:
    """A single point off its line while all others of the line fit: a slip of the hand."""
    gamma = GAMMA_PERCENT / 100 * size.diagonal
    for fit in calibration.markings:
        if not fit.used or len(fit.distances_px) < 2:
            continue
        index = int(np.argmax(fit.distances_px))
        others = [apart for at, apart in enumerate(fit.distances_px) if at != index]
        worst = fit.distances_px[index]
        if worst <= BAD_POINT_GAMMA * gamma or max(others) > GOOD_POINT_GAMMA * gamma:
            continue
        yield Finding(
            "bad_point",
            f"Point {index + 1} of “{fit.marking}” lies {worst:.1f} px off the line on which all "
            "its other points lie. Drop it, or move it onto the paint.",
            view,
            fit.marking,
            number=worst,
            threshold=BAD_POINT_GAMMA * gamma,
            fix=Fix("drop_point", view, fit.marking, index=index),
        )


def _not_annotated(
    calibration: Calibration, size: ImageSize, view: str | None
) -> Iterator[Finding]:
    if calibration.jac is None or calibration.unobservable:
        return
    shortest = UNANNOTATED_PERCENT / 100 * size.diagonal
    mislabelled = {suspect.suggested for suspect in calibration.suspects}
    for fit in calibration.markings:
        if fit.outcome != "fp" or fit.distances_px or fit.marking in mislabelled:
            continue
        length = _length(fit)
        if length > shortest:
            yield Finding(
                "visible_not_annotated",
                f"“{fit.marking}” should be visible over {length:.0f} px, and nobody has drawn "
                "it. Draw it if you see it.",
                view,
                fit.marking,
                number=length,
                threshold=shortest,
            )


def _under_constrained(calibration: Calibration, view: str | None) -> Iterator[Finding]:
    if calibration.camera is None:
        yield Finding(
            "under_constrained",
            f"No camera was found: {calibration.reason}. Draw more lines.",
            view,
        )
    elif calibration.unobservable:
        words = " and ".join(calibration.unobservable)
        verb = "are" if len(calibration.unobservable) > 1 else "is"
        yield Finding(
            "under_constrained",
            f"The annotated lines do not determine the camera: its {words} {verb} a guess. Draw "
            "lines of other directions.",
            view,
            number=calibration.position_sigma_m,
            threshold=MAX_POSITION_SIGMA_M,
        )


def _implausible_camera(calibration: Calibration, view: str | None) -> Iterator[Finding]:
    """One finding, with the number of what is wrong first."""
    if calibration.camera is None:
        return
    x, y, z = calibration.camera.position.tolist()
    height, distance = height_above_grass(z), float(np.hypot(x, y))
    wrong = [
        (number, threshold, words)
        for number, threshold, is_wrong, words in (
            (height, 0.0, height <= 0, f"stands {-height:.1f} m below the grass"),
            (
                height,
                MAX_CAMERA_HEIGHT_M,
                height > MAX_CAMERA_HEIGHT_M,
                f"hangs {height:.0f} m above the grass",
            ),
            (
                distance,
                MAX_CAMERA_DISTANCE_M,
                distance > MAX_CAMERA_DISTANCE_M,
                f"is {distance:.0f} m away from the centre mark",
            ),
        )
        if is_wrong
    ]
    if wrong:
        number, threshold, _ = wrong[0]
        sentence = (
            f"The camera {' and '.join(words for _, _, words in wrong)}. Check the labels of its "
            "lines."
        )
        yield Finding("implausible_camera", sentence, view, number=number, threshold=threshold)


def _length(fit: MarkingFit) -> float:
    """Length of a projected marking, pixels."""
    points = np.array(fit.polyline, dtype=np.float64).reshape(-1, 2)
    return float(np.hypot(*np.diff(points, axis=0).T).sum()) if len(points) > 1 else 0.0
