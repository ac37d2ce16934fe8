"""Shots of a recording: from its index to intervals with kinds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt

from app.config import Settings
from app.errors import GeometryError
from app.paint.grass import find_field_of_play
from app.paint.propose import propose_camera
from app.progress import ReportProgress
from app.video.cuts import find_hard_cuts
from app.video.frames import Image, RecordingReader
from app.video.index import RecordingIndex
from app.video.indexing import index_recording
from app.video.repeats import Freeze, find_blended_frames, find_freezes, find_repeated_frames
from app.video.replays import cluster_logos, find_shots_between_logos
from app.video.transitions import Transition, find_soft_transitions

ShotKind = Literal["main", "replay", "closeup", "other"]
EnteredBy = Literal["start", "cut", "dissolve", "wipe", "fade"]

SHOT_SECONDS = 0.2
"""Shortest shot; what is shorter belongs to the transition beside it, or to the shot before."""
SLOW_SHARE = 0.2
"""Frames that are repeats or mixes in slow motion."""
LOOKED_AT = (0.2, 0.5, 0.8)
"""Of a shot, where frames are looked at."""
LEAST_MAIN = 2
"""Frames with a proposed camera in a main shot; of a shot that is too short for three, one."""
SHORT_SECONDS = 1.0
GRASS_MAIN, GRASS_CLOSEUP = 0.45, 0.08
"""Share of grass in which a main camera is sought, and less than that is no pitch."""
_LOOKED_WIDTH = 960


@dataclass(frozen=True)
class Shot:
    """Frames that one camera shows without a break.

    Attributes:
        first, last: Its frames.
        start_s, end_s: When its first frame is shown and its last one is over, seconds after the
            first frame of the recording.
        kind: What it shows.
        entered_by: What lies between it and the shot before; ``start``: the recording begins.
        logo: Number of the logo that flies before it; None: none does.
        repeated, blended: How many of its frames show the frame before once more, or a mix.
        freezes: Stretches of it that stand still.
    """

    first: int
    last: int
    start_s: float
    end_s: float
    entered_by: EnteredBy
    kind: ShotKind = "other"
    logo: int | None = None
    repeated: int = 0
    blended: int = 0
    freezes: tuple[Freeze, ...] = ()


@dataclass(frozen=True)
class RecordingShots:
    """All shots of a recording, in order.

    Attributes:
        frames: Of the recording.
        fps: Frames a second; of a variable rate the mean.
        variable: Whether the rate is one.
        shots: The shots.
        transitions: Soft transitions; their frames belong to no shot.
    """

    frames: int
    fps: float
    variable: bool
    shots: tuple[Shot, ...]
    transitions: tuple[Transition, ...]


def find_shots(
    index: RecordingIndex,
    look: Callable[[Sequence[int]], Sequence[FrameContent]] | None = None,
    progress: ReportProgress | None = None,
) -> RecordingShots:
    """Shots of a recording.

    Args:
        index: Its index.
        look: Gives what frames show, by their numbers; None: kinds are not told, all are ``other``.
        progress: Called with how many shots were looked at.
    """
    rows = index.measured
    cuts, flashed = find_hard_cuts(rows, index.step)
    transitions = find_soft_transitions(rows, index.step, cuts, flashed)
    shots = _split_into_shots(index, cuts.tolist(), transitions)
    wipes = [one for one in transitions if one.kind == "wipe"]
    clusters = cluster_logos(rows, [(one.first, one.last) for one in wipes])
    logos = {one.last + 1: cluster for one, cluster in zip(wipes, clusters, strict=True)}
    kinds: list[ShotKind] = []
    for done, shot in enumerate(shots):
        numbers = choose_frames_for_kind(shot.first, shot.last, shot.end_s - shot.start_s)
        kinds.append("other" if look is None else classify_shot(look(numbers)))
        if progress is not None:
            progress(done + 1, len(shots), "Looking at shots.")
    before = [logos.get(shot.first) for shot in shots]
    still, mixed = find_repeated_frames(rows), find_blended_frames(rows)
    slow = [(still | mixed)[shot.first : shot.last + 1].mean() > SLOW_SHARE for shot in shots]
    replays = find_shots_between_logos(
        before[1:],
        [(shot.start_s, shot.end_s) for shot in shots],
        [kind == "main" and not is_slow for kind, is_slow in zip(kinds, slow, strict=True)],
    )
    stands = find_freezes(rows, index.step)
    return RecordingShots(
        frames=len(index),
        fps=index.fps,
        variable=index.is_variable,
        shots=tuple(
            replace(
                shot,
                kind="replay" if is_replay else kind,
                logo=logo,
                repeated=int(still[shot.first : shot.last + 1].sum()),
                blended=int(mixed[shot.first : shot.last + 1].sum()),
                freezes=tuple(
                    one for one in stands if shot.first <= one.first <= one.last <= shot.last
                ),
            )
            for shot, kind, is_replay, logo in zip(shots, kinds, replays, before, strict=True)
        ),
        transitions=tuple(transitions),
    )


def _split_into_shots(
    index: RecordingIndex, cuts: Sequence[int], transitions: Sequence[Transition]
) -> list[Shot]:
    """Shots without kinds."""
    begins: dict[int, EnteredBy] = {0: "start"}
    ends = [len(index) - 1]
    for cut in cuts:
        begins[cut] = "cut"
        ends.append(cut - 1)
    for one in transitions:
        begins.pop(one.first, None)
        begins[one.last + 1] = one.kind
        ends.append(one.first - 1)
    least = max(round(SHOT_SECONDS / index.step), 1)
    shots: list[Shot] = []
    stops = sorted(end for end in set(ends) if end >= 0)
    for first in sorted(begins):
        last = next((end for end in stops if end >= first), None)
        if last is None or first >= len(index):
            continue
        if last - first + 1 < least and shots and last < len(index) - 1:
            continue
        shots.append(
            Shot(
                first,
                last,
                float(index.seconds[first]),
                float(index.seconds[last + 1]) if last + 1 < len(index) else index.end,
                begins[first],
            )
        )
    return shots


def index_and_find_shots(
    path: Path, settings: Settings, tell: Callable[[Any], Any]
) -> RecordingShots:
    """Index a recording and find its shots, in this process.

    Args:
        path: The file.
        settings: Limits.
        tell: Called with (done, total, sentence).

    Raises:
        ImageError, TooLargeError: As ``index_recording`` does.
    """
    # One of two cores decodes meanwhile.
    cv2.setNumThreads(1)
    index = index_recording(
        path, settings, lambda done, total: tell((done, total, "Reading frames."))
    )

    def report_progress(done: int, total: int | None = None, sentence: str = "") -> None:
        tell((done, total, sentence))

    return find_shots_of_indexed_recording(path, index, report_progress)


def find_shots_of_indexed_recording(
    path: Path, index: RecordingIndex, progress: ReportProgress | None = None
) -> RecordingShots:
    """Find the shots of a recording that is indexed, in this process.

    Args:
        path: The file.
        index: Its index.
        progress: Called with how many shots were looked at.

    Raises:
        ImageError: The file is not a video that can be read any more, or another one by now.
    """
    with closing(RecordingReader(path, index, kept_bytes=0)) as reader:

        def analyse_numbered_frames(numbers: Sequence[int]) -> list[FrameContent]:
            return [analyse_frame(_downscale_image(reader.read(number))) for number in numbers]

        return find_shots(index, analyse_numbered_frames, progress)


def _downscale_image(image: Image) -> Image:
    height, width = image.shape[:2]
    if width <= _LOOKED_WIDTH:
        return image
    size = (_LOOKED_WIDTH, max(round(height * _LOOKED_WIDTH / width), 1))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


@dataclass(frozen=True)
class FrameContent:
    """What a frame shows.

    Attributes:
        grass: Share of the picture.
        proposed: Whether the paint says where the camera stands.
    """

    grass: float
    proposed: bool


def choose_frames_for_kind(first: int, last: int, seconds: float) -> list[int]:
    """Numbers of the frames of a shot that tell its kind."""
    places = LOOKED_AT if seconds >= SHORT_SECONDS else (0.5,)
    return sorted({first + round(place * (last - first)) for place in places})


def analyse_frame(image: npt.NDArray[np.uint8]) -> FrameContent:
    """What a frame shows.

    Args:
        image: Red green blue, shape (H, W, 3).
    """
    grass = float(find_field_of_play(image).mean())
    if grass < GRASS_MAIN:
        return FrameContent(grass, False)
    try:
        return FrameContent(grass, propose_camera(image).outcome == "proposed")
    except (GeometryError, np.linalg.LinAlgError):
        return FrameContent(grass, False)


def classify_shot(looks: Sequence[FrameContent]) -> ShotKind:
    """Kind of a shot by what its frames show; whether it is a replay is not told by that."""
    proposed = sum(look.proposed for look in looks)
    if proposed >= min(LEAST_MAIN, len(looks)):
        return "main"
    grass = float(np.median([look.grass for look in looks])) if looks else 0.0
    return "closeup" if grass >= GRASS_CLOSEUP else "other"
