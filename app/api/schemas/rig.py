"""Static cameras adjusted together, as that is asked for."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class RigRequest(BaseModel):
    """Adjust the static cameras of a dataset; without `accept` that is a proposal."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{}]})

    accept: Literal["cameras", "sigma"] | None = Field(
        default=None,
        description="Save the adjusted cameras, or only how far the cameras in use may be off.",
    )
    inputs: Annotated[str, Field(pattern="^[0-9a-f]{32}$")] | None = Field(
        default=None,
        description="`inputs` of the proposal that was looked at: another one is not saved.",
    )


class RigTakenBack(BaseModel):
    """An accepted rig that was undone."""

    taken_back: int = Field(description="How many cameras are what they were.")
