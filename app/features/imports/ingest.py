"""Ingest: groups and unassigned frames from an importer into a dataset; again and again without doing anything twice."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

from app.db.json_columns import compress_json, decompress_json
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError
from app.features.datasets.queries import find_dataset
from app.features.datasets.service import insert_dataset, read_dataset_head
from app.features.findings.queries import (
    filter_groups_with_finding,
    list_group_import_findings,
    replace_group_import_findings,
)
from app.features.groups.edit import SetCameraPositions, SetPaintReadings
from app.features.groups.insert_queries import NewRows
from app.features.groups.pictures import mark_paint_outdated_where_player_boxes_changed
from app.features.groups.queries import (
    StoredGroup,
    iterate_unassigned_frames,
    read_groups,
    read_unassigned_extras,
    upsert_unassigned_frames,
)
from app.features.groups.reimport import (
    KIND,
    KeptEditFinding,
    SharedStations,
    shows_another_picture,
    shows_another_scene,
    update_group_from_dataset,
)
from app.features.groups.revision_queries import save_reimported_group
from app.features.imports.body import (
    GONE,
    MAX_VIEWS,
    GroupLimits,
    collect_view_and_station_ids,
    count_new_missing_group_findings,
    filter_missing_groups_of_read_matches,
    make_import_entry_body,
    save_missing_group_findings,
)
from app.features.imports.queries import KnownGroup, find_newest_imports, list_known_groups
from app.features.independent_annotations.queries import is_copy_dataset
from app.features.paint.queries import insert_paint_readings
from app.features.pitches.queries import is_pitch_edited, read_edited_pitches
from app.features.pitches.service import set_pitch_of_groups
from app.features.policies.service import choose_first_policy
from app.features.queue.refresh_queries import refresh_queue
from app.features.verdicts.bulk import save_verdicts
from app.features.verdicts.queries import find_next_verdict_id, read_verdicts
from app.formats.frame_names import compose_name
from app.formats.issia import FramePersons
from app.formats.report import ReaderReport
from app.object_store.path import is_address
from app.progress import ReportProgress
from app.soccer.annotation import Extras
from app.soccer.codec import extras_from_json, hash_imported_group
from app.soccer.group import Group, View
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER, Policy
from app.wording import plural

BATCH = 20
"""Groups a transaction: one import holds the writers up for a fraction of a second at a time."""


@dataclass
class IngestReport:
    """What became of the groups.

    Attributes:
        changed: Groups, and static cameras that many groups share.
        findings: Edits that a changed source met, and pictures of another shape than declared.
        without_picture: Groups of which no view has a picture.
        missing: Groups that this source brought before and does not bring any more; they stay.
        problems: What to tell about the groups; nothing was left out by it.
        left_out: Takes what was left out, with the reason.
        dropped_views: Views that left groups of which others came, by the group's key.
        replaced: Groups that changed and came from another source before, by that source.
        withdrawn: Verdicts that were withdrawn, as their groups show other pictures now.
    """

    new: int = 0
    changed: int = 0
    unchanged: int = 0
    findings: int = 0
    missing: int = 0
    without_picture: int = 0
    problems: list[str] = field(default_factory=list)
    left_out: ReaderReport = field(default_factory=ReaderReport, compare=False)
    dropped_views: dict[str, int] = field(default_factory=dict)
    replaced: Counter[str] = field(default_factory=Counter)
    withdrawn: int = 0

    def describe_replaced_parts(self, source: str) -> list[str]:
        """A sentence for each part of earlier imports that was replaced."""
        sentences = []
        if self.dropped_views:
            views = plural(sum(self.dropped_views.values()), "view")
            groups = plural(len(self.dropped_views), "group")
            were = "was" if sum(self.dropped_views.values()) == 1 else "were"
            are = "is" if were == "was" else "are"
            sentences.append(f"{views} of {groups} {are} no longer in the files and {were} removed")
        for before, count in sorted(self.replaced.items()):
            have = "has" if count == 1 else "have"
            sentences.append(
                f"{plural(count, 'group')} came from {before} before and now {have} other pictures or "
                f"annotations from {source}"
            )
        if self.withdrawn:
            was = "was" if self.withdrawn == 1 else "were"
            sentences.append(
                f"{plural(self.withdrawn, 'verdict')} {was} withdrawn, because the picture that was judged "
                "has been replaced by another"
            )
        return sentences


@dataclass(frozen=True)
class ImportContext:
    """Into which dataset, from where, and who brings it."""

    dataset_id: int
    source: str
    actor: str
    lines_left: bool = False


def import_groups(
    store: Store,
    dataset: str,
    groups: Iterable[Group],
    *,
    source: str,
    actor: str,
    progress: ReportProgress | None = None,
    dry_run: bool = False,
    policy: Policy | None = PAPER,
    limit_report: ReaderReport | None = None,
    lines_left: bool = False,
) -> IngestReport:
    """Bring groups into a dataset, which the first of them makes when there is none of that name.

    Killed anywhere and started again, it ends in the same state. What nobody edited follows a
    changed source; what a person edited stays and becomes a finding.

    Args:
        store: The database.
        dataset: Name.
        groups: As an importer yields them; read as they come, so any number fits.
        source: Where they come from, for the log.
        actor: Who imports.
        progress: Called after each batch.
        dry_run: Dry run: report what would happen, change nothing.
        policy: Of a dataset that is made; None: as its first pictures suggest.
        lines_left: Whether lines of static cameras that do not come were left aside, so that those of
            an earlier import go.
        limit_report: What the files hold; hears what of a group is left out, beyond its ``GroupLimits``.
    """
    left_out = ReaderReport() if limit_report is None else limit_report
    report, seen, done = IngestReport(left_out=left_out), dict[str, str](), 0
    limits = GroupLimits(source, left_out)
    known = _list_groups_of_dataset(store, dataset)
    before = {group.key for group in known if not group.match}
    groups = _keep_stored_spelling(groups, known)
    sound, stations = _prepare_storable_groups(groups, seen, report, limits), set[str]()
    while batch := list(islice(sound, BATCH)):
        with open_import_session(store, keep=not dry_run) as session:
            identity = _ensure_dataset(
                session, dataset, actor, policy or choose_first_policy(batch)
            )
            origin = ImportContext(identity, source, actor, lines_left)
            import_group_chunk(session, origin, batch, report, stations)
        done += len(batch)
        if progress is not None:
            progress(done)
    if done:
        with store.read() as session:
            missing = _find_and_report_missing_groups(session, origin, seen, report)
            # Files of no match are of one series only where some of it came again.
            matches = {match for key, match in seen.items() if match or key in before}
            gone = filter_missing_groups_of_read_matches(
                session, origin.dataset_id, matches, missing
            )
            if dry_run:
                report.findings += count_new_missing_group_findings(session, gone)
        for start in range(0, 0 if dry_run else len(gone), BATCH):
            with store.write() as session:
                ids = gone[start : start + BATCH]
                report.findings += save_missing_group_findings(
                    session, origin.dataset_id, ids, source=origin.source, actor=actor
                )
    report.problems += report.describe_replaced_parts(source)
    return report


def _list_groups_of_dataset(store: Store, dataset: str) -> list[KnownGroup]:
    with store.read() as session:
        row = find_dataset(session, dataset)
        return [] if row is None else list_known_groups(session, int(row.id))


def _keep_stored_spelling(groups: Iterable[Group], known: Iterable[KnownGroup]) -> Iterator[Group]:
    """The groups, those of matches that an earlier version stored with accents apart called as there."""
    matches = {group.match for group in known}
    apart = {
        composed: match
        for match in matches
        if (composed := compose_name(match)) != match and composed not in matches
    }
    for group in groups:
        match = apart.get(group.match)
        yield group if match is None else _respell_match(group, match)


def _respell_match(group: Group, match: str) -> Group:
    def respell(key: str) -> str:
        own = key.removeprefix(f"{group.match}/")
        return key if own == key else f"{match}/{own}"

    views = (
        replace(view, station=replace(view.station, key=respell(view.station.key)))
        for view in group.views
    )
    return replace(group, key=respell(group.key), match=match, views=tuple(views))


class _DryRunRollback(Exception):  # noqa: N818
    """Ends a transaction that shall leave nothing."""


@contextmanager
def open_import_session(store: Store, *, keep: bool) -> Iterator[Session]:
    """A write session; where nothing shall be kept, what it did is taken back at its end."""
    try:
        with store.write() as session:
            yield session
            if not keep:
                raise _DryRunRollback
    except _DryRunRollback:
        pass


def ensure_dataset(store: Store, dataset: str, actor: str) -> int:
    """Id of the dataset of that name, made with the policy ``paper`` when there is none."""
    with store.write() as session:
        return _ensure_dataset(session, dataset, actor, PAPER)


def _ensure_dataset(session: Session, dataset: str, actor: str, policy: Policy) -> int:
    row = find_dataset(session, dataset)
    return insert_dataset(session, dataset, policy, actor) if row is None else int(row.id)


def _find_and_report_missing_groups(
    session: Session, origin: ImportContext, seen: Collection[str], report: IngestReport
) -> set[int]:
    """Count the groups that the same source brought last and that did not come this time."""
    missing: set[int] = set()
    known = list_known_groups(session, origin.dataset_id)
    absent = [group.id for group in known if group.key not in seen]
    for start in range(0, len(absent), BATCH):
        entries = find_newest_imports(session, absent[start : start + BATCH])
        missing |= {
            entry.group_id or 0 for entry in entries if entry.body["source"] == origin.source
        }
    report.missing = len(missing)
    if report.missing:
        groups = plural(report.missing, "group")
        report.problems.append(
            f"{groups} of an earlier import are missing in this import; all are kept"
        )
    return missing


def _prepare_storable_groups(
    groups: Iterable[Group], seen: dict[str, str], report: IngestReport, limits: GroupLimits
) -> Iterator[Group]:
    """Groups that can be stored, their media by absolute path; ``seen`` takes the match of each key."""
    for group in groups:
        keys = [view.key for view in group.views]
        if group.key in seen:
            limits.report_group_left_out(group.key, "appears twice; the first one counts")
        elif len(set(keys)) < len(keys):
            limits.report_group_left_out(
                group.key, "has two views with the same name; it is left out"
            )
        else:
            # One that is left out is not missing: the source brought it.
            seen[group.key] = group.match
            held = limits.trim_group_to_limits(group)
            if held is not None:
                report.without_picture += all(view.media is None for view in held.views)
                yield replace(held, views=tuple(map(_make_media_path_absolute, held.views)))


def _make_media_path_absolute(view: View) -> View:
    if view.media is None or is_address(view.media.path):
        return view
    path = Path(view.media.path).absolute()
    # The reader saw where a link leads; one that comes later is not followed.
    path = path.resolve() if path.is_symlink() else path
    return replace(view, media=replace(view.media, path=str(path)))


def import_group_chunk(
    session: Session,
    origin: ImportContext,
    batch: Sequence[Group],
    report: IngestReport,
    stations: set[str],
) -> None:
    """Bring a batch of groups, inside the caller's write transaction.

    ``stations`` are shared ones that are counted already: a dry run meets them again.

    Raises:
        ConflictError: The dataset holds somebody's own annotations, which they alone change.
    """
    if is_copy_dataset(session, origin.dataset_id):
        raise ConflictError(
            "this dataset holds the independent annotations of one person, so nothing can be"
            " imported into it",
            hint="Import into the dataset that the annotated groups come from.",
        )
    keys = [group.key for group in batch]
    known = {item.key: item for item in list_known_groups(session, origin.dataset_id, keys)}
    gone = filter_groups_with_finding(session, [item.id for item in known.values()], GONE)
    fresh: list[tuple[Group, str]] = []
    changed: list[tuple[int, Group, str]] = []
    for group in batch:
        digest, there = hash_imported_group(group), known.get(group.key)
        if there is None:
            fresh.append((group, digest))
        elif there.source_hash == digest and there.id not in gone:
            report.unchanged += 1
        else:
            changed.append((there.id, group, digest))
    before = _find_sources(session, [identity for identity, _, _ in changed])
    # Decided before cameras that groups share are updated: those of another group are not theirs.
    others = {
        group.key
        for identity, group, digest in changed
        if _is_another_group(session, origin, identity, group, digest, before.get(identity))
    }
    shared = SharedStations(
        session, origin.dataset_id, origin.source, origin.actor, lines_left=origin.lines_left
    )
    for group in batch:
        if group.key not in others:
            shared.insert_or_update(view.station for view in group.views)
    report.changed += len(set(shared.changed) - stations)
    report.findings += len(set(shared.kept) - stations)
    stations.update(shared.changed)
    for identity, group, digest in changed:
        if group.key in others:
            report.left_out.add_problem_at(
                origin.source,
                group.key,
                None,
                f"is also the name of another group, which came from {before[identity]}; this one is left out: "
                "import it into another dataset, or give its pictures other names; if it is the same scene, "
                f"import it under the name {before[identity]}",
            )
            continue
        _update_group(
            session, origin, identity, group, digest, shared.ids, report, before.get(identity)
        )
    insert_new_groups(session, origin, fresh, shared.ids)
    report.new += len(fresh)


def _find_sources(session: Session, group_ids: Sequence[int]) -> dict[int | None, str]:
    """The sources that last brought groups, by the group's id."""
    entries = find_newest_imports(session, group_ids) if group_ids else []
    return {entry.group_id: str(entry.body["source"]) for entry in entries}


