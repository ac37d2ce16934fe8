"""Tracks of the ball: one a stretch, made in a job, judged and corrected by people."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np

from app.canonical import canonical
from app.db.json_columns import Json, as_written, pack, parse, unpack
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.audit.audit_events import add_audit_event
from app.features.datasets.service import DatasetHead, read_dataset_head
from app.features.groups.digest import digest
from app.features.groups.state import read_states, require_etag
from app.features.tracks.codec import (
    TRACK_VERSION,
    Correction,
    TrackInputs,
    corrected,
    corrections_from_json,
    corrections_to_json,
    frozen_track,
    inputs_digest,
    inputs_from_json,
    inputs_to_json,
    make_track,
    track_from_json,
    track_to_json,
)
from app.features.tracks.export import KnownTrack, TrackSource
from app.features.tracks.queries import (
    TrackGroup,
    delete_tracks,
    find_row,
    insert_track,
    list_rows,
    match_groups,
    read_bodies,
    recording_shots,
    update_track,
)
from app.features.tracks.stretches import (
    Stretch,
    frame_of,
    gather_stretches,
    instant_of,
    require_stretch,
)
from app.formats.export_record import ExportRecord
from app.progress import ReportProgress
from app.soccer.policy import Policy
from app.soccer.reasons import checked_note
from app.soccer.solution import SOLVER_VERSION
from app.tracking.ball_track import BallTrack

BATCH = 200
MOST_CORRECTIONS = 2000
Verdict = Literal["accepted", "rejected"]


@dataclass(frozen=True)
class TrackSummary:
    """What a list says of a track.

    Attributes:
        frames: Of its stretch.
        states: How many of them are ``measured``, ``one_view``, ``predicted``, ``bridged`` and ``gap``.
        events: How many there are, by kind, without corrections.
        measurements: What views measured.
        contradicted: Measurements that took no part because the track does not explain them.
        median_px, p95_px: Of what was left out in turn and predicted; None where nothing was.
        worst: Frame with the largest such error; None where there is none.
        reason: Why there is no track; None where there is one.
        rate: Frames a second.
        unused: Balls that are no measurement, counted by reason.
    """

    frames: int
    states: dict[str, int]
    events: dict[str, int]
    measurements: int
    contradicted: int
    median_px: float | None
    p95_px: float | None
    worst: int | None
    reason: str | None
    rate: float
    unused: dict[str, int]


@dataclass(frozen=True)
class Track:
    """The track of a stretch, without its frames.

    Attributes:
        key: Of the stretch; unique in its dataset.
        match: Of its groups.
        first, last: Its first and last frame.
        stale: Whether its groups have changed since, so that another track would come of them.
        corrections: Events that people added, and removed.
        summary: What came of it.
        revision: How often something was said of it, or it was made anew.
    """

    id: int
    dataset_id: int
    dataset: str
    key: str
    match: str
    first: int
    last: int
    stale: bool
    verdict: Verdict | None
    note: str | None
    judged_by: str | None
    judged_at: str | None
    corrections: tuple[Correction, ...]
    summary: TrackSummary
    actor: str
    created: str
    revision: int
    etag: str


@dataclass(frozen=True)
class TrackDetail:
    """A track with all that its page shows.

    Attributes:
        track: The track.
        ball: Its values, with corrections.
        inputs: What it was computed from.
        groups: The group of each frame that has one.
    """

    track: Track
    ball: BallTrack
    inputs: TrackInputs
    groups: Mapping[int, TrackGroup]


@dataclass(frozen=True)
class TrackChange:
    """What a person says of a track; what is None stays as it is.

    Attributes:
        verdict: ``none`` takes a verdict back.
        note: Why.
        corrections: All of them.
    """

    verdict: Literal["accepted", "rejected", "none"] | None = None
    note: str | None = None
    corrections: tuple[Correction, ...] | None = None


@dataclass
class MadeTracks:
    """What came of making tracks.

    Attributes:
        made: Stretches that were tracked.
        unchanged: Those whose track is what would come of them again.
        without: Stretches without a track, with the reason.
    """

    made: int = 0
    unchanged: int = 0
    without: list[dict[str, str]] = field(default_factory=list)


def list_tracks(store: Store, dataset: str | int) -> list[Track]:
    """The tracks of a dataset, by match and frame."""
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        rows = list_rows(session, found.id)
        groups = match_groups(session, found.id, {row.match for row in rows}) if rows else {}
        return [_track(row, found.policy, groups.get(row.match, ())) for row in rows]


def get_track(store: Store, track_id: int) -> Track:
    """A track by its id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return _read(session, track_id)[0]


