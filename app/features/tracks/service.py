"""Tracks of the ball: one a stretch, made in a job, judged and corrected by people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from app.config import Settings
from app.db.json_columns import Json, compress_json, decompress_json, parse_json_column
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.audit.service import add_audit_event
from app.features.datasets.service import DatasetHead, read_dataset_head
from app.features.groups.state import require_etag
from app.features.tracks.codec import (
    TrackInputs,
    apply_corrections,
    corrections_from_json,
    corrections_to_text,
    frozen_track_to_json,
    inputs_from_json,
    patches_from_json,
    patches_to_json,
    solve_corrected_parts,
    track_from_json,
)
from app.features.tracks.export import StoredStretchTrack, TrackSource, parse_frozen_track
from app.features.tracks.findings import (
    TrackNotices,
    make_track_notices,
    map_groups_by_frame,
    save_notices,
)
from app.features.tracks.making import MadeTracks as MadeTracks
from app.features.tracks.making import make_tracks as make_tracks
from app.features.tracks.queries import (
    GroupForTracking,
    TrackBody,
    find_track_row,
    list_track_rows,
    read_group_states_by_match,
    read_groups_by_match,
    read_recording_shots,
    read_track_bodies,
    update_track,
)
from app.features.tracks.run_measurements import (
    collect_accepted_run_observations,
    list_accepted_runs,
)
from app.features.tracks.stored import (
    UNJUDGED,
    build_track_from_row,
    parse_corrections,
    summarize_track,
)
from app.features.tracks.stored import Track as Track
from app.features.tracks.stored import TrackSummary as TrackSummary
from app.json_text import canonical_json_text
from app.soccer.group import strip_and_check_note
from app.soccer.policy import Policy
from app.tracking.ball_correct import TrackPatch
from app.tracking.ball_track import BallTrack, EventCorrection

MOST_CORRECTIONS = 2000


@dataclass(frozen=True)
class TrackedFrames:
    """Frames of a track with all that is shown of them.

    Attributes:
        etag: Of the track.
        ball: Its values, with corrections.
        inputs: What it was computed from.
        groups: The group of each frame that has one.
    """

    etag: str
    ball: BallTrack
    inputs: TrackInputs
    groups: Mapping[int, GroupForTracking]


@dataclass(frozen=True)
class TrackDetail(TrackedFrames):
    """All frames of a track, with what a list says of it."""

    track: Track


@dataclass(frozen=True)
class TrackReview:
    """What a person says of a track; what is None stays as it is.

    Attributes:
        verdict: ``none`` takes a verdict back.
        note: Why.
        corrections: All of them.
    """

    verdict: Literal["accepted", "rejected", "none"] | None = None
    note: str | None = None
    corrections: tuple[EventCorrection, ...] | None = None


def list_tracks(store: Store, dataset: str | int) -> list[Track]:
    """The tracks of a dataset, by match and frame."""
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        rows = list_track_rows(session, found.id)
        return _build_tracks(session, found, rows)


def get_track(store: Store, track_id: int) -> Track:
    """A track by its id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return _read_track_and_groups(session, track_id)[0]


