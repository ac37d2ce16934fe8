"""Undo and redo: the last edit of a group taken back, or done again, as a step like any other."""

from __future__ import annotations

from typing import Unpack

from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.groups.edit_codec import edit_from_json
from app.features.groups.state import GroupState, Record
from app.features.groups.submit import EditOptions, GroupChange, Plan, submit_change
from app.features.groups.undo_stacks import undo_entry_body


def undo(store: Store, group_id: int, **how: Unpack[EditOptions]) -> GroupState:
    """Take the last edit of a group back, whoever made it; raises ConflictError without one."""
    return submit_change(store, lambda _session: group_id, _plan_step("undo"), **how)


def redo(store: Store, group_id: int, **how: Unpack[EditOptions]) -> GroupState:
    """Do again what undo took back last; raises ConflictError without such an edit."""
    return submit_change(store, lambda _session: group_id, _plan_step("redo"), **how)


def _plan_step(kind: str) -> Plan:
    def plan(session: Session, record: Record, _actor: str) -> GroupChange:
        body = undo_entry_body(session, record.stacks, kind, "in this group")
        try:
            group = edit_from_json(body["edit"]).apply(record.stored.group)
        except NotFoundError as error:
            raise ConflictError(
                f"this can no longer be undone or redone: {error.message}"
            ) from error
        return GroupChange(kind, body, group)

    return plan
