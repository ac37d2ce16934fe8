"""Findings of one calibration: wrong labels, bad points, what the lines leave open."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from app.soccer.finding import PITCH_SIZE, Finding, SuggestedFix
from app.soccer.frames import ImageSize, height_above_grass
from app.soccer.group import Group, View
from app.soccer.paint_evidence import NO_FRAME, NO_PAINT, PAINT_DISAGREES
from app.soccer.picture import size_centred_on_principal_point
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration, ViewSolution
from app.solving.calibrate import MAX_POSITION_SIGMA_M, find_wanted_paint_reading
from app.solving.camera_positions import MAX_CAMERA_DISTANCE_M, MAX_CAMERA_HEIGHT_M
from app.solving.labels import FITS, GAMMA_SHARE
from app.solving.picture_camera import BELIEVED, MIN_SHIFT, MIN_STRETCH
from app.wording import format_metres, format_pixels

BAD_POINT_GAMMA = 2.0
"""A point is bad when it lies farther than this from its marking, in units of gamma ..."""
GOOD_POINT_GAMMA = 1.0
"""... while all others of the marking lie within this."""
GAMMA_PERCENT = 0.5
MIN_POINTS = {True: 2, False: 3}
"""Of a marking in which one point is called bad: more where the solver left the marking out."""
UNANNOTATED_PERCENT = 5.0
"""A marking that nobody annotated is worth a word when it is seen over this length, in per cent
of the diagonal."""


def find_calibration_findings(
    calibration: Calibration, size: ImageSize, view: str | None = None
) -> Iterator[Finding]:
    """The findings about the calibration of one view (or line file).

    Args:
        calibration: The calibration, measured against its lines.
        size: Annotated size.
        view: Key of the view, for findings of a group.
    """
    if calibration.mirrored_px is not None:
        # What else looks wrong follows from it.
        yield _make_mirrored_finding(calibration.mirrored_px, size, view)
        return
    slips = _find_misplaced_points(calibration, size)
    yield from _find_wrong_labels(calibration, slips, view)
    yield from _make_bad_point_findings(slips, size, view)
    yield from _find_unannotated_markings(calibration, size, view)
    yield from _find_unconstrained_parameters(calibration, view)
    yield from _find_picture_distortions(calibration, size, view)
    yield from _find_other_pitch(calibration, view)
    yield from _find_camera_size_mismatch(calibration, size, view)
    yield from _find_implausible_camera(calibration, view)


def _find_wrong_labels(
    calibration: Calibration, slips: Mapping[str, tuple[int, float]], view: str | None
) -> Iterator[Finding]:
    for suspect in calibration.suspects:
        if suspect.suggested is None and suspect.marking in slips:
            # It fits where it is said to lie, but for one point.
            continue
        if suspect.suggested is None:
            sentence = (
                f"“{suspect.marking}” contradicts all other lines and fits no other marking. Delete "
                "it, or draw it again."
            )
            fix = SuggestedFix("drop_marking", view, suspect.marking)
        else:
            sentence = (
                f"“{suspect.marking}” has the wrong label: its points lie on “{suspect.suggested}”."
            )
            fix = SuggestedFix("relabel", view, suspect.marking, to=suspect.suggested)
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


def _find_misplaced_points(
    calibration: Calibration, size: ImageSize
) -> dict[str, tuple[int, float]]:
    """Single points off their line while all others of the line fit: a slip of the hand.

    Returns:
        By marking: index of the point, and how far off it is, pixels. Markings that fit under
        another name are none of these.
    """
    gamma = GAMMA_PERCENT / 100 * size.diagonal
    relabelled = {item.marking for item in calibration.suspects if item.suggested is not None}
    found = {}
    for fit in calibration.markings:
        if fit.marking in relabelled or len(fit.distances_px) < MIN_POINTS[fit.used]:
            continue
        index = int(np.argmax(fit.distances_px))
        others = [apart for at, apart in enumerate(fit.distances_px) if at != index]
        worst = fit.distances_px[index]
        if worst > BAD_POINT_GAMMA * gamma and max(others) <= GOOD_POINT_GAMMA * gamma:
            found[fit.marking] = (index, worst)
    return found


def _make_bad_point_findings(
    slips: Mapping[str, tuple[int, float]], size: ImageSize, view: str | None
) -> Iterator[Finding]:
    for marking, (index, worst) in sorted(slips.items(), key=lambda slip: -slip[1][1]):
        yield Finding(
            "bad_point",
            f"Point {index + 1} of “{marking}” lies {format_pixels(worst)} off the line on which its other "
            "points lie. Delete it, or move it onto the paint.",
            view,
            marking,
            number=worst,
            threshold=BAD_POINT_GAMMA * GAMMA_PERCENT / 100 * size.diagonal,
            fix=SuggestedFix("drop_point", view, marking, index=index),
        )


def _find_unannotated_markings(
    calibration: Calibration, size: ImageSize, view: str | None
) -> Iterator[Finding]:
    if calibration.jac is None or calibration.unobservable:
        return
    shortest = UNANNOTATED_PERCENT / 100 * size.diagonal
    mislabelled = {suspect.suggested for suspect in calibration.suspects}
    for fit in calibration.markings:
        if fit.outcome != "fp" or fit.distances_px or fit.marking in mislabelled:
            continue
        length = fit.length_px
        if length > shortest:
            yield Finding(
                "visible_not_annotated",
                f"“{fit.marking}” should be visible over {format_pixels(length)} and is not drawn. "
                "Draw it if you see it, or mark it as not visible under Lines.",
                view,
                fit.marking,
                number=length,
                threshold=shortest,
            )


def _find_unconstrained_parameters(calibration: Calibration, view: str | None) -> Iterator[Finding]:
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


def _find_picture_distortions(
    calibration: Calibration, size: ImageSize, view: str | None
) -> Iterator[Finding]:
    """A stretched picture, or one with a middle that is not the camera's, by what is larger."""
    picture = calibration.picture
    if picture is None:
        return
    aside = float(np.hypot(*picture.shift)) * size.diagonal / 2 / size.width
    stretched = abs(picture.stretch) * MIN_SHIFT > aside * MIN_STRETCH
    number, threshold = picture.ratio, BELIEVED
    if stretched:
        word = "wide" if picture.stretch > 0 else "narrow"
        found = f"its pixels are {100 * abs(picture.stretch):.0f} % too {word}: a stretched picture"
    else:
        right, down = picture.shift
        where = "below" if down > 0 else "above"
        if abs(right) > abs(down):
            where = "right of" if right > 0 else "left of"
        found = (
            f"the principal point lies {100 * aside:.0f} % of the width {where} the middle: a "
            "cropped picture"
        )
    yield Finding(
        "picture_geometry",
        f"The lines fit far better if {found}. The camera was computed without this, so its "
        "position is doubtful. Use this geometry, import the picture as it was taken, or leave the view "
        "out.",
        view,
        number=number,
        threshold=threshold,
        fix=None if view is None else SuggestedFix("free_picture", view),
    )


