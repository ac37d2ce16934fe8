"""What webhooks are told, and the signature of it."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from itertools import groupby
from typing import Any

from standardwebhooks import Webhook

from app.config import Settings
from app.db.home import WEBHOOKS, get_or_make_secret_key
from app.db.json_columns import Json
from app.db.session import Session
from app.features.jobs.queries import DONE, FAILED
from app.features.webhooks import queries as webhook_outbox
from app.features.webhooks.queries import (
    list_jobs_ended_since,
    list_log_entries_since,
    make_time_suffix,
)
from app.json_text import canonical_json_text


class MessageKind(StrEnum):
    """What a message tells of."""

    CHANGED = "group.changed"
    """Lines, balls or cameras of groups were changed, or that was taken back."""
    JUDGED = "group.judged"
    """Groups were accepted, rejected, deferred, or are not judged any more."""
    COMMENTED = "group.commented"
    """A comment was written on a group, or a thread was resolved; the message does not contain the text."""
    DATASET = "dataset.changed"
    """What concerns a whole dataset: an import, thresholds, static cameras, pitches, positions."""
    GIVEN_OUT = webhook_outbox.GIVEN_OUT
    """A batch was made."""
    HANDED_ON = webhook_outbox.HANDED_ON
    """A batch has other people."""
    DONE = webhook_outbox.DONE
    """The work on the last group of a batch is over."""
    STALLED = webhook_outbox.STALLED
    """Work on a batch has stalled, or its due day is over."""
    DISPUTED = webhook_outbox.DISPUTED
    """Annotations of a group do not agree: somebody has to decide."""
    HANDED_BACK = webhook_outbox.HANDED_BACK
    """Submitted work was returned to its annotator; the message does not contain the reason."""
    FROZEN = "version.frozen"
    JOB_DONE = "job.done"
    JOB_FAILED = "job.failed"
    PING = "ping"
    """A test message; every webhook gets it."""


CHOSEN = tuple(kind for kind in MessageKind if kind is not MessageKind.PING)
"""Kinds that a webhook asks for."""
MOST = 500
"""Entries of the log in one message."""
_OF_LOG = {
    "edit": MessageKind.CHANGED,
    "undo": MessageKind.CHANGED,
    "redo": MessageKind.CHANGED,
    "verdict": MessageKind.JUDGED,
    "dismissal": MessageKind.JUDGED,
    "comment": MessageKind.COMMENTED,
    "freeze": MessageKind.FROZEN,
}
_OF_JOBS = {DONE: MessageKind.JOB_DONE, FAILED: MessageKind.JOB_FAILED}


@dataclass(frozen=True)
class WebhookMessage:
    """One thing to tell; ``id`` is the same however often it is sent.

    ``log_id``, or ``ended`` and ``job_id``, are up to where the log or the jobs are told with it.
    """

    id: str
    kind: MessageKind
    body: str
    log_id: int = 0
    ended: str = ""
    job_id: int = 0


def make_new_messages(session: Session, webhook: Any, dataset: str) -> list[WebhookMessage]:
    """What has happened since a webhook was told last, its kinds and others."""
    entries = list_log_entries_since(session, webhook.dataset_id, webhook.log_id, MOST)
    place = (webhook.jobs_until, webhook.job_id)
    jobs = list_jobs_ended_since(session, webhook.dataset_id, *place, _OF_JOBS)
    return [
        *_make_log_messages(webhook.id, dataset, entries),
        *_make_job_messages(webhook.id, dataset, jobs),
    ]


def make_ping_message(webhook_id: int, dataset: str, at: str, actor: str) -> WebhookMessage:
    """A message that says nothing."""
    stamp = "".join(letter for letter in at if letter.isdigit())
    body = _message_body(MessageKind.PING, at, {"dataset": dataset, "actor": actor})
    return WebhookMessage(f"msg_{webhook_id}_ping{stamp}", MessageKind.PING, body)


def _make_log_messages(
    webhook_id: int, dataset: str, entries: Sequence[Any]
) -> Iterator[WebhookMessage]:
    """Entries of one kind by one person that follow each other become one message."""

    def classify_entry(row: Any) -> tuple[MessageKind, str]:
        kind = _OF_LOG.get(row.kind.removeprefix("station_"), MessageKind.DATASET)
        return (
            kind if row.group_id is not None or kind is MessageKind.FROZEN else MessageKind.DATASET
        ), row.actor

    for (kind, actor), rows in groupby(entries, classify_entry):
        found = list(rows)
        first, last = found[0].id, found[-1].id
        data = {
            "dataset": dataset,
            "actor": actor,
            "entries": [
                {"id": row.id, "kind": row.kind, "at": row.at, "group": row.group_id}
                for row in found
            ],
        }
        yield WebhookMessage(
            f"msg_{webhook_id}_log{first}-{last}_{make_time_suffix(found[-1].at)}",
            kind,
            _message_body(kind, found[-1].at, data),
            log_id=last,
        )


def _make_job_messages(
    webhook_id: int, dataset: str, jobs: Sequence[Any]
) -> Iterator[WebhookMessage]:
    for row in jobs:
        kind = _OF_JOBS[row.state]
        data = {
            "dataset": dataset,
            "actor": row.actor,
            "job": {"id": row.id, "kind": row.kind, "title": row.title, "state": row.state},
        }
        body = _message_body(kind, row.ended, data)
        name = f"msg_{webhook_id}_job{row.id}_{make_time_suffix(row.ended)}"
        yield WebhookMessage(name, kind, body, ended=row.ended, job_id=row.id)


def _message_body(kind: MessageKind, at: str, data: Json) -> str:
    return canonical_json_text({"type": str(kind), "timestamp": at, "data": data})


def make_salt() -> str:
    """What makes a secret another one."""
    return secrets.token_hex(16)


def derive_webhook_secret(settings: Settings, salt: str) -> str:
    """The secret of a webhook, as the specification writes it (``whsec_``).

    Raises:
        StorageError: The disk refuses the key.
    """
    made = hmac.digest(get_or_make_secret_key(settings, WEBHOOKS), salt.encode(), hashlib.sha256)
    return f"whsec_{b64encode(made).decode()}"


def sign_message(secret: str, message: str, at: datetime, body: str) -> dict[str, str]:
    """Headers of a message (standardwebhooks.com)."""
    return {
        "webhook-id": message,
        "webhook-timestamp": str(int(at.timestamp())),
        "webhook-signature": Webhook(secret).sign(message, at, body),
    }
