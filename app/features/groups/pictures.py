"""What a worker process makes of one picture: its paint, or proposed lines."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from app.config import Settings
from app.errors import (
    ImageError,
    NotFoundError,
    OverloadedError,
    ReviewError,
    StorageError,
    TooLargeError,
)
from app.features.paint.proposal_queries import Proposal
from app.geometry.camera import Camera
from app.media.files import read_digest_and_pixels
from app.media.frames import make_picture_error
from app.paint.evidence import Image
from app.paint.view_paint import (
    drop_boxes_larger_than_a_person,
    explain_unreadable_picture,
    read_paint_of_image,
)
from app.paint.view_proposal import ViewProposal, keep_undrawn_markings, propose_lines_in_image
from app.soccer.annotation import Lines
from app.soccer.codec import digest_json
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, View
from app.soccer.paint_evidence import (
    EXTRACTOR_VERSION,
    NO_FRAME,
    NO_PAINT,
    PaintEvidence,
    PaintReading,
)
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate_from_clicks
from app.worker_pool import WorkerPool
from app.worker_process import WorkerEnded

NOTHING = PaintEvidence({})


@dataclass(frozen=True)
class PaintTask:
    """One view whose picture is read.

    Attributes:
        group: Its group, the other views left out.
        policy: Its clicks are calibrated by.
        sought_for: Key of the camera of that calibration.
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
    def reusable_reading(self) -> PaintReading | None:
        """What was read before, where it was for the same clicks beside the same people, and as
        it is read today."""
        old = self.old
        if old is None or old.reason == NO_FRAME or old.sought_for != self.sought_for:
            return None
        if old.people != digest_people_boxes(self.view):
            return None
        return old if old.evidence.version == EXTRACTOR_VERSION else None

    @property
    def is_outdated(self) -> bool:
        """Whether something was read that is to be read again."""
        return (
            self.old is not None and self.old.reason != NO_FRAME and self.reusable_reading is None
        )

    @property
    def make_reading_without_frame(self) -> PaintReading:
        """What is kept where no picture can be read."""
        return PaintReading("", self.sought_for, NOTHING, NO_FRAME)


def digest_people_boxes(view: View) -> str:
    """Digest of the boxes that hide paint in a view; empty where there are none."""
    boxes = drop_boxes_larger_than_a_person(view.extras.pixel_boxes, view.size)
    if not boxes:
        return ""
    return digest_json(sorted([box.x, box.y, box.width, box.height] for box in boxes))


def mark_readings_with_stale_people_boxes(
    group: Group, readings: Mapping[str, PaintReading]
) -> dict[str, PaintReading]:
    """Readings as they are given to a group: of those that were made beside other people than its
    views have now, solving goes without and names the mending."""
    given = {}
    for key, reading in readings.items():
        view = group.view(key)
        if view is not None and reading.reason != NO_FRAME:
            fits = reading.people == digest_people_boxes(view)
            reading = reading if fits else replace(reading, sought_for="")
        given[key] = reading
    return given


def mark_paint_outdated_where_player_boxes_changed(
    old: Group, new: Group
) -> dict[str, PaintReading]:
    """The paint readings of a group, by view; those of views whose player boxes changed are outdated.

    An outdated reading has an empty ``sought_for``: solving does not use it and suggests reading again.
    """
    readings = {}
    for key, reading in old.paint.items():
        was, now = old.view(key), new.view(key)
        if (
            was is not None
            and now is not None
            and digest_people_boxes(was) != digest_people_boxes(now)
        ):
            reading = replace(reading, sought_for="")
        readings[key] = reading
    return readings


def read_view_paint(task: PaintTask, settings: Settings) -> PaintReading | None:
    """What is to be kept of a view's picture; None where its clicks give no camera, or where no
    import ever brought one.

    A picture that was read for the same clicks before is not decoded again. Where it is missing,
    what was read of it stays.
    """
    reusable, media = task.reusable_reading, task.view.media
    if media is None:
        return reusable
    try:
        known = "" if reusable is None else reusable.frame
        frame, image = read_digest_and_pixels(media, task.view.station.flipped, settings, known)
    except NotFoundError:
        return reusable or task.make_reading_without_frame
    except (ImageError, StorageError, TooLargeError):
        return task.make_reading_without_frame
    if image is None:
        return reusable
    return _read_paint_of_image(task, frame, image)


