"""Bulk redo: a batch that was taken back is given again, as a batch of its own."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from app.errors import ConflictError
from app.review.verdicts.bulk import ASKED, BatchRun, Refusal, chunks, sort_out
from app.review.verdicts.bulk_undo import read_batch
from app.review.verdicts.verdict import check_verdict
from app.store.batches import Spans, StoredBulkVerdict, update_batch
from app.store.listing import read_columns
from app.store.session import Session
from app.store.solutions import present_keys
from app.store.store import Store
from app.store.verdicts import inputs_judged, newest_between


@dataclass(frozen=True)
class RedoReport:
    """What giving a batch again did.

    Attributes:
        batch: The new batch, which can be taken back like any other; None when nothing changed.
        changed: Groups that have the verdict again.
        kept: Groups that somebody has judged or edited since; they stay as they are.
        refused: Groups that the verdict cannot be given to any more, and why.
    """

    batch: int | None
    changed: int
    kept: int
    refused: tuple[Refusal, ...]


def redo_batch(store: Store, batch_id: int, *, actor: str) -> RedoReport:
    """Give the verdicts of a batch again after they were taken back.

    A group keeps what it has when somebody judged it after the batch was taken back, or edited
    it since the batch judged it: nobody has seen what the verdict would speak of. What a run that
    was stopped has left over is given as the same batch, also under another key.

    Raises:
        NotFoundError: There is no such batch.
        ConflictError: It was not taken back, or it was given again already, or somebody else has
            begun to.
    """
    with store.read() as session:
        batch = read_batch(session, batch_id)
        verdict = check_verdict(batch.state, batch.reason, batch.note)
        run = BatchRun(batch.dataset_id, batch.query, verdict, actor, batch_id)
        begun = run.resume(session)
    spans = _spans(batch) if begun is None else begun["left"]
    refused: Counter[str] = Counter({} if begun is None else begun["refused"])
    if not spans:
        return _report(batch, run, refused)
    for number, (first, last) in enumerate(spans, 1):
        with store.write() as session:
            run.batch = _begun(session, batch_id, actor)
            ids = _unchanged(session, batch.spans, first, last)
            rows = read_columns(session, ids, (), ASKED)
            found = sort_out(session, batch.dataset_id, rows, verdict)
            run.save(session, found.change)
            refused.update({item.reason: item.groups for item in found.refused})
            if run.batch is not None:
                update_batch(session, batch_id, redone=run.batch)
            if number < len(spans):
                left = [list(span) for span in spans[number:]]
                run.interrupt(session, {"left": left, "refused": dict(refused)})
            else:
                run.close(session)
                report = _report(batch, run, refused)
                session.respond(report)
    return report


def _report(batch: StoredBulkVerdict, run: BatchRun, refused: Counter[str]) -> RedoReport:
    kept = batch.changed - run.changed - refused.total()
    reasons = tuple(Refusal(reason, groups) for reason, groups in refused.items())
    return RedoReport(run.batch, run.changed, kept, reasons)


def _spans(batch: StoredBulkVerdict) -> Spans:
    """First and last id of the verdicts that took a batch back, chunk by chunk."""
    if batch.undone is None:
        raise ConflictError("this batch was not taken back, so there is nothing to give again")
    if batch.undo_spans is None:
        raise ConflictError(
            "this batch was taken back by an older version of Touchline, which kept no record "
            "of the groups",
            hint="Give the verdict once more in the queue.",
        )
    return chunks(batch.undo_spans)


def _begun(session: Session, batch_id: int, actor: str) -> int | None:
    """The batch that gives a batch again and is not complete; None where nobody has begun."""
    redone = read_batch(session, batch_id).redone
    if redone is None:
        return None
    again = read_batch(session, redone)
    if again.done or again.is_taken_back:
        raise ConflictError("the verdicts of this batch were given again already")
    if again.actor != actor:
        raise ConflictError(
            f"{again.actor} has begun to give this batch again",
            hint=f"Let {again.actor} finish it, or take back what was given.",
        )
    return again.id


def _unchanged(session: Session, given: Spans, first: int, last: int) -> list[int]:
    """Groups of one chunk that nobody has judged since it was taken back, or edited."""
    ids = newest_between(session, first, last)
    judged: dict[int, str] = {}
    for start, end in given:
        judged |= inputs_judged(session, start, end, ids)
    keys = present_keys(session, ids)
    return [group for group in ids if judged.get(group) == keys[group].inputs_hash]