def read_track(store: Store, track_id: int) -> TrackDetail:
    """A track with its frames.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        track, groups = _read(session, track_id)
        inputs, body = read_bodies(session, [track_id])[track_id]
    ball = corrected(track_from_json(unpack(body)), track.corrections)
    return TrackDetail(track, ball, inputs_from_json(unpack(inputs)), _by_frame(track, groups))


def change_track(
    store: Store, track_id: int, change: TrackChange, if_match: str, *, actor: str
) -> Track:
    """Accept or reject a track, or correct its events.

    Args:
        store: The database.
        track_id: Which.
        change: What is said.
        if_match: ETag of the track that the change builds on.
        actor: Who says so.

    Raises:
        NotFoundError: There is no such track.
        StaleRevisionError: Somebody changed it meanwhile, or it was made anew.
        ConflictError: It is accepted though it is stale, or though there is none.
        InputError: Nothing is changed, or a correction is outside of the stretch.
    """
    if change.verdict is None and change.corrections is None:
        raise InputError(
            "this changes nothing of the track",
            hint="Send a verdict, with a note where there is something to say, or corrections.",
        )
    with store.write() as session:
        track, _ = _read(session, track_id)
        require_etag(track.etag, if_match, f'the track "{track.key}"')
        values: dict[str, Any] = {"revision": track.revision + 1}
        if change.corrections is not None:
            values["corrections"] = _checked(track, change.corrections)
            # What was accepted is not what it is now.
            values |= dict.fromkeys(("verdict", "note", "judged_by", "judged_at"))
        if change.verdict is not None:
            if change.verdict == "accepted":
                _require_acceptable(track)
            if change.verdict == "none":
                values |= dict.fromkeys(("verdict", "note", "judged_by", "judged_at"))
            else:
                note = checked_note(change.note or "")
                values |= {"verdict": change.verdict, "note": note, "judged_by": actor}
                values["judged_at"] = now()
        update_track(session, track_id, **values)
        did = f"track {change.verdict}" if change.verdict else "track corrected"
        add_audit_event(session, actor, did, track.dataset_id, track=track_id, name=track.key)
        found, _ = _read(session, track_id)
        session.respond(found)
    return found


def make_tracks(
    store: Store,
    dataset: str | int,
    matches: Collection[str] | None,
    actor: str,
    progress: ReportProgress,
) -> MadeTracks:
    """Track the ball over all stretches of a dataset, or of some matches, and store the tracks.

    What people corrected stays; a verdict holds for the track that it was given to. Killed anywhere and
    started again, it ends in the same state.

    Raises:
        InputError: No groups follow each other in time, or two of a stretch are one frame.
    """
    made = MadeTracks()
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        shots = recording_shots(session, found.id)
        groups = match_groups(session, found.id, matches)
        timed = {name: items for name, items in groups.items() if _says_time(session, items)}
        total, done = sum(map(len, timed.values())), 0
        stretches: list[Stretch] = []
        for items in timed.values():
            records = []
            for record in _records(session, items):
                records.append(record)
                if len(records) % BATCH == 0:
                    progress(done + len(records), total)
            done += len(items)
            stretches += gather_stretches(records, found.policy, shots)
        stored = {row.key: row for row in list_rows(session, found.id)}
    require_stretch(found.name, stretches)
    for tracked, stretch in enumerate(stretches, 1):
        stamp = _stamp(found.policy, groups[stretch.match], stretch.frames[0], stretch.frames[-1])
        inputs = TrackInputs.of(stretch)
        row, key = stored.get(stretch.key), inputs_digest(inputs)
        if row is not None and row.digest == key:
            with store.write() as session:
                update_track(session, row.id, stamp=stamp)
            made.unchanged += 1
            reason = parse(row.summary)["reason"]
        else:
            track = make_track(inputs)
            values = _values(stretch, inputs, track) | {"stamp": stamp, "digest": key}
            _save(store, found, stretch, values, actor)
            made.made += 1
            reason = track.reason
        if reason is not None:
            made.without.append({"stretch": stretch.key, "reason": reason})
        progress(done, total, f"{tracked} of {len(stretches)} stretches tracked.")
    _forget(store, found, {stretch.key for stretch in stretches}, matches)
    return made


def accepted_tracks(session: Session, dataset: DatasetHead) -> dict[str, Json]:
    """The tracks of a dataset that people accepted as its groups are now, by stretch, each with all that it
    was computed from (``codec.frozen_track``)."""
    rows = [row for row in list_rows(session, dataset.id) if row.verdict == "accepted"]
    groups = match_groups(session, dataset.id, {row.match for row in rows}) if rows else {}
    found = {}
    for row in rows:
        track = _track(row, dataset.policy, groups.get(row.match, ()))
        if track.stale:
            continue
        inputs, body = (unpack(part) for part in read_bodies(session, [row.id])[row.id])
        whole = replace(inputs_from_json(inputs), corrections=track.corrections)
        found[row.key] = frozen_track(whole, corrected(track_from_json(body), track.corrections))
    return found


def track_source(
    session: Session,
    dataset_id: int,
    dataset: str,
    policy: Policy,
    frozen: Mapping[str, Json] | None = None,
) -> TrackSource:
    """What makes the tracks of an export.

    Args:
        session: Any session.
        dataset_id: Of the dataset.
        dataset: Its name.
        policy: Says how noisy clicks and cameras are.
        frozen: The tracks of a frozen version by stretch (``codec.frozen_track``); None: the dataset
            is exported as it is.
    """
    shots = recording_shots(session, dataset_id)
    if frozen is not None:
        tracks = {key: track_from_json(value["track"]) for key, value in frozen.items()}
        return TrackSource(dataset, policy, shots, frozen=tracks)
    rows = list_rows(session, dataset_id)
    bodies = read_bodies(session, [row.id for row in rows if row.verdict == "accepted"])
    known = {}
    for row in rows:
        corrections = _corrections(row)
        body = bodies.get(row.id)
        track = body and corrected(track_from_json(unpack(body[1])), corrections)
        known[row.key] = KnownTrack(row.digest, track or None, row.verdict, corrections)
    return TrackSource(dataset, policy, shots, known)


def _records(session: Session, groups: Sequence[TrackGroup]) -> Iterator[ExportRecord]:
    """Groups with their solutions; those that people rejected measure nothing."""
    ids = [group.id for group in groups if not group.rejected]
    for start in range(0, len(ids), BATCH):
        for state in read_states(session, ids[start : start + BATCH], markings=False):
            yield ExportRecord(state.group, state.solution, state.verdict.state)


def _says_time(session: Session, groups: Sequence[TrackGroup]) -> bool:
    """Whether a match's groups follow each other in time, by the first of them."""
    first = next(iter(_records(session, groups[:1])), None)
    return first is None or instant_of(first.group) is not None


