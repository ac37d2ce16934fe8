"""JSON and Python-literal text to plain values: capped in size and depth, never evaluated."""

from __future__ import annotations

import ast
import json
import math
import re
from collections import Counter
from typing import Any, Literal, NoReturn

import numpy as np

from app.errors import DatasetFormatError
from app.formats.camera_matrix import contains_homography, has_camera_matrices
from app.formats.report import ReaderReport
from app.json_text import quote_text
from app.soccer.pitch import find_marking_like
from app.wording import plural

EVALUATE = "touchline evaluate"
EXPORT = "export it as COCO from your tool and import that"
_KEYS = 4
"""Keys that are named of an object that is nothing known."""


def describe_document(value: Any) -> str:
    """What a document is, as the end of a sentence that begins with its name.

    Example:
        >>> describe_document({"kp": {}, "lines": {}})
        'holds keypoints that a detector predicted (kp), not annotated lines'
    """
    if contains_homography(value):
        return (
            "holds a homography: it maps the grass alone and is not a camera (no focal length, no height). "
            "Write K, R and t, or SoccerNet's camera JSON"
        )
    if isinstance(value, list):
        return _describe_list(value)
    if not isinstance(value, dict):
        return f"is {quote_text(value, 40) if isinstance(value, str) else value}, not an object"
    return _describe_object(value)


def is_camera(value: Any) -> bool:
    """Whether a value looks like one camera, in any spelling that is read."""
    if not isinstance(value, dict):
        return False
    return "pan_degrees" in value or "cam_params" in value or has_camera_matrices(value)


def is_gamestate(annotations: Any) -> bool:
    """Whether annotations are those of sn-gamestate, whose files are COCO's but for their boxes."""
    listed = annotations[:100] if isinstance(annotations, list) else []
    names = {name for item in listed if isinstance(item, dict) for name in item}
    return "bbox_image" in names and "bbox" not in names


def _describe_list(value: list[Any]) -> str:
    first = next((item for item in value if isinstance(item, dict)), None)
    if first is None:
        return f"is a list of {len(value)} values"
    if "bbox" in first and "image_id" in first:
        return f"holds COCO results, boxes that a detector predicted: evaluate them ({EVALUATE})"
    if is_camera(first):
        return "holds cameras: import it as cameras"
    return f"is a list of objects with {_format_first_keys(first)}"


def _describe_object(value: dict[str, Any]) -> str:
    if is_gamestate(value.get("annotations")):
        return "is a file of sn-gamestate: import it as gamestate"
    if "images" in value and ("annotations" in value or "categories" in value):
        return "is a COCO document: import it as coco"
    if is_camera(value):
        return "holds a camera: import it as cameras"
    for name in ("kp", "keypoints", "kps"):
        if name in value:
            return f"holds keypoints that a detector predicted ({name}), not annotated lines"
    if "actions" in value or "replays" in value:
        return "holds the labels of a match: import it as soccernet-v3 or soccernet-v3d"
    if "shapes" in value and "imagePath" in value:
        return f"is an annotation of LabelMe: {EXPORT}"
    if any(map(is_camera, value.values())):
        return "holds cameras: import it as cameras"
    if any(map(find_marking_like, value)):
        return "holds field lines: import it as sn-calibration"
    return f"is an object with {_format_first_keys(value)}" if value else "is an empty object"


def _format_first_keys(value: dict[str, Any]) -> str:
    names = ", ".join(quote_text(name, 30) for name in list(value)[:_KEYS])
    return f"{names} and {len(value) - _KEYS} more" if len(value) > _KEYS else names


NanRule = Literal["refuse", "keep"]
MAX_BYTES = 256 * 1024 * 1024
MAX_LITERAL_CHARACTERS = 16 * 1024 * 1024
MAX_DEPTH = 64
MAX_NAMED = 100
"""Numbers of one file that are not finite and are named one by one."""

# Possessive, and an open string runs to the end: one pass, whatever the text.
_DOUBLE = rb'"(?:[^"\\]++|\\.)*+\\?(?:"|\Z)'
_SINGLE = _DOUBLE.replace(b'"', b"'")
_STRING = re.compile(_DOUBLE, re.DOTALL)
_LITERAL_STRING = re.compile(_DOUBLE + b"|" + _SINGLE, re.DOTALL)
# Half of a character pair is no text and could not be stored.
_SURROGATE = re.compile(rb"\\u[dD]")
# Words and exponents of which a number that is not finite may come; there are none in most files.
_INFINITE = re.compile(rb"NaN|Infinity|\d[eE]\+?\d{2}|\d{309}")
_NO_NUMBER = re.compile(r"\b(?:nan|inf|NaN|Infinity)\b")
_PLAIN = (str, int, float, bool, type(None))