def insert_new_groups(
    session: Session,
    origin: ImportContext,
    fresh: Sequence[tuple[Group, str]],
    shared: dict[str, int],
) -> list[int]:
    """Insert groups that a dataset has not yet, with their source hashes; returns their ids.

    ``shared`` has the ids of its shared stations by key.
    """
    if not fresh:
        return []
    at, rows = now(), NewRows(session, origin.dataset_id)
    ids, entries = [], []
    for group, digest in fresh:
        first = len(rows.views)
        identity = rows.add_group(group, digest, at, shared)
        places = {row["key"]: (row["id"], row["station_id"]) for row in rows.views[first:]}
        body = make_import_entry_body(group, None, origin.source, digest, places)
        entries.append(NewLogEntry("import", origin.actor, at, body, origin.dataset_id, identity))
        ids.append(identity)
    rows.insert()
    append_entries(session, entries)
    pitches = read_edited_pitches(session, origin.dataset_id, {group.match for group, _ in fresh})
    for identity, (group, _) in zip(ids, fresh, strict=True):
        if (pitch := pitches.get(group.match)) is not None:
            set_pitch_of_groups(session, origin.dataset_id, [identity], pitch, origin.actor)
    refresh_queue(session, ids)
    return ids


def _is_another_group(
    session: Session,
    origin: ImportContext,
    group_id: int,
    incoming: Group,
    digest: str,
    before: str | None,
) -> bool:
    if before in (None, origin.source):
        return False
    stored = read_groups(session, [group_id])[group_id]
    return stored.source_hash != digest and shows_another_scene(stored.group, incoming)


