"""Edits and verdicts of another installation, merged with those of this one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TypeVar

from app.db.json_columns import Json
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import DatasetFormatError, InputError
from app.features.datasets.queries import find_dataset
from app.features.datasets.service import insert_dataset
from app.features.findings.queries import find_station_finding, replace_station_finding
from app.features.groups.queries import read_groups
from app.features.groups.reimport import KIND, SharedStations
from app.features.groups.revision_chain import (
    RevisionChains,
    StationRevisionChain,
    digest_imported_group,
    read_station_revision_chain,
)
from app.features.groups.revision_queries import refresh_inputs_hashes
from app.features.groups.view_queries import StoredStation, list_groups_of_station, save_station
from app.features.imports.edits_export import GROUPS, SPARE, STATIONS
from app.features.imports.ingest import (
    ImportContext,
    IngestReport,
    UnassignedFrame,
    import_group_chunk,
    import_unassigned_frames,
    open_import_session,
)
from app.features.imports.merge_group import (
    CONFLICT,
    FOLLOW,
    UPSTREAM,
    EditStateDigests,
    choose_merge_action,
    merge_dismissals,
    merge_group,
    merge_verdicts,
)
from app.features.imports.merge_parse import (
    MergeGroup,
    MergeHeader,
    MergeStation,
    parse_group,
    parse_station,
    parse_unassigned_frame,
    read_lines,
    read_merge_header,
)
from app.features.imports.queries import list_known_groups, list_shared_stations
from app.features.queue.refresh_queries import refresh_queue
from app.formats.file_tree import FileTree, ImportLimits, Root
from app.formats.report import ReaderReport
from app.formats.trees import open_tree_context
from app.progress import ReportProgress
from app.soccer.codec import station_digest, station_to_json
from app.soccer.group import Group, Station


def merge_stations(
    session: Session, origin: ImportContext, exported: Iterable[MergeStation], report: IngestReport
) -> None:
    """Bring static cameras up to what another installation made of them."""
    for item in exported:
        stored = _find_stored_station(session, origin.dataset_id, item.station.key)
        if stored is None or _is_station_only_in_other(session, stored, item):
            shared = SharedStations(session, origin.dataset_id, origin.source, origin.actor)
            shared.insert_or_update([item.base])
            report.changed += len(shared.changed)
            report.findings += len(shared.kept)
            stored = _find_stored_station(session, origin.dataset_id, item.station.key)
        assert stored is not None
        report.changed += _merge_station(session, origin, stored, item, report)


def _is_station_only_in_other(session: Session, stored: StoredStation, item: MergeStation) -> bool:
    """Whether the other's dataset brought what this one's never did."""
    base = station_digest(item.base)
    if base == stored.source_digest:
        return False
    return base not in read_station_revision_chain(session, stored).states


def _merge_station(
    session: Session,
    origin: ImportContext,
    stored: StoredStation,
    item: MergeStation,
    report: IngestReport,
) -> bool:
    chain = read_station_revision_chain(session, stored)
    here = EditStateDigests(stored.digest, stored.source_digest, chain.states)
    there = EditStateDigests(station_digest(item.station), station_digest(item.base), item.states)
    decision = choose_merge_action(here, there)
    if decision in (FOLLOW, UPSTREAM):
        _adopt_other_station(
            session, origin, stored, item, chain, _format_finding_sentence(decision, stored)
        )
    elif decision == CONFLICT:
        return _save_conflict(
            session, origin, stored, chain, _format_finding_sentence(decision, stored), report
        )
    return decision in (FOLLOW, UPSTREAM)


def _format_finding_sentence(decision: str, stored: StoredStation) -> str | None:
    key = stored.station.key
    if decision == CONFLICT:
        return (
            f"another installation edited the lines or the camera of {key} too; the edit of this "
            f"installation is kept"
        )
    if decision == UPSTREAM:
        return (
            f"another installation edited the lines or the camera of {key} on another state of "
            "the dataset; its edit is in place now"
        )
    return None


def _adopt_other_station(
    session: Session,
    origin: ImportContext,
    stored: StoredStation,
    item: MergeStation,
    chain: StationRevisionChain,
    sentence: str | None,
) -> None:
    station = stored.station.with_annotations_of(item.station)
    save_station(session, stored, station)
    replace_station_finding(session, stored.id, KIND, sentence)
    _log_station(session, origin, replace(stored, station=station), chain, sentence, list(item.log))
    groups = list_groups_of_station(session, stored.id)
    refresh_inputs_hashes(session, groups)
    refresh_queue(session, groups)


def _save_conflict(
    session: Session,
    origin: ImportContext,
    stored: StoredStation,
    chain: StationRevisionChain,
    sentence: str | None,
    report: IngestReport,
) -> bool:
    """Save a conflict, unless it is known; whether it was new."""
    if find_station_finding(session, stored.id) == sentence:
        return False
    # A revision of its own, as every entry of the log about a station makes one.
    save_station(session, stored, stored.station)
    replace_station_finding(session, stored.id, KIND, sentence)
    _log_station(session, origin, stored, chain, sentence, [])
    refresh_queue(session, list_groups_of_station(session, stored.id))
    report.findings += 1
    return True


def _log_station(
    session: Session,
    origin: ImportContext,
    stored: StoredStation,
    chain: StationRevisionChain,
    sentence: str | None,
    exported: list[object],
) -> None:
    station, base = station_to_json(stored.station), station_to_json(chain.base)
    body = {
        "source": origin.source,
        "station": station,
        "base": None if base == station else base,
        "kept": sentence,
        "carried": exported,
    }
    entry = NewLogEntry(
        "station", origin.actor, now(), body, origin.dataset_id, station_id=stored.id
    )
    append_entries(session, [entry])


def _find_stored_station(session: Session, dataset_id: int, key: str) -> StoredStation | None:
    return next(iter(list_shared_stations(session, dataset_id, key)), None)


BATCH = 20
T = TypeVar("T")


@dataclass
class _MergeRun:
    """One import under way."""

    store: Store
    dataset: str
    head: MergeHeader
    source: str
    actor: str
    keep: bool
    report: IngestReport
    counted: set[str]
    """Static cameras that are counted already."""

    def ensure_target_dataset(self, session: Session) -> ImportContext:
        """The dataset, made with the other's policy when there is none of that name."""
        row = find_dataset(session, self.dataset)
        number = (
            insert_dataset(session, self.dataset, self.head.policy, self.actor)
            if row is None
            else int(row.id)
        )
        return ImportContext(number, self.source, self.actor)


