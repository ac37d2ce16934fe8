"""Documents of tracks: what lists say, their frames in columns, and what people say of them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, StrictBool

from app.features.tracks.around import AROUND, TrackExcerpt
from app.features.tracks.findings import find_contradicting_balls
from app.features.tracks.listing import ListedTrack
from app.features.tracks.service import (
    MOST_CORRECTIONS,
    TrackedFrames,
    TrackReview,
    TrackSummary,
)
from app.formats.tracks_writer import position_sigma
from app.geometry.arrays import FloatArray
from app.http.documents import Document, ListDocument, RequestBody
from app.json_text import MAX_ID, replace_non_finite
from app.tracking.ball_correct import is_near_correction
from app.tracking.ball_track import BallMode, BallState, EventCorrection, EventKind, ViewJump

MOST_FRAMES = 5000
"""Of one answer."""
Number = float | None


class CorrectionDocument(BaseModel):
    """An event that a person added to a track, or removed from it."""

    model_config = ConfigDict(extra="forbid", from_attributes=True)

    frame: Annotated[int, Field(ge=0, le=MAX_ID)] = Field(description="Of the stretch.")
    kind: EventKind = Field(description="What happened.")
    added: StrictBool = Field(description="Whether it happened; false: it did not.")


class TrackDocument(Document):
    """The track of the ball over a stretch: a static rig's frames, or a shot of a recording."""

    id: int
    dataset: str
    key: str = Field(description="Of the stretch; unique in its dataset.")
    match: str
    first: int = Field(description="Its first frame.")
    last: int = Field(description="Its last frame.")
    stale: bool = Field(description="Whether its groups have changed since it was made.")
    verdict: Literal["accepted", "rejected"] | None = Field(description="Null: nobody judged it.")
    note: str | None = Field(description="Why it was accepted or rejected.")
    judged_by: str | None = Field(description="Who accepted or rejected it.")
    judged_at: datetime | None = Field(description="When.")
    corrections: list[CorrectionDocument] = Field(
        description="Events that people added and removed; they stay when it is made again."
    )
    summary: TrackSummary = Field(description="What came of it.")
    created: datetime
    by: str = Field(validation_alias="actor")
    etag: str


class ListedTrackDocument(TrackDocument):
    """A track of a list, and for whom it is."""

    batches: list[int] = Field(description="Ids of the open batches that it is in.")
    assigned: list[str] = Field(
        description="Names of the people whom these are given to; empty: every reviewer."
    )


class TrackList(ListDocument[ListedTrackDocument]):
    """Tracks of a dataset."""

    @staticmethod
    def of(listed: Sequence[ListedTrack]) -> TrackList:
        """The document of a list."""
        items = [
            {**vars(one.track), "batches": one.batches, "assigned": one.assigned} for one in listed
        ]
        return TrackList.model_validate({"items": items})


class TrackEventDocument(Document):
    """What happened to the ball."""

    frame: int = Field(description="The nearest frame.")
    time_s: float = Field(description="Seconds.")
    kind: EventKind = Field(description="What happened.")
    position: list[float] = Field(description="x, y and z in the pitch frame, metres, z down.")
    sigma_s: float = Field(description="Standard deviation of its time, seconds.")
    added: bool = Field(description="Whether a person added it.")


class ContradictionDocument(Document):
    """A ball that the track does not explain, and what would mend it."""

    frame: int = Field(description="Of the stretch.")
    view: str = Field(description="Name of the camera or recording.")
    group: int | None = Field(description="Id of its group.")
    x: float = Field(description="Where it was annotated, pixels.")
    y: float = Field(description="Where it was annotated, pixels.")
    track_x: float | None = Field(description="Where the track is seen, pixels; null in a gap.")
    track_y: float | None = Field(description="Where the track is seen, pixels; null in a gap.")
    px: float = Field(description="How far from the track, pixels.")
    sentence: str = Field(description="What is wrong.")
    fix: str = Field(description="What to do.")


