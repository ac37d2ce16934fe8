"""Submit: an edit of one group, from the state that its author saw to the state that follows.

Load, apply, solve, save. Solving happens before the write transaction, which checks again that
nobody was faster; the edit's log entry, the revision and the solution are one transaction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.errors import ConflictError, NotFoundError, SharedStationError
from app.review.editing.codec import edit_from_json, edit_to_json
from app.review.editing.edit import STATION_EDITS, Edit, need_view
from app.review.editing.encode import encode
from app.review.editing.etags import require_unchanged
from app.review.editing.idempotency import Request, is_repeated, remember
from app.review.editing.known import known_calibrations
from app.review.editing.solver import Solver
from app.review.editing.state import GroupState, Solutions, read_state, unsolved
from app.review.editing.undo import Stacks, read_stacks
from app.soccer.group import Group
from app.soccer.solution import Solution
from app.solving.solve import solve
from app.store.clock import now
from app.store.codecs import Json
from app.store.digest import group_inputs_hash
from app.store.groups import save_group
from app.store.log import Entry, LogEntry, append, read_log
from app.store.models import GroupModel, LogModel
from app.store.queue import refresh_queue
from app.store.session import Store
from app.store.solutions import SolutionKey, insert_solutions, read_solutions


@dataclass(frozen=True)
class _Change:
    """One step of a group: its kind and body in the log, and the group that it makes."""

    kind: str
    body: Json
    group: Group


def load(store: Store, group_id: int) -> GroupState:
    """A group as it is now.

    Raises:
        NotFoundError: There is no such group.
    """
    with store.read() as session:
        return read_state(session, group_id)


def submit(
    store: Store,
    group_id: int,
    edit: Edit,
    *,
    if_match: str,
    actor: str,
    idempotency_key: str | None = None,
    solver: Solver = solve,
) -> GroupState:
    """Save an edit and answer with the group as it is then, solved.

    Args:
        store: The database.
        group_id: The group.
        edit: What to change.
        if_match: ETag of the state that the edit builds on.
        actor: Who says so.
        idempotency_key: The caller's name for this request; sent again it changes nothing.
        solver: Only tests put another one in.

    Raises:
        StaleRevisionError: Somebody else was faster.
        SharedStationError: The edit belongs to a static camera.
        InputError, NotFoundError: The edit does not fit the group.
        IdempotencyError: The key was used for something else.
        StorageError: Nothing was saved.
    """

    def plan(_session: Session, state: GroupState) -> _Change:
        refuse_shared(state, edit)
        body = {
            "edit": edit_to_json(edit),
            "inverse": edit_to_json(edit.inverse(state.group)),
        }
        return _Change("edit", body, edit.apply(state.group))

    request = Request(idempotency_key, actor, ["edit", group_id, edit_to_json(edit)])
    return _change(store, group_id, plan, if_match, request, solver)


def undo(
    store: Store,
    group_id: int,
    *,
    if_match: str,
    actor: str,
    idempotency_key: str | None = None,
    solver: Solver = solve,
) -> GroupState:
    """Take the last edit of a group back, whoever made it; raises ConflictError without one."""
    request = Request(idempotency_key, actor, ["undo", group_id])
    return _change(store, group_id, _plan_undo, if_match, request, solver)


def redo(
    store: Store,
    group_id: int,
    *,
    if_match: str,
    actor: str,
    idempotency_key: str | None = None,
    solver: Solver = solve,
) -> GroupState:
    """Do again what undo took back last; raises ConflictError without such an edit."""
    request = Request(idempotency_key, actor, ["redo", group_id])
    return _change(store, group_id, _plan_redo, if_match, request, solver)


def preview(
    store: Store, group_id: int, edits: Sequence[Edit], *, solver: Solver = solve
) -> Solution:
    """The solution as it would be after edits; saves nothing, and shared stations may move."""
    with store.read() as session:
        state = read_state(session, group_id)
        group = state.group
        for edit in edits:
            group = edit.apply(group)
        known = known_calibrations(session, [group], state.policy)
    return solver(group, state.policy, known)


def history(store: Store, group_id: int) -> list[LogEntry]:
    """Everything that was said about a group, oldest first."""
    with store.read() as session:
        # The log remembers groups of datasets that were deleted, too.
        there = session.scalar(select(GroupModel.id).where(GroupModel.id == group_id))
        entries = list(read_log(session, LogModel.group_id == group_id))
    if there is None:
        raise NotFoundError(f"there is no group {group_id}")
    return entries


def solved(store: Store, group_id: int, *, solver: Solver = solve) -> GroupState:
    """A group as it is now, its solution computed and kept if that was still to do."""
    state = load(store, group_id)
    if state.solution is not None:
        return state
    with store.read() as session:
        known = known_calibrations(session, [state.group], state.policy)
    solution = solver(state.group, state.policy, known)
    encoded = encode(state.group, solution, known)
    with store.write() as session:
        insert_solutions(session, [(state.solution_key, encoded)])
        refresh_queue(session, [group_id])
    return load(store, group_id)


def refuse_shared(state: GroupState, edit: Edit) -> None:
    """Refuse an edit that belongs to the station when many views share that."""
    if not isinstance(edit, STATION_EDITS):
        return
    station = need_view(state.group, edit.view).station
    if station.shared:
        raise SharedStationError(edit.view, state.station_ids[station.key], station.key)


def _change(
    store: Store,
    group_id: int,
    plan: Callable[[Session, GroupState], _Change],
    if_match: str,
    request: Request,
    solver: Solver,
) -> GroupState:
    with store.read() as session:
        state = read_state(session, group_id, unsolved)
        repeated = is_repeated(session, request)
        if not repeated:
            require_unchanged(session, group_id, if_match, f"group {state.key}")
            change = plan(session, state)
            known = known_calibrations(session, [change.group], state.policy)
    if repeated or change.group == state.group:
        return load(store, group_id)
    solution = solver(change.group, state.policy, known)
    encoded = encode(change.group, solution, known)
    key = SolutionKey(group_id, group_inputs_hash(change.group), state.policy.hash)
    with store.write() as session:
        if not is_repeated(session, request):
            require_unchanged(session, group_id, state.etag, f"group {state.key}")
            _save(session, state, change, request)
            insert_solutions(session, [(key, encoded)])
            refresh_queue(session, [group_id])
    with store.read() as session:
        return read_state(session, group_id, _known(key, solution))


def _known(key: SolutionKey, solution: Solution) -> Solutions:
    """The solution at hand where the group still is what it was solved as, else the stored one."""

    def solutions(session: Session, keys: Sequence[SolutionKey]) -> Mapping[int, Solution]:
        if list(keys) == [key]:
            return {key.group_id: solution}
        return read_solutions(session, keys)

    return solutions


def _save(session: Session, state: GroupState, change: _Change, request: Request) -> None:
    at = now()
    save_group(session, state.stored, change.group, at=at)
    entry = Entry(change.kind, request.actor, at, change.body, state.dataset_id, state.id)
    (log_id,) = append(session, [entry])
    remember(session, request, log_id, at)


def _plan_undo(session: Session, state: GroupState) -> _Change:
    done = _stacks(session, state).done
    if not done:
        raise ConflictError("there is nothing to undo in this group")
    return _again(session, state, "undo", done[-1], forward="inverse", backward="edit")


def _plan_redo(session: Session, state: GroupState) -> _Change:
    undone = _stacks(session, state).undone
    if not undone:
        raise ConflictError("there is nothing to redo in this group")
    return _again(session, state, "redo", undone[-1], forward="edit", backward="inverse")


def _stacks(session: Session, state: GroupState) -> Stacks:
    return read_stacks(session, [state.id])[state.id]


def _again(
    session: Session, state: GroupState, kind: str, log_id: int, *, forward: str, backward: str
) -> _Change:
    (entry,) = read_log(session, LogModel.id == log_id)
    body = {"edit": entry.body[forward], "inverse": entry.body[backward], "of": log_id}
    try:
        group = edit_from_json(body["edit"]).apply(state.group)
    except NotFoundError as error:
        raise ConflictError(f"this cannot be done any more: {error.message}") from error
    return _Change(kind, body, group)
