"""JSON text: the canonical one, of which digests are made, and values on their way out: numbers that are infinite or
NaN become null, texts are quoted, times are in UTC with a Z.

JSON, CSV and logs have no infinity and no NaN that every reader understands. A number that is
neither known nor finite leaves as null, as an empty cell, as nothing.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from threading import Lock
from typing import Annotated, Any

import msgspec

_ENCODER = json.JSONEncoder(
    sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
)


def canonical_json_text(value: Any) -> str:
    """The one JSON text of a value: sorted keys, no spaces.

    Raises:
        ValueError: A number is infinite or NaN.

    Example:
        >>> canonical_json_text({"b": 1, "a": [1.5, None]})
        '{"a":[1.5,null],"b":1}'
    """
    return _ENCODER.encode(value)


def digest_content(content: bytes) -> str:
    """Digest of content, 32 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()[:32]


MAX_ID = 2**63 - 1
"""The largest whole number that a column of ids, and an answer, holds."""


class _DatetimeSerialization:
    """How a time of a value that is served is told; the value itself keeps the text of the database."""

    def __get_pydantic_core_schema__(self, _source: Any, _handler: Any) -> Any:
        # What starts fast, such as the command line, does not import pydantic.
        from pydantic_core import core_schema

        told = core_schema.datetime_schema()
        written = core_schema.plain_serializer_function_ser_schema(
            datetime.fromisoformat, return_schema=told, when_used="json"
        )
        return {**told, "serialization": written}


Moment = Annotated[str, _DatetimeSerialization()]
"""A time as ``format_utc_time`` writes it; RFC 3339 where it is served."""


def replace_non_finite(value: Any) -> Any:
    """A value of dicts, lists and plain values in which no number is infinite or NaN.

    Example:
        >>> replace_non_finite({"error": float("inf"), "at": (1.0, float("nan"))})
        {'error': None, 'at': [1.0, None]}
    """
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: replace_non_finite(item) for key, item in value.items()}
    return (
        [replace_non_finite(item) for item in value] if isinstance(value, (list, tuple)) else value
    )


_LOOKING = Lock()


def prepare_msgspec_type(kind: Any) -> None:
    """Let msgspec find out what a type is made of, once and by one thread, before it is read.

    It keeps what it found at the classes before that is whole: of two threads that are the first to
    read a type, one would follow an empty pointer, and the process would end (msgspec 0.22).
    """
    with _LOOKING, suppress(msgspec.ValidationError):
        msgspec.convert(None, kind)


def json_text(
    value: Any,
    *,
    indent: int | None = None,
    ascii_: bool = False,
    compact: bool = False,
) -> str:
    """The JSON text of a value; a number that is not finite is null.

    Args:
        value: Dicts, lists and plain values.
        indent: Spaces a level, for people; None: one line.
        ascii_: Whether letters beyond ASCII are escaped.
        compact: Without spaces.
    """
    try:
        # Numbers that are not finite are null to this encoder, which is ten times as fast as Python's.
        data = msgspec.json.encode(value)
    except (TypeError, UnicodeEncodeError):
        return _encode_json_slowly(value, indent, ascii_, compact)
    if ascii_ and not data.isascii():
        return _encode_json_slowly(value, indent, ascii_, compact)
    if not compact:
        data = msgspec.json.format(data, indent=indent or 0)
    return data.decode()


def _encode_json_slowly(value: Any, indent: int | None, ascii_: bool, compact: bool) -> str:
    """``json_text`` of what the fast encoder has no place for: other keys and numbers than Python's,
    halves of a surrogate pair; and of letters that are to be escaped."""
    separators = (",", ":") if compact else None
    return json.dumps(
        replace_non_finite(value),
        indent=indent,
        ensure_ascii=ascii_,
        separators=separators,
        allow_nan=False,
    )


def quote_text(text: str, most: int = 40) -> str:
    """The beginning of somebody's text in a sentence, in quotes; what cannot be printed is spelt out.

    Example:
        >>> quote_text("Müller"), quote_text("a\\nb"), quote_text("abc", 2)
        ('"Müller"', '"a\\\\nb"', '"ab"')
    """
    start = text[:most]
    return json_text(start, ascii_=not start.isprintable())
