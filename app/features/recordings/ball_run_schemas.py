"""Documents of ball runs."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import Field, StrictBool

from app.features.recordings.ball_runs import BallRunReview, StoredRun
from app.features.recordings.follow import EACH_WAY
from app.features.recordings.schemas import Frame
from app.http.documents import Document, ListDocument, RequestBody
from app.tracking.ball_run import BallClick, End

Pixel = Annotated[float, Field(ge=-1, le=20_000, allow_inf_nan=False)]


class BallClickRequest(RequestBody, examples=[{"frame": 30, "x": 612.5, "y": 344.0}]):
    """A click on a ball."""

    frame: Frame = Field(description="Number of the frame, from 0.")
    x: Pixel = Field(description="About the middle of the ball, pixels of the recording.")
    y: Pixel = Field(description="About the middle of the ball, pixels of the recording.")

    def to_ball_click(self) -> BallClick:
        """The click as a value."""
        return BallClick(self.frame, self.x, self.y)


class BallRunReviewRequest(RequestBody, examples=[{"accepted": True}]):
    """What a person says of a ball run; what is absent stays as it is."""

    accepted: StrictBool | None = Field(
        default=None,
        description="true: views of its frames get the ball, unless they have one; false: those balls go again.",
    )
    confirmed: Annotated[list[Frame], Field(max_length=2 * EACH_WAY + 1)] | None = Field(
        default=None, description="All uncertain frames that are right."
    )

    def to_review(self) -> BallRunReview:
        """The change as a value."""
        confirmed = None if self.confirmed is None else tuple(self.confirmed)
        return BallRunReview(self.accepted, confirmed)


class BallRunDocument(Document):
    """A ball that was followed from clicks through the frames of a shot."""

    id: int
    recording: int = Field(description="Id of the recording.")
    clicks: list[BallClick] = Field(description="What people clicked, by frame.")
    first: int = Field(description="Its first frame.")
    last: int = Field(description="Its last frame.")
    before: End = Field(
        description="Why it begins there: the ball is `lost`, `left` the picture, or `limit`: it was followed no further."
    )
    after: End = Field(description="Why it ends there.")
    followed: int = Field(description="Frames in which the ball was followed.")
    uncertain: int = Field(description="Frames that a person has to look at.")
    confirmed: list[int] = Field(description="Uncertain frames that a person said are right.")
    accepted_by: str | None = Field(description="Who accepted it; null: nobody.")
    placed: int | None = Field(description="Views that have the ball from it.")
    kept: int | None = Field(description="Views of its frames that had another ball, which stays.")
    refused: int | None = Field(
        default=None,
        description="Views that could not be edited, as their group is closed or somebody edited it meanwhile: they do"
        " not have the ball, or, where the run was to be taken back, still have it, and it stays accepted.",
    )
    stale: bool = Field(description="Whether the video is another one by now.")
    created: datetime
    by: str
    etag: str

    @staticmethod
    def of(found: StoredRun) -> BallRunDocument:
        """The document of a run."""
        return BallRunDocument(**_build_run_summary(found))


class BallRunFrames(BallRunDocument):
    """A ball run with its frames as columns: the same place is the same frame."""

    frame: list[int] = Field(description="Numbers of the frames; others between are lost.")
    x: list[float] = Field(description="Of the centre, pixels of the recording.")
    y: list[float] = Field(description="Of the centre, pixels of the recording.")
    diameter: list[float] = Field(description="Pixels.")
    sigma_px: list[float] = Field(
        description="Standard deviation of the centre along each axis, pixels."
    )
    confidence: list[float] = Field(description="How likely it is the ball, 0 to 1.")
    state: str = Field(description="A letter a frame: `F` followed, `U` uncertain.")

    @staticmethod
    def of(found: StoredRun) -> BallRunFrames:
        """The document of a run."""
        balls = found.run.balls
        columns = {
            name: [round(getattr(ball, name), 3) for ball in balls]
            for name in ("x", "y", "diameter", "sigma_px", "confidence")
        }
        return BallRunFrames(
            **_build_run_summary(found),
            **columns,
            frame=[ball.frame for ball in balls],
            state="".join(ball.state[0].upper() for ball in balls),
        )


class BallRunList(ListDocument[BallRunDocument]):
    """Ball runs of a recording, by their first frames."""

    following: list[int] = Field(
        description="Frames whose clicks are being followed now; what comes of them is in a later list."
    )


def _build_run_summary(found: StoredRun) -> dict[str, object]:
    run = found.run
    return {
        "id": found.id,
        "recording": found.recording,
        "clicks": list(run.clicks),
        "first": run.first,
        "last": run.last,
        "before": run.before,
        "after": run.after,
        "followed": run.count("followed"),
        "uncertain": run.count("uncertain"),
        "confirmed": list(found.confirmed),
        "accepted_by": found.accepted_by,
        "placed": found.groups.get("placed"),
        "kept": found.groups.get("kept"),
        "refused": found.groups.get("refused"),
        "stale": found.stale,
        "created": found.created,
        "by": found.actor,
        "etag": found.etag,
    }
