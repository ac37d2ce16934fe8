"""Bulk undo: every group of a batch gets the verdict back that it had before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.errors import ConflictError, NotFoundError
from app.review.verdicts.bulk import chunks, save_verdicts
from app.store.batches import Spans, StoredBulkVerdict, find_batch, update_batch, with_span
from app.store.clock import now
from app.store.log import Entry, append
from app.store.session import Session
from app.store.store import Store
from app.store.verdicts import StoredVerdict, judged_between, next_verdict_id, read_verdicts


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
        before = read_batch(session, batch_id).undo_spans or ()
        restored = _restored(session, before)
    known, number = _verdicts_in(before), 0
    while True:
        with store.write() as session:
            batch = _standing(session, batch_id)
            left = chunks(batch.spans)[number:]
            # What another run has taken back is not taken back again: it is not the newest.
            verdicts = _restore(session, batch, *left[0], actor) if left else []
            spans = with_span(batch.undo_spans or (), [item.id for item in verdicts])
            update_batch(session, batch_id, undo_spans=spans)
            restored += len({item.group_id for item in verdicts})
            known += len(verdicts)
            number += 1
            if len(left) <= 1:
                if _verdicts_in(spans) != known:
                    # Another run has been at it meanwhile.
                    restored = _restored(session, spans)
                report = UndoReport(batch_id, restored, batch.changed - restored)
                _close(session, batch, report, actor)
                session.respond(report)
                return report


def _restored(session: Session, spans: Spans) -> int:
    """Of how many groups these verdicts are."""
    return len({group for span in spans for group in judged_between(session, *span)})


def _verdicts_in(spans: Spans) -> int:
    return sum(last - first + 1 for first, last in spans)


def _standing(session: Session, batch_id: int) -> StoredBulkVerdict:
    """A batch that was not taken back, or not wholly.

    Raises:
        NotFoundError: There is no such batch.
        ConflictError: It was taken back before.
    """
    batch = read_batch(session, batch_id)
    if batch.undone is not None:
        raise ConflictError(f"{batch.undone_by} has taken this batch back already")
    return batch


def _close(session: Session, batch: StoredBulkVerdict, report: UndoReport, actor: str) -> None:
    """Say of a batch, and in the log, that it was taken back."""
    at = now()
    update_batch(session, batch.id, undone=at, undone_by=actor)
    entry = Entry("verdict_batch_undo", actor, at, dict(vars(report)), batch.dataset_id)
    append(session, [entry])


def read_batch(session: Session, batch_id: int) -> StoredBulkVerdict:
    """A batch by its id.

    Raises:
        NotFoundError: There is no such batch.
    """
    batch = find_batch(session, batch_id)
    if batch is None:
        raise NotFoundError(f"there is no batch of verdicts {batch_id}")
    return batch


def _restore(
    session: Session, batch: StoredBulkVerdict, first: int, last: int, actor: str
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