def read_json(
    content: bytes,
    path: str,
    *,
    record: str | None = None,
    double_encoded: bool = False,
    nan: NanRule = "refuse",
    max_bytes: int = MAX_BYTES,
    report: ReaderReport | None = None,
) -> Any:
    """The value of JSON text.

    Args:
        content: UTF-8 text; a byte order mark is tolerated.
        path: File as the user knows it, for the error.
        record: Record inside the file, for the error.
        double_encoded: Also accept a JSON string that holds JSON or a Python dict literal.
        nan: Without a report: whether NaN, Infinity and numbers that are too large refuse the text, or
            are kept, for a reader that refuses them field by field (``fields.parse_number``).
        max_bytes: Longest text that is looked at.
        report: Takes a remark for each NaN, Infinity and number that is too large, which are null
            in the value: what is left out for want of it, the reader of its field says. It takes a
            remark for characters U+0000, too, which are U+FFFD in the value.

    Raises:
        DatasetFormatError: Not JSON, too long, nested too deeply, or (without ``report``) with a
            number in it that is not finite.
    """
    value = _parse_json(content, path, record, max_bytes, nan, report)
    if double_encoded and isinstance(value, str):
        return _parse_inner_text(value, path, record, nan, report)
    return value


def read_json_lines(content: bytes, path: str, report: ReaderReport) -> list[Any] | None:
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
        report.add_problem(problem)
    return found


def _parse_json(
    content: bytes,
    path: str,
    record: str | None,
    max_bytes: int,
    nan: NanRule,
    report: ReaderReport | None,
) -> Any:
    if len(content) > max_bytes:
        raise DatasetFormatError(path, record, None, f"is longer than {max_bytes:,} bytes")
    if _nesting_depth(content, _STRING) > MAX_DEPTH:
        raise DatasetFormatError(path, record, None, f"is nested deeper than {MAX_DEPTH} levels")
    try:
        text = content.decode("utf-8-sig")
        if report is None and nan == "refuse":
            value = json.loads(
                text, parse_constant=_refuse_constant, parse_float=_parse_finite_number
            )
        else:
            value = json.loads(text)
        if report is not None and _INFINITE.search(content):
            value = _replace_non_finite(value, path, report)
        if b"\\u0000" in content:
            value = _replace_null_characters(value, path, record, report)
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


def _parse_inner_text(
    text: str, path: str, record: str | None, nan: NanRule, report: ReaderReport | None
) -> Any:
    try:
        return _parse_json(text.encode(), path, record, MAX_LITERAL_CHARACTERS, nan, report)
    except (DatasetFormatError, UnicodeEncodeError):
        # A literal has no number that is not finite: what is missing there is refused by its field.
        return parse_literal(text, path, record, ReaderReport() if nan == "keep" else report)


def parse_literal(
    text: str, path: str, record: str | None = None, report: ReaderReport | None = None
) -> Any:
    """The value of a Python literal of dicts, lists, tuples, strings, numbers and None.

    Nothing is evaluated: names, calls, sets, bytes and complex numbers are refused. With a report
    ``nan`` and ``inf``, as Python writes them, are None, and are counted there.

    Raises:
        DatasetFormatError: Not such a literal, too long or nested too deeply.
    """
    if len(text) > MAX_LITERAL_CHARACTERS:
        raise DatasetFormatError(path, record, None, "is too long for a Python literal")
    problem = "is neither JSON nor a Python literal of strings, numbers, lists and dictionaries"
    try:
        if _nesting_depth(text.encode(), _LITERAL_STRING) > MAX_DEPTH:
            problem = f"is nested deeper than {MAX_DEPTH} levels"
            raise ValueError(problem)
        if report is not None and _NO_NUMBER.search(text):
            value = _parse_literal_with_nulls(text.strip(), path, record, report)
        else:
            value = ast.literal_eval(text.strip())
        _require_plain_values(value)
        if "\\" in text:
            value = _replace_null_characters(value, path, record, report)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError) as error:
        raise DatasetFormatError(path, record, None, problem) from error
    return value


