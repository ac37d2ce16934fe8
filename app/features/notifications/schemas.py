"""The bell: what somebody was told."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.features.notifications.queries import Notification
from app.finite import MAX_ID
from app.http.documents import ListDocument


class NotificationsDocument(ListDocument[Notification]):
    """What somebody was told in the last 90 days, of what they see now, the newest first."""

    unread: int = Field(description="How much of all of it they have not seen yet.")


class SeenNotifications(BaseModel):
    """What somebody has seen."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"ids": [12, 15]}, {"ids": None}]}
    )

    ids: list[Annotated[int, Field(ge=1, le=MAX_ID)]] | None = Field(
        default=None, max_length=200, description="null: everything."
    )