def _read_paint_of_image(task: PaintTask, frame: str, image: Image) -> PaintReading | None:
    size, policy = task.view.size, task.policy
    clicked = task.clicked or calibrate_from_clicks(task.group, task.view, policy)
    if clicked.camera is None:
        return None
    if explain_unreadable_picture(image, size) is not None:
        return replace(task.make_reading_without_frame, frame=frame)
    seen = read_paint_of_image(
        image, size, clicked, task.group.pitch, policy, task.view.extras.pixel_boxes
    )
    reason = NO_PAINT if seen.outcome == "nothing" else seen.reason
    evidence = seen.evidence if reason is None else NOTHING
    return PaintReading(
        frame,
        task.sought_for,
        evidence,
        reason,
        seen.supported,
        seen.explained,
        digest_people_boxes(task.view),
    )


MISSING = "The picture is missing."
UNREADABLE = "The picture cannot be read."


@dataclass(frozen=True)
class ProposalTask:
    """One view that is looked at.

    Attributes:
        size: Annotated size.
        known: Cameras of the match's other groups.
        sought_with: Digest of all of this but the picture and what is drawn.
        old: What was proposed before.
        drawn: Lines of the view, which determine no camera.
        beside: Digest of the station that has them; empty where there are none.
    """

    view_id: int
    media: Media
    flipped: bool
    size: ImageSize
    known: tuple[Camera, ...]
    pitch: Pitch
    policy: CalibrationPolicy
    sought_with: str
    old: Proposal | None
    drawn: Lines = field(default_factory=dict)
    beside: str = ""

    @property
    def reusable_frame_digest(self) -> str:
        """Digest of the picture of which nothing else would be said now; empty: there is none.

        What was proposed stays as it was seen. Where nothing could be, more is perhaps known of
        the match by now.
        """
        old = self.old
        if old is None or old.version != EXTRACTOR_VERSION or old.beside != self.beside:
            return ""
        is_usable = old.outcome == "proposed" or old.sought_with == self.sought_with
        return old.frame if is_usable else ""

    def make_proposal_without_picture(self, sentence: str) -> Proposal:
        """What is kept where no picture can be read."""
        return self.make_stored_proposal(ViewProposal("nothing", sentence, {}), "")

    def make_stored_proposal(self, found: ViewProposal, frame: str) -> Proposal:
        """The proposal to store for the picture with this digest."""
        return Proposal(
            view_id=self.view_id,
            **vars(found),
            frame=frame,
            sought_with=self.sought_with,
            version=EXTRACTOR_VERSION,
            beside=self.beside,
        )


def propose_lines_for_task(task: ProposalTask, settings: Settings) -> Proposal | None:
    """What is to be kept for a view; None where what was proposed before still stands."""
    known = task.reusable_frame_digest
    try:
        digest, image = read_digest_and_pixels(task.media, task.flipped, settings, known)
    except NotFoundError:
        return task.make_proposal_without_picture(MISSING)
    except (ImageError, StorageError, TooLargeError):
        return task.make_proposal_without_picture(UNREADABLE)
    if image is None:
        return None
    found = propose_lines_in_image(image, task.size, task.known, task.pitch, task.policy)
    return task.make_stored_proposal(
        keep_undrawn_markings(found, task.drawn, task.pitch, task.size, task.policy), digest
    )


class PictureTask:
    """A function of a module that reads one picture, called in a worker process from now on.

    Args:
        pool: The workers.
        work: The function.
        arguments: What it is called with.
    """

    def __init__(self, pool: WorkerPool, work: Callable[..., Any], *arguments: Any):
        self._ask = partial(pool.submit, work, *arguments, explain=_picture_error, bounded=False)
        self._task = self._ask()

    def result(self) -> Any:
        """What it returned.

        Raises:
            ImageError, TooLargeError: To this service the picture is unreadable.
            OverloadedError: Its process was killed, and another one, too.
        """
        try:
            return self._task.future.result()
        except OverloadedError:
            return self._ask().future.result()


def _picture_error(error: WorkerEnded) -> ReviewError:
    return make_picture_error("the picture", error)
