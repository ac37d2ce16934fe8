"""Webhooks: addresses that are told what happens in a dataset, signed as standardwebhooks.com says."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import Field

from app.features.webhooks import service as webhooks
from app.features.webhooks.messages import CHOSEN, MessageKind
from app.features.webhooks.sender import LONGEST
from app.features.webhooks.service import Delivery, Webhook
from app.http.cursor import Before, Cursor, paged, parse_descending_cursor
from app.http.deps import Actor, AppStore, DatasetPath, Id
from app.http.documents import Document, ListDocument, RequestBody
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import UnstoredResponseRoute

Url = Annotated[str, Field(min_length=1, max_length=LONGEST)]
Kinds = Annotated[list[MessageKind], Field(min_length=1, max_length=len(CHOSEN))]
URL = "https://hooks.example.org/touchline"


router = APIRouter(
    prefix="/datasets/{dataset}/webhooks", tags=["webhooks"], route_class=UnstoredResponseRoute
)


class NewWebhook(RequestBody, examples=[{"url": URL, "kinds": ["group.judged", "job.failed"]}]):
    """An address that shall be told."""

    url: Url = Field(description="One that the operator of the server allows.")
    kinds: Kinds


class WebhookEdit(RequestBody, examples=[{"on": False}, {"kinds": ["job.done"]}]):
    """What changes of a webhook."""

    url: Url | None = None
    kinds: Kinds | None = None
    on: bool | None = Field(
        default=None,
        description="Off: it gets no messages, and events of that time are not sent later.",
    )


class WebhookList(ListDocument[Webhook]):
    """Webhooks of a dataset, and what they may be."""

    allowed: list[str] = Field(description="How the operator lets addresses begin.")
    kinds: list[MessageKind] = Field(description="Kinds of messages a webhook can get.")


class WebhookWithSecret(Document):
    """A webhook, and what its messages are signed with: shown this once."""

    webhook: Webhook
    secret: str


class DeliveryList(ListDocument[Delivery]):
    """What a webhook was told, newest first."""


def _webhook_with_secret(made: tuple[Webhook, str]) -> WebhookWithSecret:
    webhook, secret = made
    return WebhookWithSecret(webhook=webhook, secret=secret)


@router.get("", responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@paged()
def list_webhooks(dataset: DatasetPath, store: AppStore) -> WebhookList:
    """The webhooks of a dataset."""
    items = webhooks.list_webhooks(store, dataset)
    return WebhookList(items=items, allowed=store.settings.webhooks, kinds=list(CHOSEN))


@router.post("", status_code=201, responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def make_webhook(
    dataset: DatasetPath, new: NewWebhook, store: AppStore, actor: Actor
) -> WebhookWithSecret:
    """Tell an address what happens from now on; the secret is shown this once."""
    return _webhook_with_secret(
        webhooks.make_webhook(store, dataset, new.url, new.kinds, actor=actor)
    )


@router.patch("/{webhook}", response_model=Webhook, responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def change_webhook(
    dataset: DatasetPath, webhook: Id, change: WebhookEdit, store: AppStore, actor: Actor
) -> Webhook:
    """Another address, other kinds of message, or on and off."""
    return webhooks.change_webhook(
        store, dataset, webhook, url=change.url, kinds=change.kinds, on=change.on, actor=actor
    )


@router.delete("/{webhook}", status_code=204, responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def delete_webhook(dataset: DatasetPath, webhook: Id, store: AppStore, actor: Actor) -> None:
    """Tell an address nothing more, and forget what it was told."""
    webhooks.remove_webhook(store, dataset, webhook, actor=actor)


@router.post("/{webhook}/secret", responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def renew_webhook_secret(
    dataset: DatasetPath, webhook: Id, store: AppStore, actor: Actor
) -> WebhookWithSecret:
    """Another secret; what is sent from now on is signed with it."""
    return _webhook_with_secret(webhooks.renew_secret(store, dataset, webhook, actor=actor))


@router.post("/{webhook}/ping", status_code=201, response_model=Delivery, responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def ping_webhook(dataset: DatasetPath, webhook: Id, store: AppStore, actor: Actor) -> Delivery:
    """Send a message of the kind `ping`, to see whether messages arrive."""
    return webhooks.send_ping(store, dataset, webhook, actor=actor)


@router.get("/{webhook}/deliveries", responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def list_webhook_deliveries(
    dataset: DatasetPath,
    webhook: Id,
    store: AppStore,
    limit: Annotated[int, Query(ge=1, le=200)] = 50,
    cursor: Cursor = None,
    before: Before = None,
) -> DeliveryList:
    """The deliveries of a webhook in the last 30 days, newest first."""
    start = parse_descending_cursor(cursor, before)
    found = webhooks.list_deliveries(store, dataset, webhook, before=start, most=limit + 1)
    more = str(found[limit - 1].id) if len(found) > limit else None
    return DeliveryList(items=found[:limit], next=more)


@router.post("/{webhook}/deliveries/{delivery}", response_model=Delivery, responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
def send_webhook_delivery_again(
    dataset: DatasetPath, webhook: Id, delivery: Id, store: AppStore
) -> Delivery:
    """Send a message once more, at once."""
    return webhooks.resend_delivery(store, dataset, webhook, delivery)
