"""Bulk undo: every group of a batch gets the verdict back that it had before."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from app.errors import ConflictError, NotFoundError
from app.finite import json_text
from app.review.verdicts.bulk import save_verdicts
from app.store.clock import now
from app.store.group_rows import next_id
from app.store.log import Entry, append
from app.store.models import VerdictModel
from app.store.session import Store
from app.store.view_models import VerdictBatchModel


@dataclass(frozen=True)
class UndoReport:
    """What undoing a batch did; ``kept`` are groups that somebody has judged since."""

    batch: int
    restored: int
    kept: int


def undo_batch(store: Store, batch_id: int, *, actor: str) -> UndoReport:
    """Give every group of a batch the verdict back that it had before.

    A group that somebody has judged since keeps that verdict.

    Raises:
        NotFoundError: There is no such batch.
        ConflictError: It was taken back before.
    """
    with store.read() as session:
        batch = read_batch(session, batch_id)
    if batch.undone is not None:
        raise ConflictError(f"{batch.undone_by} has taken this batch back already")
    restored, spans = 0, list[tuple[int, int]]()
    for first, last in json.loads(batch.spans):
        with store.write() as session:
            rows = _restore(session, batch, first, last, actor)
        restored += len({row["group_id"] for row in rows})
        spans += [(rows[0]["id"], rows[-1]["id"])] if rows else []
    kept = batch.changed - restored
    with store.write() as session:
        at = now()
        values = {"undone": at, "undone_by": actor, "undo_spans": json_text(spans)}
        session.execute(
            update(VerdictBatchModel).where(VerdictBatchModel.id == batch_id).values(values)
        )
        body = {"batch": batch_id, "restored": restored, "kept": kept}
        append(session, [Entry("verdict_batch_undo", actor, at, body, batch.dataset_id)])
    return UndoReport(batch_id, restored, kept)


def read_batch(session: Session, batch_id: int) -> Any:
    """The row of a batch.

    Raises:
        NotFoundError: There is no such batch.
    """
    model = VerdictBatchModel
    statement = select(*model.__table__.columns).where(model.id == batch_id)
    row = session.execute(statement).one_or_none()
    if row is None:
        raise NotFoundError(f"there is no batch of verdicts {batch_id}")
    return row


def _restore(
    session: Session, batch: Any, first: int, last: int, actor: str
) -> list[dict[str, Any]]:
    """Take one chunk back; returns the verdicts that do it, of groups not judged since."""
    given = select(VerdictModel.group_id).where(VerdictModel.id.between(first, last))
    statement = select(*VerdictModel.__table__.columns).where(VerdictModel.group_id.in_(given))
    history: dict[int, list[Any]] = {}
    for row in session.execute(statement.order_by(VerdictModel.id.desc())):
        history.setdefault(row.group_id, []).append(row)
    at, rows = now(), []
    for verdicts in history.values():
        if first <= verdicts[0].id <= last:
            rows += _before(verdicts, batch.actor, actor, at)
    number = next_id(session, VerdictModel)
    numbered = [{**row, "id": number + place} for place, row in enumerate(rows)]
    if numbered:
        save_verdicts(session, batch.dataset_id, actor, at, numbered)
    return numbered


def _before(verdicts: Sequence[Any], judge: str, actor: str, at: str) -> list[dict[str, Any]]:
    """Verdicts that put a group back: its judge's own last one, then the one that counted.

    The newest verdict counts, so what counted before is said last.
    """
    newest, earlier = verdicts[0], verdicts[1:]
    own = next((row for row in earlier if row.actor == judge), None)
    taken_back = {
        **newest._mapping,
        **dict.fromkeys(("reason", "note", "override")),
        "at": at,
        "state": "unreviewed",
        "fixed": False,
    }
    again = [taken_back if own is None else dict(own._mapping)]
    if earlier and earlier[0] is not own:
        again.append(dict(earlier[0]._mapping))
    return again
