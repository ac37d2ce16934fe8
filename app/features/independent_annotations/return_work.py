"""Return: work that was submitted goes back to its person, with a sentence that says why."""

from __future__ import annotations

from app.db.log import Entry, append
from app.db.session import Session, now
from app.db.store import Store
from app.errors import InputError
from app.features.groups.queries import StoredGroup
from app.features.groups.state import need_group
from app.features.independent_annotations.queries import annotation_of_copy
from app.features.independent_annotations.service import DisclosedAnnotation, read_annotation, show
from app.features.independent_annotations.submission_queries import KIND, RETURNED, return_copy
from app.features.notifications.queries import NotificationKind
from app.features.notifications.service import notify
from app.features.webhooks.queries import HANDED_BACK, announce, stamp
from app.soccer.actors import person_of

MAX_REASON = 500
"""Letters of the sentence that says why."""


def return_annotation(
    store: Store, annotation_id: int, reason: str = "", *, actor: str
) -> DisclosedAnnotation:
    """Let the person of an annotation that was submitted go on with it, and tell them why.

    A comparison of it that waits for a decision waits no longer: it is made anew once it is handed
    in again.

    Raises:
        NotFoundError: There is no such annotation.
        ConflictError: It is not submitted, or it was decided about.
        InputError: There is no sentence, or it is too long.
    """
    checked = checked_reason(reason)
    if not checked:
        raise InputError(
            "a reason is required to return an annotation",
            hint="Say in a sentence what its annotator should change.",
            pointer="/reason",
        )
    with store.write() as session:
        annotation = read_annotation(session, annotation_id)
        return_copy(session, annotation)
        copy = annotation.copy_id
        log_return(
            session, KIND, copy, annotation.person, checked, actor=actor, batch=annotation.batch_id
        )
        back = show(session, read_annotation(session, annotation_id))
        session.respond(back)
        return back


def log_return(
    session: Session,
    kind: str,
    group_id: int,
    person: str,
    reason: str,
    *,
    actor: str,
    batch: int | None,
) -> None:
    """Write into the log that a group was returned to somebody, and tell them.

    The entry names the group: its history says so, and a page that has it open hears of it.

    Args:
        session: The write session in which it happens.
        kind: Of the entry.
        group_id: What they worked on; for an annotation of their own, its copy.
        person: Whom it goes back to.
        reason: Why; may be empty.
        actor: Who returns it.
        batch: Of which batch it is; None: of none.
    """
    group = need_group(session, group_id)
    body: dict[str, str | int] = {"did": RETURNED, "person": person, "reason": reason}
    if batch is not None:
        body["batch"] = batch
    at = now()
    append(session, [Entry(kind, actor, at, body, group.dataset_id, group_id)])
    _announce_return(session, group, person, actor=actor, at=at, batch=batch)
    why = f": {reason}" if reason else ""
    walk = "" if batch is None else f"?q=batch%3A{batch}"
    notify(
        session, person, NotificationKind.RETURNED, f"{person_of(actor)} returned {group.group.label or group.group.key} to you{why}",
        actor=actor, address=f"/review/{group_id}{walk}", dataset_id=group.dataset_id, group_id=group_id,
    )  # fmt: skip


def _announce_return(
    session: Session, group: StoredGroup, person: str, *, actor: str, at: str, batch: int | None
) -> None:
    """Tell webhooks of the dataset, for a copy of the one that it is of."""
    row = annotation_of_copy(session, group.id)
    where, details = group.dataset_id, {"group": group.id, "person": person}
    if row is not None:
        where = need_group(session, row.group_id).dataset_id
        details = {"group": row.group_id, "person": person, "copy": group.id}
    event = f"group{group.id}_handed_back{stamp(at)}"
    announce(session, where, HANDED_BACK, event, actor=actor, at=at, batch_id=batch, also=details)


def checked_reason(reason: str) -> str:
    """The sentence without blanks around it; raises InputError where it is too long."""
    text = " ".join(reason.split())
    if len(text) > MAX_REASON:
        raise InputError(f"the reason has at most {MAX_REASON} letters", pointer="/reason")
    return text
