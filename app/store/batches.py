"""Batches in the database: verdicts that were given at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import insert, select, update

from app.finite import json_text
from app.store.group_rows import next_id
from app.store.session import Session
from app.store.stored_json import parse
from app.store.tables.saved_views import VerdictBatchModel

Spans = Sequence[tuple[int, int]]
"""First and last id of the verdicts of each chunk."""

_BATCHES = select(*VerdictBatchModel.__table__.columns)
_SPANS = ("spans", "undo_spans")


@dataclass(frozen=True)
class StoredBulkVerdict:
    """A bulk verdict as it is remembered.

    Attributes:
        log_id: The entry that closed it; None while it runs, or when it was killed.
        undone: When it was taken back; ``redone`` is the batch that gave it again after that.
        undo_spans: Of the verdicts that took it back; None where that is not known.
    """

    id: int
    dataset_id: int
    actor: str
    at: str
    query: str
    state: str
    reason: str | None
    note: str | None
    changed: int
    spans: Spans
    log_id: int | None
    undone: str | None
    undone_by: str | None
    undo_spans: Spans | None
    redone: int | None

    @property
    def done(self) -> bool:
        """False while it runs, or when it was killed."""
        return self.log_id is not None

    @property
    def is_taken_back(self) -> bool:
        """Whether its verdicts have been taken back, or are being."""
        return self.undone is not None or self.undo_spans is not None


def read_batches(
    session: Session, dataset_id: int, limit: int, before: int | None = None
) -> list[StoredBulkVerdict]:
    """The batches of a dataset, the newest first; only those before an id where there is one."""
    model = VerdictBatchModel
    statement = _BATCHES.where(model.dataset_id == dataset_id).order_by(model.id.desc())
    if before is not None:
        statement = statement.where(model.id < before)
    return [_batch(row) for row in session.execute(statement.limit(limit))]


def find_batch(session: Session, batch_id: int) -> StoredBulkVerdict | None:
    """A batch by its id."""
    row = session.execute(_BATCHES.where(VerdictBatchModel.id == batch_id)).one_or_none()
    return None if row is None else _batch(row)


def insert_batch(session: Session, **values: Any) -> int:
    """Insert a batch, from fields of ``StoredBulkVerdict`` but its id; returns its id."""
    identity = next_id(session, VerdictBatchModel)
    session.execute(insert(VerdictBatchModel), [{**_row(values), "id": identity}])
    return identity


def update_batch(session: Session, batch_id: int, **values: Any) -> None:
    """Change fields of a batch."""
    mine = VerdictBatchModel.id == batch_id
    session.execute(update(VerdictBatchModel).where(mine).values(_row(values)))


def _batch(row: Any) -> StoredBulkVerdict:
    spans = {name: parse(getattr(row, name) or "null") for name in _SPANS}
    return StoredBulkVerdict(**{**row._mapping, **spans})


def _row(values: dict[str, Any]) -> dict[str, Any]:
    return {name: json_text(item) if name in _SPANS else item for name, item in values.items()}


def with_span(spans: Spans, ids: Sequence[int]) -> Spans:
    """Spans together with that of some ids in a row, which often go on where the last one ends."""
    if not ids:
        return spans
    first, last = ids[0], ids[-1]
    if spans and spans[-1][1] + 1 == first:
        return [*spans[:-1], (spans[-1][0], last)]
    return [*spans, (first, last)]


def pieces(spans: Spans, most: int) -> list[tuple[int, int]]:
    """The same ids in spans of at most so many."""
    return [
        (start, min(start + most - 1, last))
        for first, last in spans
        for start in range(first, last + 1, most)
    ]
