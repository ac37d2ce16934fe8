"""Revisions of groups, the values that name their state, and which groups have changed since."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

from sqlalchemy import bindparam, delete, func, literal, select, update

from app.db.dialects.dialect import select_from_number_list
from app.db.log import AUDIT_KINDS, LogModel
from app.db.session import Session
from app.features.datasets.tables import (
    DatasetModel,
    GroupChangeModel,
    GroupModel,
    ImportFindingModel,
    StationModel,
    ViewModel,
)
from app.features.findings.queries import DismissalModel
from app.features.groups.insert_queries import (
    NewRows,
    camera_positions_to_column,
    group_to_columns,
    paint_to_column,
    reserve_row_ids,
    station_to_columns,
    view_to_columns,
)
from app.features.groups.queries import StoredGroup, camera_positions_from_text
from app.features.groups.view_queries import save_station
from app.features.paint.queries import read_paint_digests
from app.features.solutions.queries import SolutionModel, is_current_solution
from app.features.verdicts.tables import VerdictModel
from app.soccer import codec
from app.soccer.codec import hash_solver_inputs, station_digest, view_digest
from app.soccer.group import Group, View
from app.soccer.pitch import Pitch

_GROUP, _DATASET, _VERDICT = GroupModel.__table__, DatasetModel.__table__, VerdictModel.__table__
_DISMISSAL = DismissalModel.__table__
_LAST = (
    select(func.coalesce(func.max(_VERDICT.c.id), 0))
    .where(_VERDICT.c.group_id == _GROUP.c.id)
    .correlate(_GROUP)
    .scalar_subquery()
    .label("last")
)
_DISMISSED = (
    select(func.coalesce(func.max(_DISMISSAL.c.id), 0))
    .where(_DISMISSAL.c.group_id == _GROUP.c.id)
    .correlate(_GROUP)
    .scalar_subquery()
    .label("last_dismissal")
)
_STATIONS = (
    select(func.coalesce(func.sum(StationModel.revision), 0))
    .join_from(ViewModel, StationModel, StationModel.id == ViewModel.station_id)
    .where(ViewModel.group_id == _GROUP.c.id)
    .correlate(_GROUP)
    .scalar_subquery()
    .label("station_revisions")
)
_HEAD = (
    select(_GROUP.c.inputs_hash, _GROUP.c.revision, _DATASET.c.policy_hash, _LAST, _DISMISSED)
    .join_from(_GROUP, _DATASET, _DATASET.c.id == _GROUP.c.dataset_id)
    .where(_GROUP.c.id == bindparam("group"))
)
_HEADS = (
    select(
        _GROUP.c.id,
        _GROUP.c.inputs_hash,
        _GROUP.c.revision,
        _DATASET.c.policy,
        _DATASET.c.policy_hash,
        SolutionModel.__table__.c.summary,
        _LAST,
        _DISMISSED,
        _STATIONS,
    )
    .join_from(_GROUP, _DATASET, _DATASET.c.id == _GROUP.c.dataset_id)
    .outerjoin(SolutionModel.__table__, is_current_solution())
    .where(_GROUP.c.id.in_(bindparam("ids", expanding=True)))
)


def make_next_revision(stored: StoredGroup, group: Group, at: str) -> StoredGroup:
    """A stored group as it is once an edit has made it into ``group``, the same views otherwise.

    Shared stations are the stored ones; only what differs is digested again.
    """
    stations, digests = dict(stored.stations), dict(stored.view_digests)
    for view, old in zip(group.views, stored.group.views, strict=True):
        own = stations[view.key]
        if view.station != old.station and not own.station.shared:
            stations[view.key] = replace(
                own,
                revision=own.revision + 1,
                station=view.station,
                digest=station_digest(view.station),
            )
        if _is_view_row_changed(view, old):
            digests[view.key] = (view_digest(view), digests[view.key][1])
    pairs = [(digests[view.key][0], stations[view.key].digest) for view in group.views]
    return replace(
        stored,
        revision=stored.revision + 1,
        changed=at,
        inputs_hash=hash_solver_inputs(
            group.pitch,
            pairs,
            group.positions,
            codec.paint_digests_to_json(group.paint),
            group.noise_factors_by_view,
        ),
        group=group,
        stations=stations,
        view_digests=digests,
    )


def save_revision(session: Session, stored: StoredGroup, after: StoredGroup) -> None:
    """Write what ``make_next_revision`` changed; solutions and queue are the caller's to refresh."""
    for position, (view, old) in enumerate(zip(after.group.views, stored.group.views, strict=True)):
        if _is_view_row_changed(view, old):
            _update_row(
                session,
                ViewModel.__table__,
                after.view_ids[view.key],
                view_to_columns(view, position),
            )
        own = after.stations[view.key]
        if own != stored.stations[view.key]:
            values = {**station_to_columns(own.station), "revision": own.revision}
            _update_row(session, StationModel.__table__, own.id, values)
    names = ("revision", "changed", "inputs_hash")
    values = {name: getattr(after, name) for name in names}
    pitch = after.group.pitch
    values |= {"pitch_length": pitch.length, "pitch_width": pitch.width}
    values["positions"] = camera_positions_to_column(after.group)
    values["paint"] = paint_to_column(codec.paint_digests_to_json(after.group.paint))
    _update_row(session, GroupModel.__table__, after.id, values)


