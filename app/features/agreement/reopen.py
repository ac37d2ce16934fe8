"""Reopen: a decision whose edit is undone is none any more, and its group waits for one again."""

from __future__ import annotations

from app.db.log import (
    NewLogEntry,
    append_entries,
    list_group_entry_kinds,
    list_newest_entry_kinds,
    read_entry,
)
from app.db.session import Session, now
from app.db.store import Store
from app.features.agreement.queries import (
    DECIDED,
    OPEN,
    list_group_agreements,
    reopen_annotations,
    save_adjudication,
)
from app.features.agreement.service import KIND
from app.features.batches.completion_queries import reopen_group_in_batch
from app.features.groups.state import GroupState
from app.features.groups.undo import undo_group_edit
from app.features.groups.view_paint import PaintUpdater
from app.features.independent_annotations.adopt import ADOPTED
from app.features.independent_annotations.service import read_annotation
from app.features.independent_annotations.submission_queries import KIND as TAKE
from app.soccer.actors import person_of_actor


def undo_edit_or_decision(
    store: Store, group_id: int, *, if_match: str, actor: str, paint: PaintUpdater | None = None
) -> GroupState:
    """Take the last edit of a group back; where a decision between annotations made it, reopen the case.

    The verdict that came with the decision stays and is stale, as after every undo.

    Raises:
        ConflictError: There is nothing to undo.
    """

    def end(session: Session, state: GroupState) -> None:
        _reopen_undone_decision(session, state.id, actor=actor)
        session.respond(state)

    return undo_group_edit(store, group_id, if_match=if_match, actor=actor, paint=paint, then=end)


def _reopen_undone_decision(session: Session, group_id: int, *, actor: str) -> None:
    decided = [row for row in list_group_agreements(session, group_id) if row.state == DECIDED]
    if not decided:
        return
    ((undo, _),) = list_newest_entry_kinds(session, group_id, ["undo"], 1)
    edit = read_entry(session, undo).body["of"]
    for row in decided:
        if row.take_id is None or not _is_edit_of_adoption(session, group_id, edit, row.take_id):
            continue
        at, person = now(), read_annotation(session, row.take_id).person
        values = dict.fromkeys(("outcome", "take_id", "decided", "decided_by"))
        save_adjudication(session, group_id, row.batch_id, {**values, "state": OPEN})
        reopen_annotations(session, [int(one) for one in row.takes.split()])
        reopen_group_in_batch(session, row.batch_id, group_id)
        body = {"did": "reopened", "take": row.take_id, "person": person}
        append_entries(session, [NewLogEntry(KIND, actor, at, body, row.dataset_id, group_id)])


def _is_edit_of_adoption(session: Session, group_id: int, edit: int, take_id: int) -> bool:
    """Whether an edit is that with which an annotation was taken over: by the annotation's person, and followed by
    its entry, behind that of the annotation's verdict."""
    annotation = read_annotation(session, take_id)
    if person_of_actor(read_entry(session, edit).actor) != person_of_actor(annotation.person):
        return False
    steps = list_group_entry_kinds(session, [group_id], ["edit", "verdict", TAKE])
    judged = ["verdict"] if annotation.verdict is not None else []
    after = [row for row in steps if row.id > edit][: len(judged) + 1]
    if [row.kind for row in after] != [*judged, TAKE]:
        return False
    body = read_entry(session, after[-1].id).body
    return (body["did"], body["take"]) == (ADOPTED, take_id)
