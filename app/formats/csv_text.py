"""CSV files: floats by ``repr``, nothing for what is missing, no formulas; and read again."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import IO, Any

from app.errors import DatasetFormatError
from app.formats.file_tree import ImportLimits
from app.json_text import quote_text

MAX_CELL = 1024 * 1024
"""Longest cell, characters; a camera takes about a thousand."""
_MISSING = ("", "nan", "none", "null")
_FORMULA = ("=", "+", "-", "@", "\t", "\n")
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)

Value = str | bool | int | float | None


def format_csv_cell(value: Value) -> str:
    """The text of one cell.

    Missing values (None, NaN) are empty. Text that a spreadsheet would run as a formula gets an
    apostrophe before it, and so does what would be taken for that; numbers stay as they are.
    """
    if value is None:
        return ""
    if isinstance(value, str):
        # A carriage return alone would end the row for some readers, quoted or not.
        text = value.replace("\r\n", "\n").replace("\r", "\n")
        formula = text.lstrip("'").startswith(_FORMULA)
        return f"'{text}" if formula and not _NUMBER.fullmatch(text) else text
    if isinstance(value, (bool, int)):
        return str(value)
    return repr(float(value)) if math.isfinite(value) else ""


def format_csv_line(values: Iterable[Value]) -> str:
    """A row of a CSV file with its end."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow([format_csv_cell(value) for value in values])
    return text.getvalue()


def format_number_list(values: Sequence[float | int]) -> str:
    """A list as text, ``[1.0, 2.0]``, with every digit."""
    return "[" + ", ".join(repr(_to_builtin_number(value)) for value in values) + "]"


def _to_builtin_number(value: float) -> float:
    # numpy's own numbers would spell themselves np.float64(...).
    return int(value) if isinstance(value, int) else float(value)


class CsvTableWriter:
    """A CSV file with pandas' unnamed index column, written row by row."""

    def __init__(self, file: IO[str], columns: Iterable[str]):
        self._writer: Any = csv.writer(file, lineterminator="\n")
        self._writer.writerow(["", *columns])
        self.rows = 0

    def add(self, values: Iterable[Value]) -> None:
        """One row; its index is the number of rows before it."""
        self.add_cells(map(format_csv_cell, values))

    def add_cells(self, cells: Iterable[str]) -> None:
        """One row of what ``format_csv_cell`` made."""
        self._writer.writerow([str(self.rows), *cells])
        self.rows += 1


def read_rows(
    content: bytes,
    path: str,
    required: Iterable[str],
    limits: ImportLimits,
    *,
    delimiter: str = ",",
) -> Iterator[tuple[int, Mapping[str, str]]]:
    """The rows of a CSV file with their line numbers, each by name of column.

    Args:
        content: UTF-8 text; a byte order mark is tolerated, and so is an unnamed index column.
        path: File as the user knows it, for the error.
        required: Columns without which the file is another one.
        limits: Caps on what is read.
        delimiter: What stands between cells.

    Raises:
        DatasetFormatError: No such table; also in the middle, where the file stops being one.
    """
    if len(content) > limits.file_bytes:
        raise DatasetFormatError(path, None, None, f"is longer than {limits.file_bytes:,} bytes")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DatasetFormatError(path, None, None, "is not UTF-8 text") from error
    csv.field_size_limit(MAX_CELL)
    reader = csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=delimiter)
    try:
        header = [name.strip() for name in next(reader, [])]
        missing = [name for name in required if name not in header]
        if missing:
            raise DatasetFormatError(path, None, missing[0], "is missing from the columns")
        for row in reader:
            if row:
                yield reader.line_num, dict(zip(header, map(_unescape_formula, row), strict=False))
    except csv.Error as error:
        line = f"line {reader.line_num}"
        raise DatasetFormatError(path, line, None, f"is not valid CSV ({error})") from error


def _unescape_formula(text: str) -> str:
    """A cell without the apostrophe that ``format_csv_cell`` put before a formula."""
    if text.startswith("'") and text.lstrip("'").startswith(_FORMULA):
        return text[1:]
    return text


def is_missing(text: str | None) -> bool:
    """Whether a cell says nothing: empty, or pandas' ``nan``."""
    return text is None or text.strip().lower() in _MISSING


def parse_number_list(text: str, count: int) -> tuple[float, ...]:
    """The numbers of a list as text: ``[1, 2]``, ``[array([1., 2.])]``, ``[np.float64(1), 2]``.

    Nothing is evaluated; the words around the numbers are known ones.

    Raises:
        ValueError: Another count, or anything else between the numbers.
    """
    bare = _WORDS.sub(" ", text)
    parts = [part for part in _BETWEEN.split(bare) if part]
    if not all(_NUMBER.fullmatch(part) for part in parts):
        raise ValueError(f"is {quote_text(text, 60)}, not a list of numbers")
    if len(parts) != count:
        raise ValueError(f"has {len(parts)} numbers, not {count}")
    values = tuple(map(float, parts))
    if not all(map(math.isfinite, values)):
        raise ValueError("holds a number that is too large")
    return values


_WORDS = re.compile(r"\b(?:np\.|numpy\.)?(?:array|float64|float32|int64)\b|dtype=\w+", re.ASCII)
_BETWEEN = re.compile(r"[\s,\[\]()]+", re.ASCII)