def _update_group(
    session: Session,
    origin: ImportContext,
    group_id: int,
    incoming: Group,
    digest: str,
    shared: dict[str, int],
    report: IngestReport,
    before: str | None,
) -> None:
    stored, at = read_groups(session, [group_id])[group_id], now()
    is_replaced = before not in (None, origin.source) and stored.source_hash != digest
    followed = update_group_from_dataset(stored, incoming)
    if (count := len(followed.group.views)) > MAX_VIEWS:
        report.left_out.add_problem_at(
            origin.source,
            incoming.key,
            None,
            f"would have {count} views with those that people edited; the limit is {MAX_VIEWS}: "
            "it stays as it is",
        )
        return
    if followed.dropped:
        report.dropped_views[incoming.key] = len(followed.dropped)
    if (pitch := _find_edited_pitch(session, stored, incoming)) is not None:
        followed = replace(followed, group=replace(followed.group, pitch=pitch))
    if incoming.match == stored.group.match:
        # What the match shares comes from its other pictures.
        shared_here = SetCameraPositions(stored.group.positions).apply(followed.group)
        followed = replace(followed, group=shared_here)
    # What was read of a picture says of which, and is read again where that is another.
    paint = mark_paint_outdated_where_player_boxes_changed(stored.group, followed.group)
    followed = replace(followed, group=SetPaintReadings(paint).apply(followed.group))
    insert_paint_readings(session, origin.dataset_id, followed.group.paint.values())
    save_reimported_group(
        session, stored, followed.group, at=at, source=followed.base, digest=digest, shared=shared
    )
    after = read_groups(session, [group_id])[group_id]
    kept = save_findings(session, after, followed.kept)
    body = make_import_entry_body(
        followed.group, followed.base, origin.source, digest, collect_view_and_station_ids(after)
    )
    body["kept"] = [[item.view, item.sentence] for item in kept]
    append_entries(
        session, [NewLogEntry("import", origin.actor, at, body, origin.dataset_id, group_id)]
    )
    refresh_queue(session, [group_id])
    _withdraw_verdict_on_other_picture(session, origin, stored, after, report)
    report.changed += 1
    report.findings += len(followed.kept)
    if is_replaced:
        report.replaced[str(before)] += 1