class _NonFiniteToNone(ast.NodeTransformer):
    """Puts None for the names of numbers that are not finite."""

    def __init__(self) -> None:
        self.count = 0

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id not in ("nan", "inf", "NaN", "Infinity"):
            return node
        self.count += 1
        return ast.copy_location(ast.Constant(None), node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        named = isinstance(node.operand, ast.Name)
        return self.visit(node.operand) if named else self.generic_visit(node)


def _parse_literal_with_nulls(
    text: str, path: str, record: str | None, report: ReaderReport
) -> Any:
    missing = _NonFiniteToNone()
    value = ast.literal_eval(missing.visit(ast.parse(text, mode="eval")))
    if missing.count:
        numbers = plural(missing.count, "number is", "numbers are")
        _report_non_finite(report, path, record, None, f"{numbers} not finite (nan, inf)")
    return value


def _require_plain_values(value: Any) -> None:
    pending = [value]
    while pending:
        item = pending.pop()
        if isinstance(item, dict):
            pending.extend(item)
            pending.extend(item.values())
        elif isinstance(item, (list, tuple)):
            pending.extend(item)
        elif not isinstance(item, _PLAIN) or (isinstance(item, float) and not math.isfinite(item)):
            raise ValueError("holds a value that JSON cannot hold")


def _nesting_depth(content: bytes, strings: re.Pattern[bytes]) -> int:
    """Deepest nesting of brackets outside strings."""
    if content.count(b"[") + content.count(b"{") + content.count(b"(") <= MAX_DEPTH:
        return 0
    letters = np.frombuffer(strings.sub(b"", content), dtype=np.uint8)
    steps = np.zeros(len(letters), dtype=np.int32)
    for opening, closing in (b"[]", b"{}", b"()"):
        steps[letters == opening] = 1
        steps[letters == closing] = -1
    return int(np.cumsum(steps).max(initial=0))


def _replace_non_finite(value: Any, path: str, report: ReaderReport) -> Any:
    """The value with null for each number that is not finite, the first of which are reported."""
    found: list[tuple[tuple[str | int, ...], float]] = []
    value = _copy_without_non_finite(value, (), found)
    for place, number in found[:MAX_NAMED]:
        what = (
            "is NaN, which is not a number" if math.isnan(number) else "is too large for a number"
        )
        _report_non_finite(report, path, *_format_record_and_field(place), what)
    if len(found) > MAX_NAMED:
        fields = Counter(str(place[-1]) for place, _ in found[MAX_NAMED:] if place)
        shown = ", ".join(f"{name} ({count:,})" for name, count in fields.most_common(5))
        problem = f"{len(found) - MAX_NAMED:,} more numbers are not finite: {shown}"
        _report_non_finite(report, path, None, None, problem)
    return value


def _replace_null_characters(
    value: Any, path: str, record: str | None, report: ReaderReport | None
) -> Any:
    """The value with U+FFFD for each U+0000, which no text of a database holds; they are counted."""
    count = 0

    def copy(item: Any) -> Any:
        nonlocal count
        if isinstance(item, str):
            count += item.count("\0")
            return item.replace("\0", "\ufffd")
        if isinstance(item, dict):
            return {copy(name): copy(part) for name, part in item.items()}
        if isinstance(item, (list, tuple)):
            return type(item)(map(copy, item))
        return item

    value = copy(value)
    if count and report is not None:
        what = f"holds {plural(count, 'character')} U+0000, which cannot be stored; read as U+FFFD"
        report.add_remark(DatasetFormatError(path, record, None, what).message)
    return value


def _report_non_finite(
    report: ReaderReport, path: str, record: str | None, field: str | None, what: str
) -> None:
    """Say what a file holds. Where it is of no use without that number, its reader leaves it out."""
    problem = DatasetFormatError(path, record, field, f"{what}; read as missing")
    report.add_remark(problem.message)


def _copy_without_non_finite(
    value: Any, place: tuple[str | int, ...], found: list[tuple[tuple[str | int, ...], float]]
) -> Any:
    if isinstance(value, dict):
        return {
            key: _copy_without_non_finite(item, (*place, key), found) for key, item in value.items()
        }
    if isinstance(value, list):
        return [
            _copy_without_non_finite(item, (*place, index), found)
            for index, item in enumerate(value)
        ]
    if not isinstance(value, float) or math.isfinite(value):
        return value
    found.append((place, value))
    return None


def _format_record_and_field(place: tuple[str | int, ...]) -> tuple[str | None, str | None]:
    """Record and field of a place: ``("annotations", 3, "area")`` is annotations[3] and area."""
    parts = [f"[{name}]" if isinstance(name, int) else f".{name}"[:80] for name in place]
    head = 2 if len(parts) > 2 else 0
    record, field = ("".join(some).removeprefix(".") for some in (parts[:head], parts[head:]))
    return record or None, field or None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"holds {name}, which is not a number")


def _parse_finite_number(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"holds {text[:20]}, which is too large for a number")
    return number
