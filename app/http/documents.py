"""The base of documents, values that are their own documents, and a cache of identical ones."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import fields
from functools import cache
from inspect import get_annotations
from threading import Lock
from typing import Any, Generic, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

Item = TypeVar("Item")


class Document(BaseModel):
    """An answer; a field is the attribute of that name, or the one that its alias names.

    One that ``shows`` a dataclass has all its fields, in their order, and writes down only those
    of which it says more: a description, another type. Fields of its own come after them.
    """

    model_config = ConfigDict(from_attributes=True, validate_by_name=True, validate_by_alias=True)

    def __init_subclass__(cls, shows: type[Any] | None = None, **options: Any) -> None:
        super().__init_subclass__(**options)
        if shows is not None:
            hints = get_type_hints(shows, include_extras=True)
            shown = {field.name: hints[field.name] for field in fields(shows)}
            cls.__annotations__ = shown | get_annotations(cls)


def json_of(value: Any) -> bytes:
    """The JSON of a document, or of a frozen dataclass, which is its own; no number is infinite or NaN."""
    kind: Any = type(value)
    return _adapter_of_type(kind).dump_json(value)


@cache
def _adapter_of_type(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


class ListDocument(Document, Generic[Item]):
    """An answer of several things, in an order that its own words tell."""

    items: list[Item] = Field(description="The items; one page of them if `limit` is given.")
    next: str | None = Field(
        default=None, description="`cursor` of the next page; null on the last one."
    )


T = TypeVar("T")
R = TypeVar("R")


class IdentityCache(Generic[T, R]):
    """Calls a function once for each value; the value itself is the key, not what it equals.

    For frozen values that are expensive to hash and live as long as their own cache keeps them.

    Args:
        make: The function; it depends on nothing but the value and what is given beside it.
        size: How many results are kept; the one that was not asked for the longest goes first.
    """

    def __init__(self, make: Callable[..., R], size: int):
        self._make, self._size = make, size
        self._lock = Lock()
        self._kept: OrderedDict[int, tuple[T, tuple[object, ...], R]] = OrderedDict()

    def __call__(self, value: T, *beside: object) -> R:
        """What the function makes of the value; what is beside it counts by what it equals."""
        key = id(value)
        with self._lock:
            # A value that is kept lives, so no other has its id.
            if key in self._kept and self._kept[key][1] == beside:
                self._kept.move_to_end(key)
                return self._kept[key][2]
        made = self._make(value, *beside)
        with self._lock:
            self._kept[key] = value, beside, made
            self._kept.move_to_end(key)
            if len(self._kept) > self._size:
                self._kept.popitem(last=False)
        return made
