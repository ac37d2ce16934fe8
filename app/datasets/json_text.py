"""JSON and Python-literal text to plain values: capped in size and depth, never evaluated."""

from __future__ import annotations

import ast
import json
import math
import re
from typing import Any, Literal, NoReturn

import numpy as np

from app.datasets.report import Report
from app.errors import DatasetFormatError

NanRule = Literal["refuse", "keep", "null"]
MAX_BYTES = 256 * 1024 * 1024
MAX_LITERAL_CHARACTERS = 16 * 1024 * 1024
MAX_DEPTH = 64

# Possessive, and an open string runs to the end: one pass, whatever the text.
_DOUBLE = rb'"(?:[^"\\]++|\\.)*+\\?(?:"|\Z)'
_SINGLE = _DOUBLE.replace(b'"', b"'")
_STRING = re.compile(_DOUBLE, re.DOTALL)
_LITERAL_STRING = re.compile(_DOUBLE + b"|" + _SINGLE, re.DOTALL)
# Half of a character pair is no text and could not be stored.
_SURROGATE = re.compile(rb"\\u[dD]")
# A string stays; numbers of Python that are not finite do not.
_NOT_FINITE = re.compile(
    rf"({(_DOUBLE + b'|' + _SINGLE).decode()})|(?<![\w.])-?(?:nan|inf)(?![\w.])", re.DOTALL
)
_PLAIN = (str, int, float, bool, type(None))


def read_json(
    content: bytes,
    path: str,
    *,
    record: str | None = None,
    double_encoded: bool = False,
    nan: NanRule = "refuse",
    max_bytes: int = MAX_BYTES,
) -> Any:
    """The value of JSON text.

    Args:
        content: UTF-8 text; a byte order mark is tolerated.
        path: File as the user knows it, for the error.
        record: Record inside the file, for the error.
        double_encoded: Also accept a JSON string that holds JSON or a Python dict literal.
        nan: What becomes of NaN, Infinity and numbers too large: ``refuse`` the text; ``keep`` them as
            floats that are not finite, for a reader that refuses them field by field
            (``fields.number``); ``null``, for one that keeps fields which it does not read.
        max_bytes: Longest text that is looked at.

    Raises:
        DatasetFormatError: Not JSON, NaN or Infinity in it, too long or nested too deeply.
    """
    value = _read(content, path, record, max_bytes, nan)
    if double_encoded and isinstance(value, str):
        return _read_inner(value, path, record, nan)
    return value


def read_json_lines(content: bytes, path: str, report: Report) -> list[Any] | None:
    """The objects of JSON lines, an object a line, NaN allowed; None where the text is something else.

    A line that cannot be read is reported and left out.
    """
    lines = [(at, line) for at, line in enumerate(content.splitlines(), 1) if line.strip()]
    if len(lines) < 2 or len(content) > MAX_BYTES:
        return None
    found, problems = [], []
    for number, line in lines:
        try:
            found.append(read_json(line, path, record=f"line {number}", nan="keep"))
        except DatasetFormatError as error:
            problems.append(error)
    if len(found) < max(len(problems), 1) or not all(isinstance(item, dict) for item in found):
        return None
    for problem in problems:
        report.read += 1
        report.skip(problem)
    return found


def _read(
    content: bytes, path: str, record: str | None, max_bytes: int, nan: NanRule = "refuse"
) -> Any:
    if len(content) > max_bytes:
        raise DatasetFormatError(path, record, None, f"is longer than {max_bytes:,} bytes")
    if _depth(content, _STRING) > MAX_DEPTH:
        raise DatasetFormatError(path, record, None, f"is nested deeper than {MAX_DEPTH} levels")
    try:
        text = content.decode("utf-8-sig")
        value = json.loads(text, **_PARSERS[nan])
        if _SURROGATE.search(content):
            json.dumps(value, ensure_ascii=False).encode()
        return value
    except UnicodeError as error:
        raise DatasetFormatError(path, record, None, "is not UTF-8 text") from error
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise DatasetFormatError(path, record, place, f"is not JSON ({error.msg})") from error
    except ValueError as error:
        raise DatasetFormatError(path, record, None, str(error)) from error


def _read_inner(text: str, path: str, record: str | None, nan: NanRule) -> Any:
    try:
        return _read(text.encode(), path, record, MAX_LITERAL_CHARACTERS, nan)
    except (DatasetFormatError, UnicodeEncodeError):
        if nan != "refuse":
            text = _NOT_FINITE.sub(lambda found: found[1] or "None", text)
        return parse_literal(text, path, record)


def parse_literal(text: str, path: str, record: str | None = None) -> Any:
    """The value of a Python literal of dicts, lists, tuples, strings, numbers and None.

    Nothing is evaluated: names, calls, sets, bytes and complex numbers are refused.

    Raises:
        DatasetFormatError: Not such a literal, too long or nested too deeply.
    """
    if len(text) > MAX_LITERAL_CHARACTERS:
        raise DatasetFormatError(path, record, None, "is too long for a Python literal")
    problem = "is neither JSON nor a Python literal of plain values"
    try:
        if _depth(text.encode(), _LITERAL_STRING) > MAX_DEPTH:
            problem = f"is nested deeper than {MAX_DEPTH} levels"
            raise ValueError(problem)
        value = ast.literal_eval(text.strip())
        _require_plain(value)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError) as error:
        raise DatasetFormatError(path, record, None, problem) from error
    return value


def _require_plain(value: Any) -> None:
    pending = [value]
    while pending:
        item = pending.pop()
        if isinstance(item, dict):
            pending.extend(item)
            pending.extend(item.values())
        elif isinstance(item, (list, tuple)):
            pending.extend(item)
        elif not isinstance(item, _PLAIN) or (isinstance(item, float) and not math.isfinite(item)):
            raise ValueError("not a plain value")


def _depth(content: bytes, strings: re.Pattern[bytes]) -> int:
    """Deepest nesting of brackets outside strings."""
    if content.count(b"[") + content.count(b"{") + content.count(b"(") <= MAX_DEPTH:
        return 0
    letters = np.frombuffer(strings.sub(b"", content), dtype=np.uint8)
    steps = np.zeros(len(letters), dtype=np.int32)
    for opening, closing in (b"[]", b"{}", b"()"):
        steps[letters == opening] = 1
        steps[letters == closing] = -1
    return int(np.cumsum(steps).max(initial=0))


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"holds {name}, which is not a number")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"holds {text[:20]}, which is too large for a number")
    return number


def _finite_or_none(text: str) -> float | None:
    number = float(text)
    return number if math.isfinite(number) else None


_PARSERS: dict[NanRule, dict[str, Any]] = {
    "refuse": {"parse_constant": _refuse, "parse_float": _finite},
    "keep": {},
    "null": {"parse_constant": lambda _: None, "parse_float": _finite_or_none},
}