def _withdraw_verdict_on_other_picture(
    session: Session,
    origin: ImportContext,
    stored: StoredGroup,
    after: StoredGroup,
    report: IngestReport,
) -> None:
    """Withdraw a verdict that its group would keep though a picture of it is another one.

    A verdict on other annotations is stale by itself; the pictures are no part of what is solved.
    """
    verdict = next(iter(read_verdicts(session, [stored.id]).get(stored.id, ())), None)
    if (
        verdict is None
        or verdict.state == "unreviewed"
        or verdict.inputs_hash != after.inputs_hash
        or not shows_another_picture(stored.group, after.group)
    ):
        return
    at = now()
    withdrawn = replace(
        verdict,
        id=find_next_verdict_id(session),
        actor=origin.actor,
        at=at,
        state="unreviewed",
        reason=None,
        note="the import brought another picture",
        override=None,
        fixed=False,
    )
    save_verdicts(session, stored.dataset_id, [withdrawn], actor=origin.actor, at=at)
    report.withdrawn += 1


def _find_edited_pitch(session: Session, stored: StoredGroup, incoming: Group) -> Pitch | None:
    """The size that a person gave to a group's match, or to the group itself that has none."""
    if incoming.match:
        pitches = read_edited_pitches(session, stored.dataset_id, {incoming.match})
        return pitches.get(incoming.match)
    is_own = not stored.group.match and is_pitch_edited(session, stored.id)
    return stored.group.pitch if is_own else None


