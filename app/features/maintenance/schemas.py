"""Documents of the notice and of the server's health."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field

from app.features.maintenance.service import LONGEST


class NewBanner(BaseModel):
    """A notice, and when it is shown."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"text": "Upgrade at 18:00, ten minutes.", "until": "2099-11-28T18:10:00Z"}
            ]
        },
    )

    text: Annotated[str, Field(min_length=1, max_length=LONGEST)] = Field(
        description="One line, shown on every page, also before people log in."
    )
    starts: AwareDatetime | None = Field(
        default=None, description="When it begins to be shown; null: at once."
    )
    until: AwareDatetime | None = Field(
        default=None, description="When it is no longer shown; null: when it is deleted."
    )


class Health(BaseModel):
    """The process answers."""

    status: Literal["ok"]
    version: str


class Readiness(BaseModel):
    """The database answers."""

    status: Literal["ready"]
