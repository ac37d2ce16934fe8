"""Computed values to JSON and back, compiled from their type hints.

Solutions are rebuilt whenever the solver changes, so their JSON follows the dataclasses; what
people said has explicit codecs of its own (``codecs``).
"""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import msgspec

from app.db.json_columns import as_written, look_through
from app.features.groups.codecs import camera_from_json, camera_to_json
from app.geometry.camera import Camera
from app.soccer.frames import ImagePoint

T = TypeVar("T")
Codec = tuple[Callable[[Any], Any], Callable[[Any], Any]]


def to_json(value: Any) -> Any:
    """A dataclass of numbers, texts, tuples and other dataclasses as JSON values.

    A field that came later (``metadata``) stands there only where it says something, so that what
    was computed before it came is the same bytes.
    """
    return _codec_of_type(type(value))[0](value)


def from_json(kind: type[T], value: Any) -> T:
    """Back from ``to_json``; fields that the JSON does not have keep their default.

    Raises:
        DamagedError: It is not what ``to_json`` makes.
    """
    with as_written():
        result: T = _codec_of_type(kind)[1](value)
    return result


def dumps(value: Any) -> str:
    """JSON text of a value of ``to_json``; a number that is not finite becomes its name."""
    try:
        return json.dumps(value, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(_name_non_finite(value), separators=(",", ":"), allow_nan=False)


def _name_non_finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, dict):
        return {key: _name_non_finite(item) for key, item in value.items()}
    return [_name_non_finite(item) for item in value] if isinstance(value, list | tuple) else value


def _identity(value: Any) -> Any:
    return value


def _codec_of_type(hint: Any) -> Codec:
    return _make_codec(hint)


@cache
def _make_codec(hint: Any) -> Codec:
    if hint is float:
        # ``float`` also reads the names of numbers that are not finite.
        return _identity, float
    if hint in (int, str, bool, type(None)):
        return _identity, _identity
    if hint is ImagePoint:
        return list, ImagePoint._make
    if hint is Camera:
        return camera_to_json, camera_from_json
    if dataclasses.is_dataclass(hint):
        return _dataclass_codec(hint)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union):
        return _optional_codec(arguments)
    if origin is tuple:
        return _tuple_codec(arguments)
    if origin is typing.Literal:
        return _identity, _identity
    raise TypeError(f"no codec for {hint}")


def _dataclass_codec(kind: Any) -> Codec:
    hints = typing.get_type_hints(kind)
    codecs = [(item.name, *_codec_of_type(hints[item.name])) for item in dataclasses.fields(kind)]
    later = {
        item.name: item.default for item in dataclasses.fields(kind) if "later" in item.metadata
    }

    def whole(value: Any) -> Any:
        return {name: to(getattr(value, name)) for name, to, _ in codecs}

    def encode(value: Any) -> Any:
        written = whole(value)
        for name, default in later.items():
            if getattr(value, name) == default:
                del written[name]
        return written

    def decode(value: Any) -> Any:
        return kind(**{name: back(value[name]) for name, _, back in codecs if name in value})

    def decode_plain(value: Any) -> Any:
        try:
            return msgspec.convert(value, kind)
        except msgspec.ValidationError:
            # The name of a number that is not finite is no number to it.
            return decode(value)

    if not _is_plain_json_type(kind):
        return encode if later else whole, decode
    look_through(kind)
    return encode if later else whole, decode_plain


def _is_plain_json_type(hint: Any) -> bool:
    """Whether JSON holds a type as a library reads it; a camera has a codec of its own."""
    if hint is Camera:
        return False
    hints = typing.get_type_hints(hint).values() if dataclasses.is_dataclass(hint) else ()
    return all(map(_is_plain_json_type, (*hints, *typing.get_args(hint))))


def _optional_codec(arguments: tuple[Any, ...]) -> Codec:
    (inner,) = (item for item in arguments if item is not type(None))
    to, back = _codec_of_type(inner)
    return (
        lambda value: None if value is None else to(value),
        lambda value: None if value is None else back(value),
    )


def _tuple_codec(arguments: tuple[Any, ...]) -> Codec:
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        to, back = _codec_of_type(arguments[0])
        if to is _identity:
            return list, lambda value: tuple(map(back, value))
        return (
            lambda value: [to(item) for item in value],
            lambda value: tuple(map(back, value)),
        )
    codecs = [_codec_of_type(item) for item in arguments]
    return (
        lambda value: [to(item) for (to, _), item in zip(codecs, value, strict=True)],
        lambda value: tuple(back(item) for (_, back), item in zip(codecs, value, strict=True)),
    )
