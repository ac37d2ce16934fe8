"""Shot: the cameras of all frames of a clip.

Forwards from the first frame whose camera is given, or can be proposed; then backwards into what
was left; then all frames together (``together``). A run that no paint holds is bridged where the
background ties both of its ends to each other, and is lost elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.tracking.clip import Clip
from app.tracking.follow import BRIDGED, LOST, MOST_BRIDGED, TRACKED, Follower, TrackedFrame
from app.tracking.motion import BackgroundMatches, match_background, rotate_camera
from app.tracking.picture import Picture, read_frames

CHUNK = 32
"""Frames in memory while a clip is followed backwards."""
TIED_PX, TIED_PX_A_FRAME = 4.0, 0.3
"""At 960 wide: how far the ends of a bridge may lie from each other."""

Tell = Callable[[int], None]


@dataclass(frozen=True)
class Given:
    """The camera of an annotated frame.

    Attributes:
        camera: Pixels of the work size.
        covariance: Of its parameters, shape (8, 8); None where it is not known.
    """

    camera: Camera
    covariance: FloatArray | None


@dataclass(frozen=True)
class Shot:
    """What a clip shows of its camera.

    Attributes:
        frames: One for each frame.
        matches: From the frame before to each frame; None for the first, and where there is none.
    """

    frames: list[TrackedFrame]
    matches: list[BackgroundMatches | None]


def follow_shot(
    clip: Clip,
    given: Mapping[int, Given],
    pitch: Pitch,
    policy: CalibrationPolicy,
    tell: Tell | None = None,
) -> Shot:
    """Every frame of a clip, each from its neighbours.

    Args:
        given: Cameras of annotated frames, by number.
        tell: Called with frames done.
    """
    follower = Follower(pitch, policy, known=[item.camera for item in given.values()])
    frames: list[TrackedFrame] = []
    matches: list[BackgroundMatches | None] = []
    before: Picture | None = None
    first = min(given, default=0)
    for picture in read_frames(clip.frames()):
        match = None if before is None else match_background(before.grey, picture.grey)
        matches.append(match)
        key = given.get(picture.number)
        if key is not None:
            frames.append(follower.start(picture, key.camera, key.covariance))
        else:
            frames.append(follower.step(picture, match, may_propose=picture.number >= first))
        before = picture
        if tell is not None:
            tell(len(frames))
    for start, end in _runs(frames):
        if end < len(frames):
            _follow_back(clip, frames, matches, start, end, pitch, policy)
    _bridge(frames, matches)
    return Shot(frames, matches)


def _runs(frames: Sequence[TrackedFrame]) -> list[tuple[int, int]]:
    """First and end of each run of frames that no paint holds."""
    open_ = [frame.outcome != TRACKED and not frame.is_key for frame in frames]
    edges = np.flatnonzero(np.diff([False, *open_, False]))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _follow_back(
    clip: Clip,
    frames: list[TrackedFrame],
    matches: Sequence[BackgroundMatches | None],
    start: int,
    end: int,
    pitch: Pitch,
    policy: CalibrationPolicy,
) -> None:
    """Follow a run from the frame behind it to its start; what is better than before is kept."""
    later = frames[end]
    known = [frame.camera for frame in frames if frame.is_key and frame.camera is not None]
    follower = Follower(pitch, policy, known, later, later.seen.supported if later.seen else 0.0)
    for picture in _backwards(clip, start, end):
        match = matches[picture.number + 1]
        found = follower.step(picture, None if match is None else match.reversed())
        frames[picture.number] = _better(frames[picture.number], found)


def _better(one: TrackedFrame, other: TrackedFrame) -> TrackedFrame:
    rank = {TRACKED: 0, BRIDGED: 1, LOST: 2}
    return min(one, other, key=lambda frame: (rank[frame.outcome], frame.age))


def _backwards(clip: Clip, start: int, end: int) -> Iterator[Picture]:
    """Frames from before ``end`` down to ``start``."""
    while end > start:
        low = max(start, end - CHUNK)
        yield from reversed(list(read_frames(clip.frames(low, end))))
        end = low


def _bridge(frames: list[TrackedFrame], matches: Sequence[BackgroundMatches | None]) -> None:
    """Decide what runs without paint are: bridged where both ends tie, lost elsewhere."""
    for start, end in _runs(frames):
        inner = start > 0 and end < len(frames)
        tied = (
            inner
            and end - start <= 2 * MOST_BRIDGED
            and _ties(frames[start - 1], frames[end], matches[start : end + 1])
        )
        cameras = _carried(frames[start - 1], matches[start:end]) if tied else []
        for number in range(start, end):
            frame = frames[number]
            if tied:
                camera = frame.camera or cameras[number - start]
                frames[number] = replace(frame, outcome=BRIDGED, camera=camera)
            elif inner or frame.age > MOST_BRIDGED // 4:
                frames[number] = replace(frame, outcome=LOST, camera=None, snapped=None)


def _carried(
    start: TrackedFrame, matches: Sequence[BackgroundMatches | None]
) -> list[Camera | None]:
    """The camera of a frame carried along matches."""
    cameras: list[Camera | None] = []
    camera = start.camera
    for match in matches:
        if camera is not None and match is not None:
            half = float(np.hypot(*camera.principal_point))
            camera, _ = rotate_camera(camera, match, half)
        else:
            camera = None
        cameras.append(camera)
    return cameras


def _ties(
    one: TrackedFrame, other: TrackedFrame, matches: Sequence[BackgroundMatches | None]
) -> bool:
    """Whether the background carries the camera of one frame to that of another."""
    last = _carried(one, matches)[-1]
    if last is None or other.camera is None:
        return False
    width = 2 * last.principal_point[0]
    grid = np.stack(np.meshgrid(*(np.linspace(0.1, 0.9, 5),) * 2), -1).reshape(-1, 2)
    pixels = grid * 2 * np.array(last.principal_point)
    ground = np.nan_to_num(last.on_ground(pixels), nan=1e6)
    near = np.hypot(*ground.T) < 150
    if not near.any():
        return False
    places = np.column_stack([ground[near], np.zeros(near.sum())])
    apart = np.hypot(*(other.camera.project(places) - pixels[near]).T)
    far = float(np.median(np.nan_to_num(apart, nan=np.inf)))
    return far < (TIED_PX + TIED_PX_A_FRAME * len(matches)) * width / 960
