"""Document: what travels, read off the value that it shows."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Document(BaseModel):
    """An answer; a field is the attribute of that name, or the one that its alias names."""

    model_config = ConfigDict(from_attributes=True, validate_by_name=True, validate_by_alias=True)
