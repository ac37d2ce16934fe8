"""Paint reading: what is read of the paint in the picture of one view; runs in a child."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from app.config import Settings
from app.errors import GeometryError, ImageError, NotFoundError, StorageError, TooLargeError
from app.geometry.arrays import BoolArray
from app.paint.agreement import agreement
from app.paint.evidence import to_paint_evidence
from app.paint.grass import field_of_play, why_no_field
from app.paint.propose import LEAST_SIDE
from app.paint.ridges import line_like
from app.paint.snap import snap
from app.soccer.group import Group, View
from app.soccer.paint_evidence import (
    EXTRACTOR_VERSION,
    NO_FRAME,
    NO_PAINT,
    PaintEvidence,
    PaintReading,
)
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate_clicks, calibrate_paint
from app.store.media import read_pixels

NOTHING = PaintEvidence({})
Image = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class PaintTask:
    """One view whose picture is read.

    Attributes:
        group: Its group, the other views left out.
        policy: Its clicks are calibrated by.
        sought_for: Key of that calibration.
        clicked: The calibration, where it is known.
        old: What was read before.
    """

    group: Group
    policy: CalibrationPolicy
    sought_for: str
    clicked: Calibration | None
    old: PaintReading | None

    @property
    def view(self) -> View:
        """The view."""
        return self.group.views[0]

    @property
    def fitting(self) -> PaintReading | None:
        """What was read before, where it was for the same clicks and read as today."""
        old = self.old
        if old is None or old.reason == NO_FRAME or old.sought_for != self.sought_for:
            return None
        return old if old.evidence.version == EXTRACTOR_VERSION else None


def read_view_paint(task: PaintTask, settings: Settings) -> PaintReading | None:
    """What is to be kept of a view's picture; None where its clicks give no camera.

    A picture that was read for the same clicks before is not decoded again. Where it is missing,
    what was read of it stays.
    """
    fitting, media = task.fitting, task.view.media
    missing = PaintReading("", task.sought_for, NOTHING, NO_FRAME)
    if media is None:
        return fitting or missing
    try:
        digest, image = read_pixels(media, settings, "" if fitting is None else fitting.frame)
    except NotFoundError:
        return fitting or missing
    except (ImageError, StorageError, TooLargeError):
        return missing
    return fitting if image is None else _read(task, digest, _as_annotated(image, task.view))


def _as_annotated(image: Image, view: View) -> Image:
    """The picture as people annotated it: turned right, and of that size."""
    if view.station.flipped:
        image = np.asarray(cv2.flip(image, 1), np.uint8)
    size = view.size.width, view.size.height
    if image.shape[1::-1] == size:
        return image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _read(task: PaintTask, digest: str, image: Image) -> PaintReading | None:
    clicked = task.clicked or calibrate_clicks(task.group, task.view, task.policy)
    if clicked.camera is None:
        return None
    nothing = PaintReading(digest, task.sought_for, NOTHING, NO_PAINT)
    if min(image.shape[:2]) < LEAST_SIDE:
        return nothing
    field = field_of_play(image)
    if why_no_field(image, field) is not None:
        return nothing
    try:
        return _snapped(task, nothing, image, field, clicked)
    except (GeometryError, np.linalg.LinAlgError):
        return nothing


def _snapped(
    task: PaintTask, nothing: PaintReading, image: Image, field: BoolArray, clicked: Calibration
) -> PaintReading:
    """The reading, with the agreement of the camera that solving finds with it."""
    assert clicked.camera is not None
    known = None if clicked.covariance is None else np.reshape(clicked.covariance, (8, 8))
    pitch = task.group.pitch
    found = snap(image, field, clicked.camera, pitch, policy=task.policy, start_covariance=known)
    reading = replace(nothing, reason=found.reason)
    camera = clicked.camera
    if found.reason is None:
        reading = replace(reading, evidence=to_paint_evidence(found.evidence, found.camera))
        view = task.view
        solved = calibrate_paint(
            clicked, reading, view.station.lines, pitch, view.size, task.policy
        )
        camera = solved.camera or camera
    seen = agreement(camera, field, line_like(image, field), pitch)
    return replace(reading, supported=seen.supported, explained=seen.explained)
