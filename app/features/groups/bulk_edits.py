"""Bulk edits: balls and lines of many views in one request, one edit for each of their groups.

Each group is saved as ``submit`` saves an edit, in a transaction of its own: a group is edited whole or
not at all, and undo takes its edit back like any other. A request that was killed in between, sent
again under its key, does the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any, Literal

from app.db.idempotency import read_progress, save_progress
from app.db.session import Session
from app.db.store import Store
from app.errors import (
    ConflictError,
    InputError,
    NotFoundError,
    OverloadedError,
    ReviewError,
    SharedStationError,
    StaleRevisionError,
    TooManyPointsError,
)
from app.features.groups.edit import Edit, SetLines
from app.features.groups.edit_codec import REQUEST_POINTS
from app.features.groups.queries import StoredGroup, find_views, read_groups
from app.features.groups.state import GroupState, read_etags, require_etag
from app.features.groups.submit import (
    Then,
    combine_edits,
    read_group_etag,
    require_group_open,
    submit_edits,
)
from app.features.groups.view_paint import PaintUpdater
from app.features.solutions.service import Solve, solve_and_encode

MAX_ITEMS = 200
"""Views of one request: solving 200 groups keeps other large edits waiting for some seconds. With 2,000
points, the most that a request may bring, they stay below the limits of a body."""
TRIES = 3
"""How often an edit of any state is tried again where others edit the group at the same moment."""
_BATCH = 100
Outcome = Literal["changed", "unchanged", "refused"]


@dataclass(frozen=True)
class ViewEdits:
    """What is to be changed in one view.

    Attributes:
        view: Its id, or its key in the group whose key is ``group``.
        group: Key of the group, where the view is named by its key.
        etag: State of the group that the change builds on; None: the present one.
        edits_of: Makes the edits from the view's key.
    """

    view: int | str
    group: str | None
    etag: str | None
    edits_of: Callable[[str], Sequence[Edit]]


@dataclass(frozen=True)
class ItemOutcome:
    """What came of one item.

    Attributes:
        index: Place of the item in the request, from 0.
        group: Id of the group; None where the view was not found.
        view: Id of the view, or None.
        etag: State of the group afterwards, or None.
        error: Why the item was refused, or None.
    """

    index: int
    outcome: Outcome
    group: int | None = None
    view: int | None = None
    etag: str | None = None
    error: ReviewError | None = None


@dataclass(frozen=True)
class BulkEditReport:
    """What was done, or would be, item by item in the order of the request."""

    dry_run: bool
    items: tuple[ItemOutcome, ...]


@dataclass
class _GroupEditPlan:
    """The items of one group and the edits that they make together."""

    id: int
    key: str
    views: dict[int, int] = field(default_factory=dict)
    """Id of the view by index of the item."""
    edits: list[Edit] = field(default_factory=list)
    etag: str | None = None
    """That the items name; None: they build on the present state."""


def plan_edits(
    store: Store, dataset_id: int, items: Sequence[ViewEdits], *, actor: str
) -> BulkEditReport:
    """A report of what ``edit_views`` would change; nothing is solved or saved.

    Raises:
        TooManyPointsError: The items bring more points than a request may.
    """
    _require_request_point_limit(items)
    with store.read() as session:
        outcomes, _ = _plan_items(session, dataset_id, dict(enumerate(items)), actor)
    return _make_report(outcomes, dry_run=True)


def edit_views(
    store: Store,
    dataset_id: int,
    items: Sequence[ViewEdits],
    *,
    actor: str,
    paint: PaintUpdater | None = None,
    solve: Solve = solve_and_encode,
) -> BulkEditReport:
    """Edit the groups of many views, one after the other; one that was killed goes on.

    Args:
        store: The database.
        dataset_id: The dataset of the views.
        items: What to change; a view is named once.
        actor: Who edits.
        paint, solve: As of ``submit``.

    Raises:
        TooManyPointsError: The items bring more points than a request may.
        StorageError: What is not in the log was not saved.
    """
    _require_request_point_limit(items)
    with store.read() as session:
        saved = _read_saved_outcomes(session)
        left = {index: item for index, item in enumerate(items) if index not in saved}
        outcomes, groups = _plan_items(session, dataset_id, left, actor)
    run = _BulkEditRun({**outcomes, **saved}, saved)
    for group in groups:
        then = run.make_transaction_finalizer(group, is_last=group is groups[-1])
        try:
            state = _submit_group(store, group, actor, then=then, paint=paint, solve=solve)
        except (ConflictError, InputError, NotFoundError, OverloadedError) as error:
            run.mark_refused(group, error)
        else:
            run.mark_saved(group, state)
    return run.finish_report(store)


class _BulkEditRun:
    """A bulk edit while it is done, group by group.

    Args:
        outcomes: Of every item as planned; those of groups that are saved take their place.
        saved: Items whose groups were saved before the run was killed.
    """

    def __init__(self, outcomes: dict[int, ItemOutcome], saved: dict[int, ItemOutcome]):
        self._outcomes, self._saved = outcomes, saved
        self._new: dict[int, ItemOutcome] = {}
        self._last: BulkEditReport | None = None

    def make_transaction_finalizer(self, group: _GroupEditPlan, *, is_last: bool) -> Then:
        """What ends the transaction of a group: the response with the last, else how far it is."""
        self._new = {}

        def finalize_transaction(session: Session, state: GroupState) -> None:
            self._new = _make_outcomes_with_etag(group, self._outcomes, state.etag)
            if is_last:
                self._last = _make_report({**self._outcomes, **self._new})
                session.respond(self._last)
            else:
                _save_progress(session, [*self._saved.values(), *self._new.values()])

        return finalize_transaction

    def mark_saved(self, group: _GroupEditPlan, state: GroupState) -> None:
        """The group is as it was asked for."""
        self._saved |= self._new
        # Where nothing is new somebody has made the same change since it was planned.
        self._outcomes |= self._new or _make_outcomes_with_etag(
            group, self._outcomes, state.etag, "unchanged"
        )

    def mark_refused(self, group: _GroupEditPlan, error: ReviewError) -> None:
        """The group was refused when its turn came."""
        self._outcomes |= _make_refused_outcomes(group, error)
        self._last = None

    def finish_report(self, store: Store) -> BulkEditReport:
        """The report; where the last group was not saved, the request is answered here."""
        if self._last is not None:
            return self._last
        report = _make_report(self._outcomes)
        if self._saved:
            with store.write() as session:
                session.respond(report)
        return report


def _submit_group(store: Store, group: _GroupEditPlan, actor: str, **how: Any) -> GroupState:
    """Save the edit of a group; one that builds on any state is tried again."""
    for _ in range(TRIES - 1):
        if group.etag is not None:
            break
        try:
            present = read_group_etag(store, group.id)
            return submit_edits(store, group.id, group.edits, if_match=present, actor=actor, **how)
        except StaleRevisionError:
            continue
    etag = group.etag or read_group_etag(store, group.id)
    return submit_edits(store, group.id, group.edits, if_match=etag, actor=actor, **how)


def _plan_items(
    session: Session, dataset_id: int, items: Mapping[int, ViewEdits], actor: str
) -> tuple[dict[int, ItemOutcome], list[_GroupEditPlan]]:
    """What becomes of each item, and the groups that change, in the order of the request."""
    outcomes, groups = _locate_items(session, dataset_id, items)
    numbers, changing = [*groups], []
    for start in range(0, len(numbers), _BATCH):
        some = numbers[start : start + _BATCH]
        stored, etags = read_groups(session, some), read_etags(session, some)
        for number in some:
            found = _plan_group(
                session, stored[number], groups[number], etags[number], items, actor
            )
            outcomes |= found
            if any(item.outcome == "changed" for item in found.values()):
                changing.append(groups[number])
    return outcomes, changing


def _locate_items(
    session: Session, dataset_id: int, items: Mapping[int, ViewEdits]
) -> tuple[dict[int, ItemOutcome], dict[int, _GroupEditPlan]]:
    """Items by their groups; those whose view the reader does not see are refused as unknown ones."""
    ids = {item.view for item in items.values() if isinstance(item.view, int)}
    keys = {item.group for item in items.values() if item.group is not None}
    rows = find_views(session, dataset_id, ids, keys)
    by_id = {row.id: row for row in rows}
    by_key = {(row.group_key, row.key): row for row in rows}
    known = {row.group_key for row in rows}
    outcomes: dict[int, ItemOutcome] = {}
    groups: dict[int, _GroupEditPlan] = {}
    for index, item in items.items():
        if isinstance(item.view, int):
            row, missing = by_id.get(item.view), f"there is no view {item.view} in this dataset"
        else:
            row = by_key.get((str(item.group), item.view))
            missing = f"group {item.group} has no view {item.view}"
            if item.group not in known:
                missing = f"there is no group {item.group} in this dataset"
        if row is None:
            error = NotFoundError(missing, pointer=f"/items/{index}/view")
            outcomes[index] = ItemOutcome(index, "refused", error=error)
            continue
        group = groups.setdefault(row.group_id, _GroupEditPlan(row.group_id, row.group_key))
        group.views[index] = row.id
    return outcomes, groups


def _plan_group(
    session: Session,
    stored: StoredGroup,
    plan: _GroupEditPlan,
    etag: str,
    items: Mapping[int, ViewEdits],
    actor: str,
) -> dict[int, ItemOutcome]:
    """What becomes of the items of one group; where one is refused, none of them is done."""
    keys = {number: key for key, number in stored.view_ids.items()}
    seen: set[int] = set()
    outcomes: dict[int, ItemOutcome] = {}
    group = stored.group
    for index, view in plan.views.items():
        item, place = items[index], f"/items/{index}"
        try:
            if item.etag is not None:
                place = f"/items/{index}/etag"
                require_etag(etag, item.etag, f"group {plan.key}")
                plan.etag = item.etag
            place = f"/items/{index}/view"
            if view in seen:
                raise InputError(
                    f"another item changes view {keys[view]} already",
                    hint="Put the changes of one view into one item.",
                )
            seen.add(view)
            require_group_open(session, stored.dataset_id, stored.id)
            place = f"/items/{index}"
            edits = item.edits_of(keys[view])
            after = combine_edits(stored, edits, actor).apply(group)
        except (ConflictError, InputError, NotFoundError) as error:
            draws = isinstance(error, SharedStationError | TooManyPointsError)
            error.pointer = f"{place}/lines" if draws else place
            outcomes[index] = ItemOutcome(index, "refused", stored.id, view, etag, error)
            continue
        outcome: Outcome = "unchanged" if after == group else "changed"
        outcomes[index] = ItemOutcome(index, outcome, stored.id, view, etag)
        plan.edits.extend(edits)
        group = after
    if any(one.error is not None for one in outcomes.values()):
        spoilt = ConflictError(
            "another item of the same group was refused",
            hint="All items of a group are applied, or none.",
        )
        for index, one in outcomes.items():
            if one.error is None:
                why = _copy_error_with_pointer(spoilt, f"/items/{index}")
                outcomes[index] = ItemOutcome(index, "refused", stored.id, one.view, etag, why)
    return outcomes


def _make_refused_outcomes(group: _GroupEditPlan, error: ReviewError) -> dict[int, ItemOutcome]:
    """The items of a group that was refused when its turn came."""
    etag = error.current_etag if isinstance(error, StaleRevisionError) else None
    return {
        index: ItemOutcome(
            index,
            "refused",
            group.id,
            view,
            etag,
            _copy_error_with_pointer(error, f"/items/{index}"),
        )
        for index, view in group.views.items()
    }


def _copy_error_with_pointer(error: ReviewError, pointer: str) -> ReviewError:
    """The same error at another place of the request."""
    found = copy(error)
    found.pointer = pointer
    return found


def _make_outcomes_with_etag(
    group: _GroupEditPlan,
    outcomes: Mapping[int, ItemOutcome],
    etag: str,
    outcome: Outcome | None = None,
) -> dict[int, ItemOutcome]:
    """The items of a group as it is afterwards; ``outcome``: of all of them."""
    return {
        index: ItemOutcome(index, outcome or outcomes[index].outcome, group.id, view, etag)
        for index, view in group.views.items()
    }


def _require_request_point_limit(items: Sequence[ViewEdits]) -> None:
    edits = [edit for item in items for edit in item.edits_of("") if isinstance(edit, SetLines)]
    count = sum(len(points or ()) for edit in edits for points in edit.lines.values())
    if count > REQUEST_POINTS:
        raise TooManyPointsError(
            f"the lines of all items have {count} points; the limit is {REQUEST_POINTS}",
            hint="Send the items in several requests.",
            pointer="/items",
        )


def _make_report(outcomes: Mapping[int, ItemOutcome], *, dry_run: bool = False) -> BulkEditReport:
    return BulkEditReport(dry_run, tuple(outcomes[index] for index in sorted(outcomes)))


def _read_saved_outcomes(session: Session) -> dict[int, ItemOutcome]:
    """The items whose groups were saved before the run was killed."""
    value = read_progress(session)
    return {} if value is None else {one[0]: ItemOutcome(*one) for one in value["saved"]}


def _save_progress(session: Session, saved: Sequence[ItemOutcome]) -> None:
    """Say what is saved by now, in the transaction of the newest of it."""
    done = [[one.index, one.outcome, one.group, one.view, one.etag] for one in saved]
    save_progress(session, {"saved": done})
