"""Tables of numbers that never go without their denominator."""

from __future__ import annotations

from dataclasses import dataclass

TABLES = (
    "detection",
    "localization",
    "detection_by_size",
    "detection_by_distance",
    "boxes",
    "calibration",
    "sensitivity",
    "tracks",
    "track_events",
)


@dataclass(frozen=True)
class Cell:
    """One number.

    Attributes:
        value: None when there is nothing to compute it from.
        low: Lower end of the 95 % interval; None where there is none.
        high: Upper end.
        count: How many items the number was computed from.
        of: How many there were to compute it from; at least ``count``.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    count: int = 0
    of: int = 0


@dataclass(frozen=True)
class Column:
    """What a column holds; ``better`` is ``higher``, ``lower`` or empty."""

    name: str
    label: str
    unit: str = ""
    better: str = ""


@dataclass(frozen=True)
class FrameRange:
    """The frames behind a row: those whose ``field`` lies in [low, high), a missing bound open.

    Fields are those of ``result.FrameResult``.
    """

    field: str
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Row:
    """One line of a table, its cells in the order of the columns."""

    name: str
    label: str
    cells: tuple[Cell, ...]
    frames: FrameRange | None = None


@dataclass(frozen=True)
class Table:
    """A table; ``note`` says over what it was computed, in a sentence."""

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    note: str = ""

    def row(self, name: str) -> Row | None:
        """The row of that name, or None."""
        return next((row for row in self.rows if row.name == name), None)

    def cell(self, row: str, column: str) -> Cell:
        """One cell by the names of its row and column."""
        place = [item.name for item in self.columns].index(column)
        return next(item for item in self.rows if item.name == row).cells[place]
