"""Shot: the cameras of all frames of a clip.

Forwards from the first frame whose camera is given, or can be proposed; then backwards into what
was left; then all frames together (``together``). A run that no paint holds is bridged where the
background ties both of its ends to each other, and is lost elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from app.errors import GeometryError
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.paint.candidates import MAIN, WIDE
from app.paint.frame_pitch import make_paint_sightings
from app.paint.snap import WINDOWS, snap_to_prepared_picture
from app.soccer.frames import ImageSize
from app.soccer.paint_evidence import NO_PAINT
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.tripod_pitch import MOST_FRAMES, do_cameras_travel, find_tripod_pitch
from app.tracking.clip import Clip
from app.tracking.follow import (
    BRIDGED,
    LOST,
    MOST_BRIDGED,
    NO_CAMERA,
    RATHER,
    TRACKED,
    CameraFollower,
    TrackedFrame,
)
from app.tracking.motion import BackgroundMatches, apply_background_motion, match_background
from app.tracking.picture import (
    AHEAD,
    FramePicture,
    make_frame_picture,
    make_frame_pictures,
    propose_camera_in_picture,
)

TRIALS, ASKED = 2, 4
"""Likely cameras that are followed where none is certain, and frames in which each is asked for again."""
LEAST_TURN_DEGREES, LEAST_HELD = 5.0, 0.5
"""By how much it has to turn, and the share of the frames in which it has to lie on the paint."""
CHUNK = 32
"""Frames in memory while a clip is followed backwards."""
TIED_PX, TIED_PX_A_FRAME, FARTHEST_M = 4.0, 0.3, 150.0
"""At 960 wide: how far the ends of a bridge may lie from each other."""

SAME_STAND_M = 3.0
"""Two searches for one tripod agree within so much: no pitch is quite the plan."""
UNTIED = "the background does not tie it to a frame whose camera is known"

Tell = Callable[[int], None]


@dataclass(frozen=True)
class GivenCamera:
    """The camera of an annotated frame.

    Attributes:
        camera: Pixels of the work size.
        covariance: Of its parameters, shape (8, 8); None where it is not known.
    """

    camera: Camera
    covariance: FloatArray | None


@dataclass(frozen=True)
class FollowedShot:
    """What a clip shows of its camera.

    Attributes:
        frames: One for each frame.
        matches: From the frame before to each frame; None for the first, and where there is none.
    """

    frames: list[TrackedFrame]
    matches: list[BackgroundMatches | None]


def follow_shot(
    clip: Clip,
    given: Mapping[int, GivenCamera],
    pitch: Pitch,
    policy: CalibrationPolicy,
    tell: Tell | None = None,
) -> FollowedShot:
    """Every frame of a clip, each from its neighbours.

    Args:
        given: Cameras of annotated frames, by number.
        tell: Called with frames done.
    """
    shot, follower = _follow_both_ways(clip, given, pitch, policy, tell)
    if given or any(frame.outcome != LOST for frame in shot.frames):
        return shot
    likely = sorted(follower.unsure, key=lambda item: -item.score)
    for item in likely[:TRIALS]:
        start = {item.picture.number: GivenCamera(item.camera, None)}
        trial, _ = _follow_both_ways(clip, start, pitch, policy, tell)
        if _is_uncertain_camera_confirmed(trial, item.picture.number, clip, follower):
            return trial
    return shot


def _follow_both_ways(
    clip: Clip,
    given: Mapping[int, GivenCamera],
    pitch: Pitch,
    policy: CalibrationPolicy,
    tell: Tell | None,
) -> tuple[FollowedShot, CameraFollower]:
    """Every frame from its neighbours, and who followed them."""
    shot, follower = _follow_forwards(clip, given, pitch, policy, tell)
    first = [*shot.frames]
    for start, end in _find_runs_without_paint(shot.frames):
        if end < len(shot.frames):
            _follow_run(clip, shot, range(end - 1, start - 1, -1), pitch, policy)
    for start, end in _find_runs_without_paint(shot.frames):
        # What was found backwards may be followed forwards.
        if start > 0 and shot.frames[start - 1] is not first[start - 1]:
            _follow_run(clip, shot, range(start, end), pitch, policy)
    _bridge_or_drop_runs(shot.frames, shot.matches)
    _drop_cameras_of_unconfirmed_runs(clip, shot.frames, pitch, policy)
    return shot, follower


def _is_uncertain_camera_confirmed(
    trial: FollowedShot, number: int, clip: Clip, follower: CameraFollower
) -> bool:
    """Whether a camera that no frame proposes for certain is right all the same.

    The same view has the same fault twice; so the camera has to turn, stay on the paint while it does, and where
    it has turned a search at its position has to find it for certain.
    """
    start = trial.frames[number].camera
    if start is None:
        return False
    tracked = [frame for frame in trial.frames if frame.outcome == TRACKED]
    turns = {frame.number: _turn_degrees(start, frame.camera) for frame in tracked}
    far = [frame for frame in tracked if turns[frame.number] >= LEAST_TURN_DEGREES]
    if len(tracked) < LEAST_HELD * len(trial.frames) or not far:
        return False
    chosen = sorted(far, key=lambda frame: turns[frame.number])[:: -max(len(far) // ASKED, 1)]
    return any(
        _is_proposed(clip, frame, follower.pitch, follower.policy, [start]) for frame in chosen
    )


def _is_proposed(
    clip: Clip,
    frame: TrackedFrame,
    pitch: Pitch,
    policy: CalibrationPolicy,
    known: Sequence[Camera] = (),
) -> bool:
    """Whether a search in its picture alone finds the camera of a frame for certain.

    Args:
        known: Cameras at whose positions it is sought besides.
    """
    picture = make_frame_picture(next(clip.frames(frame.number, frame.number + 1)))
    try:
        found = propose_camera_in_picture(picture, pitch, known, policy, (MAIN, WIDE))
    except (GeometryError, np.linalg.LinAlgError):
        return False
    return found.outcome == "proposed" and _shows_same_grass(found.camera, frame.camera, 0)


def _turn_degrees(one: Camera, other: Camera | None) -> float:
    if other is None:
        return 0.0
    return float(np.degrees(np.arccos(np.clip(one.rotation[2] @ other.rotation[2], -1, 1))))


def _follow_forwards(
    clip: Clip,
    given: Mapping[int, GivenCamera],
    pitch: Pitch,
    policy: CalibrationPolicy,
    tell: Tell | None,
) -> tuple[FollowedShot, CameraFollower]:
    """Every frame from the one before, and who followed them."""
    follower = CameraFollower(pitch, policy, known=[item.camera for item in given.values()])
    shot = FollowedShot([], [])
    frames, before = clip.frames(), None
    for frame in islice(frames, min(given, default=0)):
        # They are followed backwards, and their paint is read then.
        grey = make_frame_picture(frame).grey
        shot.matches.append(None if before is None else match_background(before, grey))
        shot.frames.append(TrackedFrame(frame.number, frame.time, LOST, reason=NO_CAMERA))
        before = grey
        if tell is not None:
            tell(len(shot.frames))
    for picture in make_frame_pictures(frames, follower.has_camera):
        match = None if before is None else match_background(before, picture.grey)
        shot.matches.append(match)
        key = given.get(picture.number)
        if key is not None:
            shot.frames.append(follower.start(picture, key.camera, key.covariance))
        else:
            shot.frames.append(follower.step(picture, match))
        before = picture.grey
        if tell is not None:
            tell(len(shot.frames))
    return shot, follower


def _find_runs_without_paint(frames: Sequence[TrackedFrame]) -> list[tuple[int, int]]:
    """First and end of each run of frames that no paint holds."""
    return _find_runs([frame.outcome != TRACKED and not frame.is_key for frame in frames])


def _find_runs(flags: Sequence[bool]) -> list[tuple[int, int]]:
    """First and end of each run of frames that a flag is set for."""
    edges = np.flatnonzero(np.diff([False, *flags, False])).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _follow_run(
    clip: Clip, shot: FollowedShot, run: range, pitch: Pitch, policy: CalibrationPolicy
) -> None:
    """Follow a run from the frame beside its first one; what is better than before is kept.

    Where its last frame does not tie to the one behind it, one of both is wrong: it is followed on
    for as long as it agrees better with the paint than what is there.

    Args:
        run: Numbers of its frames, in the order in which they are followed.
    """
    frames, matches = shot.frames, shot.matches
    before = frames[run[0] - run.step]
    known = [frame.camera for frame in frames if frame.is_key and frame.camera is not None]
    follower = CameraFollower(
        pitch, policy, known, before, before.seen.supported if before.seen else 0.0
    )
    for picture in _read_pictures_from_run(clip, run):
        number = picture.number
        match = matches[number if run.step > 0 else number + 1]
        if match is not None and run.step < 0:
            match = match.swap_frames()
        there, last = frames[number], follower.last
        if number in run:
            frames[number] = _choose_better_frame(there, follower.step(picture, match))
            continue
        if (
            there.is_key
            or last is None
            or _is_tied_by_background(last.camera, there.camera, [match])
        ):
            break
        found = follower.step(picture, match)
        if found.outcome != TRACKED or found.score < RATHER * there.score:
            break
        frames[number] = found


def _choose_better_frame(one: TrackedFrame, other: TrackedFrame) -> TrackedFrame:
    rank = {TRACKED: 0, BRIDGED: 1, LOST: 2}
    return min(one, other, key=lambda frame: (rank[frame.outcome], frame.age))


def _read_pictures_from_run(clip: Clip, run: range) -> Iterator[FramePicture]:
    """The frames of a run, and those behind it, in the order of the run."""
    if run.step > 0:
        yield from make_frame_pictures(clip.frames(run.start))
        return
    end = run.start + 1
    while end > 0:
        least, most = (run[-1], CHUNK) if end > run[-1] else (0, AHEAD)
        low = max(least, end - most)
        yield from reversed(list(make_frame_pictures(clip.frames(low, end))))
        end = low


def _bridge_or_drop_runs(
    frames: list[TrackedFrame], matches: Sequence[BackgroundMatches | None]
) -> None:
    """Decide what runs without paint are: bridged where both ends tie, lost elsewhere."""
    for start, end in _find_runs_without_paint(frames):
        inner = start > 0 and end < len(frames)
        tied = (
            inner
            and end - start <= 2 * MOST_BRIDGED
            and _is_tied_by_background(
                frames[start - 1].camera, frames[end].camera, matches[start : end + 1]
            )
        )
        cameras = _propagate_camera(frames[start - 1].camera, matches[start:end]) if tied else []
        for number in range(start, end):
            frame = frames[number]
            if tied:
                camera = frame.camera or cameras[number - start]
                frames[number] = replace(frame, outcome=BRIDGED, camera=camera)
            elif inner or frame.reason != NO_PAINT or frame.age > MOST_BRIDGED // 4:
                frames[number] = replace(frame, outcome=LOST, camera=None, snapped=None)


def _drop_cameras_of_unconfirmed_runs(
    clip: Clip, frames: list[TrackedFrame], pitch: Pitch, policy: CalibrationPolicy
) -> None:
    """Take the cameras of runs that tie to no key frame, unless their own paint says the same."""
    keys = [frame.camera for frame in frames if frame.is_key and frame.camera is not None]
    for start, end in _find_runs([frame.outcome != LOST for frame in frames]):
        run = frames[start:end]
        if any(frame.is_key for frame in run):
            continue
        asked = [frame for frame in run if frame.outcome == TRACKED]
        chosen = asked[len(asked) // (2 * ASKED) :: max(len(asked) // ASKED, 1)]
        near = (
            frame for frame in chosen if _is_at_key_frame_position(clip, frame, keys, pitch, policy)
        )
        confirmed = next(near, None)
        if confirmed is None and chosen and _stand_on_one_tripod(frames, asked, pitch, policy):
            confirmed = chosen[0]
        if confirmed is None:
            # Each of these searches costs as much as following a dozen frames.
            again = (frame for frame in chosen[1::2] if _is_proposed(clip, frame, pitch, policy))
            confirmed = next(again, None)
        if confirmed is not None:
            frames[confirmed.number] = replace(confirmed, is_key=True)
        else:
            for number in range(start, end):
                frames[number] = replace(
                    frames[number], outcome=LOST, camera=None, snapped=None, reason=UNTIED
                )


def _is_at_key_frame_position(
    clip: Clip,
    frame: TrackedFrame,
    keys: Sequence[Camera],
    pitch: Pitch,
    policy: CalibrationPolicy,
) -> bool:
    """Whether the paint of a frame alone puts its camera where those of key frames stand."""
    if frame.camera is None:
        return False
    picture = make_frame_picture(next(clip.frames(frame.number, frame.number + 1)))
    try:
        snapped = snap_to_prepared_picture(
            picture.reading, frame.camera, pitch, WINDOWS, policy, circles_count_twice=True
        )
    except (GeometryError, np.linalg.LinAlgError):
        return False
    if snapped.reason is not None or not _shows_same_grass(snapped.camera, frame.camera, 0):
        return False
    away = [float(np.linalg.norm(snapped.camera.position - key.position)) for key in keys]
    return min(away, default=np.inf) < SAME_STAND_M


def _stand_on_one_tripod(
    frames: Sequence[TrackedFrame],
    asked: Sequence[TrackedFrame],
    pitch: Pitch,
    policy: CalibrationPolicy,
) -> bool:
    """Whether frames lie on the paint of the pitch that those of runs with a key frame show, by cameras on their tripod.

    On a pitch that is not quite the plan, cameras of one tripod lie metres apart.
    """
    known = [
        frame
        for start, end in _find_runs([frame.outcome != LOST for frame in frames])
        if any(frame.is_key for frame in frames[start:end])
        for frame in frames[start:end]
        if frame.outcome == TRACKED
    ]
    before, behind = (
        [
            frame.snapped
            for frame in each[:: max(len(each) // (MOST_FRAMES // 2), 1)]
            if frame.snapped is not None
        ]
        for each in (known, asked)
    )
    if not before or not behind:
        return False
    height, width = behind[0].size
    size = ImageSize(width, height)
    painted = [make_paint_sightings(snapped) for snapped in (*before, *behind)]
    shown = find_tripod_pitch(painted, size, pitch, policy)
    if shown is None:
        return False
    # A few frames beside many hardly move the tripod: they are judged by themselves.
    errors = []
    for each in painted[len(before) :]:
        # From metres away one fit does not get there.
        near = replace(each, parameters=shown.fit_camera(each)[0])
        errors.append(shown.error_px(near, shown.fit_camera(near)[0]))
    alone = [snapped.error_px for snapped in behind]
    return not do_cameras_travel(np.array(errors), np.array(alone), size)


def _propagate_camera(
    camera: Camera | None, matches: Sequence[BackgroundMatches | None]
) -> list[Camera | None]:
    """A camera carried along matches."""
    cameras: list[Camera | None] = []
    for match in matches:
        if camera is not None and match is not None:
            half = float(np.hypot(*camera.principal_point))
            try:
                camera, _ = apply_background_motion(camera, match, half)
            except (GeometryError, np.linalg.LinAlgError):
                camera = None
        else:
            camera = None
        cameras.append(camera)
    return cameras


def _is_tied_by_background(
    one: Camera | None, other: Camera | None, matches: Sequence[BackgroundMatches | None]
) -> bool:
    """Whether the background carries one camera to the other."""
    return _shows_same_grass(_propagate_camera(one, matches)[-1], other, len(matches))


def _shows_same_grass(one: Camera | None, other: Camera | None, frames: int) -> bool:
    """Whether two cameras of a frame lay the grass of its picture on the same places.

    Args:
        frames: Over how many frames the one was carried.
    """
    if one is None or other is None:
        return False
    width = 2 * one.principal_point[0]
    grid = np.stack(np.meshgrid(*(np.linspace(0.1, 0.9, 5),) * 2), -1).reshape(-1, 2)
    pixels = grid * 2 * np.array(one.principal_point)
    ground = np.nan_to_num(one.project_to_ground(pixels), nan=1e6)
    near = np.hypot(*ground.T) < FARTHEST_M
    if not near.any():
        return False
    places = np.column_stack([ground[near], np.zeros(near.sum())])
    apart = np.hypot(*(other.project(places) - pixels[near]).T)
    far = float(np.median(np.nan_to_num(apart, nan=np.inf)))
    return far < (TIED_PX + TIED_PX_A_FRAME * frames) * width / 960
