"""Comparison of two runs: their tables side by side, and frame by frame what changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.evaluation.result import Cell, FrameResult, Table

FIELDS = ("error_m", "iou", "hit_iou", "predicted_error_m", "predicted_jac")
"""Fields of ``FrameResult`` whose difference is told per frame."""

_MEASURES = (
    "state",
    "policy_hash",
    "solver_version",
    "split",
    "boxes",
    "min_score",
    "software_version",
)


@dataclass(frozen=True)
class CellDifference:
    """One number of both runs; ``change`` is the second minus the first.

    ``unit`` and ``better`` are those of its column.
    """

    table: str
    row: str
    column: str
    label: str
    unit: str
    better: str
    first: Cell | None
    second: Cell | None

    @property
    def change(self) -> float | None:
        """None where one of them has no value."""
        values = [cell.value if cell else None for cell in (self.first, self.second)]
        if values[0] is None or values[1] is None:
            return None
        return values[1] - values[0]


@dataclass(frozen=True)
class FrameOfTwoRuns:
    """One frame of both runs; ``change`` of one field, None where a run has no value."""

    first: FrameResult
    second: FrameResult
    change: float | None


@dataclass(frozen=True)
class FrameComparison:
    """Frames by field.

    Attributes:
        better: Frames whose field became smaller (errors) or larger (overlap).
        gained: Frames that only the second run has a value for; ``lost`` the other way round.
        frames: Those that differ, the largest change first; gained and lost ones before.
    """

    field: str
    shared: int
    better: int
    worse: int
    gained: int
    lost: int
    mean_change: float | None
    frames: tuple[FrameOfTwoRuns, ...]


def list_differing_settings(first: Mapping[str, Any], second: Mapping[str, Any]) -> tuple[str, ...]:
    """Pins in which two runs differ that should be measured alike."""
    names = [name for name in _MEASURES if first.get(name) != second.get(name)]
    # Where one has no reference boxes, no two numbers come of different ones.
    drawn = {pins["careful"]["digest"] for pins in (first, second) if pins.get("careful")}
    return (*names, *(["careful"] if len(drawn) > 1 else []))


def compare_tables(first: Sequence[Table], second: Sequence[Table]) -> list[CellDifference]:
    """Every number that stands in either run, in the order of the first."""
    names = list(dict.fromkeys([table.name for table in (*first, *second)]))
    found: list[CellDifference] = []
    for name in names:
        pair = [next((t for t in tables if t.name == name), None) for tables in (first, second)]
        found += _compare_table(name, pair[0], pair[1])
    return found


def compare_frames(
    first: Sequence[FrameResult], second: Sequence[FrameResult], field: str = "error_m"
) -> FrameComparison:
    """What became of each frame that both runs judged.

    Args:
        first: Of the run that is compared with.
        second: Of the newer one.
        field: One of ``FIELDS``.
    """
    then = {(frame.group, frame.view): frame for frame in first}
    pairs = [
        (then[frame.group, frame.view], frame)
        for frame in second
        if (frame.group, frame.view) in then
    ]
    sign = -1.0 if field.endswith("error_m") else 1.0
    rows, changes = [], []
    better = worse = gained = lost = 0
    for before, after in pairs:
        a, b = getattr(before, field), getattr(after, field)
        change = None if a is None or b is None else b - a
        if change is not None:
            changes.append(change)
            better += sign * change > 0
            worse += sign * change < 0
        gained += a is None and b is not None
        lost += a is not None and b is None
        if a != b:
            rows.append(FrameOfTwoRuns(before, after, change))
    rows.sort(key=lambda row: (row.change is not None, -abs(row.change or 0.0)))
    mean = sum(changes) / len(changes) if changes else None
    return FrameComparison(field, len(pairs), better, worse, gained, lost, mean, tuple(rows))


def _compare_table(name: str, first: Table | None, second: Table | None) -> list[CellDifference]:
    both = [table for table in (first, second) if table is not None]
    rows = {row.name: row.label for table in both for row in table.rows}
    # A release may measure what the one before did not, and the other way round.
    columns = {column.name: column for table in both for column in table.columns}
    return [
        CellDifference(name, row, column, f"{label}: {head.label}", head.unit, head.better, *cells)
        for row, label in rows.items()
        for column, head in columns.items()
        if (cells := (_find_cell(first, row, column), _find_cell(second, row, column)))
        != (None, None)
    ]


def _find_cell(table: Table | None, row: str, column: str) -> Cell | None:
    if table is None or table.row(row) is None:
        return None
    has = any(known.name == column for known in table.columns)
    return table.cell(row, column) if has else None
