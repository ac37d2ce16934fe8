"""Ingest: groups from an importer into a dataset; again and again without doing anything twice."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

from sqlalchemy import delete, func, insert, select
from sqlalchemy.orm import Session

from app.review.datasets import find_dataset, insert_dataset
from app.review.shared_stations import SharedStations
from app.review.upstream import KIND, Kept, follow_group
from app.soccer.group import Group, View
from app.soccer.policy import PAPER
from app.store.clock import now
from app.store.codecs import Json, group_head_to_json, view_to_json
from app.store.digest import source_hash
from app.store.group_rows import NewRows
from app.store.groups import StoredGroup, read_groups, save_group
from app.store.log import Entry, append, read_log
from app.store.models import GroupModel, ImportFindingModel, LogModel
from app.store.queue import refresh_queue
from app.store.session import Store

BATCH = 200
"""Groups a transaction: one import holds the writers up for a fraction of a second at a time."""

Progress = Callable[[int], None]
"""Called with the number of groups done so far."""


@dataclass
class IngestReport:
    """What became of the groups.

    Attributes:
        changed: Groups, and static cameras that many groups share.
        findings: Edits that a changed source met.
        missing: Groups that this source brought before and does not bring any more; they stay.
        problems: What to tell about single groups, or about the missing ones.
    """

    new: int = 0
    changed: int = 0
    unchanged: int = 0
    findings: int = 0
    missing: int = 0
    problems: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Origin:
    dataset_id: int
    source: str
    actor: str


def ingest(
    store: Store,
    dataset: str,
    groups: Iterable[Group],
    *,
    source: str,
    actor: str,
    progress: Progress | None = None,
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
    """
    report, seen, done = IngestReport(), set[str](), 0
    sound = _sound(groups, seen, report)
    while batch := list(islice(sound, BATCH)):
        with store.write() as session:
            origin = _Origin(_ensure_dataset(session, dataset, actor), source, actor)
            _ingest_batch(session, origin, batch, report)
        done += len(batch)
        if progress is not None:
            progress(done)
    if done:
        with store.read() as session:
            _note_missing(session, origin, seen, report)
    return report


def ensure_dataset(store: Store, dataset: str, actor: str) -> int:
    """Id of the dataset of that name, made with the default policy when there is none."""
    with store.write() as session:
        return _ensure_dataset(session, dataset, actor)


def _ensure_dataset(session: Session, dataset: str, actor: str) -> int:
    row = find_dataset(session, dataset)
    return insert_dataset(session, dataset, PAPER, actor) if row is None else int(row.id)


def _note_missing(
    session: Session, origin: _Origin, seen: Collection[str], report: IngestReport
) -> None:
    """Count the groups that the same source brought last and that did not come this time."""
    statement = select(GroupModel.id, GroupModel.key).where(
        GroupModel.dataset_id == origin.dataset_id
    )
    absent = [row.id for row in session.execute(statement) if row.key not in seen]
    for start in range(0, len(absent), BATCH):
        newest = (
            select(func.max(LogModel.id))
            .where(LogModel.kind == "import", LogModel.group_id.in_(absent[start : start + BATCH]))
            .group_by(LogModel.group_id)
        )
        entries = read_log(session, LogModel.id.in_(newest))
        report.missing += sum(entry.body["source"] == origin.source for entry in entries)
    if report.missing:
        groups = "1 group" if report.missing == 1 else f"{report.missing} groups"
        report.problems.append(f"{groups} of an earlier import did not come again; all stay")


def _sound(groups: Iterable[Group], seen: set[str], report: IngestReport) -> Iterator[Group]:
    """Groups that can be stored, their media by absolute path."""
    for group in groups:
        keys = [view.key for view in group.views]
        if group.key in seen:
            report.problems.append(f"group {group.key} appears twice; the first one counts")
        elif len(set(keys)) < len(keys):
            report.problems.append(f"group {group.key} has two views of one name")
        else:
            seen.add(group.key)
            yield replace(group, views=tuple(map(_absolute, group.views)))


def _absolute(view: View) -> View:
    if view.media is None:
        return view
    return replace(view, media=replace(view.media, path=str(Path(view.media.path).absolute())))


