"""Recording: minutes of a broadcast as a video, with the truth of every frame beside it.

Live shots of a main camera that pans and zooms after the ball, two replays in slow motion from other places, each
between two flights of one logo, close-ups, the stands, cuts and a dissolve.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d

from app.durable import PARTIAL
from app.errors import InputError
from app.formats.camera_json import camera_to_json
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.json_text import json_text
from app.progress import ReportProgress
from app.sample import RECORDING_SECONDS, SEED, SHORTEST_RECORDING
from app.sample.cameras import HEIGHT, WIDTH, is_inside_image
from app.sample.film import (
    Backdrop,
    add_grain,
    aim_cameras,
    is_ball_hidden,
    make_backdrop,
    render_picture,
)
from app.sample.fixture import make_sample_match
from app.sample.play import BALL_DIAMETER, TEAM, Play, choose_shirt_numbers, make_play
from app.sample.props import Image, draw_scoreboard

FPS, REPLAY_FPS = 25, 50
"""Of the video and of the main camera; of the cameras of replays."""
MATCH = 1
"""Its look: an overcast afternoon, without the hard shadow of a stand."""
MAIN = np.array([-2.0, 64.0, -16.5])
STANDS = (np.array([10.0, -66.0, -14.0]), np.array([57.0, 47.0, -19.0]))
"""Where replays are filmed from, metres."""
CLOSEUP_FOCAL, CROWD_FOCAL = 22_000.0, 3200.0
SOFT = {"dissolve": 16, "wipe": 18}
"""Frames of transitions that are no cut."""
START_MINUTE = 12

Show = Literal["main", "replay", "closeup", "other"]
EnteredBy = Literal["start", "cut", "dissolve", "wipe"]


@dataclass(frozen=True)
class ShotPlan:
    """One shot of a recording.

    Attributes:
        kind: As ``video.shots`` names what it shows.
        seconds: Of the video.
        entered_by: What lies before it.
        speed: Of a replay: 0.5 is half as fast.
        stand: Of a replay: which of ``STANDS``.
        between: Of a replay slower than its camera: what is shown between two of its pictures.
    """

    kind: Show
    seconds: float
    entered_by: EnteredBy = "cut"
    speed: float = 1.0
    stand: int = 0
    between: Literal["repeat", "blend"] = "repeat"


PARTS = (
    ShotPlan("main", 27, "start"), ShotPlan("closeup", 5), ShotPlan("main", 26),
    ShotPlan("replay", 11, "wipe", 0.5, 0), ShotPlan("main", 24, "wipe"),
    ShotPlan("other", 4), ShotPlan("main", 25, "dissolve"),
    ShotPlan("replay", 13, "wipe", 0.25, 1), ShotPlan("main", 24, "wipe"),
    ShotPlan("closeup", 5), ShotPlan("main", 16),
)  # fmt: skip
"""Three minutes."""


def plan_shots(seconds: float) -> list[ShotPlan]:
    """What a recording of so many seconds shows: ``PARTS``, shorter or longer and several times.

    Raises:
        InputError: It would be too short to show them.
    """
    if seconds < SHORTEST_RECORDING:
        raise InputError(
            f"a recording of the sample must be at least {SHORTEST_RECORDING} seconds long"
        )
    times = max(1, round(seconds / RECORDING_SECONDS))
    scale = seconds / (times * RECORDING_SECONDS)
    parts = [
        ShotPlan(p.kind, p.seconds * scale, p.entered_by, p.speed, p.stand, p.between)
        for p in PARTS
    ]
    again = [ShotPlan("main", parts[0].seconds), *parts[1:]]
    return parts + again * (times - 1)


@dataclass(frozen=True, eq=False)
class _FilmedShot:
    """A shot with its cameras: picture k of its camera is taken ``start + k / rate`` seconds after play began.

    ``first`` and ``last`` are the frames of the video that show it alone, ``begin`` the one that would
    show picture 0. ``source`` is the number of the live shot that a replay shows again.
    """

    part: ShotPlan
    number: int
    first: int
    last: int
    begin: int
    start: float
    rate: int
    lowest: int
    cameras: list[Camera]
    source: int | None

    def picture_number_of(self, frame: int) -> float:
        """Which picture a frame shows; between two there is a share."""
        return (frame - self.begin) * self.part.speed * self.rate / FPS

    def picture_of_frame(self, frame: int) -> tuple[float, bool]:
        """Which picture a frame shows in truth, and whether it mixes the two beside it."""
        wanted = self.picture_number_of(frame)
        whole = abs(wanted - round(wanted)) < 1e-6
        if whole or self.part.between == "repeat":
            return (float(round(wanted)) if whole else math.floor(wanted)), False
        return wanted, True

    def camera(self, picture: int) -> Camera:
        """The camera of a picture."""
        return self.cameras[picture - self.lowest]

    def seconds(self, picture: float) -> float:
        """When a picture was taken, seconds after play began."""
        return self.start + picture / self.rate


@dataclass(frozen=True)
class RecordingReport:
    """What was written."""

    recording: str
    truth: str
    frames: int
    seconds: float
    shots: int


def write_recording(
    out: Path,
    seconds: float = RECORDING_SECONDS,
    seed: int = SEED,
    parts: Sequence[ShotPlan] | None = None,
    since: float = 0.0,
    progress: ReportProgress | None = None,
) -> RecordingReport:
    """Write a recording, and ``<stem>.json`` with its truth beside it.

    The same arguments give the same bytes on the same machine.

    Args:
        out: A file; its ending says the container (.mp4, .avi, .mkv).
        seconds: How long it is, ``SHORTEST_RECORDING`` or more.
        seed: Whole number from 0; another one gives another play.
        parts: What it shows instead; a replay needs a live shot before it that is as long as what it shows.
        since: How long play has gone on when it begins, seconds.
        progress: Called with (frames done, frames in all).

    Raises:
        InputError: The recording would be too short, its name has no ending of a video, or is that
            of a folder.
    """
    if out.suffix.lower() not in (".mp4", ".avi", ".mkv"):
        raise InputError(
            f"{out.name} does not end in .mp4, .avi or .mkv", hint="Choose a name such as film.mp4."
        )
    if out.is_dir():
        raise InputError(f"{out} is a folder; name a file, such as {out / 'film.mp4'}")
    play, shots = _plan_recording(list(parts) if parts else plan_shots(seconds), seed, since)
    total = shots[-1].last + 1
    out.parent.mkdir(parents=True, exist_ok=True)
    part, truth = out.with_name(f".{out.stem}{PARTIAL}{out.suffix}"), out.with_suffix(".json")
    try:
        video = cv2.VideoWriter(str(part), cv2.VideoWriter.fourcc(*"mp4v"), FPS, (WIDTH, HEIGHT))
        if not video.isOpened():
            raise InputError(f"no video can be written to {out.parent}")
        for number, image in enumerate(_render_frames(shots, play, seed)):
            video.write(image)
            if progress is not None:
                progress(number + 1, total)
        video.release()
        text = json_text(_recording_truth_to_json(play, shots, since), compact=True)
        truth.write_text(text + "\n", encoding="utf-8")
        part.replace(out)
    finally:
        part.unlink(missing_ok=True)
    return RecordingReport(str(out), str(truth), total, total / FPS, len(shots))


def _plan_recording(
    parts: list[ShotPlan], seed: int, since: float
) -> tuple[Play, list[_FilmedShot]]:
    """The play of a recording, and the shots that show it."""
    bounds = [round(FPS * end) for end in accumulate((p.seconds for p in parts), initial=0.0)]
    soft = [*(SOFT.get(part.entered_by, 0) for part in parts), 0]
    numbers = choose_shirt_numbers(np.random.default_rng([seed, MATCH, 0x21]))
    play = make_play(since + bounds[-1] / FPS, seed, numbers)
    live: tuple[int, float, float] | None = None
    shots = []
    for number, (part, (begin, end)) in enumerate(zip(parts, pairwise(bounds), strict=True)):
        first, last = begin + soft[number] // 2, end - soft[number + 1] // 2 - 1
        if last < first:
            raise InputError(
                f"shot {number + 1} must be longer than the transitions before and after it"
            )
        is_replay = part.kind == "replay"
        rate, start, source = REPLAY_FPS if is_replay else FPS, since + begin / FPS, None
        if is_replay:
            if live is None:
                raise InputError(f"shot {number + 1} is a replay, but no live shot comes before it")
            source = live[0]
            start = _find_liveliest_stretch(play, *live[1:], part.seconds * part.speed)
        elif part.kind == "main":
            live = number, since + first / FPS, since + last / FPS
        low, high = begin - soft[number] // 2, end + soft[number + 1] // 2
        lowest, highest = (
            math.floor((frame - begin) * part.speed * rate / FPS) for frame in (low, high)
        )
        times = start + np.arange(lowest, highest + 2) / rate
        cameras = _make_cameras_of_shot(part, play, times)
        shots.append(
            _FilmedShot(part, number, first, last, begin, start, rate, lowest, cameras, source)
        )
    return play, shots


def _find_liveliest_stretch(play: Play, first: float, last: float, length: float) -> float:
    """When a replay begins: the stretch of a live shot in which the ball goes farthest, heights above all."""
    if length > last - first:
        raise InputError("a replay must not be longer than the live shot before it")
    starts = np.arange(first, last - length + 1e-9, 0.1)
    steps = np.arange(first, last + 0.02, 0.02)
    moves = np.abs(np.diff(play.ball_at(steps), axis=0)) @ (1.0, 1.0, 4.0)
    gone = np.concatenate([[0.0], np.cumsum(moves)])
    covered = np.interp(starts + length, steps, gone) - np.interp(starts, steps, gone)
    # A part of a frame later: cameras of replays keep their own time.
    return float(starts[np.argmax(covered)]) + (0.007 if length < last - first - 0.1 else 0.0)


def _make_cameras_of_shot(part: ShotPlan, play: Play, times: FloatArray) -> list[Camera]:
    """The cameras of a shot at times."""
    if part.kind == "main":
        return _make_cameras_following_ball(play, times, MAIN, 0.7, 1650.0, 0.004)
    if part.kind == "replay":
        return _make_cameras_following_ball(play, times, STANDS[part.stand], 0.45, 2300.0, -0.006)
    if part.kind == "other":
        across = np.linspace(-9.0, 9.0, len(times)) + 0.2 * (times[0] % 60)
        aims = np.column_stack(
            [across, np.full((len(times), 1), -50.0), np.full((len(times), 1), -13.0)]
        )
        return aim_cameras(MAIN, aims, np.full(len(times), CROWD_FOCAL), 0.0)  # fmt: skip
    instants = [play.instant_at(time) for time in times]
    # Somebody who stands where few lines are: a camera cannot be told from what is seen.
    outfield = np.r_[1:TEAM, TEAM + 1 : 2 * TEAM]
    places = np.array([instant.feet[outfield] for instant in instants])
    reach = np.abs(places[..., 0])
    lonely = np.minimum(np.abs(reach - 26.0).max(axis=0), 30.0) + 0.4 * np.abs(places[..., 1]).max(
        0
    )
    who = outfield[int(np.argmin(lonely))]
    feet = np.array([instant.feet[who] for instant in instants])
    aims = np.column_stack([_smooth_over_time(feet, times, 0.3), np.full(len(times), -1.05)])
    return aim_cameras(MAIN, aims, np.full(len(times), CLOSEUP_FOCAL), 0.0)


def _make_cameras_following_ball(
    play: Play, times: FloatArray, position: FloatArray, late: float, focal: float, roll: float
) -> list[Camera]:
    """Cameras that follow the ball, smoothly and a little late, and zoom in where play is near a goal."""
    step = times[1] - times[0]
    margin = round(4 * late / step)
    wide = times[0] + step * np.arange(-margin, len(times) + margin)
    ball = _smooth_over_time(play.ball_at(np.maximum(wide - 0.25 * late, 0.0))[:, :2], wide, late)
    end = np.abs(ball[:, 0]) / 45.0
    zoom = 0.42 * np.minimum(end, 1.0) ** 2 + 0.05 * np.sin(2 * np.pi * wide / 17.0)
    seen = np.s_[margin : margin + len(times)]
    # Operators keep the middle of the pitch in the picture, and the ball out of its middle.
    aims = np.column_stack([ball[seen] * (0.93, 0.62), np.zeros(len(times))])
    far = float(np.hypot(*position[:2])) / 64.0
    return aim_cameras(
        position, aims, focal * far * np.exp(_smooth_over_time(zoom, wide, 1.0)[seen]), roll
    )


def _smooth_over_time(values: FloatArray, times: FloatArray, seconds: float) -> FloatArray:
    """Values over time as somebody follows them, of the same shape."""
    step = times[1] - times[0]
    return np.asarray(gaussian_filter1d(values, seconds / step, axis=0, mode="nearest"))


class _ShotRenderer:
    """Takes the pictures of one shot."""

    def __init__(self, shot: _FilmedShot, play: Play, backdrop: Backdrop, seed: int) -> None:
        self.shot, self._play, self._backdrop = shot, play, backdrop
        self._fixture = make_sample_match(MATCH, seed)
        self._kept: dict[int, Image] = {}

    def frame(self, number: int) -> Image:
        """What the video shows of it."""
        picture, is_mix = self.shot.picture_of_frame(number)
        low = math.floor(picture)
        if not is_mix:
            return self._add_caption(self._render_picture(low), picture)
        share = picture - low
        both = self._render_picture(low), self._render_picture(low + 1)
        mixed = np.asarray(cv2.addWeighted(both[0], 1 - share, both[1], share, 0), np.uint8)
        return self._add_caption(mixed, picture)

    def _render_picture(self, picture: int) -> Image:
        found = self._kept.get(picture)
        if found is None:
            shot = self.shot
            instant = self._play.instant_at(max(shot.seconds(picture), 0.0))
            image = render_picture(
                self._backdrop, shot.camera(picture), instant, self._fixture.look
            )
            found = add_grain(image, shot.number * 1009 + picture)
            self._kept = {k: v for k, v in self._kept.items() if k == picture - 1}
            self._kept[picture] = found
        return found

    def _add_caption(self, image: Image, picture: float) -> Image:
        kind = self.shot.part.kind
        if kind not in ("main", "replay"):
            return image
        image = image.copy()
        minutes, seconds = divmod(int(self.shot.seconds(picture)), 60)
        clock = f"1 - {START_MINUTE + minutes:02d}:{seconds:02d}"
        draw_scoreboard(image, self._fixture, clock, kind == "main")
        return image


def _render_frames(shots: list[_FilmedShot], play: Play, seed: int) -> Iterator[Image]:
    """All frames of the video, in their order."""
    look = make_sample_match(MATCH, seed).look
    main = [camera for shot in shots if shot.part.kind == "main" for camera in shot.cameras]
    shared = make_backdrop(main, look) if main else None

    def renderer_of(shot: _FilmedShot) -> _ShotRenderer:
        known = shared if shot.part.kind == "main" else None
        return _ShotRenderer(shot, play, known or make_backdrop(shot.cameras, look), seed)

    at, frame = renderer_of(shots[0]), 0
    for shot, follower in pairwise([*shots, None]):
        assert shot is not None
        for frame in range(shot.first, shot.last + 1):
            yield at.frame(frame)
        if follower is None:
            return
        following = renderer_of(follower)
        length = follower.first - shot.last - 1
        for number in range(length):
            share = (number + 1) / (length + 1)
            frame = shot.last + 1 + number
            if follower.part.entered_by == "dissolve":
                both = at.frame(frame), following.frame(frame)
                yield np.asarray(cv2.addWeighted(both[0], 1 - share, both[1], share, 0), np.uint8)
            else:
                yield draw_logo((at if share < 0.5 else following).frame(frame).copy(), share)
        at = following


def draw_logo(picture: Image, share: float, turn: int = 0) -> Image:
    """Draw the logo that flies before and after replays: a disc with a star, which covers all in its middle.

    Args:
        picture: What is seen beside it; it is drawn on.
        share: How much of its way it has gone, 0 to 1; at a half the picture behind it changes.
        turn: Which logo.
    """
    height, width = picture.shape[:2]
    along = 2 * share - 1
    size = int(width * (0.85 - 0.55 * abs(along)))
    middle = (int(width * (0.5 + 0.8 * along)), int(height * (0.5 + 0.2 * along * (-1) ** turn)))
    ground, ink = [((150, 70, 30), (240, 220, 200)), ((20, 20, 20), (240, 240, 240))][turn % 2]
    cv2.circle(picture, middle, size, ground, -1, cv2.LINE_AA)
    spokes = 5 + turn % 3
    for spoke in range(2 * spokes):
        angles = [2 * math.pi * (spoke + step) / (2 * spokes) + 2 * share for step in (0, 0.5, 1)]
        reach = (0.9 if spoke % 2 else 0.5) * size
        points = [
            (middle[0] + reach * math.cos(a) * f, middle[1] + reach * math.sin(a) * f)
            for a, f in zip(angles, (0.5, 1.0, 0.5), strict=True)
        ]
        cv2.fillPoly(picture, [np.array([middle, *points]).astype(np.int32)], ink, cv2.LINE_AA)
    return picture


def _recording_truth_to_json(play: Play, shots: list[_FilmedShot], since: float) -> dict[str, Any]:
    """What is true of a recording, as JSON; times are seconds after its first frame."""
    frames, links = [], []
    for shot in shots:
        part = shot.part
        frames += [
            _frame_truth_to_json(play, shot, frame) for frame in range(shot.first, shot.last + 1)
        ]
        if shot.source is not None:
            offset = shot.start - since - part.speed * shot.begin / FPS
            link = {"live": shot.source, "replay": shot.number}
            links.append({**link, "offset_s": offset, "speed": part.speed})
    return {
        "frames": shots[-1].last + 1, "fps": FPS, "width": WIDTH, "height": HEIGHT,
        "shots": [
            {
                "first": shot.first, "last": shot.last, "kind": shot.part.kind,
                "entered_by": shot.part.entered_by, "speed": shot.part.speed,
                "position": shot.cameras[0].position.tolist(),
            }
            for shot in shots
        ],
        "links": links,
        "each": frames,
    }  # fmt: skip


def _frame_truth_to_json(play: Play, shot: _FilmedShot, frame: int) -> dict[str, Any]:
    picture, is_mix = shot.picture_of_frame(frame)
    low = math.floor(picture)
    seconds = max(shot.seconds(picture), 0.0)
    camera, instant = shot.camera(low), play.instant_at(seconds)
    pixel = camera.project(instant.ball[None])[0]
    depth = float(camera.pitch_to_camera(instant.ball[None])[0, 2])
    in_view = bool(is_inside_image(pixel[None])[0]) and depth > 0
    before = shot.picture_of_frame(frame - 1)
    return {
        "frame": frame,
        "shot": shot.number,
        "play_s": seconds,
        "repeats": frame > shot.first and before == (picture, is_mix),
        "mixes": is_mix,
        "camera": camera_to_json(camera),
        "ball": instant.ball.tolist(),
        "mode": play.mode_at(seconds),
        "pixel": pixel.tolist() if in_view else None,
        "diameter_px": BALL_DIAMETER * camera.focal_length[0] / depth if in_view else None,
        "hidden": in_view and is_ball_hidden(camera, instant),
    }