def _is_view_row_changed(view: View, old: View) -> bool:
    """Whether the view's own row is another; its station has one of its own."""
    return replace(view, station=old.station) != old


def _update_row(session: Session, table: Any, identity: int, values: Mapping[str, Any]) -> None:
    session.execute(_update_statement(table), {"row": identity, **values})


@cache
def _update_statement(table: Any) -> Any:
    return update(table).where(table.c.id == bindparam("row"))


def save_reimported_group(
    session: Session,
    stored: StoredGroup,
    group: Group,
    *,
    at: str,
    source: Group,
    digest: str | None = None,
    shared: Mapping[str, int] | None = None,
) -> None:
    """Write the next revision of a group whose dataset has changed: head, views, own stations.

    Shared stations are left alone; ``save_station`` writes those. Views that are gone are
    deleted, new ones inserted. Solutions go where a match is named, or no longer, for a single view:
    what its camera knows of the pitch depends on it (``solving.calibrate.is_lone_frame``), and the
    digest of inputs does not tell.

    Args:
        session: A write session.
        stored: The group as it is.
        group: The group as it shall be.
        at: Time of the change.
        source: The group as it would be had nobody edited it.
    """
    kept = {view.key for view in group.views if has_same_station(stored, view)}
    _delete_views(session, stored, set(stored.view_ids) - kept)
    for position, view in enumerate(group.views):
        if view.key in kept:
            _save_view(session, stored, view, position, source.view(view.key))
    if len(kept) < len(group.views):
        rows = NewRows(session, stored.dataset_id)
        for position, view in enumerate(group.views):
            if view.key not in kept:
                rows.add_view(stored.id, view, position, shared or {})
        rows.insert()
    values = {**group_to_columns(group), "revision": stored.revision + 1, "changed": at}
    if digest is not None:
        values["source_hash"] = digest
    session.execute(update(GroupModel).where(GroupModel.id == stored.id).values(values))
    if len(group.views) == 1 and bool(group.match) != bool(stored.group.match):
        session.execute(delete(SolutionModel).where(SolutionModel.group_id == stored.id))


def has_same_station(stored: StoredGroup, view: View) -> bool:
    """Whether a view is stored and still has its own station, or still shares the same one."""
    if view.key not in stored.stations:
        return False
    old, new = stored.stations[view.key].station, view.station
    return old.shared == new.shared and (not new.shared or old.key == new.key)


def _save_view(
    session: Session, stored: StoredGroup, view: View, position: int, source: View | None
) -> None:
    old = stored.group.view(view.key)
    if source is None and view == old and stored.group.views.index(old) == position:
        return
    values = view_to_columns(view, position)
    if source is not None:
        values["source_digest"] = view_digest(source)
    identity = stored.view_ids[view.key]
    session.execute(update(ViewModel).where(ViewModel.id == identity).values(values))
    own = stored.stations[view.key]
    base = None if source is None else source.station
    if not own.station.shared and (view.station != own.station or base is not None):
        save_station(session, own, view.station, source=base)


