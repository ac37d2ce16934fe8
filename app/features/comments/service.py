"""Comments: what people say to each other about a group, in threads that are open until settled.

Each word goes into the log, like everything that people say; the tables show how it stands.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from app.db.check import CheckResult, summarize_faulty_records
from app.db.dialects.dialect import get_session_dialect
from app.db.json_columns import translate_shape_errors_to_damage
from app.db.log import LogEntry, NewLogEntry, append_entries, iterate_entries_of_kinds
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, ForbiddenError, InputError, NotFoundError, StorageError
from app.features.comments.queries import (
    CommentedGroup,
    ThreadRecord,
    change_comment,
    delete_thread,
    find_group,
    insert_comment,
    insert_thread,
    read_all_threads,
    read_threads,
    set_mentions,
    set_thread_resolved,
)
from app.features.comments.queries import StoredComment as StoredComment
from app.features.comments.queries import StoredThread as StoredThread
from app.features.notifications.queries import NotificationKind
from app.features.notifications.service import notify_person
from app.features.people.logins import read_roles
from app.features.people.queries import find_person_by_name, read_members
from app.features.people.roles import Role
from app.soccer.actors import is_actor_of, person_of_actor

COMMENT = "comment"
"""Kind of the log's entries about comments."""
LONGEST = 4000
"""Characters of a comment."""
MOST = 200
"""Comments in one thread."""
_MENTION = re.compile(r"(?<![\w@.-])@([a-z0-9](?:[a-z0-9._-]{0,38}[a-z0-9])?)", re.IGNORECASE)


WRONG = "not as the log says"


def extract_mentions(text: str) -> list[str]:
    """The names that a text mentions, each once.

    Example:
        >>> extract_mentions("@anna, look at this; mail bob@club.org or @Carl.")
        ['anna', 'carl']
    """
    return list(dict.fromkeys(name.lower() for name in _MENTION.findall(text)))


def list_threads(store: Store, group_id: int) -> list[StoredThread]:
    """Everything that people say to each other about a group, the oldest thread first.

    Raises:
        NotFoundError: There is no such group.
    """
    with store.read() as session:
        _require_group(session, group_id)
        return read_threads(session, group_id)


def list_mentionable_people(store: Store, group_id: int) -> list[str]:
    """Names of everybody who sees a group, and can be mentioned there.

    Raises:
        NotFoundError: There is no such group.
    """
    with store.read() as session:
        group = _require_group(session, group_id)
        return [
            row.name
            for row in read_members(session, group.dataset_id)
            if _can_read_dataset(session, row.id, row.everywhere, group.dataset_id)
        ]


def begin_thread(
    store: Store,
    group_id: int,
    text: str,
    *,
    actor: str,
    view: str | None = None,
    at: tuple[float, float] | None = None,
) -> StoredThread:
    """Say something about a group, a view of it, or a place there (pixels of its annotated size).

    Raises:
        NotFoundError: There is no such group.
        InputError: It has no such view, there is no text, or it is too long.
    """
    text = _validate_comment(text)
    if at is not None and view is None:
        raise InputError(
            "a comment on a point in a picture must name the view of that point", pointer="/view"
        )
    with store.write() as session:
        group = _require_group(session, group_id)
        if view is not None and view not in group.views:
            raise InputError(f'the group has no view "{view}"', pointer="/view")
        thread_id = insert_thread(session, group, view, at, now())
        where = {"view": view, "at": None if at is None else [*at]}
        _insert_comment(session, group, thread_id, text, actor, (), **where)
        return _respond_with_thread(session, group_id, thread_id)


def add_reply(
    store: Store, group_id: int, thread_id: int, text: str, *, actor: str
) -> StoredThread:
    """Say something in a thread; who spoke there before is told.

    Raises:
        NotFoundError: There is no such thread of that group.
        InputError: There is no text, or it is too long.
        ConflictError: The thread is full.
    """
    text = _validate_comment(text)
    with store.write() as session:
        group, thread = (
            _require_group(session, group_id),
            _require_thread(session, group_id, thread_id),
        )
        if len(thread.comments) >= MOST:
            raise ConflictError(
                f"a thread has at most {MOST} comments", hint="Start another thread on this group."
            )
        before = {person_of_actor(one.actor) for one in thread.comments if one.text is not None}
        _insert_comment(session, group, thread_id, text, actor, sorted(before))
        return _respond_with_thread(session, group_id, thread_id)