def save_findings(
    session: Session, stored: StoredGroup, kept: Sequence[KeptEditFinding]
) -> list[KeptEditFinding]:
    """Save what imports noticed about a group: this one, and earlier ones as far as it holds.

    A finding goes when its view is as the dataset has it now. Returns what is noticed then.
    """
    fresh = {item.view for item in kept}
    noticed = [
        KeptEditFinding(view, sentence)
        for view, sentence in list_group_import_findings(session, stored.id)
        if view is not None
        and view not in fresh
        and view in stored.view_ids
        and stored.is_view_edited(view)
    ]
    noticed.extend(kept)
    sentences = ((item.view, item.sentence) for item in noticed)
    replace_group_import_findings(session, stored.id, KIND, sentences)
    return noticed


UNASSIGNED_AT_ONCE = 1000
"""Frames a transaction and a log entry."""
_NUMBER = re.compile(r"-?\d{1,9}", re.ASCII)
_CAMERA = re.compile(r"cam[1-6]", re.ASCII)


@dataclass(frozen=True)
class UnassignedFrame:
    """One image: the camera that took it, its frame, and what is known of it."""

    camera: str
    frame: str
    extras: Extras


def import_unassigned_frames(
    store: Store, dataset: str, frames: Iterable[UnassignedFrame], *, source: str, actor: str
) -> IngestReport:
    """Keep unassigned frames with a dataset; keeping them again changes nothing.

    People do not edit them, so they follow whatever the dataset brings.
    """
    report, items = IngestReport(), iter(frames)
    while batch := list(islice(items, UNASSIGNED_AT_ONCE)):
        dataset_id = ensure_dataset(store, dataset, actor)
        with store.write() as session:
            _save_unassigned_frame_chunk(session, dataset_id, batch, source, actor, report)
    return report


def read_unassigned_frames(session: Session, dataset_id: int) -> Iterator[UnassignedFrame]:
    """The unassigned frames of a dataset, by camera and frame as texts."""
    for row in iterate_unassigned_frames(session, dataset_id):
        yield UnassignedFrame(row.camera, row.frame, extras_from_json(decompress_json(row.extras)))


def read_unassigned_persons(session: Session, dataset: str | int) -> Iterator[FramePersons]:
    """People of the unassigned frames of a dataset of ISSIA, for its original shape."""
    for item in read_unassigned_frames(session, read_dataset_head(session, dataset).id):
        if _NUMBER.fullmatch(item.frame) and _CAMERA.fullmatch(item.camera):
            yield FramePersons(int(item.frame), item.camera, item.extras.boxes)


def _save_unassigned_frame_chunk(
    session: Session,
    dataset_id: int,
    batch: Sequence[UnassignedFrame],
    source: str,
    actor: str,
    report: IngestReport,
) -> None:
    known = read_unassigned_extras(session, dataset_id, {item.frame for item in batch})
    fresh = {}
    for item in batch:
        place, body = (item.camera, item.frame), compress_json(item.extras.to_plain_values())
        if known.get(place) == body:
            report.unchanged += 1
        else:
            report.changed += place in known
            report.new += place not in known
            fresh[place] = body
    _write_unassigned_frames(session, dataset_id, fresh, source, actor)


def _write_unassigned_frames(
    session: Session,
    dataset_id: int,
    fresh: dict[tuple[str, str], bytes],
    source: str,
    actor: str,
) -> None:
    if not fresh:
        return
    upsert_unassigned_frames(session, dataset_id, fresh)
    frames = [[camera, frame, decompress_json(body)] for (camera, frame), body in fresh.items()]
    body = {"source": source, "frames": frames}
    append_entries(session, [NewLogEntry("spare", actor, now(), body, dataset_id)])