def _delete_views(session: Session, stored: StoredGroup, keys: set[str]) -> None:
    if keys:
        reserve_row_ids(session, ViewModel, StationModel)
    for key in keys:
        session.execute(delete(ViewModel).where(ViewModel.id == stored.view_ids[key]))
        own = stored.stations[key]
        if not own.station.shared:
            session.execute(
                delete(ImportFindingModel).where(ImportFindingModel.station_id == own.id)
            )
            session.execute(delete(StationModel).where(StationModel.id == own.id))


def refresh_inputs_hashes(session: Session, group_ids: Sequence[int]) -> None:
    """Bring the inputs hashes of groups in step after a station of theirs changed."""
    statement = (
        select(
            GroupModel.id,
            GroupModel.pitch_length,
            GroupModel.pitch_width,
            GroupModel.positions,
            GroupModel.paint,
            ViewModel.key.label("view"),
            ViewModel.noise,
            ViewModel.digest,
            StationModel.digest.label("station_digest"),
        )
        .join(ViewModel, ViewModel.group_id == GroupModel.id)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(GroupModel.id.in_(select_from_number_list(group_ids)))
        .order_by(GroupModel.id, ViewModel.position)
    )
    heads: dict[int, Any] = {}
    pairs: dict[int, list[tuple[str, str]]] = {}
    noise: dict[int, dict[str, float]] = {}
    for row in session.execute(statement):
        heads.setdefault(row.id, row)
        pairs.setdefault(row.id, []).append((row.digest, row.station_digest))
        if row.noise is not None:
            noise.setdefault(row.id, {})[row.view] = row.noise
    rows = []
    for key, row in heads.items():
        positions = camera_positions_from_text(row.positions)
        pitch = Pitch(row.pitch_length, row.pitch_width)
        paint = read_paint_digests(row.paint)
        digest = hash_solver_inputs(pitch, pairs[key], positions, paint, noise.get(key, {}))
        rows.append({"of": key, "inputs_hash": digest})
    if rows:
        session.execute(update(GroupModel).where(GroupModel.id == bindparam("of")), rows)


def bump_group_revisions(session: Session, group_ids: Sequence[int], at: str) -> None:
    """Count a revision of groups that a change of something of theirs made."""
    session.execute(
        update(GroupModel)
        .where(GroupModel.id.in_(select_from_number_list(group_ids)))
        .values(revision=GroupModel.revision + 1, changed=at)
    )


def find_newest_change_id(session: Session) -> int:
    """Number of the last change of any group; 0 where there is none."""
    return session.scalar(select(func.max(GroupChangeModel.id))) or 0


def count_groups(session: Session, dataset_id: int) -> int:
    """How many groups a dataset has."""
    mine = GroupModel.dataset_id == dataset_id
    return session.scalar(select(func.count()).select_from(GroupModel).where(mine)) or 0


def count_changed_groups(session: Session, dataset_id: int, after: int) -> int:
    """How many groups of a dataset have changed after a change."""
    statement = select(func.count()).select_from(GroupChangeModel)
    return session.scalar(statement.where(*_changed_since_conditions(dataset_id, after))) or 0


def list_changed_group_ids(session: Session, dataset_id: int, after: int) -> list[int]:
    """Ids of the groups of a dataset that have changed after a change."""
    statement = select(GroupChangeModel.group_id).where(
        *_changed_since_conditions(dataset_id, after)
    )
    return list(session.scalars(statement))


class SolvedGroupRow(NamedTuple):
    """A group with the solution that fits it as it is, and its last change; 0 where that is not asked for."""

    group_id: int
    number: int
    inputs_hash: str
    solution_id: int | None
    split: str
    match: str
    pitch_length: float
    pitch_width: float
    change_id: int


