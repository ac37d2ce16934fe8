"""Changes to a view or a station that are neither lines nor ball."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, StrictBool, model_validator


class ViewEdit(BaseModel):
    """Leave a view out of its group or take it in again, or choose which calibration counts."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "minProperties": 1,
            "maxProperties": 1,
            "examples": [{"included": False}, {"calibration": "lines"}],
        },
    )

    included: StrictBool = True
    calibration: Literal["given", "lines"] = "given"

    @model_validator(mode="after")
    def _one_thing(self) -> ViewEdit:
        if len(self.model_fields_set) != 1:
            raise ValueError("change one of included and calibration at a time")
        return self


class StationEdit(BaseModel):
    """Choose which calibration of a static camera counts."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"calibration": "lines"}]}
    )

    calibration: Literal["given", "lines"]
