"""Undo and redo of verdicts that were given in bulk."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.queue.queries import read_columns_of_groups
from app.features.solutions.queries import read_current_solution_keys
from app.features.verdicts.bulk import (
    ASKED,
    BulkVerdictRun,
    RefusedGroups,
    save_verdicts,
    select_groups_for_verdict,
    split_for_transactions,
)
from app.features.verdicts.queries import (
    Spans,
    StoredBulkVerdict,
    StoredVerdict,
    append_span,
    find_bulk_verdict,
    find_next_verdict_id,
    list_groups_of_verdict_range,
    list_groups_with_newest_verdict_in_range,
    read_judged_inputs_hashes,
    read_verdicts,
    update_bulk_verdict,
)
from app.features.verdicts.service import check_verdict
from app.features.verdicts.undo import make_restoring_verdicts


@dataclass(frozen=True)
class UndoReport:
    """What undoing a batch did; ``kept`` are groups that somebody has judged since.

    Attributes:
        restored: Groups that have the verdict of before again.
        kept: Groups that a person has judged since.
    """

    batch: int
    restored: int
    kept: int


def undo_bulk_verdict(store: Store, batch_id: int, *, actor: str) -> UndoReport:
    """Give every group of a batch the verdict back that it had before.

    A group that somebody has judged since keeps that verdict.

    Raises:
        NotFoundError: There is no such batch.
        ConflictError: It was taken back before.
    """
    with store.read() as session:
        before = read_bulk_verdict(session, batch_id).undo_spans or ()
        restored = _count_groups(session, before)
    known, number = _count_verdicts(before), 0
    while True:
        with store.write() as session:
            batch = _read_active_batch(session, batch_id)
            left = split_for_transactions(batch.spans)[number:]
            # What another run has taken back is not taken back again: it is not the newest.
            verdicts = _restore_chunk(session, batch, *left[0], actor) if left else []
            spans = append_span(batch.undo_spans or (), [item.id for item in verdicts])
            update_bulk_verdict(session, batch_id, undo_spans=spans)
            restored += len({item.group_id for item in verdicts})
            known += len(verdicts)
            number += 1
            if len(left) <= 1:
                if _count_verdicts(spans) != known:
                    # Another run has been at it meanwhile.
                    restored = _count_groups(session, spans)
                report = UndoReport(batch_id, restored, batch.changed - restored)
                _mark_batch_taken_back(session, batch, report, actor)
                session.respond(report)
                return report


def _count_groups(session: Session, spans: Spans) -> int:
    """Of how many groups these verdicts are."""
    return len({group for span in spans for group in list_groups_of_verdict_range(session, *span)})


def _count_verdicts(spans: Spans) -> int:
    return sum(last - first + 1 for first, last in spans)


def _read_active_batch(session: Session, batch_id: int) -> StoredBulkVerdict:
    """A batch that was not taken back, or not wholly.

    Raises:
        NotFoundError: There is no such batch.
        ConflictError: It was taken back before.
    """
    batch = read_bulk_verdict(session, batch_id)
    if batch.undone is not None:
        raise ConflictError(f"{batch.undone_by} has undone this batch already")
    return batch


def _mark_batch_taken_back(
    session: Session, batch: StoredBulkVerdict, report: UndoReport, actor: str
) -> None:
    """Say of a batch, and in the log, that it was taken back."""
    at = now()
    update_bulk_verdict(session, batch.id, undone=at, undone_by=actor)
    entry = NewLogEntry("verdict_batch_undo", actor, at, dict(vars(report)), batch.dataset_id)
    append_entries(session, [entry])


def read_bulk_verdict(session: Session, batch_id: int) -> StoredBulkVerdict:
    """A batch by its id.

    Raises:
        NotFoundError: There is no such batch.
    """
    batch = find_bulk_verdict(session, batch_id)
    if batch is None:
        raise NotFoundError(f"there is no batch of verdicts {batch_id}")
    return batch


def _restore_chunk(
    session: Session, batch: StoredBulkVerdict, first: int, last: int, actor: str
) -> list[StoredVerdict]:
    """Take one chunk back; returns the verdicts that do it, of groups not judged since."""
    at, number = now(), find_next_verdict_id(session)
    again: list[StoredVerdict] = []
    for verdicts in read_verdicts(
        session, list_groups_of_verdict_range(session, first, last)
    ).values():
        if first <= verdicts[0].id <= last:
            again += make_restoring_verdicts(verdicts, batch.actor, at)
    numbered = [replace(item, id=number + place) for place, item in enumerate(again)]
    if numbered:
        save_verdicts(session, batch.dataset_id, numbered, actor=actor, at=at)
    return numbered


@dataclass(frozen=True)
class RedoReport:
    """What giving a batch again did.

    Attributes:
        batch: The new batch, which can be undone like any other; None when nothing changed.
        changed: Groups that have the verdict again.
        kept: Groups that a person has judged or edited since; they stay as they are.
        refused: Groups that the verdict cannot be given to any more, and why.
    """

    batch: int | None
    changed: int
    kept: int
    refused: tuple[RefusedGroups, ...]


def redo_bulk_verdict(store: Store, batch_id: int, *, actor: str) -> RedoReport:
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
        batch = read_bulk_verdict(session, batch_id)
        verdict = check_verdict(batch.state, batch.reason, batch.note)
        run = BulkVerdictRun(batch.dataset_id, batch.query, verdict, actor, batch_id)
        begun = run.resume(session)
    spans = _read_undo_spans(batch) if begun is None else begun["left"]
    refused: Counter[str] = Counter({} if begun is None else begun["refused"])
    if not spans:
        return _redo_report(batch, run, refused)
    for number, (first, last) in enumerate(spans, 1):
        with store.write() as session:
            run.batch = _unfinished_redo(session, batch_id, actor)
            ids = _list_unchanged_groups(session, batch.spans, first, last)
            rows = read_columns_of_groups(session, ids, (), ASKED)
            found = select_groups_for_verdict(session, batch.dataset_id, rows, verdict)
            run.save_chunk(session, found.change)
            refused.update({item.reason: item.groups for item in found.refused})
            if run.batch is not None:
                update_bulk_verdict(session, batch_id, redone=run.batch)
            if number < len(spans):
                left = [list(span) for span in spans[number:]]
                run.save_remaining(session, {"left": left, "refused": dict(refused)})
            else:
                run.log_completion(session)
                report = _redo_report(batch, run, refused)
                session.respond(report)
    return report


def _redo_report(
    batch: StoredBulkVerdict, run: BulkVerdictRun, refused: Counter[str]
) -> RedoReport:
    kept = batch.changed - run.changed - refused.total()
    reasons = tuple(RefusedGroups(reason, groups) for reason, groups in refused.items())
    return RedoReport(run.batch, run.changed, kept, reasons)


def _read_undo_spans(batch: StoredBulkVerdict) -> Spans:
    """First and last id of the verdicts that took a batch back, chunk by chunk."""
    if batch.undone is None:
        raise ConflictError("this batch was not undone, so there is nothing to redo")
    if batch.undo_spans is None:
        raise ConflictError(
            "this batch was undone by an older version of Touchline, which kept no record of the "
            "groups",
            hint="Set the verdict again in the queue.",
        )
    return split_for_transactions(batch.undo_spans)


def _unfinished_redo(session: Session, batch_id: int, actor: str) -> int | None:
    """The batch that gives a batch again and is not complete; None where nobody has begun."""
    redone = read_bulk_verdict(session, batch_id).redone
    if redone is None:
        return None
    again = read_bulk_verdict(session, redone)
    if again.done or again.is_taken_back:
        raise ConflictError("the verdicts of this batch were redone already")
    if again.actor != actor:
        raise ConflictError(
            f"{again.actor} is redoing this batch",
            hint=f"Wait until {again.actor} is done, or undo the verdicts redone so far.",
        )
    return again.id


def _list_unchanged_groups(session: Session, given: Spans, first: int, last: int) -> list[int]:
    """Groups of one chunk that nobody has judged since it was taken back, or edited."""
    ids = list_groups_with_newest_verdict_in_range(session, first, last)
    judged: dict[int, str] = {}
    for start, end in given:
        judged |= read_judged_inputs_hashes(session, start, end, ids)
    keys = read_current_solution_keys(session, ids)
    return [group for group in ids if judged.get(group) == keys[group].inputs_hash]
