"""Work that is given out, in the database: batches, their people and groups, and leases."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from sqlalchemy import (
    BindParameter,
    ColumnElement,
    Integer,
    Select,
    bindparam,
    case,
    delete,
    exists,
    func,
    insert,
    literal,
    or_,
    select,
    update,
)

from app.db.dialects.dialect import insert as upsert
from app.db.log import LogModel
from app.db.session import Session
from app.features.batches.tables import (
    BatchGroupModel,
    BatchModel,
    BatchPersonModel,
    BatchTrackModel,
    LeaseModel,
)
from app.features.datasets.tables import DatasetModel
from app.features.groups.insert_queries import find_next_row_id, reserve_row_ids
from app.features.independent_annotations.tables import IndependentAnnotationModel
from app.features.people.tables import PersonModel
from app.features.people.visibility_queries import visible_groups_condition
from app.features.queue.tables import QueueModel
from app.features.tracks.tables import TrackModel
from app.soccer.choices import BatchState

OPEN: BatchState = "open"
CLOSED: BatchState = "closed"


class BatchRow(NamedTuple):
    """A batch with the name of its ``dataset``."""

    id: int
    dataset_id: int
    name: str
    kind: str
    query: str
    sort: str
    verdicts: int
    blind: bool
    gold_every: int | None
    due: str | None
    state: str
    created: str
    created_by: str
    dataset: str


class NumberedBatchGroup(NamedTuple):
    """A group of a batch with its ``number`` in the dataset."""

    batch_id: int
    group_id: int
    place: int
    submitted: str | None
    submitted_by: str | None
    settled: str | None
    number: int


_BATCHES = select(*BatchModel.__table__.columns, DatasetModel.name.label("dataset")).join(
    DatasetModel, DatasetModel.id == BatchModel.dataset_id
)
_LEASES = select(*LeaseModel.__table__.columns).order_by(LeaseModel.id)
_IDS: BindParameter[Any] = bindparam("ids", expanding=True)
# What each "next" and each minute of an open page asks is put together once: that takes longer than
# to answer it.
_BATCH = _BATCHES.where(BatchModel.id == bindparam("id"))
_GROUP = select(*(column.label(column.key) for column in BatchGroupModel.__table__.columns)).where(
    BatchGroupModel.batch_id == bindparam("batch"), BatchGroupModel.group_id == bindparam("group")
)
_LEASES_ON = _LEASES.where(
    LeaseModel.group_id == bindparam("group"), LeaseModel.until > bindparam("at")
)
_LEASES_IN = _LEASES.where(LeaseModel.batch_id.in_(_IDS), LeaseModel.until > bindparam("at"))
_ANNOTATION = upsert(LeaseModel)
_KEEP = _ANNOTATION.on_conflict_do_update(
    index_elements=["batch_id", "group_id", "person"],
    set_={"seen": _ANNOTATION.excluded.seen, "until": _ANNOTATION.excluded.until},
)
_ENDED = delete(LeaseModel).where(LeaseModel.until <= bindparam("at"))
_PEOPLE = (
    select(BatchPersonModel.batch_id, BatchPersonModel.part, PersonModel.id, PersonModel.name)
    .join(PersonModel, PersonModel.id == BatchPersonModel.person_id)
    .where(BatchPersonModel.batch_id.in_(_IDS))
    .order_by(PersonModel.name)
)
_WAITS = BatchGroupModel.submitted.is_not(None) & BatchGroupModel.settled.is_(None)
_COUNT = (
    select(
        BatchGroupModel.batch_id,
        func.count().label("groups"),
        func.sum(case((_WAITS, 1), else_=0)).label("submitted"),
        func.count(BatchGroupModel.settled).label("settled"),
        func.max(func.coalesce(BatchGroupModel.settled, BatchGroupModel.submitted)).label("last"),
    )
    .where(BatchGroupModel.batch_id.in_(_IDS))
    .group_by(BatchGroupModel.batch_id)
)
_COUNT_TRACKS = (
    select(
        BatchTrackModel.batch_id,
        func.count().label("groups"),
        literal(0).label("submitted"),
        func.count(TrackModel.verdict).label("settled"),
        func.max(TrackModel.judged_at).label("last"),
    )
    .join(TrackModel, TrackModel.id == BatchTrackModel.track_id)
    .where(BatchTrackModel.batch_id.in_(_IDS))
    .group_by(BatchTrackModel.batch_id)
)
_DONE_KINDS = ("edit", "undo", "redo", "verdict")
"""Entries of the log that show that somebody works on a group."""


def find_batch(session: Session, batch_id: int) -> BatchRow | None:
    """A batch by its id, with the name of its ``dataset``."""
    return session.row(BatchRow, _BATCH, {"id": batch_id})


def find_dataset_batches(session: Session, dataset_ids: Collection[int]) -> Sequence[BatchRow]:
    """The batches of datasets, with the names of those; open ones and those that are due first come first."""
    order = (BatchModel.state.desc(), BatchModel.due.is_(None), BatchModel.due, BatchModel.id)
    mine = BatchModel.dataset_id.in_(dataset_ids)
    return session.rows(BatchRow, _BATCHES.where(mine).order_by(*order))


def list_datasets_with_open_batches(session: Session) -> list[int]:
    """Ids of the datasets in which a batch is open."""
    found = select(BatchModel.dataset_id).where(BatchModel.state == OPEN).distinct()
    return list(session.scalars(found))


def list_unfinished_batches(session: Session, dataset_ids: Collection[int]) -> list[int]:
    """Ids of the open batches of datasets in which a group or a track waits."""
    waits = exists().where(
        BatchGroupModel.batch_id == BatchModel.id, BatchGroupModel.settled.is_(None)
    )
    open_tracks = exists().where(
        BatchTrackModel.batch_id == BatchModel.id,
        TrackModel.id == BatchTrackModel.track_id,
        TrackModel.verdict.is_(None),
    )
    mine = (BatchModel.dataset_id.in_(dataset_ids), BatchModel.state == OPEN)
    found = select(BatchModel.id).where(*mine, or_(waits, open_tracks)).order_by(BatchModel.id)
    return list(session.scalars(found))


def insert_batch(session: Session, values: Mapping[str, Any]) -> int:
    """Insert a batch, from columns of ``BatchModel`` but its id; returns its id.

    Independent annotations name batches that are gone, too, of which older versions reserved no id.
    """
    named = session.scalar(select(func.max(IndependentAnnotationModel.batch_id))) or 0
    identity = max(find_next_row_id(session, BatchModel), named + 1)
    session.execute(insert(BatchModel), [{"id": identity, **values}])
    return identity


def update_batch(session: Session, batch_id: int, values: Mapping[str, Any]) -> None:
    """Change columns of a batch."""
    session.execute(update(BatchModel).where(BatchModel.id == batch_id).values(**values))


def delete_batch(session: Session, batch_id: int) -> None:
    """Delete a batch with all that hangs on it; what was said of its groups stays."""
    reserve_row_ids(session, BatchModel)
    session.execute(delete(BatchModel).where(BatchModel.id == batch_id))


def set_batch_people(session: Session, batch_id: int, part: str, person_ids: Iterable[int]) -> None:
    """Give a batch to people, and to nobody else in that part."""
    table = BatchPersonModel
    session.execute(delete(table).where(table.batch_id == batch_id, table.part == part))
    rows = [{"batch_id": batch_id, "person_id": one, "part": part} for one in person_ids]
    if rows:
        session.execute(insert(table), rows)


class BatchPersonRow(NamedTuple):
    """A person to whom a batch was given, and for which part."""

    batch_id: int
    part: str
    id: int
    name: str


def list_batch_people(session: Session, batch_ids: Collection[int]) -> Sequence[BatchPersonRow]:
    """The people to whom batches were given, by name."""
    return session.rows(BatchPersonRow, _PEOPLE, {"ids": list(batch_ids)})


def insert_groups(session: Session, batch_id: int, group_ids: Sequence[int]) -> None:
    """Put groups into a batch that has none, in this order."""
    rows = [
        {"batch_id": batch_id, "group_id": group, "place": place}
        for place, group in enumerate(group_ids, start=1)
    ]
    if rows:
        session.execute(insert(BatchGroupModel), rows)


def insert_tracks(session: Session, batch_id: int, track_ids: Sequence[int]) -> None:
    """Put tracks into a batch that has none, in this order."""
    rows = [
        {"batch_id": batch_id, "track_id": track, "place": place}
        for place, track in enumerate(track_ids, start=1)
    ]
    session.execute(insert(BatchTrackModel), rows)


def list_batches_of_tracks(session: Session, dataset_id: int) -> dict[int, list[tuple[int, int]]]:
    """The open batches of a dataset that each track is in: their ids, and its place in them."""
    statement = (
        select(BatchTrackModel.track_id, BatchTrackModel.batch_id, BatchTrackModel.place)
        .join(BatchModel, BatchModel.id == BatchTrackModel.batch_id)
        .where(BatchModel.dataset_id == dataset_id, BatchModel.state == OPEN)
        .order_by(BatchTrackModel.batch_id)
    )
    found: dict[int, list[tuple[int, int]]] = {}
    for track, batch, place in session.execute(statement):
        found.setdefault(track, []).append((batch, place))
    return found


def list_groups_in_open_batches(session: Session, dataset_id: int) -> set[int]:
    """Ids of the groups that wait in an open batch of a dataset."""
    statement = (
        select(BatchGroupModel.group_id)
        .join(BatchModel, BatchModel.id == BatchGroupModel.batch_id)
        .where(
            BatchModel.dataset_id == dataset_id,
            BatchModel.state == OPEN,
            BatchGroupModel.settled.is_(None),
        )
    )
    return set(session.scalars(statement))


def read_batch_groups(session: Session, batch_id: int) -> Sequence[NumberedBatchGroup]:
    """Every group of a batch in order, with its ``number``."""
    statement = (
        select(
            *(column.label(column.key) for column in BatchGroupModel.__table__.columns),
            QueueModel.number,
        )
        .join(QueueModel, QueueModel.group_id == BatchGroupModel.group_id)
        .where(BatchGroupModel.batch_id == batch_id)
        .order_by(BatchGroupModel.place)
    )
    return session.rows(NumberedBatchGroup, statement)


def find_batch_group(session: Session, batch_id: int, group_id: int) -> BatchGroupModel | None:
    """A group of a batch."""
    return session.row(BatchGroupModel, _GROUP, {"batch": batch_id, "group": group_id})


class BatchGroupRow(NamedTuple):
    """A group of a batch."""

    batch_id: int
    group_id: int


def list_returned_batch_groups(
    session: Session, batch_ids: Collection[int], person: str
) -> Sequence[BatchGroupRow]:
    """Groups that were returned to a person and wait for them, in order."""
    table = BatchGroupModel
    back = (table.submitted_by == person, table.submitted.is_(None), table.settled.is_(None))
    statement = select(table.batch_id, table.group_id).where(table.batch_id.in_(batch_ids), *back)
    return session.rows(BatchGroupRow, statement.order_by(table.batch_id, table.place))


class WorkCount(NamedTuple):
    """How much of a batch is done.

    Attributes:
        groups: Its groups or tracks.
        submitted: Of these, those that are submitted and not settled.
        last: When something of it was done last.
    """

    batch_id: int
    groups: int
    submitted: int
    settled: int
    last: str | None


def count_work(session: Session, batch_ids: Collection[int]) -> dict[int, WorkCount]:
    """How much of each batch is done, by its id."""
    ids = {"ids": list(batch_ids)}
    return {
        row.batch_id: row
        for count in (_COUNT, _COUNT_TRACKS)
        for row in session.rows(WorkCount, count, ids)
    }


def count_visible_work(session: Session, batch_id: int, dataset_id: int) -> WorkCount | None:
    """How much is done of the groups of a batch that whoever asks may see; None: it is of tracks."""
    if session.row(WorkCount, _COUNT, {"ids": [batch_id]}) is None:
        return None
    visible = visible_groups_condition(dataset_id, BatchGroupModel.group_id)
    found = session.row(WorkCount, _COUNT.where(*visible), {"ids": [batch_id]})
    return found or WorkCount(batch_id, 0, 0, 0, None)


def set_group_submission(
    session: Session,
    batch_id: int,
    group_id: int,
    *,
    at: str | None,
    by: str,
    returned: bool = False,
) -> None:
    """A group of a batch is done by its annotator; ``at`` None: it is not, after all.

    ``returned``: it goes back to them, so that their name stays with it.
    """
    where = (BatchGroupModel.batch_id == batch_id, BatchGroupModel.group_id == group_id)
    values = {"submitted": at, "submitted_by": by if at is not None or returned else None}
    session.execute(update(BatchGroupModel).where(*where).values(**values))


class WaitingGroup(NamedTuple):
    """A group of a batch that somebody may take, and whether it was submitted."""

    group_id: int
    submitted: str | None
    submitted_by: str | None


def find_next_waiting_group(
    session: Session,
    batch_id: int,
    dataset_id: int,
    person: str,
    at: str,
    *,
    submitted: bool | None,
    after: int,
) -> WaitingGroup | None:
    """The group that a person would take next, if there is one.

    Args:
        session: A write session, so that nobody else takes it meanwhile.
        batch_id: The batch.
        dataset_id: Its dataset.
        person: Who asks. What others have open, in any batch, is left out, and what is hidden from
            whoever asks.
        at: Now.
        submitted: Whether it must have been submitted, or must not; None: either.
        after: Place after which to look first, and which is never meant; what else the person has
            open comes last then: they may have it in another window, or had it in one that is gone.
            0: what they have open comes first.
    """
    given = {"batch": batch_id, "person": person, "at": at, "after": after}
    waiting = _build_waiting_group_statement(submitted, bool(after))
    if seen := visible_groups_condition(dataset_id, BatchGroupModel.group_id):
        waiting = waiting.where(*seen)
    return session.row(WaitingGroup, waiting, given)


@cache
def _build_waiting_group_statement(
    submitted: bool | None, goes_on: bool
) -> Select[*tuple[Any, ...]]:
    """Made once for each case: it takes longer to put together than to answer."""
    table = BatchGroupModel
    person: BindParameter[str] = bindparam("person")
    after = bindparam("after", type_=Integer())
    lasts = LeaseModel.until > bindparam("at")
    mine, others = (
        _build_lease_condition(LeaseModel.person == person, lasts),
        LeaseModel.person != person,
    )
    where = [
        table.batch_id == bindparam("batch"),
        table.settled.is_(None),
        ~_build_lease_condition(others, lasts),
    ]
    if submitted is not None:
        where.append(table.submitted.is_not(None) if submitted else table.submitted.is_(None))
    # What somebody submitted themselves, and what was returned to others, comes last for them.
    theirs = table.submitted_by == person
    back = case((theirs, -1), else_=1)
    waits = case((table.submitted.is_not(None), case((theirs, 1), else_=0)), else_=back)
    order: list[ColumnElement[Any]] = [case((table.submitted_by.is_(None), 0), else_=waits)]
    if goes_on:
        where.append(table.place != after)
        order.append(case((table.place > after, 0), else_=1))
    order.insert(0, case((mine, int(goes_on)), else_=int(not goes_on)))
    row = (
        table.group_id,
        table.submitted.label("submitted"),
        table.submitted_by.label("submitted_by"),
    )
    return select(*row).where(*where).order_by(*order, table.place).limit(1)


def _build_lease_condition(*where: ColumnElement[bool]) -> ColumnElement[bool]:
    return exists().where(LeaseModel.group_id == BatchGroupModel.group_id, *where)


def list_group_leases(session: Session, group_id: int, at: str) -> Sequence[LeaseModel]:
    """The leases on a group that last, the oldest first."""
    return session.rows(LeaseModel, _LEASES_ON, {"group": group_id, "at": at})


def list_leases(session: Session, batch_ids: Collection[int], at: str) -> Sequence[LeaseModel]:
    """The leases in batches that last."""
    return session.rows(LeaseModel, _LEASES_IN, {"ids": list(batch_ids), "at": at})


def save_lease(
    session: Session, batch_id: int, group_id: int, person: str, *, at: str, until: str
) -> None:
    """Take a lease, or let the one last on that the person has."""
    named = {"batch_id": batch_id, "group_id": group_id, "person": person, "taken": at}
    session.execute(_KEEP, {**named, "seen": at, "until": until})


def end_leases(session: Session, ids: Collection[int]) -> None:
    """End leases."""
    session.execute(delete(LeaseModel).where(LeaseModel.id.in_(ids)))


def end_person_lease(session: Session, batch_id: int, group_id: int, person: str) -> bool:
    """End a person's lease; whether there was one."""
    where = (
        LeaseModel.batch_id == batch_id,
        LeaseModel.group_id == group_id,
        LeaseModel.person == person,
    )
    done: Any = session.execute(delete(LeaseModel).where(*where))
    return bool(done.rowcount)


