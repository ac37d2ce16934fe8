"""Agreement in the database: what annotations of a group came to, and the limits of a dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from sqlalchemy import ForeignKey, Index, LargeBinary, Select, delete, func, insert, select, update
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base, Session
from app.evaluation.rater_agreement import AgreementLimits
from app.features.batches.tables import BatchModel
from app.features.independent_annotations.queries import INDEPENDENT
from app.features.independent_annotations.tables import IndependentAnnotationModel
from app.features.queue.tables import QueueModel

AGREED, OPEN, DECIDED = "agreed", "open", "decided"
"""States of an agreement."""


class AgreementModel(Base):
    """What the annotations of a group that were submitted came to; ``batch_id`` is 0 for no batch.

    ``state`` is ``agreed``, ``open`` (it waits for somebody to decide) or ``decided``. ``takes`` names
    what was compared, ``pairs`` is how far they lie apart (compressed JSON), ``worst`` how many
    times its limit the worst disagreement is, ``disagreements`` how many there are. ``take_id`` is
    the one that was taken, ``outcome`` ``take`` or ``start`` (it was gone on from).
    """

    __tablename__ = "agreement"
    __table_args__ = (Index("agreement_dataset", "dataset_id", "state"),)

    group_id: Mapped[int] = mapped_column(
        ForeignKey("groups.id", ondelete="CASCADE"), primary_key=True
    )
    batch_id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"))
    state: Mapped[str]
    takes: Mapped[str]
    pairs: Mapped[bytes] = mapped_column(LargeBinary)
    worst: Mapped[float]
    disagreements: Mapped[int]
    found: Mapped[str]
    outcome: Mapped[str | None]
    take_id: Mapped[int | None]
    decided: Mapped[str | None]
    decided_by: Mapped[str | None]


class AgreementLimitsModel(Base):
    """How far annotations of a dataset's groups may lie apart and still agree; no row: defaults."""

    __tablename__ = "agreement_limits"

    dataset_id: Mapped[int] = mapped_column(
        ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True
    )
    line_px: Mapped[float]
    markings: Mapped[int]
    ball_px: Mapped[float]
    diameter_px: Mapped[float]
    ball_m: Mapped[float]
    jac: Mapped[float]
    changed: Mapped[str]
    changed_by: Mapped[str]


class AgreementRow(NamedTuple):
    """What a group came to in a batch, with its ``number`` and ``status`` in the queue."""

    group_id: int
    batch_id: int
    dataset_id: int
    state: str
    takes: str
    pairs: bytes
    worst: float
    disagreements: int
    found: str
    outcome: str | None
    take_id: int | None
    decided: str | None
    decided_by: str | None
    number: int
    status: str


_ROWS = select(*AgreementModel.__table__.columns, QueueModel.number, QueueModel.status).join(
    QueueModel, QueueModel.group_id == AgreementModel.group_id
)


def list_agreements(
    session: Session, dataset_id: int, *, batch_id: int | None = None, state: str | None = None
) -> Sequence[AgreementRow]:
    """What the groups of a dataset came to, each with its ``number`` and ``status``; the worst first.

    Args:
        session: The database.
        dataset_id: The dataset.
        batch_id: One batch alone; 0: what belongs to none.
        state: One state alone.
    """
    where = [AgreementModel.dataset_id == dataset_id]
    if batch_id is not None:
        where.append(AgreementModel.batch_id == batch_id)
    if state is not None:
        where.append(AgreementModel.state == state)
    order = (AgreementModel.worst.desc(), AgreementModel.group_id)
    return session.rows(AgreementRow, _ROWS.where(*where).order_by(*order))


def list_group_agreements(session: Session, group_id: int) -> Sequence[AgreementRow]:
    """The agreement rows of a group, one for each batch, open ones first."""
    order = (AgreementModel.state != OPEN, AgreementModel.batch_id)
    mine = AgreementModel.group_id == group_id
    return session.rows(AgreementRow, _ROWS.where(mine).order_by(*order))


def put_agreement(session: Session, values: Mapping[str, Any]) -> None:
    """Write what a group came to in place of what it came to before; all columns are named."""
    table = AgreementModel
    where = (table.group_id == values["group_id"], table.batch_id == values["batch_id"])
    session.execute(delete(table).where(*where))
    session.execute(insert(table), [dict(values)])


def select_groups_in_agreement_state(state: str) -> Select[int]:
    """Ids of the groups whose annotations came to a state, in any batch."""
    return select(AgreementModel.group_id).where(AgreementModel.state == state)


