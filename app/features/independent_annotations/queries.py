"""Independent annotations and gold groups in the database."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

from sqlalchemy import (
    ColumnElement,
    Exists,
    Select,
    bindparam,
    delete,
    exists,
    func,
    insert,
    or_,
    select,
    update,
)
from sqlalchemy.orm import aliased

from app.db.dialects.dialect import insert as insert_or_update
from app.db.json_columns import Json, compress_json, decompress_json
from app.db.session import Session, now
from app.features.batches.tables import BatchGroupModel, BatchPersonModel
from app.features.datasets.tables import DatasetModel, GroupModel
from app.features.groups.insert_queries import find_next_row_id
from app.features.independent_annotations.tables import (
    CopyDatasetModel,
    GoldModel,
    IndependentAnnotationModel,
)
from app.features.people.tables import PersonModel
from app.features.queue.tables import QueueModel
from app.soccer.choices import GoldStart

GOLD = "gold"
INDEPENDENT = "independent"
_ANNOTATIONS = select(
    *(column.label(column.key) for column in IndependentAnnotationModel.__table__.columns)
)
# What somebody made of a gold group tells nothing of its own: nobody is to know which one it is.
_READY = (
    IndependentAnnotationModel.kind == INDEPENDENT,
    IndependentAnnotationModel.submitted.is_not(None),
)
_OF_COPY = _ANNOTATIONS.where(IndependentAnnotationModel.copy_id == bindparam("copy"))


class OpenCopy(NamedTuple):
    """A copy in a batch that somebody has begun and not submitted."""

    batch_id: int
    group_id: int


class CopyDataset(NamedTuple):
    """A dataset of copies, by its ``name``: of ``of_id``, in a batch (0: none), by a person."""

    dataset_id: int
    of_id: int
    batch_id: int
    person: str
    name: str


class GoldHead(NamedTuple):
    """A gold group without its known truth."""

    group_id: int
    dataset_id: int
    start: str
    marked: str
    marked_by: str
    key: str
    label: str


_COPIES = select(*CopyDatasetModel.__table__.columns, DatasetModel.name).join(
    DatasetModel, DatasetModel.id == CopyDatasetModel.dataset_id
)
IMPORTED = "imported"
WITHOUT_BALLS = "without_balls"
BARE = "bare"
STARTS: tuple[str, ...] = get_args(GoldStart)
_HEADS = select(
    GoldModel.group_id,
    GoldModel.dataset_id,
    GoldModel.start,
    GoldModel.marked,
    GoldModel.marked_by,
    GroupModel.key,
    GroupModel.label,
).join(GroupModel, GroupModel.id == GoldModel.group_id)


@dataclass(frozen=True)
class IndependentAnnotation:
    """A person's own annotation of a group.

    Attributes:
        group_id: The original.
        copy_id: The group that is the copy; it is opened and edited like any other.
        kind: ``independent``, or ``gold`` where the original's truth is known: for leads alone.
        place: Which one of this person in this batch it is, from 1.
        verdict: What they judged; None: nothing.
        settled: When something was decided about it; None: not yet.
    """

    id: int
    batch_id: int | None
    group_id: int
    copy_id: int
    person: str
    kind: str
    place: int
    begun: str
    submitted: str | None
    verdict: str | None
    settled: str | None


def _fetch_annotations(
    session: Session, statement: Select[*tuple[Any, ...]], values: dict[str, Any] | None = None
) -> list[IndependentAnnotation]:
    return [IndependentAnnotation(**row._mapping) for row in session.execute(statement, values)]


def insert_annotation(
    session: Session,
    *,
    batch_id: int | None,
    group_id: int,
    copy_id: int,
    person: str,
    kind: str,
    place: int,
) -> int:
    """Insert an independent annotation that begins now; returns its id."""
    identity = find_next_row_id(session, IndependentAnnotationModel)
    values = {"batch_id": batch_id, "group_id": group_id, "copy_id": copy_id, "person": person}
    ends = dict.fromkeys(("submitted", "verdict", "settled"))
    row = {"id": identity, **values, "kind": kind, "place": place, "begun": now(), **ends}
    session.execute(insert(IndependentAnnotationModel), [row])
    return identity


def find_annotation(session: Session, annotation_id: int) -> IndependentAnnotation | None:
    """An independent annotation by its id."""
    return next(
        iter(
            _fetch_annotations(
                session, _ANNOTATIONS.where(IndependentAnnotationModel.id == annotation_id)
            )
        ),
        None,
    )


def find_annotation_of_copy(session: Session, copy_id: int) -> IndependentAnnotation | None:
    """The independent annotation whose copy a group is; None for an ordinary group."""
    return next(iter(_fetch_annotations(session, _OF_COPY, {"copy": copy_id})), None)


def list_closed_copies(session: Session, dataset_id: int) -> set[int]:
    """Ids of the copies in a dataset that were submitted or settled: nothing in them changes."""
    closed = or_(
        IndependentAnnotationModel.submitted.is_not(None),
        IndependentAnnotationModel.settled.is_not(None),
    )
    statement = select(IndependentAnnotationModel.copy_id).join(
        GroupModel, GroupModel.id == IndependentAnnotationModel.copy_id
    )
    return set(session.scalars(statement.where(GroupModel.dataset_id == dataset_id, closed)))


def list_annotations_of_group(session: Session, group_id: int) -> list[IndependentAnnotation]:
    """The independent annotations of a group in the order in which they began."""
    mine = IndependentAnnotationModel.group_id == group_id
    return _fetch_annotations(
        session, _ANNOTATIONS.where(mine).order_by(IndependentAnnotationModel.id)
    )


def list_annotations_of_batch(
    session: Session, batch_id: int | None, dataset_id: int
) -> list[IndependentAnnotation]:
    """The independent annotations of a batch (None: of none) of a dataset, in the order in which they began."""
    batch = IndependentAnnotationModel.batch_id
    mine = batch.is_(None) if batch_id is None else batch == batch_id
    statement = _ANNOTATIONS.where(
        mine, IndependentAnnotationModel.copy_id.in_(_select_copy_ids(dataset_id))
    )
    return _fetch_annotations(session, statement.order_by(IndependentAnnotationModel.id))


def is_abandoned() -> ColumnElement[bool]:
    """Whether an annotation of a batch was begun, not submitted, and its person works on the batch no
    more: they are disabled, or the batch was given to others. It leaves its place to somebody else."""
    annotation, part, person = IndependentAnnotationModel, BatchPersonModel, aliased(PersonModel)
    here, own = part.batch_id == annotation.batch_id, part.person_id == person.id

    def is_given(*where: ColumnElement[bool]) -> Exists:
        return exists().where(here, *where).correlate(annotation, person)

    annotates = is_given(own, part.part == "annotator") | (
        ~is_given(part.part == "annotator") & (is_given(own) | ~is_given())
    )
    left = person.disabled.is_(True) | ~annotates
    gone = exists().where(person.name == annotation.person, left).correlate(annotation)
    return annotation.submitted.is_(None) & gone


def list_abandoned_annotations(session: Session, batch_id: int) -> set[int]:
    """Ids of the annotations of a batch that were begun by people who work on it no more."""
    mine = IndependentAnnotationModel.batch_id == batch_id
    return set(session.scalars(select(IndependentAnnotationModel.id).where(mine, is_abandoned())))


def count_begun_and_free_groups(
    session: Session, batch_id: int, dataset_id: int, person: str, verdicts: int
) -> tuple[int, int]:
    """How many independent annotations of a batch a person has begun, and of how many of its groups they may make one.

    ``verdicts`` people may have a group; whose annotation is settled do not count where it waits again,
    nor do those who began one and left.
    """
    annotation, group = IndependentAnnotationModel, BatchGroupModel
    here = (annotation.batch_id == batch_id, annotation.copy_id.in_(_select_copy_ids(dataset_id)))
    mine, this = annotation.person == person, annotation.group_id == group.group_id
    ends = (annotation.submitted.is_(None), annotation.settled.is_(None))
    begun_by_others = (
        select(func.count())
        .where(
            *here,
            this,
            annotation.kind == INDEPENDENT,
            annotation.settled.is_(None),
            ~is_abandoned(),
        )
        .scalar_subquery()
    )
    free = select(func.count()).where(
        group.batch_id == batch_id,
        group.settled.is_(None),
        group.submitted.is_(None),
        group.submitted_by.is_(None),
        ~exists().where(*here, this, mine),
        begun_by_others < verdicts,
    )
    begun = select(func.count()).select_from(annotation).where(*here, mine, *ends)
    return session.scalar(begun) or 0, session.scalar(free) or 0


def _select_copy_ids(dataset_id: int) -> Select[int]:
    return (
        select(GroupModel.id)
        .join(CopyDatasetModel, CopyDatasetModel.dataset_id == GroupModel.dataset_id)
        .where(CopyDatasetModel.of_id == dataset_id)
    )


def select_groups_with_annotations(
    compare: Callable[[Any, float], Any] | None = None, number: float = 0
) -> Select[int]:
    """Ids of groups of which somebody submitted an annotation of their own, or so many people did."""
    statement = (
        select(IndependentAnnotationModel.group_id)
        .where(*_READY)
        .group_by(IndependentAnnotationModel.group_id)
    )
    return statement if compare is None else statement.having(compare(func.count(), number))


def count_submitted(session: Session, group_ids: Sequence[int]) -> dict[int, int]:
    """How many people submitted an annotation of their own, by group; groups without are left out."""
    statement = select(IndependentAnnotationModel.group_id, func.count()).where(*_READY)
    rows = session.execute(
        statement.where(IndependentAnnotationModel.group_id.in_(group_ids)).group_by(
            IndependentAnnotationModel.group_id
        )
    )
    return {row[0]: row[1] for row in rows}


def list_open_annotations(
    session: Session, batch_ids: Collection[int], person: str
) -> Sequence[OpenCopy]:
    """The copies in batches that somebody has begun and not submitted."""
    mine = (
        IndependentAnnotationModel.person == person,
        IndependentAnnotationModel.submitted.is_(None),
        IndependentAnnotationModel.settled.is_(None),
    )
    columns = (
        IndependentAnnotationModel.batch_id,
        IndependentAnnotationModel.copy_id.label("group_id"),
    )
    statement = select(*columns).where(IndependentAnnotationModel.batch_id.in_(batch_ids), *mine)
    return session.rows(OpenCopy, statement.order_by(IndependentAnnotationModel.id))


def read_annotations(
    session: Session, dataset_id: int, person: str | None = None, kind: str | None = None
) -> list[IndependentAnnotation]:
    """The independent annotations of a dataset, of one person or one kind where these are named, oldest first."""
    statement = _ANNOTATIONS.join(
        GroupModel, GroupModel.id == IndependentAnnotationModel.copy_id
    ).join(CopyDatasetModel, CopyDatasetModel.dataset_id == GroupModel.dataset_id)
    where = [CopyDatasetModel.of_id == dataset_id]
    if person is not None:
        where.append(IndependentAnnotationModel.person == person)
    if kind is not None:
        where.append(IndependentAnnotationModel.kind == kind)
    return _fetch_annotations(
        session, statement.where(*where).order_by(IndependentAnnotationModel.id)
    )


class CopyAndOriginalNames(NamedTuple):
    """Names of a copy and of the group that it is a copy of.

    Attributes:
        of_id: Dataset of the original.
        same: Whether the copy has the key of the original.
        of_key, of_label, number: Of the original.
    """

    id: int
    key: str
    label: str
    of_id: int
    same: bool
    of_key: str
    of_label: str
    number: int


def read_copy_names(session: Session, copy_ids: Sequence[int]) -> Sequence[CopyAndOriginalNames]:
    """Names of copies and of their originals."""
    original = aliased(GroupModel)
    statement = (
        select(
            GroupModel.id,
            GroupModel.key,
            GroupModel.label,
            CopyDatasetModel.of_id,
            (original.key == GroupModel.key).label("same"),
            original.key.label("of_key"),
            original.label.label("of_label"),
            QueueModel.number,
        )
        .join(CopyDatasetModel, CopyDatasetModel.dataset_id == GroupModel.dataset_id)
        .join(IndependentAnnotationModel, IndependentAnnotationModel.copy_id == GroupModel.id)
        .join(original, original.id == IndependentAnnotationModel.group_id)
        .join(QueueModel, QueueModel.group_id == original.id)
    )
    return session.rows(CopyAndOriginalNames, statement.where(GroupModel.id.in_(copy_ids)))


def count_annotations(session: Session, batch_id: int | None, person: str) -> int:
    """How many takes a person has begun in a batch."""
    batch = IndependentAnnotationModel.batch_id
    mine = batch.is_(None) if batch_id is None else batch == batch_id
    statement = select(func.count()).where(mine, IndependentAnnotationModel.person == person)
    return session.scalar(statement) or 0


def update_annotation(session: Session, annotation_id: int, **values: str | None) -> None:
    """Write when an independent annotation was submitted, judged or settled."""
    session.execute(
        update(IndependentAnnotationModel)
        .where(IndependentAnnotationModel.id == annotation_id)
        .values(**values)
    )


@dataclass(frozen=True)
class CopyDatasetKey:
    """Of what a dataset holds copies: of the groups of ``of_id``, by a person, in a batch (0: none)."""

    of_id: int
    batch_id: int
    person: str


def insert_copy_dataset(session: Session, dataset_id: int, copies: CopyDatasetKey) -> None:
    """Say whose copies a dataset holds."""
    session.execute(insert(CopyDatasetModel), [{"dataset_id": dataset_id, **vars(copies)}])


def list_copy_datasets(session: Session, dataset_id: int) -> Sequence[CopyDataset]:
    """The datasets of a dataset's copies."""
    return session.rows(CopyDataset, _COPIES.where(CopyDatasetModel.of_id == dataset_id))


