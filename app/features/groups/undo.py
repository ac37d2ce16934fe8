"""Undo and redo of the last edit of a group, and the entry of the log that either writes."""

from __future__ import annotations

from typing import Unpack

from app.db.json_columns import Json
from app.db.log import read_entry
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.groups.edit import Edit
from app.features.groups.edit_codec import edit_from_json, edit_to_json
from app.features.groups.group_edits import (
    places_balls,
    read_ball_actors_after_step,
    renew_noise,
)
from app.features.groups.state import GroupState, GroupWithoutSolution
from app.features.groups.submit import EditOptions, GroupChange, Plan, submit_change
from app.features.groups.undo_stacks import UndoStacks


def undo_group_edit(store: Store, group_id: int, **how: Unpack[EditOptions]) -> GroupState:
    """Take the last edit of a group back, whoever made it; raises ConflictError without one."""
    return submit_change(
        store, lambda _session: group_id, _make_undo_or_redo_planner("undo"), **how
    )


def redo_group_edit(store: Store, group_id: int, **how: Unpack[EditOptions]) -> GroupState:
    """Do again what undo took back last; raises ConflictError without such an edit."""
    return submit_change(
        store, lambda _session: group_id, _make_undo_or_redo_planner("redo"), **how
    )


def _make_undo_or_redo_planner(kind: str) -> Plan:
    def plan_undo_or_redo(
        session: Session, record: GroupWithoutSolution, _actor: str
    ) -> GroupChange:
        body = make_undo_entry_body(session, record.stacks, kind, "in this group")
        try:
            edit = _renew_noise_of_balls(session, record, kind, body)
            group = edit.apply(record.stored.group)
        except NotFoundError as error:
            raise ConflictError(
                f"this can no longer be undone or redone: {error.message}"
            ) from error
        return GroupChange(kind, {**body, "edit": edit_to_json(edit)}, group)

    return plan_undo_or_redo


def _renew_noise_of_balls(
    session: Session, record: GroupWithoutSolution, kind: str, body: Json
) -> Edit:
    """The edit of an undo or a redo; noise may have been estimated since its balls were placed."""
    edit, stored = edit_from_json(body["edit"]), record.stored
    if not places_balls(edit):
        return edit
    placed = {}
    if stored.factors:
        placed = read_ball_actors_after_step(session, stored.id, kind, body["of"])
    return renew_noise(stored.factors, stored.group, edit, placed)


def make_undo_entry_body(session: Session, stacks: UndoStacks, kind: str, where: str) -> Json:
    """Body of the entry that an undo or a redo writes: the edit that it makes, and back.

    Args:
        session: Any session.
        stacks: Of the group or station.
        kind: ``undo`` or ``redo``.
        where: What it is asked for, as people call it.

    Raises:
        ConflictError: There is nothing to undo, or to do again.
    """
    steps = stacks.done if kind == "undo" else stacks.undone
    if not steps:
        raise ConflictError(f"there is nothing to {kind} {where}")
    body = read_entry(session, steps[-1]).body
    made, back = ("inverse", "edit") if kind == "undo" else ("edit", "inverse")
    return {"edit": body[made], "inverse": body[back], "of": steps[-1]}
