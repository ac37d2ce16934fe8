"""An edit of one group, from the state that its author saw to the state that is stored."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NotRequired, TypedDict, Unpack

from app.db.json_columns import Json
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import InputError, NotFoundError, SharedStationError
from app.features.groups import view_queries as views
from app.features.groups.edit import (
    STATION_EDITS,
    CompositeEdit,
    Edit,
    SetPaintReadings,
    SetPictureGeometry,
    require_view,
)
from app.features.groups.edit_codec import edit_and_inverse_to_json, require_point_limits_of_edits
from app.features.groups.group_edits import add_noise_of_actor, keep_view_noise
from app.features.groups.queries import StoredGroup, find_group_of_view
from app.features.groups.revision_queries import make_next_revision, save_revision
from app.features.groups.state import (
    GroupState,
    GroupWithoutSolution,
    read_etags,
    read_group_without_solution,
    read_state,
    require_group,
    require_unchanged,
    require_unchanged_content,
)
from app.features.groups.view_paint import PaintUpdater
from app.features.independent_annotations import submission_queries as submissions
from app.features.independent_annotations.queries import find_annotation_of_copy
from app.features.paint.queries import FOLLOWS, PAINT, insert_paint_readings
from app.features.people.visibility_queries import COPIES
from app.features.queue.refresh_queries import refresh_queue, update_row
from app.features.solutions.queries import EncodedSolution, insert_solutions, read_solutions
from app.features.solutions.service import Solve, read_known_calibrations, solve_and_encode
from app.json_text import quote_text
from app.soccer.group import Group, Media
from app.soccer.policy import Policy
from app.soccer.solution import Calibration, Solution
from app.solving.solve import solve_group


@dataclass(frozen=True)
class ViewLocation:
    """Where a view belongs and where its frame lies."""

    group_id: int
    key: str
    media: Media | None
    flipped: bool
    width: int
    group_key: str
    static: bool
    """Whether the camera stands still for all views that share it."""


def find_view_location(store: Store, view_id: int) -> ViewLocation:
    """The view of that id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        found = views.find_view(session, view_id)
    if found is None:
        raise NotFoundError(f"there is no view {view_id}")
    return ViewLocation(
        found.group_id,
        found.key,
        found.media,
        found.flipped,
        found.width,
        found.group,
        found.shared,
    )


def require_group_open(session: Session, dataset_id: int, group_id: int) -> None:
    """Raise ConflictError where a group is an independent annotation that was submitted."""
    if dataset_id > COPIES:
        submissions.require_annotation_open(find_annotation_of_copy(session, group_id))


@dataclass(frozen=True)
class GroupChange:
    """One step of a group: its kind and body in the log, and the group that it makes."""

    kind: str
    body: Json
    group: Group


@dataclass(frozen=True)
class _AppliedChange:
    """A change with all that is saved of it; ``painted`` is its group as it is afterwards."""

    change: GroupChange
    painted: Group
    before: GroupWithoutSolution
    after: GroupWithoutSolution
    solution: Solution
    encoded: EncodedSolution


class EditOptions(TypedDict):
    """How a step is taken.

    Attributes:
        if_match: ETag of the state that it builds on.
        actor: Who says so.
        then: Ends the transaction; default: the request is answered with the group.
        paint: Reads the paint of edited lines again, as part of it; None: it stays as it is.
        solve: Solves the group that comes of it.
    """

    if_match: str
    actor: str
    then: NotRequired[Then]
    paint: NotRequired[PaintUpdater | None]
    solve: NotRequired[Solve]


Solver = Callable[[Group, Policy, Mapping[str, Calibration]], Solution]
Then = Callable[[Session, GroupState], None]
Find = Callable[[Session], int]
Plan = Callable[[Session, GroupWithoutSolution, str], GroupChange]


def load_group_state(store: Store, group_id: int) -> GroupState:
    """A group as it is now.

    Raises:
        NotFoundError: There is no such group.
    """
    with store.read() as session:
        return read_state(session, group_id)


def read_group_etag(store: Store, group_id: int) -> str:
    """The ETag of a group as it is now; nothing else of it is decoded.

    Raises:
        NotFoundError: There is no such group.
    """
    with store.read() as session:
        found = read_etags(session, [group_id])
    if group_id not in found:
        raise NotFoundError.group(group_id)
    return found[group_id]


def submit_edit(
    store: Store,
    group_id: int,
    edit: Edit,
    **how: Unpack[EditOptions],
) -> GroupState:
    """Save an edit and answer with the group as it is then, solved.

    Args:
        store: The database.
        group_id: The group.
        edit: What to change.
        how: See ``EditOptions``.

    Raises:
        StaleRevisionError: It was changed meanwhile.
        SharedStationError: The edit belongs to a static camera.
        InputError, NotFoundError: The edit does not fit the group.
        StorageError: Nothing was saved.
    """
    return submit_change(
        store, lambda _session: group_id, _make_edit_planner(lambda _stored: [edit]), **how
    )


