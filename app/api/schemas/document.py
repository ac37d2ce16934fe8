"""Document: what travels, read off the value that it shows."""

from __future__ import annotations

from dataclasses import fields
from inspect import get_annotations
from typing import Any, Generic, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, Field

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


class ListDocument(Document, Generic[Item]):
    """An answer of several things, in an order that its own words tell."""

    items: list[Item] = Field(description="The things, of one page where a limit was asked for.")
    next: str | None = Field(
        default=None, description="`cursor` of the next page; null on the last one."
    )
