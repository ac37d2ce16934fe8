"""Whether what people said to each other stands in the tables as the log has it."""

from __future__ import annotations

from collections.abc import Iterable

from app.db.check import Check, compared
from app.db.dialects.dialect import dialect_in
from app.db.json_columns import as_written
from app.db.log import LogEntry, entries_of_kinds
from app.db.session import Session
from app.db.store import Store
from app.errors import StorageError
from app.features.comments.queries import ThreadRecord, all_threads
from app.features.comments.service import COMMENT

WRONG = "not as the log says"


def examine_threads(store: Store) -> Check:
    """Compare every thread and comment with the log.

    When a thread began and whom it mentions stands in the tables alone.
    """
    with store.read() as session:
        return _compare_with_log(session, dialect_in(session).restoring)


def _compare_with_log(session: Session, restore: str) -> Check:
    try:
        with as_written():
            logged = logged_threads(entries_of_kinds(session, (COMMENT, "dataset_deleted")))
    except StorageError as error:
        return Check("threads", False, error.message, error.hint or restore)
    present = all_threads(session)
    keys = sorted(logged.keys() | present.keys())
    apart = [str(key) for key in keys if logged.get(key) != present.get(key)]
    return compared("threads", f"{len(present):,}, as the log says", apart, WRONG, restore)


def logged_threads(entries: Iterable[LogEntry]) -> dict[int, ThreadRecord]:
    """The threads that follow from the log, by id.

    Args:
        entries: Of comments, and of datasets that were deleted, oldest first.
    """
    threads: dict[int, ThreadRecord] = {}
    for entry in entries:
        if entry.kind == COMMENT:
            _apply_entry(threads, entry)
        else:
            gone = entry.dataset_id
            threads = {key: one for key, one in threads.items() if one.dataset_id != gone}
    return threads


def _apply_entry(threads: dict[int, ThreadRecord], entry: LogEntry) -> None:
    body, number = entry.body, entry.body["thread"]
    if number not in threads:
        threads[number] = _new_thread(entry)
    thread, comment = threads[number], body.get("comment", 0)
    match body["did"]:
        case "said":
            thread.comments[comment] = (entry.actor, entry.at, None, body["text"])
        case "edited" | "deleted":
            thread.comments[comment] = (*thread.comments[comment][:2], entry.at, body.get("text"))
        case "resolved":
            thread.resolved = (entry.at, entry.actor)
        case "reopened":
            thread.resolved = (None, None)
    if all(text is None for *_, text in thread.comments.values()):
        del threads[number]


def _new_thread(entry: LogEntry) -> ThreadRecord:
    x, y = entry.body.get("at", (None, None))
    return ThreadRecord(entry.dataset_id, entry.group_id, entry.body.get("view"), x, y)