def merge_edits(
    store: Store,
    dataset: str,
    path: Root,
    report: ReaderReport,
    limits: ImportLimits,
    *,
    source: str,
    actor: str,
    progress: ReportProgress | None = None,
    dry_run: bool = False,
) -> IngestReport:
    """Merge what ``export_edits`` wrote into a dataset, which is made when there is none.

    Killed anywhere and started again, it ends in the same state.

    Args:
        store: The database.
        dataset: Name.
        path: Folder or zip.
        report: What the files hold, and what of it had to be left out.
        limits: Caps on what is read.
        source: Where it comes from, for the log.
        actor: Who imports.
        progress: Called with the number of groups done.
        dry_run: Dry run: report what would happen, change nothing.
    """
    result = IngestReport(left_out=report)
    with open_tree_context(path, report, limits) as tree:
        if tree is None:
            return result
        try:
            head = read_merge_header(tree)
            run = _MergeRun(store, dataset, head, source, actor, not dry_run, result, set())
            _merge_tree(run, tree, report, progress)
        except DatasetFormatError as error:
            report.add_problem(error)
    return result


def _merge_tree(
    run: _MergeRun, tree: FileTree, report: ReaderReport, progress: ReportProgress | None
) -> None:
    stations = {
        item.station.key: item for item in _parse_records(tree, STATIONS, report, parse_station)
    }
    with open_import_session(run.store, keep=run.keep) as session:
        origin = run.ensure_target_dataset(session)
        _report_policy_difference(session, run)
        merge_stations(session, origin, stations.values(), run.report)
    known = {key: item.station for key, item in stations.items()}
    groups = _parse_records(tree, GROUPS, report, lambda value: parse_group(value, known))
    done = 0
    while batch := list(islice(groups, BATCH)):
        with open_import_session(run.store, keep=run.keep) as session:
            _merge_group_chunk(session, run, batch, stations)
        done += len(batch)
        if progress is not None:
            progress(done)
    if run.keep:
        frames = (
            UnassignedFrame(*item)
            for item in _parse_records(tree, SPARE, report, parse_unassigned_frame)
        )
        import_unassigned_frames(run.store, run.dataset, frames, source=run.source, actor=run.actor)


