"""Static cameras adjusted together, as that is asked for."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator


class RigRequest(BaseModel):
    """Adjust the static cameras of a dataset; without `accept` that is a proposal."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{}]})

    accept: Literal["cameras", "sigma"] | None = Field(
        default=None,
        description="Save the adjusted cameras, or only how far the cameras in use may be off.",
    )
    inputs: Annotated[str, Field(pattern="^[0-9a-f]{32}$")] | None = Field(
        default=None,
        description="`inputs` of the proposal that was looked at: another one is not saved. "
        "`accept` needs it.",
    )

    @model_validator(mode="after")
    def _seen(self) -> RigRequest:
        if self.accept is not None and self.inputs is None:
            raise ValueError("to accept a proposal, give the inputs of the one that was looked at")
        return self


class RigTakenBack(BaseModel):
    """An accepted rig that was undone."""

    taken_back: int = Field(description="How many cameras are what they were.")