def _read(session: Session, track_id: int) -> tuple[Track, list[TrackGroup]]:
    row = find_row(session, track_id)
    if row is None:
        raise NotFoundError(f"there is no track {track_id}")
    found = read_dataset_head(session, int(row.dataset_id))
    groups = match_groups(session, found.id, [row.match]).get(row.match, [])
    return _track(row, found.policy, groups), groups


def _track(row: Any, policy: Policy, groups: Iterable[TrackGroup]) -> Track:
    with as_written():
        summary = TrackSummary(**parse(row.summary))
    return Track(
        id=row.id,
        dataset_id=row.dataset_id,
        dataset=row.dataset,
        key=row.key,
        match=row.match,
        first=row.first,
        last=row.last,
        stale=row.stamp != _stamp(policy, groups, row.first, row.last),
        verdict=row.verdict,
        note=row.note,
        judged_by=row.judged_by,
        judged_at=row.judged_at,
        corrections=_corrections(row),
        summary=summary,
        actor=row.actor,
        created=row.created,
        revision=row.revision,
        etag=f'"{digest([row.digest, row.revision])[:16]}"',
    )


def _corrections(row: Any) -> tuple[Correction, ...]:
    with as_written():
        return corrections_from_json(parse(row.corrections))


def _stamp(policy: Policy, groups: Iterable[TrackGroup], first: int, last: int) -> str:
    """A digest of what a stretch's track depends on, without computing it."""
    states = [
        [group.key, *group.state]
        for group in groups
        if (frame := frame_of(group.key)) is not None and first <= frame <= last
    ]
    return digest([TRACK_VERSION, SOLVER_VERSION, policy.hash, states])