def _parse_records(
    tree: FileTree, name: str, report: ReaderReport, parse: Callable[[Json], T]
) -> Iterator[T]:
    for place, value in read_lines(tree, name, report):
        try:
            item = parse(value)
        except InputError as error:
            report.add_problem_at(tree.shown(name), place, None, error.message)
            continue
        report.imported += 1
        yield item


def _report_policy_difference(session: Session, run: _MergeRun) -> None:
    row = find_dataset(session, run.dataset)
    if row is not None and row.policy_hash != run.head.policy.hash:
        run.report.problems.append(
            "the other installation uses another policy; the policy of this installation is kept"
        )


def _merge_group_chunk(
    session: Session,
    run: _MergeRun,
    batch: Sequence[MergeGroup],
    stations: Mapping[str, MergeStation],
) -> None:
    origin = run.ensure_target_dataset(session)
    if not run.keep:
        # A dry run took its stations back; the groups need them for a moment.
        merge_stations(session, origin, stations.values(), IngestReport())
    items = {item.group.key: item for item in batch}
    known = {item.key: item.id for item in list_known_groups(session, origin.dataset_id, items)}
    upstream = _list_groups_only_in_other(session, origin, items, known)
    import_group_chunk(session, origin, upstream, run.report, run.counted)
    counted = {group.key for group in upstream}
    ids = {item.key: item.id for item in list_known_groups(session, origin.dataset_id, items)}
    stored = read_groups(session, list(ids.values()))
    chains = RevisionChains(session, origin.dataset_id).read_chains_by_group_id(stored.values())
    touched = []
    for key, number in ids.items():
        item = items[key]
        changed = merge_group(session, origin, stored[number], chains[number], item, run.report)
        judged = merge_verdicts(session, origin, number, item.verdicts)
        judged |= merge_dismissals(session, origin, number, item.dismissals)
        if changed or judged:
            touched.append(number)
        if key not in counted:
            run.report.changed += changed or judged
            run.report.unchanged += not (changed or judged)
    refresh_queue(session, touched)


def _list_groups_only_in_other(
    session: Session,
    origin: ImportContext,
    items: Mapping[str, MergeGroup],
    known: Mapping[str, int],
) -> list[Group]:
    """What the other's dataset brought and this one's never did: groups as they came."""
    stored = read_groups(session, list(known.values()))
    chains = RevisionChains(session, origin.dataset_id).read_chains_by_group_id(stored.values())
    shared = _read_static_cameras(session, origin.dataset_id)
    upstream = []
    for key, item in items.items():
        base = _replace_with_own_stations(item.base, shared)
        if key not in known:
            upstream.append(base)
        elif digest_imported_group(base) not in chains[known[key]].bases:
            upstream.append(_copy_known_media(base, stored[known[key]].group))
    return upstream


def _replace_with_own_stations(group: Group, shared: Mapping[str, Station]) -> Group:
    """The group with its static cameras as the dataset brought them here.

    They are merged on their own; in an import of groups they must look untouched.
    """
    views = (
        replace(view, station=shared[view.station.key]) if view.station.shared else view
        for view in group.views
    )
    return replace(group, views=tuple(views))


def _copy_known_media(group: Group, stored: Group) -> Group:
    """The group with the frames that are known here; whether they are mirrored, too."""
    views = []
    for view in group.views:
        old = stored.view(view.key)
        views.append(view if old is None else replace(view, media=old.media))
    return replace(group, views=tuple(views))


def _read_static_cameras(session: Session, dataset_id: int) -> dict[str, Station]:
    """The static cameras as the dataset last brought them, by key."""
    return {
        item.station.key: read_station_revision_chain(session, item).base
        if item.edited
        else item.station
        for item in list_shared_stations(session, dataset_id)
    }