def find_copy_dataset(session: Session, copies: CopyDatasetKey) -> CopyDataset | None:
    """The dataset of such copies."""
    column = CopyDatasetModel
    mine = (column.of_id == copies.of_id) & (column.batch_id == copies.batch_id)
    return session.row(CopyDataset, _COPIES.where(mine, column.person == copies.person))


def list_copy_dataset_ids(session: Session) -> frozenset[int]:
    """Ids of the datasets that hold somebody's copies."""
    return frozenset(session.scalars(select(CopyDatasetModel.dataset_id)))


def is_copy_dataset(session: Session, dataset_id: int) -> bool:
    """Whether a dataset holds somebody's copies."""
    mine = CopyDatasetModel.dataset_id == dataset_id
    return session.scalar(select(CopyDatasetModel.dataset_id).where(mine)) is not None


def insert_gold(
    session: Session, group_id: int, dataset_id: int, start: str, truth: Json, by: str
) -> None:
    """Keep what is true of a group, in the place of what was kept before."""
    values = {"dataset_id": dataset_id, "start": start, "truth": compress_json(truth)}
    values |= {"marked": now(), "marked_by": by}
    statement = insert_or_update(GoldModel).values(group_id=group_id, **values)
    session.execute(statement.on_conflict_do_update(index_elements=["group_id"], set_=values))


