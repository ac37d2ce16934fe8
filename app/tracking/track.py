"""Track: from a clip, and lines of some of its frames, to a camera for each frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.errors import InputError
from app.geometry.arrays import flatten_covariance
from app.geometry.camera import Camera
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CLICKED, CalibrationPolicy
from app.solving.calibrate import calibrate
from app.solving.tripod_pitch import TripodPitch
from app.tracking.clip import Clip
from app.tracking.follow import Outcome, TrackedFrame
from app.tracking.shot import GivenCamera, Tell, follow_shot
from app.tracking.shot_solve import solve_shot


@dataclass(frozen=True)
class FrameCamera:
    """The camera of one frame.

    Attributes:
        number: In the video, from 0, as the decoder returns frames.
        time: When it is shown, seconds after the first frame of the video.
        outcome: ``tracked``: the camera lies on the paint; ``bridged``: the background carries it
            between frames where it does; ``lost``: there is none.
        size: Of the video, pixels.
        camera: Pixels of the video; None where it is lost.
        covariance: Of its parameters (``geometry.resection``), row by row, shape (64,).
        supported: Share of the visible markings that has paint.
        explained: Share of the line-like paint that has a marking.
        error_px: Median distance of the paint to its marking, pixels of the video.
        is_keyframe: Whether its camera was annotated, or proposed from nothing.
        reason: Why it is not tracked.
    """

    number: int
    time: float
    outcome: Outcome
    size: ImageSize
    camera: Camera | None
    covariance: tuple[float, ...] | None
    supported: float | None
    explained: float | None
    error_px: float | None
    is_keyframe: bool
    reason: str | None


@dataclass(frozen=True)
class CameraTrack:
    """The cameras of a clip.

    Attributes:
        frames: One for each frame, with cameras that lay the plan of the pitch on the paint.
        shown: The pitch that the clip shows; None where it does not.
        shown_frames: The same frames with cameras on that pitch.
    """

    frames: list[FrameCamera]
    shown: TripodPitch | None
    shown_frames: list[FrameCamera]


def track_clip(
    clip: Clip | Path,
    lines: Mapping[int, Lines],
    pitch: Pitch | None = None,
    policy: CalibrationPolicy | None = None,
    tell: Tell | None = None,
) -> CameraTrack:
    """The camera of every frame of a clip.

    Args:
        clip: The video, or a stretch of it.
        lines: Annotated lines by number of their frame in the video, pixels of the video.
        pitch: The pitch.
        policy: Prior of the distortion, and which line of the paint its markings are.
        tell: Called with frames done.

    Raises:
        InputError: The lines of a frame make no camera, or there is no such frame.
        ImageError: The clip cannot be read.
    """
    policy = policy or CalibrationPolicy()
    pitch = policy.pitch_for_paint(pitch or Pitch())
    clicked = replace(CLICKED, goal=pitch.goal) if pitch.goal == "laws" else CLICKED
    clip = clip if isinstance(clip, Clip) else Clip.open(clip)
    given: dict[int, GivenCamera] = {}
    for number, drawn in lines.items():
        if not 0 <= number - clip.start < clip.count:
            raise InputError(
                f"frame {number} is not in {clip.path.name}, whose frames are {clip.start} to "
                f"{clip.start + clip.count - 1}",
                hint="Frames are numbered from 0, the first frame of the file.",
            )
        found = calibrate(drawn, pitch, clip.size, clicked)
        if found.camera is None:
            raise InputError(
                f"no camera can be computed from the lines of frame {number}: {found.reason}",
                hint="Draw more of the markings that this frame shows, or annotate another frame.",
            )
        spread = None if found.covariance is None else np.reshape(found.covariance, (8, 8))
        given[number - clip.start] = GivenCamera(clip.scale_to_work_size(found.camera), spread)
    shot = follow_shot(clip, given, pitch, policy, tell)
    solved = solve_shot(shot.frames, shot.matches, clip.work, pitch, policy)
    return CameraTrack(
        [_make_video_frame_camera(frame, clip) for frame in solved.frames],
        solved.shown,
        [_make_video_frame_camera(frame, clip) for frame in solved.shown_frames],
    )


def _make_video_frame_camera(frame: TrackedFrame, clip: Clip) -> FrameCamera:
    """A frame in pixels and numbers of the video."""
    scale = clip.size.width / clip.work.width
    seen, covariance, error = frame.seen, frame.covariance, frame.error_px
    return FrameCamera(
        number=clip.start + frame.number,
        time=frame.time,
        outcome=frame.outcome,
        size=clip.size,
        camera=None if frame.camera is None else clip.scale_to_video(frame.camera),
        covariance=None if covariance is None else tuple(flatten_covariance(covariance)),
        supported=None if seen is None else seen.supported,
        explained=None if seen is None else seen.explained,
        error_px=None if error is None else error * scale,
        is_keyframe=frame.is_key,
        reason=frame.reason,
    )