def _find_other_pitch(calibration: Calibration, view: str | None) -> Iterator[Finding]:
    """The pitch of another size that the lines of a frame alone show."""
    other = calibration.other_pitch
    if other is None:
        return
    names = " and ".join(f"“{name}”" for name in other.explains)
    where = f"; {names} {'lies' if len(other.explains) == 1 else 'lie'} there, too" if names else ""
    length, width = other.size
    used_length, used_width = other.used
    yield Finding(
        PITCH_SIZE,
        f"The lines show a pitch of {length:g} x {width:g} m, but the camera was "
        f"computed for {used_length:g} x {used_width:g} m{where}. Its position is uncertain by this difference.",
        view,
        number=other.off_m,
        threshold=other.threshold_m,
    )


def _find_camera_size_mismatch(
    calibration: Calibration, size: ImageSize, view: str | None
) -> Iterator[Finding]:
    """A given camera whose principal point is the middle of another size."""
    if calibration.camera is None or calibration.source != "given":
        return
    other = size_centred_on_principal_point(calibration.camera, size)
    if other is None:
        return
    x, y = calibration.camera.principal_point
    aside = float(np.hypot(x - (size.width - 1) / 2, y - (size.height - 1) / 2))
    yield Finding(
        "camera_size",
        f"The given camera was made for pictures of {other.width} x {other.height}: its principal "
        f"point ({x:g}, {y:g}) is their middle, but the view has {size.width} x {size.height}. Import "
        f"the cameras again for that size (--size {other.width}x{other.height}).",
        view,
        number=aside,
        threshold=0.02 * max(size.width, size.height) / 2,
    )


