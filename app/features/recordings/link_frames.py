"""What a link is for: which frame of the replay shows what a live frame shows; and which live shots a replay may show."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from app.db.store import Store
from app.errors import InputError
from app.features.recordings.link_values import ShotLink
from app.features.recordings.links import list_links, need_link, shot_seconds, step_of
from app.features.recordings.service import (
    Recording,
    Shot,
    get_shots,
    index_place,
    list_recordings,
    read_index_at,
)
from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.tracking.link_fit import SLOWEST
from app.video.repeats import blended, repeated

SUGGESTED = 6
"""Live shots that are suggested for a replay."""


@dataclass(frozen=True)
class LinkedFrames:
    """Which frame of a replay shows the same as each live frame.

    Attributes:
        first: The first live frame.
        replay: The nearest frame of the replay for each live frame, None outside of its stretch. Where frames
            within half a live frame are neither repeated nor blended, the nearest of those.
        off_s: Live seconds by which that frame is later, for each live frame.
        repeated, blended: Frames of the replay that show the frame before once more, or a mix of those beside them.
    """

    first: int
    replay: tuple[int | None, ...]
    off_s: tuple[float | None, ...]
    repeated: tuple[int, ...]
    blended: tuple[int, ...]


@dataclass(frozen=True)
class LiveSuggestion:
    """A live shot that a replay may show.

    Attributes:
        recording: Id of its recording.
        name: Name of its recording.
        first, last: Numbers of its frames.
        why: What speaks for it and against it, a sentence.
        link: Id of the link of the two where there is one.
    """

    recording: int
    name: str
    first: int
    last: int
    why: str
    link: int | None


def linked_frames(store: Store, link: ShotLink) -> LinkedFrames:
    """Which frame of a replay shows the same as each frame of its live shot.

    Raises:
        ConflictError: An index is gone, or of an older version.
    """
    settings = store.settings
    with store.read() as session:
        row = need_link(session, link.live.recording, link.id)
    live = shot_seconds(settings, row.live_sha256, link.live)
    marks = _marks(index_place(settings, row.replay_sha256), link.replay.first, link.replay.last)
    nearest: list[int | None] = [None] * len(live)
    off: list[float | None] = [None] * len(live)
    if link.map.is_usable:
        replay = link.map.live(shot_seconds(settings, row.replay_sha256, link.replay))
        half = step_of(live) / 2
        for at, (frame, later) in enumerate(_nearest(live, replay, np.logical_or(*marks), half)):
            if frame is not None:
                nearest[at], off[at] = link.replay.first + frame, later
    repeats, blends = (
        tuple(link.replay.first + int(frame) for frame in np.flatnonzero(mark)) for mark in marks
    )
    return LinkedFrames(link.live.first, tuple(nearest), tuple(off), repeats, blends)


def _nearest(
    live: FloatArray, replay: FloatArray, marked: BoolArray, half: float
) -> list[tuple[int | None, float]]:
    """For each live time the number of the nearest time of the replay, and how much later it is.

    Unmarked ones within half a live frame come first. None beyond the ends of the replay.
    """
    found: list[tuple[int | None, float]] = []
    for time in live:
        off = replay - time
        if off.min() > half or off.max() < -half:
            found.append((None, 0.0))
            continue
        sound: IntArray = np.flatnonzero((np.abs(off) <= half) & ~marked)
        choice = sound if len(sound) else np.arange(len(off))
        best = int(choice[np.abs(off[choice]).argmin()])
        found.append((best, float(off[best])))
    return found


@lru_cache(maxsize=64)
def _marks(index: Path, first: int, last: int) -> BoolArray:
    """Whether frames of a shot are repeated, and whether they are blended, shape (2, N)."""
    rows = read_index_at(index).measured[first : last + 1]
    return np.array([repeated(rows), blended(rows)])


def suggest_live(store: Store, recording_id: int, frame: int) -> list[LiveSuggestion]:
    """Live shots that the replay at a frame may show, the likeliest first.

    They are shots of the main camera: those that end before the replay in its own recording, the
    nearest first, then those of other recordings of the dataset.

    Args:
        store: The database.
        recording_id: Recording of the replay.
        frame: Any frame of the replay.

    Raises:
        ConflictError: An index is gone.
        InputError: There is no shot at that frame.
        NotFoundError: There is no such recording.
    """
    mine = get_shots(store, recording_id)
    timed = list(zip(mine.items, mine.times, strict=True))
    found = next((one for one in timed if one[0].first <= frame <= one[0].last), None)
    if found is None:
        raise InputError(f"frame {frame} is in no shot", pointer="/frame")
    replay, (start, end) = found
    known = {
        (one.live.recording, one.live.first): one.id
        for one in list_links(store, recording_id)
        if one.replay.recording == recording_id and one.replay.first == replay.first
    }

    def suggestion(recording: Recording, shot: Shot, why: str) -> LiveSuggestion:
        link = known.get((recording.id, shot.first))
        return LiveSuggestion(recording.id, recording.name, shot.first, shot.last, why, link)

    suggested: list[tuple[tuple[bool, float], LiveSuggestion]] = []
    for shot, (first, last) in timed:
        if shot.kind != "main" or shot.last >= replay.first or shot.kept is False:
            continue
        short = last - first < SLOWEST * (end - start)
        why = f"Main camera, {last - first:.1f} s long, ends {start - last:.1f} s before the replay"
        why += ", shorter than a replay of this length shows." if short else "."
        suggested.append(((short, start - last), suggestion(mine.recording, shot, why)))
    here = [one for _, one in sorted(suggested, key=lambda item: item[0])][:SUGGESTED]
    for recording in list_recordings(store, mine.recording.dataset_id):
        if len(here) >= SUGGESTED or recording.id == recording_id or not recording.indexed:
            continue
        others = [one for one in get_shots(store, recording.id).items if one.kind == "main"]
        why = f"Main camera of {recording.name}; when that was, nothing says."
        here += [suggestion(recording, shot, why) for shot in others[: SUGGESTED - len(here)]]
    return here
