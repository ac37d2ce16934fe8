"""Webhooks: addresses that are told what happens in a dataset."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.features.webhooks.messages import CHOSEN, Kind
from app.features.webhooks.sender import LONGEST
from app.features.webhooks.service import Delivery, Webhook
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


class WebhookList(ListDocument[Webhook]):
    """Webhooks of a dataset, and what they may be."""

    allowed: list[str] = Field(description="How the operator lets addresses begin.")
    kinds: list[Kind] = Field(description="Kinds of messages a webhook can get.")


class WebhookWithSecret(Document):
    """A webhook, and what its messages are signed with: shown this once."""

    webhook: Webhook
    secret: str


class DeliveryList(ListDocument[Delivery]):
    """What a webhook was told, newest first."""
