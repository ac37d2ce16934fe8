"""Which live shots a replay may show: main cameras before it, of the same half, that look where it looks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from app.db.store import Store
from app.errors import ConflictError, InputError
from app.features.recordings.cameras import (
    ShotCameras,
    cameras_file_path,
    list_shot_cameras,
    read_cameras_file,
)
from app.features.recordings.links import list_links
from app.features.recordings.match_clock import MatchClockReading, find_clock_at_frame
from app.features.recordings.service import Recording, list_recordings
from app.features.recordings.shots import Shot, get_shots
from app.tracking.link_fit import SLOWEST
from app.tracking.view_path import PathComparison, ViewPath, compare_paths, compute_view_path

SUGGESTED = 6
"""Live shots that are suggested for a replay."""
LIKENED = 30
"""Of the nearest in time, whose cameras are looked at."""
ALIKE_M, UNLIKE_M = 12.0, 25.0
"""Median distance of the places at which two cameras look that show the same play, and that speaks against it."""
_ROUND_M = 4.0
"""Distances that differ by less say nothing."""


@dataclass(frozen=True)
class LiveShotSuggestion:
    """A live shot that a replay may show.

    Attributes:
        recording: Id of its recording.
        name: Name of its recording.
        first, last: Numbers of its frames.
        why: What speaks for it and against it, a sentence.
        link: Id of the link of the two where there is one.
        apart_m: Median distance of the places on the grass at which both cameras look, metres; None: cameras are not
            tracked.
        turned: Whether that is so once the cameras of the replay are turned by half a turn of the pitch.
    """

    recording: int
    name: str
    first: int
    last: int
    why: str
    link: int | None
    apart_m: float | None = None
    turned: bool = False


@dataclass(frozen=True)
class _LiveShotCandidate:
    recording: Recording
    shot: Shot
    seconds: float
    before: float | None
    """Seconds from its end to the replay; None: another recording, of which nothing says."""


def suggest_live_shots(store: Store, recording_id: int, frame: int) -> list[LiveShotSuggestion]:
    """Live shots that the replay at a frame may show, the likeliest first.

    They are shots of the main camera: those of the replay's half that end before it in its own recording, then those
    of other recordings of the dataset. Where cameras are tracked, those come first that look where the replay looks,
    and those last that look elsewhere; else the nearest in time come first.

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
        raise InputError(f"frame {frame} does not belong to any shot", pointer="/frame")
    replay, (start, end) = found
    half = _find_match_half(mine.recording.clocks, replay.first)
    candidates = [
        _LiveShotCandidate(mine.recording, shot, last - first, start - last)
        for shot, (first, last) in timed
        if shot.kind == "main"
        and shot.last < replay.first
        and shot.kept is not False
        and _find_match_half(mine.recording.clocks, shot.first) == half
    ]
    candidates.sort(key=lambda one: one.before or 0.0)
    candidates += _list_shots_of_other_recordings(
        store, mine.recording, half, LIKENED - len(candidates)
    )
    paths = _ViewPathCache(store)
    path = paths.find_longest_path(mine.recording, replay)
    known = {
        (one.live.recording, one.live.first): one.id
        for one in list_links(store, recording_id)
        if one.replay.recording == recording_id and one.replay.first == replay.first
    }
    ranked: list[tuple[tuple[float, ...], LiveShotSuggestion]] = []
    for number, one in enumerate(candidates):
        like = None
        if path is not None and number < LIKENED:
            live = paths.find_longest_path(one.recording, one.shot)
            like = None if live is None else compare_paths(live, path)
        short = one.seconds < SLOWEST * (end - start)
        rank = _compute_rank_key(like)
        ranked.append(
            (
                (one.before is None and rank[0] > 0, short, *rank, number),
                LiveShotSuggestion(
                    one.recording.id,
                    one.recording.name,
                    one.shot.first,
                    one.shot.last,
                    _explain_suggestion(one, short, like),
                    known.get((one.recording.id, one.shot.first)),
                    None if like is None else like.apart_m,
                    like is not None and like.turned,
                ),
            )
        )
    return [suggestion for _, suggestion in sorted(ranked, key=lambda item: item[0])][:SUGGESTED]


def _find_match_half(clocks: Sequence[MatchClockReading], frame: int) -> int | None:
    """The half of the match in a frame; None where nobody read the clock."""
    clock = find_clock_at_frame(clocks, frame)
    return None if clock is None else clock.half


def _list_shots_of_other_recordings(
    store: Store, mine: Recording, half: int | None, most: int
) -> list[_LiveShotCandidate]:
    """Main shots of other recordings, but for those of which the clock says another half."""
    found: list[_LiveShotCandidate] = []
    for recording in list_recordings(store, mine.dataset_id):
        if len(found) >= most:
            break
        if recording.id == mine.id or not recording.indexed:
            continue
        listed = get_shots(store, recording.id)
        for shot, (first, last) in zip(listed.items, listed.times, strict=True):
            there = _find_match_half(recording.clocks, shot.first)
            if shot.kind == "main" and (half is None or there in (half, None)):
                found.append(_LiveShotCandidate(recording, shot, last - first, None))
    return found[: max(most, 0)]


def _compute_rank_key(like: PathComparison | None) -> tuple[float, float]:
    """What a likeness says first, and by how much: the smaller, the likelier."""
    if like is None or ALIKE_M < like.apart_m <= UNLIKE_M:
        return 1.0, 0.0
    if like.apart_m > UNLIKE_M:
        return 2.0, 0.0
    return 0.0, like.apart_m // _ROUND_M


def _explain_suggestion(one: _LiveShotCandidate, short: bool, like: PathComparison | None) -> str:
    if one.before is None:
        told = f"Main camera of {one.recording.name}; the time of this shot is not known"
    else:
        told = f"Main camera, {one.seconds:.1f} s long, ends {one.before:.1f} s before the replay"
    told += ", shorter than a replay of this length shows." if short else "."
    if like is None:
        return told
    if like.apart_m > UNLIKE_M:
        return f"{told} It shows another part of the pitch, at least {like.apart_m:.0f} m away."
    turned = ", if the replay is turned to the other side" if like.turned else ""
    return f"{told} At speed {like.speed:.2g}, both show places {like.apart_m:.0f} m apart{turned}."


class _ViewPathCache:
    """Where the cameras of shots look, as far as they are tracked."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._stretches: dict[int, list[ShotCameras]] = {}

    def find_longest_path(self, recording: Recording, shot: Shot) -> ViewPath | None:
        """The path of the stretch with the most frames of a shot; None where none is tracked."""
        if recording.id not in self._stretches:
            self._stretches[recording.id] = list_shot_cameras(self._store, recording.id)
        inside = [
            (min(one.last, shot.last) - max(one.first, shot.first), one.digest)
            for one in self._stretches[recording.id]
            if not one.stale and one.first <= shot.last and shot.first <= one.last
        ]
        if not inside:
            return None
        _, digest = max(inside)
        try:
            return _read_view_path(
                cameras_file_path(self._store.settings, digest), shot.first, shot.last
            )
        except ConflictError:
            return None


@lru_cache(maxsize=512)
def _read_view_path(place: Path, first: int, last: int) -> ViewPath:
    frames = [one for one in read_cameras_file(place) if first <= one.number <= last]
    return compute_view_path([one.time for one in frames], [one.camera for one in frames])
