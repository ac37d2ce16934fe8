"""Stored JSON: values as the database keeps them, packed or not; what is not as written is damage."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import msgspec
from zlib_ng import zlib_ng

from app.errors import EXAMINE, DamagedError, GeometryError, InputError
from app.json_text import canonical_json_text

Shape = TypeVar("Shape")
Json = Any
"""What ``json`` makes: dict, list, str, int, float, bool or None."""
_NULL_CHARACTERS = re.compile(rb"((?<!\\)(?:\\\\)*)\\u0000")
"""U+0000 as JSON writes it, behind an even number of backslashes; tables cannot keep it."""
_MISSHAPEN = (
    ArithmeticError,
    AttributeError,
    GeometryError,
    InputError,
    LookupError,
    TypeError,
    ValueError,
)


def parse_json_column(text: str | bytes) -> Json:
    """The value of a JSON text of the database.

    Raises:
        DamagedError: The text is not what was written.
    """
    try:
        return msgspec.json.decode(text)
    except ValueError as error:
        raise _damaged_record_error() from error


def parse_json_as(text: str | bytes, kind: type[Shape]) -> Shape:
    """The members of a JSON text that a type names; all others are passed over, which is faster.

    Raises:
        DamagedError: The text is not what was written.
    """
    try:
        return msgspec.json.decode(text, type=kind)
    except (ValueError, msgspec.MsgspecError) as error:
        raise _damaged_record_error() from error


@contextmanager
def translate_shape_errors_to_damage() -> Iterator[None]:
    """For making values of stored JSON: what has another shape than we gave it is damage.

    Raises:
        DamagedError: A member is missing, or is something else.
    """
    try:
        yield
    except _MISSHAPEN as error:
        raise _damaged_record_error() from error


def compress_json(value: Json) -> bytes:
    """A value as compressed canonical JSON."""
    return zlib_ng.compress(canonical_json_text(value).encode())


def decompress_json(data: bytes) -> Json:
    """The value of compressed JSON.

    Raises:
        DamagedError: The bytes are not what was written.
    """
    text = decompress(data)
    return parse_json_column(
        _NULL_CHARACTERS.sub(rb"\1\\ufffd", text) if b"\\u0000" in text else text
    )


def decompress(data: bytes) -> bytes:
    """What was compressed.

    Raises:
        DamagedError: The bytes are not what was written.
    """
    try:
        return zlib.decompress(data)
    except zlib.error as error:
        raise _damaged_record_error() from error


def _damaged_record_error() -> DamagedError:
    return DamagedError("a record in the database is damaged: it cannot be decoded", hint=EXAMINE)