def _by_frame(track: Track, groups: Iterable[TrackGroup]) -> dict[int, TrackGroup]:
    found = {frame_of(group.key): group for group in groups}
    return {
        frame: group
        for frame, group in found.items()
        if frame is not None and track.first <= frame <= track.last
    }


def _values(stretch: Stretch, inputs: TrackInputs, track: BallTrack) -> dict[str, Any]:
    """The columns of what was computed."""
    left, worst = track.left_out, None
    if left is not None and np.isfinite(left.by_frame).any():
        worst = int(track.frames[np.nanargmax(left.by_frame)])
    kinds = [event.kind for event in track.events]
    summary = TrackSummary(
        frames=len(track.frames),
        states={state: track.state.count(state) for state in sorted(set(track.state))},
        events={kind: kinds.count(kind) for kind in sorted(set(kinds))},
        measurements=len(inputs.measurements),
        contradicted=len(track.contradicted),
        median_px=None if left is None else left.median_px,
        p95_px=None if left is None else left.p95_px,
        worst=worst,
        reason=track.reason,
        rate=stretch.rate,
        unused=dict(stretch.unused),
    )
    return {
        "inputs": pack(inputs_to_json(inputs)),
        "body": pack(track_to_json(track)),
        "summary": canonical(asdict(summary)),
        "first": int(stretch.frames[0]),
        "last": int(stretch.frames[-1]),
    }


def _save(
    store: Store, dataset: DatasetHead, stretch: Stretch, values: dict[str, Any], actor: str
) -> None:
    """Store a track; what was said of its verdict was said of another."""
    values |= {"actor": actor, "created": now(), "match": stretch.match}
    with store.write() as session:
        row = next((row for row in list_rows(session, dataset.id) if row.key == stretch.key), None)
        unjudged: dict[str, Json] = dict.fromkeys(("verdict", "note", "judged_by", "judged_at"))
        if row is not None:
            update_track(session, row.id, revision=row.revision + 1, **values, **unjudged)
            return
        fresh = {"dataset_id": dataset.id, "key": stretch.key, "corrections": "[]", "revision": 0}
        insert_track(session, {**values, **fresh, **unjudged})


def _forget(
    store: Store, dataset: DatasetHead, keys: Collection[str], matches: Collection[str] | None
) -> None:
    """Delete tracks of stretches that are no more, unless a person said something of them."""
    with store.write() as session:
        gone = [
            row.id
            for row in list_rows(session, dataset.id)
            if row.key not in keys and (matches is None or row.match in matches)
            if row.verdict is None and row.corrections == "[]"
        ]
        if gone:
            delete_tracks(session, gone)


def _require_acceptable(track: Track) -> None:
    if track.summary.reason is not None:
        raise ConflictError(
            f'the stretch "{track.key}" has no track ({track.summary.reason})',
            hint="Annotate the ball in more of its frames, and make its track again.",
        )
    if track.stale:
        raise ConflictError(
            f'groups of the track "{track.key}" have changed since it was made',
            hint="Make it again, and accept that one.",
        )


def _checked(track: Track, corrections: Sequence[Correction]) -> str:
    """Corrections as they are stored.

    Raises:
        InputError: One is outside of the stretch, or they are too many.
    """
    if len(corrections) > MOST_CORRECTIONS:
        raise InputError(
            f"a track has at most {MOST_CORRECTIONS:,} corrections", pointer="/corrections"
        )
    for number, item in enumerate(corrections):
        if not track.first <= item.frame <= track.last:
            raise InputError(
                f'frame {item.frame} is not of the track "{track.key}", {track.first} to {track.last}',
                pointer=f"/corrections/{number}/frame",
            )
    whole = sorted(set(corrections), key=lambda item: (item.frame, item.kind, item.added))
    return canonical(corrections_to_json(whole))
