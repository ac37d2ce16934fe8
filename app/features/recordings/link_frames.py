"""What a link is for: which frame of the replay shows what a live frame shows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from app.config import Settings
from app.db.store import Store
from app.features.recordings.index import read_index_file
from app.features.recordings.link_values import LinkedShot, ShotLink
from app.features.recordings.links import compute_frame_interval, read_shot_times, require_link
from app.features.recordings.service import index_file_path
from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.video.repeats import find_blended_frames, find_repeated_frames


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


def find_linked_frames(store: Store, link: ShotLink) -> LinkedFrames:
    """Which frame of a replay shows the same as each frame of its live shot.

    Raises:
        ConflictError: An index is gone, or of an older version.
    """
    settings = store.settings
    with store.read() as session:
        row = require_link(session, link.live.recording, link.id)
    live = read_shot_times(settings, row.live_sha256, link.live)
    marks = _read_repeat_and_blend_flags(
        index_file_path(settings, row.replay_sha256), link.replay.first, link.replay.last
    )
    nearest: list[int | None] = [None] * len(live)
    off: list[float | None] = [None] * len(live)
    if link.map.is_usable:
        replay = link.map.to_live_times(read_shot_times(settings, row.replay_sha256, link.replay))
        half = compute_frame_interval(live) / 2
        frames, later = find_nearest_frames(live, replay, np.logical_or(*marks), half)
        for at in np.flatnonzero(frames >= 0):
            nearest[at] = link.replay.first + int(frames[at])
            off[at] = float(later[at])
    repeats, blends = (
        tuple(link.replay.first + int(frame) for frame in np.flatnonzero(mark)) for mark in marks
    )
    return LinkedFrames(link.live.first, tuple(nearest), tuple(off), repeats, blends)


def find_repeated_or_blended_frames(settings: Settings, sha256: str, shot: LinkedShot) -> set[int]:
    """Frames of a shot that show the one before once more, or a mix of those beside them.

    Raises:
        ConflictError: The index is gone, or of an older version.
    """
    marks = _read_repeat_and_blend_flags(index_file_path(settings, sha256), shot.first, shot.last)
    return {shot.first + int(at) for at in np.flatnonzero(np.logical_or(*marks))}


def find_nearest_frames(
    live: FloatArray, replay: FloatArray, marked: BoolArray, half: float
) -> tuple[IntArray, FloatArray]:
    """For each live time the number of the nearest time of the replay, and how much later that is.

    Unmarked ones within half a live frame come first. None (-1) beyond the ends of the replay.

    Args:
        live: Live times, seconds, shape (N,).
        replay: Live times that the frames of a replay show, seconds, in any order, shape (M,).
        marked: Which of these are repeated or blended, shape (M,).
        half: Half a live frame, seconds.

    Returns:
        Numbers of frames, shape (N,); seconds, shape (N,).
    """
    order: IntArray = np.argsort(replay, kind="stable")
    found = order[_find_nearest_times(replay[order], live)]
    sound = order[~marked[order]]
    if len(sound):
        unmarked = sound[_find_nearest_times(replay[sound], live)]
        found = np.where(np.abs(replay[unmarked] - live) <= half, unmarked, found)
    outside = (replay.min() - live > half) | (replay.max() - live < -half)
    return np.where(outside, -1, found), np.where(outside, 0.0, replay[found] - live)


def _find_nearest_times(times: FloatArray, wanted: FloatArray) -> IntArray:
    """Places of the nearest of ascending times, of equal ones the first, shape (N,)."""
    behind = np.minimum(np.searchsorted(times, wanted), len(times) - 1)
    before = np.searchsorted(times, times[np.maximum(behind - 1, 0)])
    is_before = np.abs(times[before] - wanted) <= np.abs(times[behind] - wanted)
    return np.where(is_before, before, behind)


@lru_cache(maxsize=64)
def _read_repeat_and_blend_flags(index: Path, first: int, last: int) -> BoolArray:
    """Whether frames of a shot are repeated, and whether they are blended, shape (2, N)."""
    rows = read_index_file(index).measured[first : last + 1]
    return np.array([find_repeated_frames(rows), find_blended_frames(rows)])