def read_track_detail(store: Store, track_id: int) -> TrackDetail:
    """A track with its frames.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        track, groups = _read_track_and_groups(session, track_id)
        body = read_track_bodies(session, [track_id])[track_id]
    inputs, ball = _build_ball_track(body, track.corrections)
    near = map_groups_by_frame(groups, track.first, track.last)
    return TrackDetail(track.etag, ball, inputs, near, track)


def review_track(
    store: Store, track_id: int, change: TrackReview, if_match: str, *, actor: str
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
            "this request changes nothing",
            hint="Send a verdict, with a note where there is something to say, or corrections.",
        )
    solved, notices = _solve_track_change(store, track_id, change, if_match)
    with store.write() as session:
        track, _ = _read_track_and_groups(session, track_id)
        require_etag(track.etag, if_match, f'the track "{track.key}"')
        values: dict[str, Any] = {"revision": track.revision + 1, **solved}
        if change.verdict is not None:
            if change.verdict == "accepted":
                _require_acceptable(replace(track, summary=_get_new_summary(solved, track)))
            if change.verdict == "none":
                values |= UNJUDGED
            else:
                note = strip_and_check_note(change.note or "")
                values |= {"verdict": change.verdict, "note": note, "judged_by": actor}
                values["judged_at"] = now()
        update_track(session, track_id, **values)
        if notices is not None:
            save_notices(session, track.dataset_id, notices)
        did = f"track {change.verdict}" if change.verdict else "track corrected"
        add_audit_event(session, actor, did, track.dataset_id, track=track_id, name=track.key)
        found, _ = _read_track_and_groups(session, track_id)
        session.respond(found)
    return found


def _solve_track_change(
    store: Store, track_id: int, change: TrackReview, if_match: str
) -> tuple[dict[str, Any], TrackNotices | None]:
    """Columns that come of corrections, and what the track says of its groups then where that may differ; all
    that takes time is done before the write."""
    with store.read() as session:
        track, groups = _read_track_and_groups(session, track_id)
        require_etag(track.etag, if_match, f'the track "{track.key}"')
        if change.corrections is None and "rejected" not in (track.verdict, change.verdict):
            return {}, None
        body = read_track_bodies(session, [track_id])[track_id]
        solved: dict[str, Any] = {}
        if change.corrections is None:
            inputs, ball = _build_ball_track(body, track.corrections)
        else:
            solved, inputs, ball = _recompute_corrected_track(body, track, change.corrections)
        near = map_groups_by_frame(groups, track.first, track.last)
        told = None if change.verdict == "rejected" else (ball, inputs)
        return solved, make_track_notices(session, track.match, near, told)


def collect_accepted_tracks(session: Session, dataset: DatasetHead) -> dict[str, Json]:
    """The tracks of a dataset that people accepted as its groups are now, by stretch, each with all that it
    was computed from (``codec.frozen_track_to_json``)."""
    found = {}
    for track in list_accepted_tracks(session, dataset):
        if not track.stale:
            body = read_track_bodies(session, [track.id])[track.id]
            whole, ball = _build_ball_track(body, track.corrections)
            found[track.key] = frozen_track_to_json(track.match, whole, ball)
    return found


def list_accepted_tracks(session: Session, dataset: DatasetHead) -> list[Track]:
    """The tracks of a dataset that people accepted, also those that are stale since."""
    rows = [row for row in list_track_rows(session, dataset.id) if row.verdict == "accepted"]
    return _build_tracks(session, dataset, rows)


def _build_tracks(session: Session, dataset: DatasetHead, rows: Sequence[Any]) -> list[Track]:
    """Tracks of a dataset from their rows, with what they depend on as it is now."""
    if not rows:
        return []
    groups = read_group_states_by_match(session, dataset.id, {row.match for row in rows})
    runs = list_accepted_runs(session, dataset.id)
    shots = read_recording_shots(session, dataset.id)
    return [
        build_track_from_row(
            row,
            dataset.policy,
            groups.get(row.match, ()),
            runs.get(row.match, ()),
            shots.get(row.match),
        )
        for row in rows
    ]


def make_track_source(
    session: Session,
    settings: Settings,
    dataset_id: int,
    dataset: str,
    policy: Policy,
    frozen: Mapping[str, Json] | None = None,
) -> TrackSource:
    """The source of the tracks of an export.

    Args:
        session: Any session.
        settings: Say where indexes and cameras of recordings lie.
        dataset_id: Of the dataset.
        dataset: Its name.
        policy: Says how noisy clicks and cameras are.
        frozen: The tracks of a frozen version by stretch (``codec.frozen_track_to_json``); None: the dataset
            is exported as it is.
    """
    if frozen is not None:
        # A version knows no shots: those of its recordings may be others by now.
        tracks = [parse_frozen_track(key, value) for key, value in frozen.items()]
        return TrackSource(dataset, policy, {}, tracks, frozen=bool(tracks))
    shots = read_recording_shots(session, dataset_id)
    rows = list_track_rows(session, dataset_id)
    bodies = read_track_bodies(session, [row.id for row in rows if row.verdict == "accepted"])
    known = []
    for row in rows:
        said, body = parse_corrections(row), bodies.get(row.id)
        track = None if body is None else _build_ball_track(body, said)[1]
        place = row.key, row.match, row.first, row.last
        known.append(StoredStretchTrack(*place, row.digest, track, row.verdict, said))
    followed = collect_accepted_run_observations(
        session, settings, list_accepted_runs(session, dataset_id), policy
    )
    return TrackSource(dataset, policy, shots, known, followed=followed)


def _read_track_and_groups(session: Session, track_id: int) -> tuple[Track, list[GroupForTracking]]:
    row = find_track_row(session, track_id)
    if row is None:
        raise NotFoundError(f"there is no track {track_id}")
    found = read_dataset_head(session, int(row.dataset_id))
    groups = read_groups_by_match(session, found.id, [row.match]).get(row.match, [])
    runs = list_accepted_runs(session, found.id).get(row.match, ())
    shots = read_recording_shots(session, found.id).get(row.match)
    return build_track_from_row(row, found.policy, groups, runs, shots), groups


def _build_ball_track(
    body: TrackBody, said: tuple[EventCorrection, ...]
) -> tuple[TrackInputs, BallTrack]:
    """A stored track with its corrections, and all that it was computed from."""
    inputs = replace(inputs_from_json(decompress_json(body.inputs)), corrections=said)
    return inputs, apply_corrections(
        inputs, track_from_json(decompress_json(body.body)), _parse_patches(body)
    )


def _parse_patches(body: TrackBody) -> tuple[TrackPatch, ...]:
    return () if body.patches is None else patches_from_json(decompress_json(body.patches))


def _recompute_corrected_track(
    body: TrackBody, track: Track, corrections: Sequence[EventCorrection]
) -> tuple[dict[str, Any], TrackInputs, BallTrack]:
    """The columns of a track whose events are corrected, and itself; it is solved anew around what is new."""
    text = _validate_corrections(track, corrections)
    inputs = replace(
        inputs_from_json(decompress_json(body.inputs)),
        corrections=corrections_from_json(parse_json_column(text)),
    )
    base = track_from_json(decompress_json(body.body))
    patches = solve_corrected_parts(inputs, base, _parse_patches(body))
    ball = apply_corrections(inputs, base, patches)
    summary = summarize_track(ball, track.summary)
    columns = {
        "corrections": text,
        "patches": compress_json(patches_to_json(patches)) if patches else None,
        "summary": canonical_json_text(asdict(summary)),
        # What was accepted is not what it is now.
        **UNJUDGED,
    }
    return columns, inputs, ball


def _get_new_summary(solved: Mapping[str, Any], track: Track) -> TrackSummary:
    """What a list says of a track once a change is made."""
    if "summary" not in solved:
        return track.summary
    return TrackSummary(**parse_json_column(solved["summary"]))


def _require_acceptable(track: Track) -> None:
    if track.summary.reason is not None:
        raise ConflictError(
            f'the stretch "{track.key}" has no track ({track.summary.reason})',
            hint="Annotate the ball in more of its frames, and recompute the track.",
        )
    if track.stale:
        raise ConflictError(
            f'groups of the track "{track.key}" have changed since it was computed',
            hint="Recompute the track, then accept it.",
        )


def _validate_corrections(track: Track, corrections: Sequence[EventCorrection]) -> str:
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
                f'frame {item.frame} is not in the track "{track.key}", which has the frames'
                f" {track.first} to {track.last}",
                pointer=f"/corrections/{number}/frame",
            )
    return corrections_to_text(corrections)