def update_gold_start(session: Session, group_id: int, start: str) -> None:
    """Let annotators of a gold group begin with something else; what is true of it stays."""
    of = GoldModel.group_id == group_id
    session.execute(update(GoldModel).where(of).values(start=start))


def delete_gold(session: Session, group_id: int) -> None:
    """A gold group is an ordinary one again."""
    session.execute(delete(GoldModel).where(GoldModel.group_id == group_id))


def read_gold_start(session: Session, group_id: int) -> str:
    """The start that annotators of a gold group get."""
    statement = select(GoldModel.start).where(GoldModel.group_id == group_id)
    return session.scalar(statement) or IMPORTED


def find_common_gold_start(session: Session, dataset_id: int) -> str | None:
    """What everybody begins with in batches that mix the gold groups of a dataset in: that which
    leaves least of those that its gold groups have; None where there is not a gold group."""
    mine = GoldModel.dataset_id == dataset_id
    found = session.scalars(select(GoldModel.start).where(mine).distinct())
    return max(found, key=(IMPORTED, WITHOUT_BALLS, BARE).index, default=None)


def list_gold_heads(session: Session, dataset_id: int) -> Sequence[GoldHead]:
    """The gold groups of a dataset without what is true of them, by id of the group."""
    statement = _HEADS.where(GoldModel.dataset_id == dataset_id).order_by(GoldModel.group_id)
    return session.rows(GoldHead, statement)


def find_gold_head(session: Session, group_id: int) -> GoldHead | None:
    """A gold group without what is true of it; None: it is none."""
    return session.row(GoldHead, _HEADS.where(GoldModel.group_id == group_id))


def read_gold_truth(session: Session, group_id: int) -> Json | None:
    """The truth of a gold group as JSON; None where it has none."""
    packed = session.scalar(select(GoldModel.truth).where(GoldModel.group_id == group_id))
    return None if packed is None else decompress_json(packed)


def list_gold_without_copy(session: Session, dataset_id: int, person: str) -> list[int]:
    """Ids of the gold groups of a dataset of which a person has had no copy yet."""
    had = select(IndependentAnnotationModel.group_id).where(
        IndependentAnnotationModel.person == person
    )
    mine = GoldModel.dataset_id == dataset_id
    statement = select(GoldModel.group_id).where(mine, GoldModel.group_id.not_in(had))
    return list(session.scalars(statement.order_by(GoldModel.group_id)))
