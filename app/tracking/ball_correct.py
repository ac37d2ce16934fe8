"""Correct: a track solved anew around the events that people added and removed.

Each part is solved between instants that the rest of the track holds; what lies farther off stays as it is.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import BoolArray, IntArray
from app.soccer.pitch import Pitch
from app.tracking.ball_constraints import EventConstraint, PlaceConstraint, TrackConstraints
from app.tracking.ball_join import join_runs
from app.tracking.ball_models import BOUNCE, KICK, REST
from app.tracking.ball_prediction import summarize_prediction_errors
from app.tracking.ball_solve import track_ball
from app.tracking.ball_solve_run import TrackOptions, solve_run, split_into_runs
from app.tracking.ball_track import (
    BallEvent,
    BallMeasurements,
    BallMode,
    BallTrack,
    EventCorrection,
    ViewErrors,
)

NEAR_FRAMES = 3
"""Between an event and the frame in which a person says of it."""
_KINDS = {"kick": KICK, "bounce": BOUNCE}
_LEAST_S, _MOST_S = 0.6, 2.5
"""How far around a correction a track is solved anew: at least, and where no two views see the ball."""
_CLEAR_S = 0.1
"""Between an event and the end of such a part."""
_HELD_S = 0.5
"""Beyond it what is measured takes part, too; there the rest of the track holds the ball."""
_SHARED = 2.0
"""Times its covariance that the rest of the track holds the ball: it was made of these measurements, too."""
_LEAST_HELD_M = 0.01
_LINE_SIGMA_M = 0.5
"""How far a ball that is said to be out is beyond the line: it moves on until the next frame."""
_LOW_M = 0.5
"""Height below which a ball that is not out rolls."""


@dataclass(frozen=True)
class TrackPatch:
    """A part of a track that corrections changed.

    Attributes:
        corrections: Which.
        rows: Measurements of its frames.
        part: The track of its frames; ``contradicted`` names rows of all measurements, ``left_out.px``
            is by ``rows``.
    """

    corrections: tuple[EventCorrection, ...]
    rows: IntArray
    part: BallTrack


def correct_track(
    track: BallTrack,
    measurements: BallMeasurements,
    pitch: Pitch,
    corrections: Iterable[EventCorrection],
    known: Sequence[TrackPatch] = (),
) -> tuple[TrackPatch, ...]:
    """The parts of a track that corrections change, solved anew.

    Events that were added are forced into the search and the fit near their frames, those that were
    removed are forbidden there, and a ball that is said to be out is at a line. What the measurements
    say nothing of is not changed.

    Args:
        track: Made of the measurements without corrections.
        measurements: Of the stretch.
        pitch: Where the ball is played.
        corrections: In any order; frames that the track has not are left out.
        known: Parts of this track that were solved before: those of the same corrections are taken.
    """
    rows = {int(frame): row for row, frame in enumerate(track.frames)}
    wanted = sorted(
        (item for item in set(corrections) if item.frame in rows),
        key=lambda item: (item.frame, item.kind, item.added),
    )
    if not wanted:
        return ()
    if track.reason is not None:
        return _solve_whole_track(track, measurements, pitch, tuple(wanted))
    before = {
        (item.corrections, int(item.part.frames[0]), len(item.part.frames)): item for item in known
    }
    found = []
    for first, last, said in _group_corrections(
        track, [(rows[item.frame], item) for item in wanted]
    ):
        patch = before.get((said, int(track.frames[first]), last - first + 1))
        patch = patch or _solve_rows(track, measurements, pitch, first, last, said)
        if patch is not None:
            found.append(patch)
    return tuple(found)


def apply_patches(
    track: BallTrack,
    measurements: BallMeasurements,
    patches: Sequence[TrackPatch],
    corrections: Iterable[EventCorrection],
) -> BallTrack:
    """A track with its corrections.

    Args:
        track: Made of the measurements without corrections.
        measurements: Of the stretch.
        patches: As ``correct_track`` made them.
        corrections: All of them: an event that the measurements say nothing of stands where the ball is.
    """
    for patch in patches:
        track = _splice_patch(track, measurements, patch)
    return _apply_event_corrections(
        track, sorted(corrections, key=lambda item: (item.frame, item.kind, item.added))
    )


def is_near_correction(
    event: BallEvent, corrections: Iterable[EventCorrection], added: bool
) -> bool:
    """Whether an event is one that a person added, or removed."""
    return any(
        item.added == added
        and item.kind == event.kind
        and abs(item.frame - event.frame) <= NEAR_FRAMES
        for item in corrections
    )


def _solve_whole_track(
    track: BallTrack,
    measurements: BallMeasurements,
    pitch: Pitch,
    said: tuple[EventCorrection, ...],
) -> tuple[TrackPatch, ...]:
    """What is said may give a track where measurements alone say none."""
    events = tuple(_build_event_constraints(track, said))
    if not events:
        return ()
    found = track_ball(
        measurements, track.frames, track.times, pitch=pitch, said=TrackConstraints(events)
    )
    if found.reason is not None:
        return ()
    return (TrackPatch(said, np.arange(len(measurements)), found),)


def _group_corrections(
    track: BallTrack, wanted: Sequence[tuple[int, EventCorrection]]
) -> Iterator[tuple[int, int, tuple[EventCorrection, ...]]]:
    """First and last rows that are solved anew together, with their corrections."""
    first = last = -1
    said: list[EventCorrection] = []
    for row, item in wanted:
        begin, end = _find_end_of_new_solve(track, row, -1), _find_end_of_new_solve(track, row, 1)
        if said and begin > last:
            yield first, last, tuple(said)
            said = []
        first, last = (min(first, begin), max(last, end)) if said else (begin, end)
        said.append(item)
    yield first, last, tuple(said)


def _find_end_of_new_solve(track: BallTrack, row: int, step: int) -> int:
    """The row up to which a track is solved anew: as far as no two views see the ball."""
    times, at = track.times, row
    events = np.array([event.time_s for event in track.events])
    while 0 <= at + step < len(times):
        gone = abs(float(times[at + step] - times[row]))
        clear = not len(events) or np.abs(events - times[at]).min() > _CLEAR_S
        if gone > _MOST_S or (gone > _LEAST_S and clear and track.state[at] == "measured"):
            break
        at += step
    return at


def _solve_rows(
    track: BallTrack,
    measurements: BallMeasurements,
    pitch: Pitch,
    first: int,
    last: int,
    corrections: tuple[EventCorrection, ...],
) -> TrackPatch | None:
    """The rows from one to another, solved anew; None where measurements say nothing of them."""
    times, frames = track.times, track.frames
    begin = int(np.searchsorted(times, times[first] - _HELD_S))
    end = int(np.searchsorted(times, times[last] + _HELD_S, "right")) - 1
    around = (measurements.frames >= frames[begin]) & (measurements.frames <= frames[end])
    numbers = np.flatnonzero(around)
    if not len(numbers):
        return None
    near, options = measurements.part(numbers), TrackOptions()
    known = ViewErrors(dict(track.noise), dict(track.offsets))
    shift = known.time_shifts(near.view_names)
    said = TrackConstraints(
        tuple(_build_event_constraints(track, corrections)),
        tuple(_build_place_constraints(track, begin, end, first, last, corrections, pitch)),
    )
    own = slice(begin, end + 1)
    runs = [
        solve_run(near, rows, times[own], shift, pitch, options, said, known)
        for rows in split_into_runs(near.times, options.longest_gap_s)
    ]
    if all(run.fitted is None for run in runs):
        return None
    part = join_runs(near, frames[own], times[own], runs, shift, pitch, options)
    # Where this says nothing, what the whole track said stays.
    for run in runs:
        if run.fitted is None:
            low, high = near.times[run.rows].min(), near.times[run.rows].max()
            lost = (times[own] > low - options.beyond_s) & (times[own] < high + options.beyond_s)
            rows = np.flatnonzero(lost & ~_has_position(part))
            part = _replace_rows(part, rows, track, rows + begin)
    inner = (near.frames >= frames[first]) & (near.frames <= frames[last])
    rows = np.arange(first, last + 1) - begin
    left = part.left_out
    assert left is not None
    px = left.px[inner]
    cut = BallTrack(
        part.frames[rows],
        part.times[rows],
        part.position[rows],
        part.velocity[rows],
        part.covariance[rows],
        tuple(part.state[row] for row in rows),
        tuple(part.mode[row] for row in rows),
        tuple(part.views[row] for row in rows),
        tuple(event for event in part.events if frames[first] <= event.frame <= frames[last]),
        tuple(
            replace(item, measurement=int(numbers[item.measurement]))
            for item in part.contradicted
            if inner[item.measurement]
        ),
        None,
        summarize_prediction_errors(px, near.frames[inner], part.frames[rows]),
        jumps=tuple(jump for jump in part.jumps if frames[first] <= jump.frame <= frames[last]),
    )
    return TrackPatch(corrections, numbers[inner], cut)


def _build_event_constraints(
    track: BallTrack, corrections: Iterable[EventCorrection]
) -> Iterator[EventConstraint]:
    """Kicks and bounces that are forced and forbidden; where both are said, both hold."""
    step = _frame_interval_s(track)
    for item in corrections:
        if item.kind in _KINDS:
            at = float(track.times[item.frame - track.frames[0]])
            # People see an event in a frame, and not when between two of them.
            slack = step / 2 if item.added else NEAR_FRAMES * step
            yield EventConstraint(_KINDS[item.kind], at - slack, at + slack, item.added)


def _build_place_constraints(
    track: BallTrack,
    begin: int,
    end: int,
    first: int,
    last: int,
    corrections: Iterable[EventCorrection],
    pitch: Pitch,
) -> Iterator[PlaceConstraint]:
    """Where the rest of the track holds the ball, and the lines at which it is said to be out."""
    known = _has_position(track)
    for rows in (range(begin, first), range(end, last, -1)):
        row = next((row for row in rows if known[row]), None)
        if row is None:
            continue
        spread = _SHARED * track.covariance[row, :3, :3]
        # The upper half alone: the lower one is not stored.
        values, axes = np.linalg.eigh(spread, UPLO="U")
        for value, axis in zip(values, axes.T, strict=True):
            sigma = max(float(np.sqrt(max(value, 0.0))), _LEAST_HELD_M)
            place = float(axis @ track.position[row])
            x, y, z = axis.tolist()
            yield PlaceConstraint(float(track.times[row]), (x, y, z), place, sigma)
    for item in corrections:
        row = int(item.frame - track.frames[0])
        if item.kind == "out" and item.added and known[row]:
            x, y, _ = track.position[row].tolist()
            over = abs(x) - pitch.length / 2 > abs(y) - pitch.width / 2
            normal = (
                (1.0 if x > 0 else -1.0, 0.0, 0.0) if over else (0.0, 1.0 if y > 0 else -1.0, 0.0)
            )
            line = (pitch.length if over else pitch.width) / 2 + REST
            yield PlaceConstraint(float(track.times[row]), normal, line, _LINE_SIGMA_M)


def _frame_interval_s(track: BallTrack) -> float:
    """Seconds from frame to frame."""
    return float(np.median(np.diff(track.times))) if len(track.times) > 1 else 0.0


def _has_position(track: BallTrack) -> BoolArray:
    return np.asarray(np.isfinite(track.position).all(axis=1))


def _replace_rows(
    track: BallTrack, rows: IntArray, other: BallTrack, places: IntArray
) -> BallTrack:
    """A track with the ball of some of its rows as another one has it in as many."""
    position, velocity = track.position.copy(), track.velocity.copy()
    covariance = track.covariance.copy()
    position[rows], velocity[rows] = other.position[places], other.velocity[places]
    covariance[rows] = other.covariance[places]
    state, mode, views = list(track.state), list(track.mode), list(track.views)
    for row, place in zip(rows.tolist(), places.tolist(), strict=True):
        state[row], mode[row], views[row] = (
            other.state[place],
            other.mode[place],
            other.views[place],
        )
    return replace(
        track,
        position=position,
        velocity=velocity,
        covariance=covariance,
        state=tuple(state),
        mode=tuple(mode),
        views=tuple(views),
    )


def _splice_patch(track: BallTrack, measurements: BallMeasurements, patch: TrackPatch) -> BallTrack:
    part = patch.part
    if track.reason is not None:
        return part
    first, last = int(part.frames[0]), int(part.frames[-1])
    rows = np.arange(len(part.frames))
    whole = _replace_rows(track, rows + first - int(track.frames[0]), part, rows)
    taken = set(patch.rows.tolist())
    beside = [event for event in track.events if not first <= event.frame <= last]
    jumps = [jump for jump in track.jumps if not first <= jump.frame <= last]
    against = [item for item in track.contradicted if item.measurement not in taken]
    left = track.left_out
    if left is not None and part.left_out is not None:
        px = left.px.copy()
        px[patch.rows] = part.left_out.px
        left = summarize_prediction_errors(px, measurements.frames, track.frames)
    return replace(
        whole,
        events=tuple(sorted([*beside, *part.events], key=lambda event: event.time_s)),
        contradicted=tuple(
            sorted([*against, *part.contradicted], key=lambda item: item.measurement)
        ),
        left_out=left,
        jumps=tuple(sorted([*jumps, *part.jumps], key=lambda jump: jump.time_s)),
    )


def _apply_event_corrections(track: BallTrack, corrections: Sequence[EventCorrection]) -> BallTrack:
    """A track with the events that people added and without those they removed."""
    events, mode = list(track.events), list(track.mode)
    rows = {int(frame): row for row, frame in enumerate(track.frames)}
    for item in corrections:
        row = rows.get(item.frame)
        if row is None:
            continue
        if not item.added:
            gone = [
                event
                for event in events
                if is_near_correction(event, [item], added=False)
                and not is_near_correction(event, corrections, added=True)
            ]
            events = [event for event in events if all(event is not other for other in gone)]
            if item.kind == "out" and gone:
                _set_in_play_from(track, mode, rows[gone[0].frame])
        elif np.isfinite(track.position[row]).all() and not any(
            is_near_correction(event, [item], added=True) for event in events
        ):
            time, half = float(track.times[row]), _frame_interval_s(track) / 2
            events.append(BallEvent(item.frame, time, item.kind, track.position[row], half))
    events.sort(key=lambda event: event.time_s)
    return replace(track, events=tuple(events), mode=tuple(mode))


def _set_in_play_from(track: BallTrack, mode: list[BallMode], row: int) -> None:
    """Let a ball that somebody says is not out do what its height says, from a row on."""
    while row < len(mode) and mode[row] != "out":
        row += 1
    while row < len(mode) and mode[row] == "out":
        mode[row] = "flight" if -track.position[row, 2] > _LOW_M else "roll"
        row += 1
