"""Carry in: edits and verdicts of another installation, merged with those of this one.

What nobody edited here follows; what was edited here and is not in the other's past stays, and is
named in a finding where the other edited it too. Everyone's verdicts are kept. Doing it again
changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TypeVar

from app.datasets.file_tree import FileTree, Limits, Root
from app.datasets.report import Report
from app.datasets.trees import opened_tree
from app.errors import DatasetFormatError, InputError
from app.progress import TellProgress
from app.review.datasets.dataset import insert_dataset
from app.review.editing.lineage import Lineages, base_digest, station_lineage
from app.review.importing.carry import GROUPS, SPARE, STATIONS
from app.review.importing.carry_merge import merge_group
from app.review.importing.carry_parse import (
    CarriedGroup,
    CarriedHead,
    CarriedStation,
    parse_group,
    parse_spare,
    parse_station,
    read_head,
    read_lines,
)
from app.review.importing.carry_stations import merge_stations
from app.review.importing.carry_verdicts import merge_dismissals, merge_verdicts
from app.review.importing.ingest import IngestReport, Origin, attempt, ingest_batch
from app.review.importing.spare import SpareFrame, ingest_spare
from app.soccer.group import Group, Station
from app.store.datasets import find_dataset
from app.store.groups import read_groups
from app.store.imports import known_groups, shared_stations
from app.store.queue import refresh_queue
from app.store.session import Session
from app.store.store import Store
from app.store.stored_json import Json

BATCH = 20
T = TypeVar("T")


@dataclass
class _Run:
    """One import under way."""

    store: Store
    dataset: str
    head: CarriedHead
    source: str
    actor: str
    keep: bool
    report: IngestReport
    counted: set[str]
    """Static cameras that are counted already."""

    def origin(self, session: Session) -> Origin:
        """The dataset, made with the other's policy when there is none of that name."""
        row = find_dataset(session, self.dataset)
        number = (
            insert_dataset(session, self.dataset, self.head.policy, self.actor)
            if row is None
            else int(row.id)
        )
        return Origin(number, self.source, self.actor)


def carry_in(
    store: Store,
    dataset: str,
    path: Root,
    report: Report,
    limits: Limits,
    *,
    source: str,
    actor: str,
    progress: TellProgress | None = None,
    dry_run: bool = False,
) -> IngestReport:
    """Merge what ``carry_out`` wrote into a dataset, which is made when there is none.

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
    result = IngestReport()
    with opened_tree(path, report, limits) as tree:
        if tree is None:
            return result
        try:
            head = read_head(tree)
            run = _Run(store, dataset, head, source, actor, not dry_run, result, set())
            _carry(run, tree, report, progress)
        except DatasetFormatError as error:
            report.skip(error)
    return result


def _carry(run: _Run, tree: FileTree, report: Report, progress: TellProgress | None) -> None:
    stations = {item.station.key: item for item in _parsed(tree, STATIONS, report, parse_station)}
    with attempt(run.store, keep=run.keep) as session:
        origin = run.origin(session)
        _note_policy(session, run)
        merge_stations(session, origin, stations.values(), run.report)
    known = {key: item.station for key, item in stations.items()}
    groups = _parsed(tree, GROUPS, report, lambda value: parse_group(value, known))
    done = 0
    while batch := list(islice(groups, BATCH)):
        with attempt(run.store, keep=run.keep) as session:
            _merge_batch(session, run, batch, stations)
        done += len(batch)
        if progress is not None:
            progress(done)
    if run.keep:
        frames = (SpareFrame(*item) for item in _parsed(tree, SPARE, report, parse_spare))
        ingest_spare(run.store, run.dataset, frames, source=run.source, actor=run.actor)


def _parsed(tree: FileTree, name: str, report: Report, parse: Callable[[Json], T]) -> Iterator[T]:
    for place, value in read_lines(tree, name, report):
        try:
            item = parse(value)
        except InputError as error:
            report.note(tree.shown(name), place, None, error.message)
            continue
        report.imported += 1
        yield item


def _note_policy(session: Session, run: _Run) -> None:
    row = find_dataset(session, run.dataset)
    if row is not None and row.policy_hash != run.head.policy.hash:
        run.report.problems.append(
            "the other installation judges by another policy; the one here stays"
        )


def _merge_batch(
    session: Session,
    run: _Run,
    batch: Sequence[CarriedGroup],
    stations: Mapping[str, CarriedStation],
) -> None:
    origin = run.origin(session)
    if not run.keep:
        # A dry run took its stations back; the groups need them for a moment.
        merge_stations(session, origin, stations.values(), IngestReport())
    items = {item.group.key: item for item in batch}
    known = {item.key: item.id for item in known_groups(session, origin.dataset_id, items)}
    upstream = _upstream(session, origin, items, known)
    ingest_batch(session, origin, upstream, run.report, run.counted)
    counted = {group.key for group in upstream}
    ids = {item.key: item.id for item in known_groups(session, origin.dataset_id, items)}
    stored = read_groups(session, list(ids.values()))
    lineages = Lineages(session, origin.dataset_id).of(stored.values())
    touched = []
    for key, number in ids.items():
        item = items[key]
        changed = merge_group(session, origin, stored[number], lineages[number], item, run.report)
        judged = merge_verdicts(session, origin, number, item.verdicts)
        judged |= merge_dismissals(session, origin, number, item.dismissals)
        if changed or judged:
            touched.append(number)
        if key not in counted:
            run.report.changed += changed or judged
            run.report.unchanged += not (changed or judged)
    refresh_queue(session, touched)


def _upstream(
    session: Session, origin: Origin, items: Mapping[str, CarriedGroup], known: Mapping[str, int]
) -> list[Group]:
    """What the other's dataset brought and this one's never did: groups as they came."""
    stored = read_groups(session, list(known.values()))
    lineages = Lineages(session, origin.dataset_id).of(stored.values())
    shared = _shared(session, origin.dataset_id)
    upstream = []
    for key, item in items.items():
        base = _here(item.base, shared)
        if key not in known:
            upstream.append(base)
        elif base_digest(base) not in lineages[known[key]].bases:
            upstream.append(_with_media(base, stored[known[key]].group))
    return upstream


def _here(group: Group, shared: Mapping[str, Station]) -> Group:
    """The group with its static cameras as the dataset brought them here.

    They are merged on their own; in an import of groups they must look untouched.
    """
    views = (
        replace(view, station=shared[view.station.key]) if view.station.shared else view
        for view in group.views
    )
    return replace(group, views=tuple(views))


def _with_media(group: Group, stored: Group) -> Group:
    """The group with the frames that are known here; whether they are mirrored, too."""
    views = []
    for view in group.views:
        old = stored.view(view.key)
        views.append(view if old is None else replace(view, media=old.media))
    return replace(group, views=tuple(views))


def _shared(session: Session, dataset_id: int) -> dict[str, Station]:
    """The static cameras as the dataset last brought them, by key."""
    return {
        item.station.key: station_lineage(session, item).base if item.edited else item.station
        for item in shared_stations(session, dataset_id)
    }
