"""Documents of cameras over time."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, Field, StrictBool

from app.features.file_tools.track import frame_to_row
from app.features.groups.schemas import PitchSize
from app.features.recordings.cameras import CameraTrackingSummary
from app.http.documents import Document, ListDocument, RequestBody
from app.json_text import MAX_ID
from app.soccer.pitch import Pitch
from app.tracking.track import FrameCamera

Frame = Annotated[int, Field(ge=0, le=MAX_ID)]
CameraFormat = Literal["soccernet", "npz", "opentrackio"]


class TrackCamerasRequest(RequestBody, examples=[{"first": 0, "last": 249}]):
    """A stretch of a recording that is tracked."""

    first: Frame = Field(description="Number of its first frame, from 0.")
    last: Frame = Field(description="Number of its last frame.")


class CamerasHalfTurnRequest(RequestBody, examples=[{"turned": True}]):
    """On which side the cameras of a stretch stand."""

    turned: StrictBool = Field(
        description="Whether they are turned by half a turn of the pitch against what the tracker gave."
    )


class EstimatedPitchSigma(BaseModel):
    """Standard deviations of a pitch that frames show together, metres."""

    length: float | None = Field(description="Null where the length is not shown.")
    width: float | None = Field(description="Null where the width is not shown.")
    crown: float = Field(description="Of the crown of the grass.")
    inward: float = Field(description="Of how far the paint lies inside the plan.")
    tripod: float = Field(description="Of the tripod's position, in the worst direction.")


class EstimatedPitch(BaseModel):
    """The pitch that the frames of a stretch show together: an estimate, which changes nothing."""

    length: float | None = Field(description="Metres; null where the frames do not show it.")
    width: float | None = Field(description="Metres; null where the frames do not show it.")
    crown: float = Field(description="How far the grass is raised along the middle, metres.")
    inward: float = Field(description="How far the paint lies inside the plan, metres.")
    tripod: tuple[float, float, float] = Field(description="Where the camera stands, metres.")
    sigma: EstimatedPitchSigma = Field(description="Standard deviations of these.")
    frames: int = Field(description="How many frames it rests on.")
    other: PitchSize | None = Field(
        description="The size, where it certainly is not that of the match's pitch."
    )


class CameraTrackingSummaryDocument(Document, shows=CameraTrackingSummary):
    """What became of the frames of a stretch."""

    frames: int = Field(description="How many frames there are.")
    tracked: int = Field(description="Frames whose camera lies on the paint.")
    bridged: int = Field(description="Frames whose camera the background carries.")
    lost: int = Field(description="Frames without a camera.")
    worst_frame: int | None = Field(
        description="Tracked frame whose paint lies farthest from its markings."
    )
    worst_px: float | None = Field(description="How far, pixels of the video.")
    annotated: tuple[int, ...] = Field(description="Frames whose lines were known.")
    unusable: tuple[int, ...] = Field(description="Frames with too few lines for a camera.")
    turned: bool = Field(
        description="Whether a person turned them by half a turn of the pitch against what the tracker gave."
    )
    pitch: EstimatedPitch | None = Field(
        default=None, description="The pitch that its frames show together."
    )


class CamerasDocument(Document):
    """Cameras of a stretch of a recording."""

    id: int
    recording: int = Field(description="Id of the recording.")
    first: int = Field(description="Number of its first frame, from 0.")
    last: int = Field(description="Number of its last frame.")
    summary: CameraTrackingSummaryDocument = Field(description="What became of its frames.")
    before: CameraTrackingSummaryDocument | None = Field(
        description="The same of the cameras that these took the place of."
    )
    revision: int = Field(description="How often the stretch was tracked.")
    stale: bool = Field(description="Whether the video is another one by now.")
    drawn: tuple[int, ...] = Field(description="Frames with lines now, which the next run knows.")
    created: datetime
    by: str = Field(validation_alias="actor")


class CamerasList(ListDocument[CamerasDocument]):
    """Stretches of a recording that have cameras, in their order."""


class FrameCamerasDocument(Document):
    """A camera for each frame of a stretch, as columns: the same place is the same frame."""

    first: int = Field(description="Number of the first frame.")
    last: int = Field(description="Number of the last frame.")
    size: list[int] = Field(description="Width and height of a frame, pixels.")
    principal_point: list[float] | None = Field(description="Of every camera, pixels.")
    pitch: list[float] = Field(description="Length and width of the pitch of the match, metres.")
    outcome: str = Field(description="A letter a frame: `T` tracked, `B` bridged, `L` lost.")
    time: list[float] = Field(description="When each is shown, seconds after the first frame.")
    supported: list[float | None] = Field(description="Share of the visible markings with paint.")
    explained: list[float | None] = Field(description="Share of the paint that has a marking.")
    error_px: list[float | None] = Field(description="Of the paint from its markings, median.")
    keyframe: list[int] = Field(description="Frames that were annotated, or proposed alone.")
    reason: list[str | None] = Field(description="Why a frame is not tracked.")
    camera: list[list[float] | None] = Field(
        description="x, y, z (metres); pan, tilt, roll (degrees); focal lengths (pixels); k1."
    )
    sigma: list[list[float] | None] = Field(
        description="Standard deviations: position, pan, tilt, roll, focal length."
    )

    @staticmethod
    def of(frames: list[FrameCamera], pitch: Pitch) -> FrameCamerasDocument:
        """The document of cameras."""
        rows = [frame_to_row(frame) for frame in frames]
        first = next((frame.camera for frame in frames if frame.camera is not None), None)
        size = frames[0].size
        columns = {
            name: [None if row[name] is None else round(row[name], 4) for row in rows]
            for name in ("supported", "explained", "error_px")
        }
        return FrameCamerasDocument(
            first=frames[0].number,
            last=frames[-1].number,
            size=[size.width, size.height],
            principal_point=None if first is None else [*first.principal_point],
            pitch=[pitch.length, pitch.width],
            outcome="".join(frame.outcome[0].upper() for frame in frames),
            time=[frame.time for frame in frames],
            **columns,
            keyframe=[frame.number for frame in frames if frame.is_keyframe],
            reason=[frame.reason for frame in frames],
            camera=[_camera_to_numbers(frame) for frame in frames],
            sigma=[
                None
                if row["sigma"] is None
                else [_round_to_three_significant_digits(row["sigma"][name]) for name in _SIGMA]
                for row in rows
            ],
        )


_SIGMA = ("position", "pan", "tilt", "roll", "focal_px")


def _round_to_three_significant_digits(value: float) -> float:
    return float(f"{value:.3g}")


def _camera_to_numbers(frame: FrameCamera) -> list[float] | None:
    """So many digits that no pixel moves by a hundredth."""
    camera = frame.camera
    if camera is None:
        return None
    place = np.round(camera.position, 4).tolist()
    turn = np.round(camera.pan_tilt_roll_degrees, 6).tolist()
    lens = [round(focal, 3) for focal in camera.focal_length]
    return [*place, *turn, *lens, round(float(camera.distortion[0]), 7)]