def resolve_thread(
    store: Store, group_id: int, thread_id: int, resolved: bool, *, actor: str
) -> StoredThread:
    """Settle a thread, or open it again.

    Raises:
        NotFoundError: There is no such thread of that group.
    """
    with store.write() as session:
        group, thread = (
            _require_group(session, group_id),
            _require_thread(session, group_id, thread_id),
        )
        if (thread.resolved is not None) != resolved:
            time = now()
            set_thread_resolved(session, thread_id, *((time, actor) if resolved else (None, None)))
            did = "resolved" if resolved else "reopened"
            _log_comment(session, group, actor, time, did=did, thread=thread_id)
        return _respond_with_thread(session, group_id, thread_id)


def edit_comment(
    store: Store, group_id: int, thread_id: int, comment_id: int, text: str, *, actor: str
) -> StoredThread:
    """Give a comment of one's own another text; it is marked as edited.

    Whom it mentions now and did not before is told.

    Raises:
        NotFoundError: There is no such comment there.
        ForbiddenError: It is somebody else's.
        InputError: There is no text, or it is too long.
    """
    text = _validate_comment(text)
    with store.write() as session:
        group = _require_group(session, group_id)
        comment = _require_own_comment(session, group_id, thread_id, comment_id, actor)
        if text != comment.text:
            time = now()
            change_comment(session, comment_id, text, time)
            people = _find_reader_ids(session, group, extract_mentions(text))
            set_mentions(session, comment_id, people.values())
            entry = {"comment": comment_id, "text": text}
            _log_comment(session, group, actor, time, did="edited", thread=thread_id, **entry)
            new = [name for name in people if name not in comment.mentions]
            _notify_people(session, group, thread_id, actor, new, ())
        return _respond_with_thread(session, group_id, thread_id)


def delete_comment(
    store: Store, group_id: int, thread_id: int, comment_id: int, *, actor: str
) -> None:
    """Delete a comment of one's own; a thread in which nothing else is said goes with it.

    Raises:
        NotFoundError: There is no such comment there.
        ForbiddenError: It is somebody else's.
    """
    with store.write() as session:
        group = _require_group(session, group_id)
        _require_own_comment(session, group_id, thread_id, comment_id, actor)
        time = now()
        change_comment(session, comment_id, None, time)
        _log_comment(
            session, group, actor, time, did="deleted", thread=thread_id, comment=comment_id
        )
        thread = _require_thread(session, group_id, thread_id)
        if all(one.text is None for one in thread.comments):
            delete_thread(session, thread_id)
        session.respond(None)


def _insert_comment(
    session: Session,
    group: CommentedGroup,
    thread_id: int,
    text: str,
    actor: str,
    before: Iterable[str],
    **where: Any,
) -> None:
    time = now()
    comment_id = insert_comment(session, thread_id, actor, text, time)
    people = _find_reader_ids(session, group, extract_mentions(text))
    set_mentions(session, comment_id, people.values())
    entry = {"comment": comment_id, "text": text, **where}
    _log_comment(session, group, actor, time, did="said", thread=thread_id, **entry)
    _notify_people(session, group, thread_id, actor, people, before)


def _notify_people(
    session: Session,
    group: CommentedGroup,
    thread_id: int,
    actor: str,
    mentioned: Iterable[str],
    spoke: Iterable[str],
) -> None:
    """Tell those whom a comment mentions, and of the others those who spoke in its thread."""
    named = sorted(set(mentioned))
    rings = [(name, NotificationKind.MENTION, "mentioned you") for name in named]
    rings += [(name, NotificationKind.REPLY, "replied") for name in spoke if name not in named]
    for name, kind, did in rings:
        notify_person(
            session,
            name,
            kind,
            f"{actor} {did} in {group.label}",
            actor=actor,
            address=f"/review/{group.group_id}?thread={thread_id}",
            dataset_id=group.dataset_id,
            group_id=group.group_id,
        )