def submit_edits(
    store: Store,
    group_id: int,
    edits: Sequence[Edit],
    **how: Unpack[EditOptions],
) -> GroupState:
    """``submit_edit`` for several edits of a group, which are one edit: undo takes them back together."""
    return submit_change(
        store, lambda _session: group_id, _make_edit_planner(lambda _stored: edits), **how
    )


def submit_view_edit(
    store: Store,
    view_id: int,
    edit_of: Callable[[str], Edit],
    **how: Unpack[EditOptions],
) -> GroupState:
    """``submit_edit`` for a view's id: ``edit_of`` makes the edit from the view's key."""

    def make_edits(stored: StoredGroup) -> list[Edit]:
        return [edit_of(next(key for key, item in stored.view_ids.items() if item == view_id))]

    def find_group_id(session: Session) -> int:
        return find_group_of_view(session, view_id)

    return submit_change(store, find_group_id, _make_edit_planner(make_edits), **how)


def solve_edited_group(
    store: Store,
    group_id: int,
    edits_of: Callable[[Group], Sequence[Edit]],
    paint: PaintUpdater | None = None,
    solve: Solver = solve_group,
) -> tuple[Group, Solution]:
    """The group and its solution as they would be after the edits that ``edits_of`` makes for it.

    Saves nothing, and lines of shared stations may move.

    Raises:
        NotFoundError: There is no such group.
        SharedStationError: The picture of a static camera is said to be cropped or stretched.
    """
    with store.read() as session:
        stored = require_group(session, group_id)
        group = stored.group
        edits = edits_of(group)
        require_point_limits_of_edits(group, edits)
        for edit in edits:
            if isinstance(edit, SetPictureGeometry):
                refuse_edit_of_shared_station(stored, edit)
        for edit in edits:
            group = keep_view_noise(group, edit).apply(group)
        known = read_known_calibrations(session, [group], stored.policy)
    if paint is not None:
        group = paint.update_paint(group, stored.policy.calibration, known)
    return group, solve(group, stored.policy, known)


def load_solved_group(store: Store, group_id: int) -> GroupState:
    """A group as it is now, its solution computed if that was still to do; saves nothing."""
    state = load_group_state(store, group_id)
    if state.solution is not None:
        return state
    _, solution = solve_edited_group(store, group_id, lambda _group: [])
    return replace(state, solution=solution)


def load_solved_group_of_view(store: Store, view_id: int) -> GroupState:
    """``load_solved_group`` for the group of a view."""
    with store.read() as session:
        group_id = find_group_of_view(session, view_id)
    return load_solved_group(store, group_id)


def solve_and_store_group(store: Store, group_id: int) -> GroupState:
    """A group as it is now, its solution computed and kept if that was still to do."""
    record, solution = ensure_group_solution(store, group_id)
    return record.make_state(solution)


def read_and_solve_group(session: Session, group_id: int) -> GroupState:
    """A group as a session sees it, its solution computed if that was still to do; saves nothing."""
    record = read_group_without_solution(session, group_id)
    solution = read_solutions(session, [record.solution_key]).get(group_id)
    if solution is None:
        group, policy = record.stored.group, record.stored.policy
        solution = solve_group(group, policy, read_known_calibrations(session, [group], policy))
    return record.make_state(solution)


def ensure_group_solution(
    store: Store, group_id: int, *, needed: bool = True
) -> tuple[GroupWithoutSolution, Solution | None]:
    """A group's record and its solution, which is computed and kept where it is needed."""
    with store.read() as session:
        record = read_group_without_solution(session, group_id)
        stored = record.stored
        solution = read_solutions(session, [record.solution_key]).get(group_id)
        if solution is not None or not needed:
            return record, solution
        known = read_known_calibrations(session, [stored.group], stored.policy)
    solution, encoded = solve_and_encode(stored.group, stored.policy, known)
    with store.write() as session:
        insert_solutions(session, [(record.solution_key, encoded)])
        refresh_queue(session, [group_id])
    return record, solution


def require_followed_groups(
    store: Store, find_dataset: Callable[[Session], int | None], groups: Mapping[str, str | None]
) -> None:
    """Refuse balls that are said to be followed from a group that their dataset does not have.

    Args:
        store: The database.
        find_dataset: Finds the id of the dataset.
        groups: Keys of groups, or None, by the JSON pointer that names each.

    Raises:
        InputError: There is no such group.
    """
    keys = {key for key in groups.values() if key is not None}
    if not keys:
        return
    with store.read() as session:
        known = views.find_group_and_view_ids(session, find_dataset(session) or 0, keys)
    for pointer, key in groups.items():
        if key is not None and key not in known:
            raise InputError(
                f"a ball cannot be followed from group {quote_text(key)}, which this dataset does not have",
                hint="Send the `group` of the answer that followed the ball. Nothing was changed.",
                pointer=pointer,
            )


