"""Making tracks: what views measured of the ball, stretch by stretch, tracked and stored."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from app.db.json_columns import compress_json, decompress_json, parse_json_column
from app.db.session import Session, now
from app.db.store import Store
from app.features.datasets.service import DatasetHead, read_dataset_head
from app.features.groups.queries import read_groups
from app.features.solutions.queries import SolutionKey, read_solutions
from app.features.tracks.codec import (
    TrackInputs,
    apply_corrections,
    corrections_from_json,
    corrections_to_text,
    digest_inputs,
    inputs_to_json,
    make_track,
    patches_to_json,
    solve_corrected_parts,
    track_from_json,
    track_to_json,
)
from app.features.tracks.findings import TRIES, refresh_track_notices
from app.features.tracks.queries import (
    GroupForTracking,
    delete_tracks,
    find_track_row,
    insert_track,
    list_track_rows,
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
    TrackSummary,
    compute_track_stamp,
    parse_corrections,
    summarize_track,
)
from app.features.tracks.stretches import (
    Stretch,
    find_group_instant,
    gather_stretches,
    match_stored_to_stretches,
    require_any_stretch,
)
from app.formats.export_record import ExportRecord
from app.json_text import canonical_json_text
from app.progress import ReportProgress
from app.tracking.ball_track import BallTrack

BATCH = 200


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


def make_tracks(
    store: Store,
    dataset: str | int,
    matches: Collection[str] | None,
    actor: str,
    progress: ReportProgress,
) -> MadeTracks:
    """Track the ball over all stretches of a dataset, or of some matches, and store the tracks.

    What people corrected stays, also where a stretch has grown, was cut or joined; a verdict holds for the
    track that it was given to. Killed anywhere and started again, it ends in the same state.

    Raises:
        InputError: No groups follow each other in time, or two of a stretch are one frame.
    """
    made = MadeTracks()
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        shots = read_recording_shots(session, found.id)
        groups = read_groups_by_match(session, found.id, matches)
        runs = list_accepted_runs(session, found.id)
        followed = collect_accepted_run_observations(
            session,
            store.settings,
            {match: items for match, items in runs.items() if match in groups},
            found.policy,
        )
        timed = {name: items for name, items in groups.items() if _has_frame_times(session, items)}
        total, done = sum(map(len, timed.values())), 0
        stretches: list[Stretch] = []
        for items in timed.values():
            records = []
            for record in read_export_records(session, items):
                records.append(record)
                if len(records) % BATCH == 0:
                    progress(done + len(records), total)
            done += len(items)
            stretches += gather_stretches(records, found.policy, shots, followed)
        stored = match_stored_to_stretches(stretches, list_track_rows(session, found.id))
    require_any_stretch(found.name, stretches)
    for tracked, stretch in enumerate(stretches, 1):
        stamp = compute_track_stamp(
            found.policy,
            groups[stretch.match],
            stretch,
            runs.get(stretch.match, ()),
            shots.get(stretch.match),
        )
        is_new, reason = _track_stretch(
            store, found, stretch, stored.get(stretch.key), stamp, actor
        )
        made.made += is_new
        made.unchanged += not is_new
        if reason is not None:
            made.without.append({"stretch": stretch.key, "reason": reason})
        progress(done, total, f"{tracked} of {len(stretches)} stretches tracked.")
    _delete_obsolete_tracks(store, found, stretches, matches)
    refresh_track_notices(store, found.id, groups.keys())
    return made


def read_export_records(
    session: Session, groups: Sequence[GroupForTracking]
) -> Iterator[ExportRecord]:
    """Groups with their solutions; those that people rejected measure nothing."""
    ids = [group.id for group in groups if not group.rejected]
    for start in range(0, len(ids), BATCH):
        stored = read_groups(session, ids[start : start + BATCH]).values()
        keys = [SolutionKey(one.id, one.inputs_hash, one.policy.hash) for one in stored]
        solutions = read_solutions(session, keys, markings=False)
        for one in stored:
            yield ExportRecord(one.group, solutions.get(one.id))


def _has_frame_times(session: Session, groups: Sequence[GroupForTracking]) -> bool:
    """Whether a match's groups follow each other in time, by the first of them."""
    first = next(iter(read_export_records(session, groups[:1])), None)
    return first is None or find_group_instant(first.group) is not None


