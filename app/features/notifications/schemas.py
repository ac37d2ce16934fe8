"""The bell: what somebody was told."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.features.notifications.service import RingKind
from app.finite import MAX_ID
from app.http.documents import Document, ListDocument


class RingDocument(Document):
    """One thing that somebody was told."""

    id: int
    at: datetime
    kind: RingKind
    actor: str = Field(description="Who did it.")
    sentence: str
    address: str = Field(description="Of the page that it is about.")
    dataset: str | None
    group_id: int | None
    read: datetime | None = Field(description="When they have seen it; null: not yet.")


class BellDocument(ListDocument[RingDocument]):
    """What somebody was told in the last 90 days, of what they see now, the newest first."""

    unread: int = Field(description="How much of all of it they have not seen yet.")


class BellRead(BaseModel):
    """What somebody has seen."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"ids": [12, 15]}, {"ids": None}]}
    )

    ids: list[Annotated[int, Field(ge=1, le=MAX_ID)]] | None = Field(
        default=None, max_length=200, description="null: everything."
    )
