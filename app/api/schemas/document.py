"""Document: what travels, read off the value that it shows."""

from __future__ import annotations

from typing import Generic, TypeVar

from pydantic import BaseModel, ConfigDict

Item = TypeVar("Item")


class Document(BaseModel):
    """An answer; a field is the attribute of that name, or the one that its alias names."""

    model_config = ConfigDict(from_attributes=True, validate_by_name=True, validate_by_alias=True)


class ListDocument(Document, Generic[Item]):
    """An answer of several things, in an order that its own words tell."""

    items: list[Item]