def refuse_edit_of_shared_station(stored: StoredGroup, edit: Edit) -> None:
    """Refuse an edit that belongs to the station when many views share that."""
    if not isinstance(edit, STATION_EDITS):
        return
    station = require_view(stored.group, edit.view).station
    if station.shared:
        what = "picture" if isinstance(edit, SetPictureGeometry) else "lines"
        raise SharedStationError(edit.view, stored.stations[edit.view].id, station.key, what)


def submit_change(
    store: Store,
    find: Find,
    plan: Plan,
    *,
    if_match: str,
    actor: str,
    then: Then = Session.respond,
    paint: PaintUpdater | None = None,
    solve: Solve = solve_and_encode,
) -> GroupState:
    """Save a step of a group (an edit, an undo, a redo) and answer with the group as it is then.

    Args:
        store: The database.
        find: Finds the group.
        plan: Makes the step for the state that it builds on.
        if_match, actor, then, paint, solve: See ``EditOptions``.

    Raises:
        StaleRevisionError: It was changed meanwhile.
        ReviewError: As ``find`` and ``plan`` raise it.
        StorageError: Nothing was saved.
    """
    while True:
        with store.read() as session:
            before = read_group_without_solution(session, find(session))
            what = f"group {before.stored.group.key}"
            require_unchanged_content(
                session, before.stored.id, before.content_part_of_etag, if_match, what
            )
            change = plan(session, before, actor)
            if change.group == before.stored.group:
                found = read_solutions(session, [before.solution_key])
                return before.make_state(found.get(before.stored.id))
            known = read_known_calibrations(session, [change.group], before.stored.policy)
        painted = change.group
        if paint is not None:
            painted = paint.update_paint(painted, before.stored.policy.calibration, known)
        outcome = _apply_change(
            before, change, painted, solve(painted, before.stored.policy, known)
        )
        state = outcome.after.make_state(outcome.solution)
        with store.write() as session:
            judge = require_unchanged(session, state.id, if_match, what)
            require_group_open(session, state.dataset_id, state.id)
            if judge == before.stored.policy.hash:
                _save_change(session, outcome, actor)
                then(session, state)
                return state
        # Another policy judges the dataset by now, so another solution belongs to the edit.


def _apply_change(
    before: GroupWithoutSolution,
    change: GroupChange,
    painted: Group,
    result: tuple[Solution, EncodedSolution],
) -> _AppliedChange:
    at = now()
    stored = make_next_revision(before.stored, change.group, at)
    if painted is not change.group:
        stored = make_next_revision(stored, painted, at)
    after = replace(before, stored=stored, stacks=before.stacks.push_entry(change.kind))
    return _AppliedChange(change, painted, before, after, *result)


def _save_change(session: Session, outcome: _AppliedChange, actor: str) -> None:
    change, after = outcome.change, outcome.after
    stored = after.stored
    save_revision(session, outcome.before.stored, stored)
    where = stored.dataset_id, stored.id
    entries = [NewLogEntry(change.kind, actor, stored.changed, change.body, *where)]
    if outcome.painted is not change.group:
        insert_paint_readings(session, stored.dataset_id, outcome.painted.paint.values())
        entries.append(
            NewLogEntry(PAINT, actor, stored.changed, _make_paint_entry_body(outcome), *where)
        )
    append_entries(session, entries)
    insert_solutions(session, [(after.solution_key, outcome.encoded)])
    if after.dismissals.last:
        refresh_queue(session, [stored.id])
        return
    noticed = [item.kind for item in after.noticed_findings]
    update_row(session, stored, after.newest_verdict, noticed, outcome.encoded.summary)


def _make_paint_entry_body(outcome: _AppliedChange) -> Json:
    """Body of the entry that says what was read of the paint with a change."""
    before = outcome.change.group
    edit = SetPaintReadings(outcome.painted.paint)
    body = edit_and_inverse_to_json(edit, edit.inverse(before))
    return {FOLLOWS: outcome.change.kind, **body}


def combine_edits(stored: StoredGroup, edits: Sequence[Edit], actor: str) -> Edit:
    """Some edits of a group as the one edit that is saved, with the noise of who makes them.

    Raises:
        SharedStationError: One of them belongs to a static camera.
        TooManyPointsError: They draw too many points.
    """
    made = [add_noise_of_actor(stored.factors, stored.group, edit, actor) for edit in edits]
    for edit in made:
        refuse_edit_of_shared_station(stored, edit)
    require_point_limits_of_edits(stored.group, made)
    return made[0] if len(made) == 1 else CompositeEdit(tuple(made))


def _make_edit_planner(edits_of: Callable[[StoredGroup], Sequence[Edit]]) -> Plan:
    def plan_edit(_session: Session, record: GroupWithoutSolution, actor: str) -> GroupChange:
        group = record.stored.group
        edit = combine_edits(record.stored, edits_of(record.stored), actor)
        body = edit_and_inverse_to_json(edit, edit.inverse(group))
        return GroupChange("edit", body, edit.apply(group))

    return plan_edit
