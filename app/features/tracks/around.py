"""A track around one frame as its groups are now: what an edit changes, told before the whole is made again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np

from app.db.session import Session
from app.db.store import Store
from app.errors import InputError, NotFoundError
from app.features.datasets.service import read_dataset_head
from app.features.people.visibility_queries import has_hidden_groups
from app.features.tracks.codec import TrackInputs, make_partial_track
from app.features.tracks.findings import map_groups_by_frame
from app.features.tracks.making import read_export_records
from app.features.tracks.queries import (
    GroupForTracking,
    find_dataset_match_and_key,
    find_track_row,
    list_group_keys_of_match,
    list_track_rows,
    read_group_states_by_match,
    read_groups_by_match,
    read_recording_shots,
)
from app.features.tracks.run_measurements import (
    collect_accepted_run_observations,
    list_accepted_runs,
)
from app.features.tracks.service import TrackedFrames
from app.features.tracks.stored import (
    Track,
    build_track_from_row,
    make_track_etag,
    parse_corrections,
    parse_track_summary,
)
from app.features.tracks.stretches import (
    GroupMeasurements,
    build_stretches,
    measure_group,
    parse_frame_number,
)
from app.geometry.camera import Camera
from app.soccer.pitch import Pitch
from app.tracking.ball_track import BallMeasurements, BallTrack, ViewErrors

AROUND = 25
"""Frames before and after the one that is asked for."""
_MARGIN = 10
"""Frames more that are tracked on either side, so that what is told knows what comes before and after."""


_MOST_KEPT = 500
"""Groups whose measurements are kept: people go from one to the next."""
_kept: dict[tuple[Any, ...], GroupMeasurements | None] = {}
_lock = Lock()


@dataclass(frozen=True)
class TrackOfGroup:
    """A track that a group is in, and its frame there."""

    track: Track
    frame: int


def find_tracks_of_group(store: Store, group_id: int) -> list[TrackOfGroup]:
    """The tracks that a group is in: at most one, unless stretches have changed.

    Who does not see all groups is told of none: a track says what was made of the others.

    Raises:
        NotFoundError: There is no such group.
    """
    with store.read() as session:
        place = find_dataset_match_and_key(session, group_id)
        if place is None:
            raise NotFoundError.group(group_id)
        if has_hidden_groups(place.dataset_id):
            return []
        frame = parse_frame_number(place.key)
        rows = [
            row
            for row in list_track_rows(session, place.dataset_id, [place.match])
            if frame is not None and row.first <= frame <= row.last
        ]
        if frame is None or not rows:
            return []
        head = read_dataset_head(session, place.dataset_id)
        groups = read_group_states_by_match(session, head.id, [place.match]).get(place.match, [])
        runs = list_accepted_runs(session, head.id).get(place.match, ())
        shots = read_recording_shots(session, head.id).get(place.match)
        return [
            TrackOfGroup(build_track_from_row(row, head.policy, groups, runs, shots), frame)
            for row in rows
        ]


@dataclass(frozen=True)
class TrackExcerpt(TrackedFrames):
    """What was tracked around a frame: ``ball`` and ``inputs`` have the frames around it alone, and a reason
    where no track comes of them.

    Attributes:
        frame: In the middle.
    """

    frame: int


def compute_track_excerpt(store: Store, track_id: int, frame: int | None = None) -> TrackExcerpt:
    """A track in the frames around one of its own, from its groups as they are now; nothing is stored.

    Args:
        store: The database.
        track_id: Which.
        frame: In the middle; None: the worst of the track, else its first.

    Raises:
        NotFoundError: There is no such track.
        InputError: It has no such frame.
    """
    with store.read() as session:
        row = find_track_row(session, track_id)
        if row is None:
            raise NotFoundError(f"there is no track {track_id}")
        head, summary = read_dataset_head(session, int(row.dataset_id)), parse_track_summary(row)
        if frame is None:
            frame = int(row.first) if summary.worst is None else summary.worst
        if not row.first <= frame <= row.last:
            raise InputError(
                f'frame {frame} is not in the track "{row.key}", which has the frames {row.first}'
                f" to {row.last}"
            )
        first = max(int(row.first), frame - AROUND - _MARGIN)
        last = min(int(row.last), frame + AROUND + _MARGIN)
        ids = [
            identity
            for identity, key in list_group_keys_of_match(session, head.id, row.match)
            if (number := parse_frame_number(key)) is not None and first <= number <= last
        ]
        groups = read_groups_by_match(session, head.id, [row.match], ids).get(row.match, [])
        near = map_groups_by_frame(groups, first, last)
        measured = _measure_cached_groups(session, list(near.values()), head.policy.hash)
        runs = list_accepted_runs(session, head.id).get(row.match, [])
        close = {row.match: [run for run in runs if run.first <= last and first <= run.last]}
        followed = {
            match: [one for one in items if first <= one.frame <= last]
            for match, items in collect_accepted_run_observations(
                session, store.settings, close, head.policy
            ).items()
        }
    # One stretch, however far apart its groups are.
    shots = {row.match: [(int(row.first), int(row.last))]}
    stretches = build_stretches(measured, head.policy, shots, followed)
    if not stretches:
        ball, inputs = _make_empty_track(summary.rate, first, last)
    else:
        corrections = (item for item in parse_corrections(row) if first <= item.frame <= last)
        inputs = TrackInputs.of(stretches[0], corrections)
        ball = make_partial_track(inputs, ViewErrors(summary.noise, summary.late))
    return TrackExcerpt(make_track_etag(row), ball, inputs, near, frame)


def _measure_cached_groups(
    session: Session, groups: Sequence[GroupForTracking], policy: str
) -> list[GroupMeasurements]:
    """What groups give; those that were read before for a frame near by are not read again."""
    key_of = {group.key: (group.id, group.source, group.state, policy) for group in groups}
    with _lock:
        found = {key: _kept[said] for key, said in key_of.items() if said in _kept}
    missing = [group for group in groups if group.key not in found]
    new: dict[tuple[Any, ...], GroupMeasurements | None] = {}
    known: dict[bytes, Camera] = {}
    for record in read_export_records(session, missing):
        measured = found[record.group.key] = measure_group(record, known)
        # What is not solved by now may be solved without another change.
        if record.solution is not None:
            new[key_of[record.group.key]] = measured
    with _lock:
        _kept.update(new)
        for said in list(_kept)[: max(len(_kept) - _MOST_KEPT, 0)]:
            del _kept[said]
    every = (found.get(group.key) for group in groups)
    return [one for one in every if one is not None]


def _make_empty_track(rate: float, first: int, last: int) -> tuple[BallTrack, TrackInputs]:
    """No ball in some frames, whose groups are all rejected."""
    frames = np.arange(first, last + 1)
    times, empty = frames / rate, np.zeros(0)
    measured = BallMeasurements(np.zeros(0, dtype=np.int64), empty, (), np.zeros((0, 2)), empty, ())
    reason = "No group near this frame is part of the track."
    return BallTrack.make_empty_track(frames, times, reason), TrackInputs(
        frames, times, Pitch(), measured
    )