def _find_implausible_camera(calibration: Calibration, view: str | None) -> Iterator[Finding]:
    """One finding, with the number of what is wrong first."""
    if calibration.camera is None:
        return
    x, y, z = calibration.camera.position.tolist()
    height, distance = height_above_grass(z), float(np.hypot(x, y))
    wrong = [
        (number, threshold, words)
        for number, threshold, is_wrong, words in (
            (height, 0.0, height <= 0, f"stands {format_metres(-height)} below the grass"),
            (
                height,
                MAX_CAMERA_HEIGHT_M,
                height > MAX_CAMERA_HEIGHT_M,
                f"hangs {format_metres(height)} above the grass",
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


def _make_mirrored_finding(error_px: float, size: ImageSize, view: str | None) -> Finding:
    return Finding(
        "implausible_camera",
        "The picture or the names of its lines are mirrored: no camera shows them like this, but with "
        f"“left” and “right” exchanged in all names their points lie within {format_pixels(error_px)} of their "
        "lines. Exchange the names, or import the picture as it was taken.",
        view,
        number=error_px,
        threshold=FITS * GAMMA_SHARE * size.diagonal,
    )


READ_PAINT = "read_paint"
"""The fix that asks for a picture to be read."""
STAYS = "so its camera comes from the annotated lines"
READ_AGAIN = (
    "The lines of this view, the boxes of its people, its pitch or the thresholds have changed since "
    f"its paint was read, {STAYS}. Read the paint again."
)
SENTENCES = {
    NO_PAINT: (
        f"Too little paint is seen near the lines of this view, {STAYS}. If the picture shows the "
        "markings well, check that each line has the right label."
    ),
    NO_FRAME: (
        f"The picture of this view is missing or cannot be read, {STAYS}. Put it where it was "
        "imported from, and read the paint again."
    ),
    PAINT_DISAGREES: (
        "The paint in this view's picture does not lie where its lines were drawn, so its camera "
        "comes from the annotated lines. Check that each line has the right label and lies on its "
        "paint, and read the paint again."
    ),
}


def find_paint_findings(
    group: Group, view: View, solved: ViewSolution, policy: CalibrationPolicy
) -> Iterator[Finding]:
    """Why the camera of a view is not that of its paint; nothing where it is, or cannot be.

    A picture that is not there, or that nobody has read yet, is no fault of the group: how many
    there are is told of the dataset.
    """
    if policy.source != "paint" or not view.can_use_paint or solved.calibration.camera is None:
        return
    fit = solved.calibration.paint
    if find_wanted_paint_reading(group, view, policy) is None:
        return
    if fit is None:
        yield Finding(NO_PAINT, READ_AGAIN, view.key, fix=SuggestedFix(READ_PAINT, view.key))
    elif fit.reason is not None:
        kind = PAINT_DISAGREES if fit.reason == PAINT_DISAGREES else NO_PAINT
        # To read again what shows no paint would show as little; a picture may have come back.
        fix = SuggestedFix(READ_PAINT, view.key) if fit.reason == NO_FRAME else None
        yield Finding(kind, SENTENCES[fit.reason], view.key, number=fit.supported, fix=fix)
