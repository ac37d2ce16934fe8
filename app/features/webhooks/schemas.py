"""Webhooks: addresses that are told what happens in a dataset."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.features.webhooks.messages import CHOSEN, Kind
from app.features.webhooks.sender import LONGEST
from app.http.documents import Document, ListDocument

Url = Annotated[str, Field(min_length=1, max_length=LONGEST)]
Kinds = Annotated[list[Kind], Field(min_length=1, max_length=len(CHOSEN))]
URL = "https://hooks.example.org/touchline"


class NewWebhook(BaseModel):
    """An address that shall be told."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"url": URL, "kinds": ["group.judged", "job.failed"]}]},
    )

    url: Url = Field(description="One that the operator of the server allows.")
    kinds: Kinds


class WebhookEdit(BaseModel):
    """What changes of a webhook."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"on": False}, {"kinds": ["job.done"]}]}
    )

    url: Url | None = None
    kinds: Kinds | None = None
    on: bool | None = Field(
        default=None,
        description="Off: it gets no messages, and events of that time are not sent later.",
    )


class WebhookDocument(Document):
    """An address that is told."""

    id: int
    url: str
    kinds: list[Kind]
    off: str | None = Field(description="Why sending was stopped; null: it is on.")
    created: datetime
    created_by: str
    waiting: int = Field(description="Messages that wait to be sent, or sent again.")
    delivered: int = Field(description="Messages of the last 30 days that arrived.")
    failed: int = Field(description="Messages of the last 30 days that were given up.")


class WebhookList(ListDocument[WebhookDocument]):
    """Webhooks of a dataset, and what they may be."""

    allowed: list[str] = Field(description="How the operator lets addresses begin.")
    kinds: list[Kind] = Field(description="Kinds of messages a webhook can get.")


class WebhookWithSecret(Document):
    """A webhook, and what its messages are signed with: shown this once."""

    webhook: WebhookDocument
    secret: str


class DeliveryDocument(Document):
    """A message to a webhook, and how its sending goes."""

    id: int
    message: str = Field(description="`webhook-id`: the same however often it is sent.")
    kind: Kind
    body: str = Field(description="The JSON that is sent, to the letter.")
    created: datetime
    state: Literal["waiting", "delivered", "failed"]
    attempts: int
    next_at: datetime | None = Field(description="When it is tried next.")
    tried: datetime | None
    status: int | None = Field(description="What the receiver answered last.")
    problem: str | None = Field(description="Why the last try failed.")


class DeliveryList(ListDocument[DeliveryDocument]):
    """What a webhook was told, newest first."""
