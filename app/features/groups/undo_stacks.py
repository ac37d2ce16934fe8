"""Which edits of a group or station can be undone and redone, as the log tells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from app.db.log import list_group_entry_kinds, list_newest_entry_kinds, list_station_entry_kinds
from app.db.session import Session

GROUP_KINDS = {"edit": "edit", "undo": "undo", "redo": "redo"}
STATION_KINDS = {"station_edit": "edit", "station_undo": "undo", "station_redo": "redo"}

_FIRST_LOOK, _FURTHER = 8, 8
"""Steps that are read of a group's history at first, and how many times more when they say too little."""


@dataclass(frozen=True)
class UndoStacks:
    """Ids of log entries: the last of ``done`` is what undo takes back, of ``undone`` what redo
    does again. Of a long history ``done`` may hold the newest alone, and then at least two."""

    done: tuple[int, ...] = ()
    undone: tuple[int, ...] = ()

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to take back."""
        return bool(self.done)

    @property
    def can_redo(self) -> bool:
        """Whether there is an edit to do again."""
        return bool(self.undone)

    def push_entry(self, kind: str, log_id: int = 0) -> UndoStacks:
        """The stacks after one more entry: an undo moves the last edit over, a redo moves it
        back, and a fresh edit clears what was undone."""
        if kind == "edit":
            return UndoStacks((*self.done, log_id))
        if kind == "undo":
            return UndoStacks(self.done[:-1], (*self.undone, self.done[-1]))
        return UndoStacks((*self.done, self.undone[-1]), self.undone[:-1])


def read_stacks(session: Session, group_ids: Sequence[int]) -> Mapping[int, UndoStacks]:
    """The stacks of each group."""
    if len(group_ids) == 1:
        return {group_ids[0]: _read_stacks_from_newest_steps(session, group_ids[0])}
    steps: dict[int, list[tuple[str, int]]] = {number: [] for number in group_ids}
    for row in list_group_entry_kinds(session, group_ids, GROUP_KINDS):
        steps[row.group_id].append((GROUP_KINDS[row.kind], row.id))
    return {number: _build_stacks(taken) for number, taken in steps.items()}


def _read_stacks_from_newest_steps(session: Session, group_id: int) -> UndoStacks:
    """The stacks of one group from as little of its history as tells them."""
    most = _FIRST_LOOK
    while True:
        rows = list_newest_entry_kinds(session, group_id, GROUP_KINDS, most)
        steps = [(GROUP_KINDS[row.kind], row.id) for row in reversed(rows)]
        stacks = (
            _build_stacks(steps) if len(rows) < most else _build_stacks_from_newest_steps(steps)
        )
        if stacks is not None:
            return stacks
        most *= _FURTHER


def _build_stacks_from_newest_steps(steps: Sequence[tuple[str, int]]) -> UndoStacks | None:
    """The stacks after the newest steps, or None where older ones must be known to tell them.

    An edit leaves nothing undone, whatever was before; so all that follows from it is known, as
    long as no undo reaches below it. Two edits on the stack also tell what is left after an undo.
    """
    first = next((at for at, (kind, _) in enumerate(steps) if kind == "edit"), len(steps))
    try:
        stacks = _build_stacks(steps[first:])
    except IndexError:
        return None
    return stacks if len(stacks.done) > 1 else None


def read_station_stacks(session: Session, station_id: int) -> UndoStacks:
    """The stacks of a shared station."""
    rows = list_station_entry_kinds(session, station_id, STATION_KINDS)
    return _build_stacks((STATION_KINDS[row.kind], row.id) for row in rows)


def _build_stacks(steps: Iterable[tuple[str, int]]) -> UndoStacks:
    """The stacks after all steps (kind, id of the entry): ``UndoStacks.push_entry`` of each, in one go."""
    done: list[int] = []
    undone: list[int] = []
    for kind, log_id in steps:
        if kind == "undo":
            undone.append(done.pop())
        elif kind == "redo":
            done.append(undone.pop())
        else:
            done.append(log_id)
            undone.clear()
    return UndoStacks(tuple(done), tuple(undone))