def _find_reader_ids(
    session: Session, group: CommentedGroup, names: Iterable[str]
) -> dict[str, int]:
    """Ids of those among some names who see a group's dataset; the others are not told apart."""
    found: dict[str, int] = {}
    for name in names:
        row = find_person_by_name(session, name)
        if row is None or row.disabled:
            continue
        if _can_read_dataset(session, row.id, row.role, group.dataset_id):
            found[name] = row.id
    return found


def _can_read_dataset(session: Session, person_id: int, everywhere: str, dataset_id: int) -> bool:
    """Whether a person sees a dataset; one of copies only its person and the leads do."""
    roles = read_roles(session, person_id, Role(everywhere))
    return roles.find_role_in(dataset_id) is not Role.NONE


def _log_comment(
    session: Session, group: CommentedGroup, actor: str, time: str, **fields: Any
) -> None:
    body = {name: value for name, value in fields.items() if value is not None}
    append_entries(
        session, [NewLogEntry(COMMENT, actor, time, body, group.dataset_id, group.group_id)]
    )


def _validate_comment(text: str) -> str:
    text = text.strip()
    if not text:
        raise InputError("a comment cannot be empty", pointer="/text")
    if len(text) > LONGEST:
        raise InputError(f"a comment has at most {LONGEST} characters", pointer="/text")
    return text


def _require_group(session: Session, group_id: int) -> CommentedGroup:
    group = find_group(session, group_id)
    if group is None:
        raise NotFoundError.group(group_id)
    return group


def _respond_with_thread(session: Session, group_id: int, thread_id: int) -> StoredThread:
    """Answer the request with a thread as it is by now."""
    thread = _require_thread(session, group_id, thread_id)
    session.respond(thread)
    return thread


def _require_thread(session: Session, group_id: int, thread_id: int) -> StoredThread:
    found = read_threads(session, group_id, thread_id)
    if not found:
        raise NotFoundError(f"group {group_id} has no thread {thread_id}")
    return found[0]


def _require_own_comment(
    session: Session, group_id: int, thread_id: int, comment_id: int, actor: str
) -> StoredComment:
    thread = _require_thread(session, group_id, thread_id)
    for comment in thread.comments:
        if comment.id == comment_id and comment.text is not None:
            if not is_actor_of(comment.actor, person_of_actor(actor)):
                raise ForbiddenError("only its author can change a comment", hint="Reply to it.")
            return comment
    raise NotFoundError(f"thread {thread_id} has no comment {comment_id}")


def examine_threads(store: Store) -> CheckResult:
    """Compare every thread and comment with the log.

    When a thread began and whom it mentions stands in the tables alone.
    """
    with store.read() as session:
        return _compare_threads_with_log(session, get_session_dialect(session).restoring)


def _compare_threads_with_log(session: Session, restore: str) -> CheckResult:
    try:
        with translate_shape_errors_to_damage():
            logged = rebuild_threads_from_log(
                iterate_entries_of_kinds(session, (COMMENT, "dataset_deleted"))
            )
    except StorageError as error:
        return CheckResult("threads", False, error.message, error.hint or restore)
    present = read_all_threads(session)
    keys = sorted(logged.keys() | present.keys())
    apart = [str(key) for key in keys if logged.get(key) != present.get(key)]
    return summarize_faulty_records(
        "threads", f"{len(present):,}, as the log says", apart, WRONG, restore
    )


def rebuild_threads_from_log(entries: Iterable[LogEntry]) -> dict[int, ThreadRecord]:
    """The threads that follow from the log, by id.

    Args:
        entries: Of comments, and of datasets that were deleted, oldest first.
    """
    threads: dict[int, ThreadRecord] = {}
    for entry in entries:
        if entry.kind == COMMENT:
            _apply_log_entry(threads, entry)
        else:
            gone = entry.dataset_id
            threads = {key: one for key, one in threads.items() if one.dataset_id != gone}
    return threads


def _apply_log_entry(threads: dict[int, ThreadRecord], entry: LogEntry) -> None:
    body, number = entry.body, entry.body["thread"]
    if number not in threads:
        threads[number] = _make_thread_from_entry(entry)
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


def _make_thread_from_entry(entry: LogEntry) -> ThreadRecord:
    x, y = entry.body.get("at", (None, None))
    return ThreadRecord(entry.dataset_id, entry.group_id, entry.body.get("view"), x, y)