def _track_stretch(
    store: Store, dataset: DatasetHead, stretch: Stretch, row: Any | None, stamp: str, actor: str
) -> tuple[bool, str | None]:
    """Track a stretch, if its measurements are others than those of its row; whether they are, and why
    there is no track."""
    inputs = TrackInputs.of(stretch)
    known: dict[str, Any] = {"key": stretch.key, "stamp": stamp, "digest": digest_inputs(inputs)}
    is_new = row is None or row.digest != known["digest"]
    base = make_track(inputs) if is_new else None
    if is_new:
        known |= UNJUDGED | {"actor": actor, "created": now()}

    def build_columns(session: Session) -> dict[str, Any]:
        """All that is stored, with what is said of its events as a session sees it."""
        nonlocal base
        said = _collect_corrections(session, dataset, stretch, row)
        own = None if row is None else find_track_row(session, row.id)
        if base is None and own is None:
            # Somebody deleted it meanwhile.
            base = make_track(inputs)
            known.update(UNJUDGED | {"actor": actor, "created": now()})
        elif base is None and own is not None and said != own.corrections:
            base = track_from_json(
                decompress_json(read_track_bodies(session, [own.id])[own.id].body)
            )
        if base is not None:
            return known | _compute_columns(stretch, inputs, base, said) | {"corrections": said}
        return known | {"corrections": said} | ({} if own is None else {"summary": own.summary})

    for turn in range(TRIES):
        with store.read() as session:
            values = build_columns(session)
        with store.write() as session:
            if turn == TRIES - 1:
                values = build_columns(session)
            if _save_track(session, dataset, stretch, row, values):
                break
    return is_new, parse_json_column(values["summary"])["reason"]


def _compute_columns(
    stretch: Stretch, inputs: TrackInputs, base: BallTrack, said: str
) -> dict[str, Any]:
    """The columns of a track with what was said of its events."""
    whole = replace(inputs, corrections=corrections_from_json(parse_json_column(said)))
    patches = solve_corrected_parts(whole, base)
    track = apply_corrections(whole, base, patches)
    summary = summarize_track(
        track,
        TrackSummary(
            *(0, {}, {}, len(inputs.measurements), 0, None, None, None, None),
            rate=stretch.rate,
            unused=dict(stretch.unused),
        ),
    )
    return {
        "inputs": compress_json(inputs_to_json(inputs)),
        "body": compress_json(track_to_json(base)),
        "patches": compress_json(patches_to_json(patches)) if patches else None,
        "summary": canonical_json_text(asdict(summary)),
        "match": stretch.match,
        "first": stretch.first,
        "last": stretch.last,
    }


def _collect_corrections(
    session: Session, dataset: DatasetHead, stretch: Stretch, own: Any | None
) -> str:
    """What was said of the events of a stretch, wherever it was stored."""
    return corrections_to_text(
        item
        for row in list_track_rows(session, dataset.id, [stretch.match])
        for item in parse_corrections(row)
        if (own is not None and row.id == own.id) or stretch.first <= item.frame <= stretch.last
    )


def _save_track(
    session: Session,
    dataset: DatasetHead,
    stretch: Stretch,
    row: Any | None,
    values: Mapping[str, Any],
) -> bool:
    """Store a track; not if somebody has said more of its events meanwhile, or deleted it."""
    if _collect_corrections(session, dataset, stretch, row) != values["corrections"]:
        return False
    own = None if row is None else find_track_row(session, row.id)
    if own is None and "body" not in values:
        return False
    if own is None:
        insert_track(session, {**values, "dataset_id": dataset.id, "revision": 0})
    else:
        told = any(values[name] != getattr(own, name) for name in ("key", "digest", "corrections"))
        update_track(session, own.id, **values, revision=own.revision + told)
    return True


def _delete_obsolete_tracks(
    store: Store,
    dataset: DatasetHead,
    stretches: Sequence[Stretch],
    matches: Collection[str] | None,
) -> None:
    """Leave each event that people said to the stretch of its frame alone, and delete tracks of stretches
    that are no more, unless a person said something of them that none of today's stretches holds."""
    with store.write() as session:
        gone = []
        for row in list_track_rows(session, dataset.id):
            if matches is not None and row.match not in matches:
                continue
            own = [item for item in stretches if item.match == row.match]
            home = next((item for item in own if item.key == row.key), None)
            elsewhere = [item for item in own if item is not home]
            said = parse_corrections(row)
            kept = [
                item
                for item in said
                if not any(other.first <= item.frame <= other.last for other in elsewhere)
            ]
            now_in = any(other.first <= row.last and row.first <= other.last for other in own)
            if home is None and not kept and (row.verdict is None or now_in):
                gone.append(row.id)
            elif len(kept) < len(said):
                text = corrections_to_text(kept)
                update_track(session, row.id, corrections=text, revision=row.revision + 1)
        if gone:
            delete_tracks(session, gone)
