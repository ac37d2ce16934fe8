"""Cells of CSV files: floats by ``repr``, nothing for what is missing, no formulas."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Sequence
from typing import IO, Any

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)

Value = str | bool | int | float | None


def cell(value: Value) -> str:
    """The text of one cell.

    Missing values (None, NaN) are empty. Text that a spreadsheet would run as a formula gets an
    apostrophe before it; numbers stay as they are.
    """
    if value is None:
        return ""
    if isinstance(value, str):
        return f"'{value}" if value.startswith(_FORMULA) and not _NUMBER.fullmatch(value) else value
    if isinstance(value, (bool, int)):
        return str(value)
    return repr(float(value)) if math.isfinite(value) else ""


def plain_list(values: Sequence[float | int]) -> str:
    """A list as text, ``[1.0, 2.0]``, with every digit."""
    return "[" + ", ".join(repr(_plain(value)) for value in values) + "]"


def _plain(value: float) -> float:
    # numpy's own numbers would spell themselves np.float64(...).
    return int(value) if isinstance(value, int) else float(value)


class Table:
    """A CSV file with pandas' unnamed index column, written row by row."""

    def __init__(self, file: IO[str], columns: Iterable[str]):
        self._writer: Any = csv.writer(file, lineterminator="\n")
        self._writer.writerow(["", *columns])
        self.rows = 0

    def add(self, values: Iterable[Value]) -> None:
        """One row; its index is the number of rows before it."""
        self._writer.writerow([str(self.rows), *map(cell, values)])
        self.rows += 1
