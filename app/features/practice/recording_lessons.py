"""What is right of a practice recording: its shots, its cameras over time and the link of its replay, beside the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from app.features.recordings.link_values import ShotLink
from app.features.recordings.shots import Shot
from app.formats.camera_json import camera_from_json
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.soccer.frames import ImageSize
from app.solving.sides import turn_camera
from app.tracking.track import FrameCamera
from app.wording import plural

LessonName = Literal["shots", "cameras", "side", "link"]
State = Literal["open", "almost", "right"]
NEAR_FRAMES = 2
"""Between the ends of a shot and where they are."""
NEAR_PX, OFF_PX = 2.0, 5.0
"""Median distance of the grass from where it is, pixels at 1280 wide: a camera that is right, and one that is not."""
NEAR_LIVE_FRAMES, ALMOST_LIVE_FRAMES, NEAR_PERCENT = 1.0, 5.0, 5.0
"""Of a link: live frames in the middle of the replay, and of the speed."""
_KINDS = {"main": "the main camera", "replay": "a replay", "closeup": "a close-up"}


@dataclass(frozen=True)
class RecordingLesson:
    """One lesson on the practice recording, as it stands.

    Attributes:
        name: Which.
        question: What to do.
        hint: With which keys.
        state: Weighed against the film's truth: ``open`` as it was made, ``almost``, or ``right``.
        feedback: What is right and what is not, in words and numbers.
        frame: Where to look: a frame of the recording.
        right: How many shots, frames or links are right.
        total: Of how many.
        off: How far from the truth: pixels of the grass (cameras, median), metres (side), live frames (link); None
            where nothing is known.
    """

    name: LessonName
    question: str
    hint: str
    state: State
    feedback: str
    frame: int
    right: int
    total: int
    off: float | None = None


@dataclass(frozen=True)
class FilmTruth:
    """What is true of a recording of the sample.

    Attributes:
        fps: Frames a second.
        size: Of a frame.
        shots: As the film shows them.
        replay, live: Numbers of the replay and of the shot that it shows again, in ``shots``.
        offset_s, speed: ``t_live = offset + speed * t_replay``, seconds after the first frame of the recording.
        cameras: Of each frame.
    """

    fps: float
    size: ImageSize
    shots: tuple[Shot, ...]
    live: int
    replay: int
    offset_s: float
    speed: float
    cameras: Mapping[int, Camera]

    @staticmethod
    def of(told: Mapping[str, Any]) -> FilmTruth:
        """The truth that ``write_recording`` writes beside a film."""
        link = told["links"][0]
        shots = [
            Shot(shot["first"], shot["last"], shot["kind"], shot["entered_by"])
            for shot in told["shots"]
        ]
        return FilmTruth(
            told["fps"],
            ImageSize(told["width"], told["height"]),
            tuple(shots),
            link["live"],
            link["replay"],
            link["offset_s"],
            link["speed"],
            {row["frame"]: camera_from_json(row["camera"], "film") for row in told["each"]},
        )


def judge_shots(truth: FilmTruth, shots: Sequence[Shot]) -> RecordingLesson:
    """How many shots are where they are in truth, and of their kind."""
    wrong = [
        one for one in truth.shots if not any(_is_nearly_same_shot(one, other) for other in shots)
    ]
    right = len(truth.shots) - len(wrong)
    told = f"{right} of {plural(len(truth.shots), 'shot')} are right."
    if wrong:
        one = wrong[0]
        shown = _KINDS.get(one.kind, "something else")
        told += f" Frames {one.first} to {one.last} are a shot of their own: {shown}."
        beside = [other for other in shots if abs(other.first - one.first) <= NEAR_FRAMES]
        if beside and abs(beside[0].last - one.last) <= NEAR_FRAMES:
            told += f" The list calls it {_KINDS.get(beside[0].kind, 'something else')}."
    elif len(shots) > len(truth.shots):
        told += f" The list has {plural(len(shots) - len(truth.shots), 'shot')} too many."
    done = not wrong and len(shots) == len(truth.shots)
    return RecordingLesson(
        "shots",
        "One cut is missing from the list of shots, and one shot has the wrong kind. Correct the list.",
        "Step through the film with the arrow keys. S splits the shot at the frame on screen; 1 to 4 set its kind.",
        "right" if done else "open",
        told,
        (wrong[0] if wrong else truth.shots[0]).first,
        right,
        len(truth.shots),
    )


def _is_nearly_same_shot(one: Shot, other: Shot) -> bool:
    ends = max(abs(one.first - other.first), abs(one.last - other.last))
    return ends <= NEAR_FRAMES and one.kind == other.kind


def judge_cameras(truth: FilmTruth, frames: Mapping[int, FrameCamera]) -> RecordingLesson:
    """How many frames of the live shot have a camera that lies where it is in truth."""
    shot = truth.shots[truth.live]
    numbers = range(shot.first, shot.last + 1)
    off = {
        number: median_grass_error_px(truth.cameras[number], frame.camera, truth.size)
        for number in numbers
        if (frame := frames.get(number)) is not None and frame.camera is not None
    }
    lost = [number for number in numbers if number not in off]
    right = [number for number, px in off.items() if px <= NEAR_PX]
    told = f"{len(right)} of {plural(len(numbers), 'frame')} have a camera that is right."
    if lost:
        told += f" {plural(len(lost), 'frame')} from {lost[0]} to {lost[-1]} have none."
    middle = float(np.median(list(off.values()))) if off else None
    if middle is not None:
        worst = max(off, key=lambda number: off[number])
        told += f" Pitch error in the picture: {middle:.1f} px in the median, {off[worst]:.1f} px in frame {worst}."
    state: State = "right" if len(right) == len(numbers) else "open"
    if state == "open" and len(right) >= 0.95 * len(numbers):
        state = "almost"
    return RecordingLesson(
        "cameras",
        "The camera of this shot is lost for a while. Draw the lines in one of these frames, and track the shot again.",
        "N goes to a lost frame, E opens it to draw its lines; when they are saved, T tracks the shot again.",
        state,
        told,
        lost[0] if lost else shot.first,
        len(right),
        len(numbers),
        middle,
    )


def judge_replay_side(truth: FilmTruth, frames: Mapping[int, FrameCamera]) -> RecordingLesson:
    """Whether the cameras of the replay stand on the side where they are in truth."""
    shot = truth.shots[truth.replay]
    numbers = range(shot.first, shot.last + 1)
    found = {
        number: frame.camera
        for number in numbers
        if (frame := frames.get(number)) is not None and frame.camera is not None
    }
    away = [_camera_distance_m(truth.cameras[number], camera) for number, camera in found.items()]
    turned = [
        _camera_distance_m(truth.cameras[number], turn_camera(camera))
        for number, camera in found.items()
    ]
    is_right = bool(away) and float(np.median(away)) < float(np.median(turned))
    if not away:
        told = "The replay has no cameras: track it."
    elif is_right:
        told = (
            f"The camera of the replay stands {np.median(away):.2f} m from its true place (median)."
        )
    else:
        told = (
            f"The camera of the replay stands {np.median(away):.0f} m from its true place; on the other side it would be "
            f"{np.median(turned):.2f} m from it."
        )
    return RecordingLesson(
        "side",
        "The lines of a pitch look the same from both sides. On which side does the camera of the replay stand?",
        "Compare stands, benches and the attacked goal with the live shot. Shift T turns the cameras to the other side.",
        "right" if is_right else "open",
        told,
        shot.first,
        len(found) if is_right else 0,
        len(numbers),
        float(np.median(away)) if away else None,
    )


def judge_replay_link(truth: FilmTruth, links: Sequence[ShotLink]) -> RecordingLesson:
    """How far the times of the replay are from the truth."""
    live, replay = truth.shots[truth.live], truth.shots[truth.replay]
    mine = [one for one in links if _covers_most_of_shot(one.replay.frames, replay)]
    fitting = [one for one in mine if _covers_most_of_shot(one.live.frames, live)]
    known = next((one for one in fitting if one.map.is_usable), None)
    state: State = "open"
    off = None
    if known is None:
        told = "The replay is not linked yet."
        if fitting:
            told = "The replay is linked to the right shot, but no instant is linked yet."
        elif mine:
            told = f"It is linked to frames {mine[0].live.first} to {mine[0].live.last}, which the replay does not show."
    else:
        middle = (replay.first + replay.last) / 2
        shown = known.map.to_live_times(np.array([(middle - known.replay.first) / truth.fps]))[0]
        shown += known.live.first / truth.fps
        off = float(abs(shown - truth.offset_s - truth.speed * middle / truth.fps) * truth.fps)
        told = f"In the middle of the replay its time is off by {off:.1f} live frames."
        speed = known.map.speed
        if known.map.outcome == "offset":
            told += " Its speed is assumed: link a second instant."
        elif speed is not None:
            percent = 100 * abs(speed / truth.speed - 1)
            told += f" Its speed is {speed:.3f}; the true speed is {truth.speed:g} ({percent:.1f} % off)."
            near = off <= NEAR_LIVE_FRAMES and percent <= NEAR_PERCENT
            state = "right" if near else "almost" if off <= ALMOST_LIVE_FRAMES else "open"
    return RecordingLesson(
        "link",
        "Which live shot does the replay show, from when, and how slowly?",
        "Open the replay and link it to its live shot. Go to the same instant in both and press I; do it twice, far apart.",
        state,
        told,
        replay.first,
        int(state == "right"),
        1,
        off,
    )


def _covers_most_of_shot(frames: range, shot: Shot) -> bool:
    """Whether most of a shot's frames are among some."""
    both = min(frames[-1], shot.last) - max(frames[0], shot.first) + 1
    return both > (shot.last - shot.first + 1) / 2


def _camera_distance_m(one: Camera, other: Camera) -> float:
    return float(np.linalg.norm(one.position - other.position))


def median_grass_error_px(truth: Camera, found: Camera, size: ImageSize) -> float:
    """Median distance of the visible grass from where a camera puts it, pixels; infinite where it puts none in view."""
    xs, ys = np.linspace(0, size.width - 1, 9), np.linspace(0, size.height - 1, 7)
    pixels: FloatArray = np.stack(np.meshgrid(xs, ys), -1).reshape(-1, 2)
    ground = truth.project_to_ground(pixels)
    inside = np.isfinite(ground).all(axis=1) & (np.abs(ground) < (52.5, 34.0)).all(axis=1)
    if not inside.any():
        return float("inf")
    places = np.column_stack([ground[inside], np.zeros(int(inside.sum()))])
    off = np.hypot(*(found.project(places) - pixels[inside]).T)
    return float(np.median(np.where(np.isfinite(off), off, np.inf)))
