"""Proposal reading: what is proposed for one view from its picture; runs in a worker process."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.config import Settings
from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.geometry.camera import Camera
from app.paint.drawn_lines import beside_drawn
from app.paint.view_proposal import ViewProposal, proposal_of
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.media import Media
from app.soccer.paint_evidence import EXTRACTOR_VERSION
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.store.media import read_pixels
from app.store.proposals import Proposal

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
    def fitting_frame(self) -> str:
        """Digest of the picture of which nothing else would be said now; empty: there is none.

        What was proposed stays as it was seen. Where nothing could be, more is perhaps known of
        the match by now.
        """
        old = self.old
        if old is None or old.version != EXTRACTOR_VERSION or old.beside != self.beside:
            return ""
        told = old.outcome == "proposed" or old.sought_with == self.sought_with
        return old.frame if told else ""

    def without_picture(self, sentence: str) -> Proposal:
        """What is kept where no picture can be read."""
        return self.said(ViewProposal("nothing", sentence, {}), "")

    def said(self, found: ViewProposal, frame: str) -> Proposal:
        """What is kept of an answer for the picture with this digest."""
        return Proposal(
            view_id=self.view_id,
            **vars(found),
            frame=frame,
            sought_with=self.sought_with,
            version=EXTRACTOR_VERSION,
            beside=self.beside,
        )


def read_proposal(task: ProposalTask, settings: Settings) -> Proposal | None:
    """What is to be kept for a view; None where what was proposed before still stands."""
    known = task.fitting_frame
    try:
        digest, image = read_pixels(task.media, task.flipped, settings, known)
    except NotFoundError:
        return task.without_picture(MISSING)
    except (ImageError, StorageError, TooLargeError):
        return task.without_picture(UNREADABLE)
    if image is None:
        return None
    found = proposal_of(image, task.size, task.known, task.pitch, task.policy)
    return task.said(beside_drawn(found, task.drawn, task.pitch, task.size, task.policy), digest)