def _ingest_batch(
    session: Session, origin: _Origin, batch: Sequence[Group], report: IngestReport
) -> None:
    shared = SharedStations(session, origin.dataset_id, origin.source, origin.actor)
    for group in batch:
        shared.follow(view.station for view in group.views)
    report.changed += shared.changed
    report.findings += shared.findings
    known = _known(session, origin.dataset_id, [group.key for group in batch])
    fresh: list[tuple[Group, str]] = []
    for group in batch:
        digest = source_hash(group)
        if group.key not in known:
            fresh.append((group, digest))
        elif known[group.key][1] == digest:
            report.unchanged += 1
        else:
            _follow(session, origin, known[group.key][0], group, digest, shared.ids, report)
    _insert(session, origin, fresh, shared.ids)
    report.new += len(fresh)


def _known(session: Session, dataset_id: int, keys: list[str]) -> dict[str, tuple[int, str]]:
    statement = select(GroupModel.key, GroupModel.id, GroupModel.source_hash).where(
        GroupModel.dataset_id == dataset_id, GroupModel.key.in_(keys)
    )
    return {row.key: (row.id, row.source_hash) for row in session.execute(statement)}


def _insert(
    session: Session, origin: _Origin, fresh: Sequence[tuple[Group, str]], shared: dict[str, int]
) -> None:
    if not fresh:
        return
    at, rows = now(), NewRows(session, origin.dataset_id)
    ids, entries = [], []
    for group, digest in fresh:
        first = len(rows.views)
        identity = rows.add_group(group, digest, at, shared)
        places = {row["key"]: (row["id"], row["station_id"]) for row in rows.views[first:]}
        body = import_body(group, None, origin.source, digest, places)
        entries.append(Entry("import", origin.actor, at, body, origin.dataset_id, identity))
        ids.append(identity)
    rows.insert()
    append(session, entries)
    refresh_queue(session, ids)


def _follow(
    session: Session,
    origin: _Origin,
    group_id: int,
    incoming: Group,
    digest: str,
    shared: dict[str, int],
    report: IngestReport,
) -> None:
    stored, at = read_groups(session, [group_id])[group_id], now()
    followed = follow_group(stored, incoming)
    save_group(
        session, stored, followed.group, at=at, source=followed.base, digest=digest, shared=shared
    )
    after = read_groups(session, [group_id])[group_id]
    kept = _note(session, after, followed.kept)
    body = import_body(followed.group, followed.base, origin.source, digest, _places(after))
    body["kept"] = [[item.view, item.sentence] for item in kept]
    append(session, [Entry("import", origin.actor, at, body, origin.dataset_id, group_id)])
    refresh_queue(session, [group_id])
    report.changed += 1
    report.findings += len(followed.kept)


def _note(session: Session, stored: StoredGroup, kept: Sequence[Kept]) -> list[Kept]:
    """Save what imports noticed about a group: this one, and earlier ones as far as it holds.

    A finding goes when its view is as the dataset has it now. Returns what is noticed then.
    """
    model = ImportFindingModel
    fresh = {item.view for item in kept}
    earlier = session.execute(
        select(model.view, model.sentence).where(model.group_id == stored.id).order_by(model.id)
    )
    noticed = [
        Kept(row.view, row.sentence)
        for row in earlier
        if row.view not in fresh and row.view in stored.view_ids and stored.is_edited(row.view)
    ]
    noticed.extend(kept)
    session.execute(delete(model).where(model.group_id == stored.id))
    rows = [
        {"group_id": stored.id, "view": item.view, "kind": KIND, "sentence": item.sentence}
        for item in noticed
    ]
    if rows:
        session.execute(insert(model), rows)
    return noticed


def _places(stored: StoredGroup) -> dict[str, tuple[int, int]]:
    return {key: (stored.view_ids[key], stored.stations[key].id) for key in stored.view_ids}


def import_body(
    group: Group,
    base: Group | None,
    source: str,
    digest: str,
    places: dict[str, tuple[int, int]],
) -> dict[str, Json]:
    """What the log keeps of an import: the group whole, with the ids of its rows.

    ``base`` is left out where it is the group itself.
    """
    return {
        "source": source,
        "source_hash": digest,
        "group": _logged(group),
        "base": None if base is None or base == group else _logged(base),
        "ids": {key: list(pair) for key, pair in places.items()},
    }


def _logged(group: Group) -> Json:
    """A group in which a shared station is its key: the log has it in an entry of its own."""
    views = [
        view_to_json(view, view.station.key if view.station.shared else None)
        for view in group.views
    ]
    return {**group_head_to_json(group), "views": views}