def delete_ended_leases(session: Session, at: str) -> None:
    """Delete the leases that have run out."""
    session.execute(_ENDED, {"at": at})


class WorkEntry(NamedTuple):
    """An entry of the log about a group of a batch."""

    actor: str
    at: str
    group_id: int
    kind: str


def list_work_entries(session: Session, batch_id: int, since: str) -> Sequence[WorkEntry]:
    """Entries of the log about a batch's groups, and people's own copies of them, since some time, in order."""
    columns = (LogModel.actor, LogModel.at, LogModel.group_id, LogModel.kind)
    statement = select(*columns).where(
        *_build_work_entry_conditions(batch_id), LogModel.at >= since
    )
    return session.rows(WorkEntry, statement.order_by(LogModel.at))


def find_last_work_time(session: Session, batch_id: int) -> str | None:
    """When somebody did something with a group of a batch last, or with a copy of one."""
    last: str | None = session.scalar(
        select(func.max(LogModel.at)).where(*_build_work_entry_conditions(batch_id))
    )
    return last


def _build_work_entry_conditions(batch_id: int) -> tuple[ColumnElement[bool], ...]:
    mine = select(BatchGroupModel.group_id).where(BatchGroupModel.batch_id == batch_id)
    copies = select(IndependentAnnotationModel.copy_id).where(
        IndependentAnnotationModel.batch_id == batch_id
    )
    return LogModel.group_id.in_(mine.union_all(copies)), LogModel.kind.in_(_DONE_KINDS)


def select_groups_in_batches(batch_ids: Collection[int]) -> Select[int]:
    """Ids of the groups of batches."""
    return select(BatchGroupModel.group_id).where(BatchGroupModel.batch_id.in_(batch_ids))


def select_place_in_batch(batch_id: int) -> ColumnElement[Any]:
    """The place of a row of the queue in a batch; NULL where it is in none of it."""
    return (
        select(BatchGroupModel.place)
        .where(
            BatchGroupModel.batch_id == batch_id, BatchGroupModel.group_id == QueueModel.group_id
        )
        .correlate(QueueModel)
        .scalar_subquery()
    )