def list_changed_groups(
    session: Session, dataset_id: int, after: int, limit: int
) -> Sequence[SolvedGroupRow]:
    """Groups of a dataset that have changed after a change, in the order of their last ones."""
    statement = (
        _changed_groups_statement()
        .add_columns(GroupChangeModel.id.label("change_id"))
        .join(GroupChangeModel, GroupChangeModel.group_id == GroupModel.id)
        .where(*_changed_since_conditions(dataset_id, after))
        .order_by(GroupChangeModel.id)
        .limit(limit)
    )
    return session.rows(SolvedGroupRow, statement)


def list_groups_after(
    session: Session, dataset_id: int, after: int, limit: int
) -> Sequence[SolvedGroupRow]:
    """Groups of a dataset in order, from the one after a number on."""
    mine = (GroupModel.dataset_id == dataset_id, GroupModel.number > after)
    statement = _changed_groups_statement().add_columns(literal(0).label("change_id"))
    statement = statement.where(*mine).order_by(GroupModel.number).limit(limit)
    return session.rows(SolvedGroupRow, statement)


def _changed_groups_statement() -> Any:
    group = GroupModel
    return (
        select(
            group.id.label("group_id"), group.number, group.inputs_hash,
            SolutionModel.id.label("solution_id"), group.split, group.match,
            group.pitch_length, group.pitch_width,
        )
        .join(DatasetModel, DatasetModel.id == group.dataset_id)
        .outerjoin(SolutionModel, is_current_solution())
    )  # fmt: skip


def _changed_since_conditions(dataset_id: int, after: int) -> tuple[Any, ...]:
    return GroupChangeModel.id > after, GroupChangeModel.dataset_id == dataset_id


@dataclass(frozen=True)
class StoredChange:
    """Something that happened to a dataset, or to one of its groups; ``id`` is its log entry's."""

    id: int | None
    dataset_id: int
    kind: str
    actor: str | None
    group_id: int | None


def iterate_changes_after_entry(session: Session, after: int) -> Iterator[StoredChange]:
    """What the log tells after an entry, in order; a static camera's stand once for each group."""
    columns = (LogModel.id, LogModel.dataset_id, LogModel.kind, LogModel.actor)
    new = (
        LogModel.id > after,
        LogModel.dataset_id.is_not(None),
        LogModel.kind.not_in(AUDIT_KINDS),
    )
    plain = select(*columns, LogModel.group_id).where(*new)
    of_station = (
        select(*columns, ViewModel.group_id)
        .join(ViewModel, ViewModel.station_id == LogModel.station_id)
        .where(*new, LogModel.group_id.is_(None))
        .distinct()
    )
    rows = [*session.execute(plain), *session.execute(of_station)]
    for row in sorted(rows, key=lambda row: int(row.id)):
        yield StoredChange(*row)


def list_groups_solved_after(session: Session, after: int) -> list[tuple[int, int]]:
    """Dataset and id of each group that got a solution after another one."""
    statement = (
        select(GroupModel.dataset_id, GroupModel.id)
        .join(SolutionModel, SolutionModel.group_id == GroupModel.id)
        .where(SolutionModel.id > after)
        .distinct()
        .order_by(GroupModel.dataset_id, GroupModel.id)
    )
    return [(row.dataset_id, row.id) for row in session.execute(statement)]


class EtagRow(NamedTuple):
    """What names the state of a group: ``last`` is its newest verdict."""

    inputs_hash: str
    revision: int
    policy_hash: str
    last: int
    last_dismissal: int


class SolvedEtagRow(NamedTuple):
    """What names the state of a group, its policy and solution.

    Attributes:
        summary: Of the solution; None: there is none.
        station_revisions: Sum of the revisions of its views' stations.
    """

    id: int
    inputs_hash: str
    revision: int
    policy: str
    policy_hash: str
    summary: str | None
    last: int
    last_dismissal: int
    station_revisions: int


def find_etag_row(session: Session, group_id: int) -> EtagRow | None:
    """The row from which the ETag of a group is made; None where there is no such group."""
    return session.row(EtagRow, _HEAD, {"group": group_id})


def read_etag_rows(session: Session, group_ids: Sequence[int]) -> Sequence[SolvedEtagRow]:
    """The rows from which the ETags of groups are made, with their policies and solutions."""
    return session.rows(SolvedEtagRow, _HEADS, {"ids": list(group_ids)})