def list_undecided_groups(session: Session, dataset_id: int) -> set[int]:
    """Ids of the groups of a dataset that wait for a decision in any batch."""
    mine = AgreementModel.dataset_id == dataset_id
    return set(session.scalars(select_groups_in_agreement_state(OPEN).where(mine)))


def read_agreement_states(session: Session, group_ids: Sequence[int]) -> dict[int, str]:
    """What groups came to, what waits for a decision first; those that were not compared are left out."""
    rows = session.execute(
        select(AgreementModel.group_id, AgreementModel.state)
        .where(AgreementModel.group_id.in_(group_ids))
        .order_by(AgreementModel.state == OPEN, AgreementModel.batch_id)
    )
    return {row.group_id: row.state for row in rows}


def delete_open_agreement(session: Session, group_id: int, batch_id: int) -> None:
    """Nothing of a group waits for a decision in a batch (0: in none) any more."""
    table = AgreementModel
    where = (table.group_id == group_id, table.batch_id == batch_id, table.state == OPEN)
    session.execute(delete(table).where(*where))


def save_adjudication(
    session: Session, group_id: int, batch_id: int, values: Mapping[str, Any]
) -> int | None:
    """Write what was decided; returns the id of the group's dataset, None where nothing was compared."""
    table = AgreementModel
    where = (table.group_id == group_id, table.batch_id == batch_id)
    done = update(table).where(*where).values(**values).returning(table.dataset_id)
    dataset: int | None = session.execute(done).scalar_one_or_none()
    return dataset


def complete_unchosen_annotations(session: Session, take_ids: Sequence[int], at: str) -> None:
    """Takes that were compared and not taken are over."""
    rest = (
        IndependentAnnotationModel.id.in_(take_ids),
        IndependentAnnotationModel.settled.is_(None),
    )
    session.execute(update(IndependentAnnotationModel).where(*rest).values(settled=at))


def reopen_annotations(session: Session, take_ids: Sequence[int]) -> None:
    """Takes that were decided about wait for a decision again."""
    mine = IndependentAnnotationModel.id.in_(take_ids)
    session.execute(update(IndependentAnnotationModel).where(mine).values(settled=None))


def list_groups_to_compare(session: Session) -> list[tuple[int, int | None]]:
    """Group and batch (None: none) of annotations that several people submitted and nobody compared."""
    annotation, row = IndependentAnnotationModel, AgreementModel
    same = (row.group_id == annotation.group_id) & (
        row.batch_id == func.coalesce(annotation.batch_id, 0)
    )
    ready = (
        annotation.kind == INDEPENDENT,
        annotation.submitted.is_not(None),
        annotation.settled.is_(None),
    )
    statement = (
        select(annotation.group_id, annotation.batch_id)
        .outerjoin(row, same)
        .where(*ready, row.group_id.is_(None))
        .group_by(annotation.group_id, annotation.batch_id)
        .having(func.count() > 1)
        .order_by(annotation.group_id)
    )
    return [(found.group_id, found.batch_id) for found in session.execute(statement)]


def list_submitted_copies_to_take_over(session: Session) -> list[int]:
    """Copies that were submitted in batches which ask for one annotation a group, and wait."""
    annotation = IndependentAnnotationModel
    ready = (
        annotation.kind == INDEPENDENT,
        annotation.submitted.is_not(None),
        annotation.settled.is_(None),
    )
    statement = select(annotation.copy_id).join(BatchModel, BatchModel.id == annotation.batch_id)
    return list(session.scalars(statement.where(*ready, BatchModel.verdicts == 1)))


def read_required_annotation_count(session: Session, batch_id: int) -> int | None:
    """How many annotations of each group a batch asks for; None where there is no such batch."""
    verdicts: int | None = session.scalar(
        select(BatchModel.verdicts).where(BatchModel.id == batch_id)
    )
    return verdicts


def find_limits(session: Session, dataset_id: int) -> AgreementLimits | None:
    """The limits of a dataset; None: nobody has set any."""
    columns = [
        column
        for column in AgreementLimitsModel.__table__.columns
        if column.name not in ("dataset_id", "changed", "changed_by")
    ]
    where = AgreementLimitsModel.dataset_id == dataset_id
    row = session.execute(select(*columns).where(where)).one_or_none()
    return None if row is None else AgreementLimits(**row._mapping)


def put_limits(session: Session, dataset_id: int, values: Mapping[str, Any]) -> None:
    """Write the limits of a dataset."""
    session.execute(
        delete(AgreementLimitsModel).where(AgreementLimitsModel.dataset_id == dataset_id)
    )
    session.execute(insert(AgreementLimitsModel), [{"dataset_id": dataset_id, **values}])