class TrackFrames(Document):
    """Frames of a track in columns: item i of every list is of one frame.

    Lengths in metres in the pitch frame, z down; null where there is no ball.
    """

    etag: str
    frame: list[int] = Field(description="Numbers.")
    time_s: list[float] = Field(description="Seconds.")
    x: list[Number] = Field(description="Along the pitch, metres.")
    y: list[Number] = Field(description="Across the pitch, metres.")
    z: list[Number] = Field(description="Downwards, metres.")
    sigma: list[Number] = Field(description="Major axis of the covariance, metres.")
    covariance: list[list[float] | None] = Field(
        description="Of the position: xx, xy, xz, yy, yz, zz, square metres."
    )
    velocity: list[list[float] | None] = Field(description="Metres a second.")
    state: list[BallState] = Field(description="How the ball is known.")
    mode: list[BallMode] = Field(description="What it does; empty in gaps.")
    views: list[list[str]] = Field(description="Cameras that saw it and agree.")
    left_out_px: list[Number] = Field(
        description="Error of what was left out in this frame and predicted, pixels."
    )
    raw: list[list[float] | None] = Field(
        description="Where the views of this frame alone put the ball: x, y, z."
    )
    group: list[int | None] = Field(description="Ids of groups.")
    events: list[TrackEventDocument] = Field(description="Those of these frames, by time.")
    jumps: list[ViewJump] = Field(
        description="Where the ball jumps in these frames because other views take over; no event of the ball."
    )
    contradicted: list[ContradictionDocument] = Field(
        description="Balls of these frames that the track does not explain."
    )

    @staticmethod
    def of(detail: TrackedFrames, first: int, last: int) -> TrackFrames:
        """The document of the frames from one number to another."""
        ball, groups = detail.ball, detail.groups
        rows = np.flatnonzero((ball.frames >= first) & (ball.frames <= last))
        numbers = [int(frame) for frame in ball.frames[rows]]
        position, spread = ball.position[rows], ball.covariance[rows]
        upper = spread[:, *np.triu_indices(3)]
        left = (
            np.full(len(ball.frames), np.nan) if ball.left_out is None else ball.left_out.by_frame
        )
        inside = set(numbers)
        return TrackFrames(
            etag=detail.etag,
            frame=numbers,
            time_s=ball.times[rows].tolist(),
            x=replace_non_finite(position[:, 0].tolist()),
            y=replace_non_finite(position[:, 1].tolist()),
            z=replace_non_finite(position[:, 2].tolist()),
            sigma=replace_non_finite(position_sigma(spread).tolist()),
            covariance=_rows_to_lists(upper),
            velocity=_rows_to_lists(ball.velocity[rows]),
            state=[ball.state[row] for row in rows],
            mode=[ball.mode[row] for row in rows],
            views=[list(ball.views[row]) for row in rows],
            left_out_px=replace_non_finite(left[rows].tolist()),
            raw=[
                _place_to_list(groups[number].place) if number in groups else None
                for number in numbers
            ],
            group=[groups[number].id if number in groups else None for number in numbers],
            events=[
                TrackEventDocument(
                    frame=event.frame,
                    time_s=event.time_s,
                    kind=event.kind,
                    position=[float(value) for value in event.position],
                    sigma_s=event.sigma_s,
                    added=is_near_correction(event, detail.inputs.corrections, added=True),
                )
                for event in ball.events
                if event.frame in inside
            ],
            jumps=[jump for jump in ball.jumps if jump.frame in inside],
            contradicted=[item for item in _build_contradictions(detail) if item.frame in inside],
        )


class TrackExcerptDocument(TrackFrames):
    """Frames of a track as they come out of their groups as they are now."""

    reason: str | None = Field(description="Why no track comes of them; null: one does.")

    @staticmethod
    def of_excerpt(found: TrackExcerpt) -> TrackExcerptDocument:
        """The document of what was tracked around a frame."""
        frames = TrackFrames.of(found, found.frame - AROUND, found.frame + AROUND)
        return TrackExcerptDocument(**vars(frames), reason=found.ball.reason)


class GroupTrackDocument(Document):
    """A track that a group is in."""

    track: TrackDocument = Field(description="The track.")
    frame: int = Field(description="The group's frame in its stretch.")


class GroupTrackList(ListDocument[GroupTrackDocument]):
    """The tracks that a group is in: at most one, unless stretches have changed."""


class TrackEdit(RequestBody, examples=[{"verdict": "accepted"}]):
    """What a person says of a track; what is left out stays."""

    verdict: Literal["accepted", "rejected", "none"] | None = Field(
        default=None, description="`none` takes the verdict back."
    )
    note: Annotated[str, Field(max_length=2000)] | None = Field(default=None, description="Why.")
    corrections: Annotated[list[CorrectionDocument], Field(max_length=MOST_CORRECTIONS)] | None = (
        Field(default=None, description="All events that are added and removed; it is judged anew.")
    )

    def to_track_review(self) -> TrackReview:
        """The change."""
        found = self.corrections
        corrections = (
            None if found is None else tuple(EventCorrection(**vars(item)) for item in found)
        )
        return TrackReview(self.verdict, self.note, corrections)


def _build_contradictions(detail: TrackedFrames) -> list[ContradictionDocument]:
    found = []
    for item in find_contradicting_balls(detail.ball, detail.inputs):
        group = detail.groups.get(item.frame)
        x, y = item.place or (None, None)
        fix = (
            "No group shows this frame. Click the followed ball again in its recording, or withdraw it."
            if group is None
            else f"Look at {item.view}: move its ball, or leave the view out."
            if x is None
            else f"Move the ball of {item.view} to ({x:.1f}, {y:.1f}) if it is there, pick the "
            "other ball if it shows two, or leave the view out."
        )
        found.append(
            ContradictionDocument(
                frame=item.frame,
                view=item.view,
                group=None if group is None else group.id,
                x=item.at[0],
                y=item.at[1],
                track_x=x,
                track_y=y,
                px=item.px,
                sentence=item.reason,
                fix=fix,
            )
        )
    return found


def _rows_to_lists(values: FloatArray) -> list[list[float] | None]:
    known = np.asarray(np.isfinite(values).all(axis=1))
    return [row if there else None for row, there in zip(values.tolist(), known, strict=True)]


def _place_to_list(place: Sequence[float] | None) -> list[float] | None:
    return None if place is None else list(place)
