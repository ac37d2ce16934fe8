"""Findings about paint: why a camera is that of its clicks although the policy wants the paint's."""

from __future__ import annotations

from collections.abc import Iterator

from app.soccer.finding import Finding, Fix
from app.soccer.group import Group, View
from app.soccer.paint_evidence import NO_FRAME, NO_PAINT, PAINT_DISAGREES
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import ViewSolution
from app.solving.calibrate import usable_paint_reading

READ_PAINT = "read_paint"
"""The fix that asks for a picture to be read."""
STAYS = "so its camera is that of the clicks"
READ_AGAIN = (
    "The lines of this view, the boxes of its people, its pitch or the thresholds have changed since "
    f"its paint was read, {STAYS}. Read the paint again."
)
SENTENCES = {
    NO_PAINT: (
        f"Too little paint is seen near the lines of this view, {STAYS}. Where the picture shows its "
        "markings well, look whether each line has the right label."
    ),
    NO_FRAME: (
        f"The picture of this view is missing or cannot be read, {STAYS}. Put it where it was "
        "imported from, and read the paint again."
    ),
    PAINT_DISAGREES: (
        "The paint in this view's picture does not lie where its lines were drawn, so its camera is "
        "that of the clicks. Look whether each line has the right label and lies on its paint, and "
        "read the paint again."
    ),
}


def paint_findings(
    group: Group, view: View, solved: ViewSolution, policy: CalibrationPolicy
) -> Iterator[Finding]:
    """Why the camera of a view is not that of its paint; nothing where it is, or cannot be.

    A picture that is not there, or that nobody has read yet, is no fault of the group: how many
    there are is told of the dataset.
    """
    if policy.source != "paint" or not view.can_use_paint or solved.calibration.camera is None:
        return
    fit = solved.calibration.paint
    if usable_paint_reading(group, view, policy) is None:
        return
    if fit is None:
        yield Finding(NO_PAINT, READ_AGAIN, view.key, fix=Fix(READ_PAINT, view.key))
    elif fit.reason is not None:
        kind = PAINT_DISAGREES if fit.reason == PAINT_DISAGREES else NO_PAINT
        # To read again what shows no paint would show as little; a picture may have come back.
        fix = Fix(READ_PAINT, view.key) if fit.reason == NO_FRAME else None
        yield Finding(kind, SENTENCES[fit.reason], view.key, number=fit.supported, fix=fix)
