"""Bulk undo: every group of a batch gets the verdict back that it had before."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from app.errors import ConflictError, NotFoundError
from app.finite import json_text
from app.review.verdicts.bulk import save_verdicts
from app.store.answers import Keep, keep_nothing
from app.store.clock import now
from app.store.log import Entry, append
from app.store.session import Store
from app.store.verdicts import StoredVerdict, judged_between, next_verdict_id, read_verdicts
from app.store.view_models import VerdictBatchModel


@dataclass(frozen=True)
class UndoReport:
    """What undoing a batch did; ``kept`` are groups that somebody has judged since."""

    batch: int
    restored: int
    kept: int


def undo_batch(
    store: Store, batch_id: int, *, actor: str, keep: Keep[UndoReport] = keep_nothing
) -> UndoReport:
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
    # What a run that was killed has taken back is not taken back again: it is not the newest.
    spans: list[tuple[int, int]] = [tuple(span) for span in json.loads(batch.undo_spans or "[]")]
    given: list[tuple[int, int]] = json.loads(batch.spans)
    for number, (first, last) in enumerate(given, 1):
        with store.write() as session:
            verdicts = _restore(session, batch, first, last, actor)
            spans += [(verdicts[0].id, verdicts[-1].id)] if verdicts else []
            _save_spans(session, batch_id, spans)
            if number == len(given):
                restored = {group for span in spans for group in judged_between(session, *span)}
                report = UndoReport(batch_id, len(restored), batch.changed - len(restored))
                _close(session, batch, report, actor)
                keep(report)(session)
    return report


def _save_spans(session: Session, batch_id: int, spans: list[tuple[int, int]]) -> None:
    """Say which verdicts have taken a batch back so far, so that a stop in between is no harm."""
    mine = VerdictBatchModel.id == batch_id
    session.execute(update(VerdictBatchModel).where(mine).values(undo_spans=json_text(spans)))


def _close(session: Session, batch: Any, report: UndoReport, actor: str) -> None:
    """Say of a batch, and in the log, that it was taken back."""
    at = now()
    values = {"undone": at, "undone_by": actor}
    session.execute(
        update(VerdictBatchModel).where(VerdictBatchModel.id == batch.id).values(values)
    )
    entry = Entry("verdict_batch_undo", actor, at, dict(vars(report)), batch.dataset_id)
    append(session, [entry])


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
) -> list[StoredVerdict]:
    """Take one chunk back; returns the verdicts that do it, of groups not judged since."""
    at, number = now(), next_verdict_id(session)
    again: list[StoredVerdict] = []
    for verdicts in read_verdicts(session, judged_between(session, first, last)).values():
        if first <= verdicts[0].id <= last:
            again += _before(verdicts, batch.actor, at)
    numbered = [replace(item, id=number + place) for place, item in enumerate(again)]
    if numbered:
        save_verdicts(session, batch.dataset_id, numbered, actor=actor, at=at)
    return numbered


def _before(verdicts: Sequence[StoredVerdict], judge: str, at: str) -> list[StoredVerdict]:
    """Verdicts that put a group back: its judge's own last one, then the one that counted.

    The newest verdict counts, so what counted before is said last.
    """
    newest, earlier = verdicts[0], verdicts[1:]
    own = next((item for item in earlier if item.actor == judge), None)
    taken_back = replace(
        newest, at=at, state="unreviewed", reason=None, note=None, override=None, fixed=False
    )
    again = [taken_back if own is None else own]
    if earlier and earlier[0] is not own:
        again.append(earlier[0])
    return again
