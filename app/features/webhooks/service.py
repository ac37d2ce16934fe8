"""Webhooks: addresses that a dataset's leads want to be told what happens in it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from app.db.json_columns import parse_json_column
from app.db.log import find_newest_entry_id
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.audit.service import add_audit_event
from app.features.datasets.queries import read_dataset_name
from app.features.datasets.service import dataset_id
from app.features.people.visibility_queries import COPIES
from app.features.webhooks.messages import (
    CHOSEN,
    MessageKind,
    derive_webhook_secret,
    make_ping_message,
    make_salt,
)
from app.features.webhooks.queries import (
    DELIVERED,
    FAILED,
    WAITING,
    count_deliveries,
    delete_webhook,
    find_delivery,
    find_waiting_delivery,
    find_webhook,
    insert_delivery,
    insert_webhook,
    read_deliveries,
    read_webhooks,
    update_delivery,
    update_webhook,
)
from app.features.webhooks.sender import find_stop_reason, require_allowed_address
from app.json_text import Moment, canonical_json_text

MOST = 20
"""Webhooks of one dataset."""
OFF = "a person turned it off"


@dataclass(frozen=True)
class Webhook:
    """An address that is told.

    Attributes:
        off: Why nothing is sent to it any more; None: it is.
        waiting: Messages that wait to be sent, or sent again.
        delivered: Messages of the last 30 days that arrived.
        failed: Messages of the last 30 days that were given up.
    """

    id: int
    url: str
    kinds: list[MessageKind]
    off: str | None
    created: Moment
    created_by: str
    waiting: int
    delivered: int
    failed: int


@dataclass(frozen=True)
class Delivery:
    """A message to a webhook, and how its sending goes.

    Attributes:
        message: ``webhook-id``: the same however often it is sent.
        body: The JSON that is sent, to the letter.
        next_at: When it is tried (again); None: never.
        status: What the receiver answered last.
        problem: Why the last try failed.
    """

    id: int
    message: str
    kind: MessageKind
    body: str
    created: Moment
    state: Literal["waiting", "delivered", "failed"]
    attempts: int
    next_at: Moment | None
    tried: Moment | None
    status: int | None
    problem: str | None


def list_webhooks(store: Store, dataset: str) -> list[Webhook]:
    """The webhooks of a dataset."""
    with store.read() as session:
        return _read_webhooks(session, _find_dataset_id(store, dataset))


def make_webhook(
    store: Store, dataset: str, url: str, kinds: Iterable[MessageKind], *, actor: str
) -> tuple[Webhook, str]:
    """A webhook that is told what happens from now on, and its secret, which is shown this once.

    Raises:
        InputError: The operator does not allow the address, or no kind is asked for.
        ConflictError: The operator allows none, or the dataset has as many as it may.
    """
    number, salt = _find_dataset_id(store, dataset), make_salt()
    require_allowed_address(url, store.settings.webhooks, "/url")
    secret = derive_webhook_secret(store.settings, salt)
    with store.write() as session:
        if len(read_webhooks(session, number)) >= MOST:
            raise ConflictError(
                f"a dataset has at most {MOST} webhooks", hint="Delete one of them."
            )
        made = insert_webhook(session, number, url, _validate_kinds(kinds), salt=salt, by=actor)
        add_audit_event(session, actor, "webhook made", number, url=url)
        return _read_webhook(session, number, made), secret


def change_webhook(
    store: Store,
    dataset: str,
    webhook_id: int,
    *,
    url: str | None = None,
    kinds: Iterable[MessageKind] | None = None,
    on: bool | None = None,
    actor: str,
) -> Webhook:
    """Another address, other kinds, or on and off; what happened while it was off is not told.

    Raises:
        NotFoundError: The dataset has none of that id.
    """
    if url is not None:
        require_allowed_address(url, store.settings.webhooks, "/url")
    number = _find_dataset_id(store, dataset)
    with store.write() as session:
        found = _read_webhook(session, number, webhook_id)
        values: dict[str, Any] = {}
        if url is not None:
            values["url"] = url
        if kinds is not None:
            values["kinds"] = canonical_json_text(_validate_kinds(kinds))
        if on is not None and on != (found.off is None):
            values |= (
                {"off": None, "log_id": find_newest_entry_id(session), "jobs_until": now()}
                if on
                else {"off": OFF}
            )
            if on and find_stop_reason(store.settings, session, number, found.created_by):
                # Whoever turns it on again answers for it from now on.
                values["created_by"] = actor
        if values:
            update_webhook(session, webhook_id, values)
            did = "webhook turned off" if on is False else "webhook changed"
            add_audit_event(session, actor, did, number, url=url or found.url)
        return _read_webhook(session, number, webhook_id)


def renew_secret(store: Store, dataset: str, webhook_id: int, *, actor: str) -> tuple[Webhook, str]:
    """Another secret in place of the one that was; what is sent from now on is signed with it."""
    number, salt = _find_dataset_id(store, dataset), make_salt()
    secret = derive_webhook_secret(store.settings, salt)
    with store.write() as session:
        found = _read_webhook(session, number, webhook_id)
        update_webhook(session, webhook_id, {"salt": salt})
        add_audit_event(session, actor, "webhook's secret renewed", number, url=found.url)
        return _read_webhook(session, number, webhook_id), secret


def remove_webhook(store: Store, dataset: str, webhook_id: int, *, actor: str) -> None:
    """Tell an address nothing more, and forget what it was told."""
    number = _find_dataset_id(store, dataset)
    with store.write() as session:
        found = _read_webhook(session, number, webhook_id)
        delete_webhook(session, webhook_id)
        add_audit_event(session, actor, "webhook deleted", number, url=found.url)


def list_deliveries(
    store: Store, dataset: str, webhook_id: int, *, before: int | None = None, most: int = 50
) -> list[Delivery]:
    """The deliveries of a webhook, newest first, from below an id."""
    number = _find_dataset_id(store, dataset)
    with store.read() as session:
        _read_webhook(session, number, webhook_id)
        return [
            _delivery_from_row(row) for row in read_deliveries(session, webhook_id, before, most)
        ]


def resend_delivery(store: Store, dataset: str, webhook_id: int, delivery_id: int) -> Delivery:
    """Send a message once more, at once; its tries are counted anew."""
    number = _find_dataset_id(store, dataset)
    with store.write() as session:
        _require_webhook_enabled(_read_webhook(session, number, webhook_id))
        if find_delivery(session, webhook_id, delivery_id) is None:
            raise NotFoundError(f"this webhook has no delivery {delivery_id}")
        update_delivery(session, delivery_id, {"state": WAITING, "attempts": 0, "next_at": now()})
        return _delivery_from_row(find_delivery(session, webhook_id, delivery_id))


def send_ping(store: Store, dataset: str, webhook_id: int, *, actor: str) -> Delivery:
    """Send a message that says nothing, to see whether messages arrive; one that waits is sent now."""
    number = _find_dataset_id(store, dataset)
    with store.write() as session:
        _require_webhook_enabled(_read_webhook(session, number, webhook_id))
        waiting = find_waiting_delivery(session, webhook_id, MessageKind.PING)
        if waiting is not None:
            update_delivery(session, waiting.id, {"next_at": now()})
            return _delivery_from_row(find_delivery(session, webhook_id, waiting.id))
        message = make_ping_message(webhook_id, read_dataset_name(session, number), now(), actor)
        insert_delivery(session, webhook_id, message.id, message.kind, message.body)
        return _delivery_from_row(read_deliveries(session, webhook_id, None, 1)[0])


def _find_dataset_id(store: Store, dataset: str) -> int:
    found = dataset_id(store, dataset)
    if found > COPIES:
        raise ConflictError(
            "this dataset is one person's own: it has no webhooks",
            hint="Add the webhook to the dataset on which people work together.",
        )
    return found


def _require_webhook_enabled(webhook: Webhook) -> None:
    if webhook.off is not None:
        raise ConflictError(
            f"the webhook is switched off: {webhook.off}", hint="Switch the webhook on first."
        )


def _validate_kinds(kinds: Iterable[MessageKind]) -> list[str]:
    chosen = sorted({str(kind) for kind in kinds})
    if not chosen or MessageKind.PING in chosen:
        raise InputError(
            "a webhook needs at least one kind of message",
            hint=f"Kinds are {', '.join(CHOSEN)}.",
            pointer="/kinds",
        )
    return chosen


def _read_webhook(session: Session, dataset: int, webhook_id: int) -> Webhook:
    row = find_webhook(session, dataset, webhook_id)
    if row is None:
        raise NotFoundError(f"this dataset has no webhook {webhook_id}")
    return _webhook_from_row(row, count_deliveries(session, [webhook_id]))


def _read_webhooks(session: Session, dataset: int) -> list[Webhook]:
    rows = read_webhooks(session, dataset)
    counts = count_deliveries(session, [row.id for row in rows])
    return [_webhook_from_row(row, counts) for row in rows]


def _webhook_from_row(row: Any, counts: Mapping[tuple[int, str], int]) -> Webhook:
    waiting, delivered, failed = (
        counts.get((row.id, state), 0) for state in (WAITING, DELIVERED, FAILED)
    )
    kinds = [MessageKind(kind) for kind in parse_json_column(row.kinds)]
    made = (row.created, row.created_by)
    return Webhook(row.id, row.url, kinds, row.off, *made, waiting, delivered, failed)


def _delivery_from_row(row: Any) -> Delivery:
    values = {name: getattr(row, name) for name in Delivery.__dataclass_fields__}
    return Delivery(**{**values, "kind": MessageKind(row.kind)})
