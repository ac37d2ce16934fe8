"""Sends messages to allowed addresses, and tries again where nobody answered."""

from __future__ import annotations

import asyncio
import ssl
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache
from typing import Any
from urllib.parse import SplitResult, urlsplit

import httpx
import structlog

from app.config import Settings
from app.db.json_columns import parse_json_column
from app.db.session import Session, format_utc_time
from app.db.store import Store
from app.errors import ConflictError, InputError, ReviewError
from app.features.batches.progress import notify_of_stalled_batches
from app.features.datasets.queries import read_dataset_names
from app.features.people.logins import read_roles
from app.features.people.queries import find_person_by_name
from app.features.people.roles import Action, Role, role_allows
from app.features.people.visibility_queries import COPIES
from app.features.webhooks.messages import (
    WebhookMessage,
    derive_webhook_secret,
    make_new_messages,
    sign_message,
)
from app.features.webhooks.queries import (
    DELIVERED,
    FAILED,
    DueDelivery,
    find_next_delivery_time,
    has_delivered_since,
    insert_delivery,
    list_active_webhooks,
    list_due_deliveries,
    update_delivery,
    update_webhook,
)
from app.soccer.actors import person_of_actor

_PORTS = {"http": 80, "https": 443}
LONGEST = 2000
"""Characters of an address."""


@dataclass(frozen=True)
class WebhookAddress:
    """What of an address decides whom it reaches."""

    scheme: str
    host: str
    port: int
    path: str

    def is_same_or_below(self, other: WebhookAddress) -> bool:
        """Whether it is another one, or leads on from it."""
        same = (self.scheme, self.host, self.port) == (other.scheme, other.host, other.port)
        folder = other.path if other.path.endswith("/") else other.path + "/"
        return same and (self.path == other.path or self.path.startswith(folder))


def parse_address(text: str, pointer: str | None = None) -> WebhookAddress:
    """An address as it will be used.

    Raises:
        InputError: It is none of http or https, names a user, or could lead elsewhere than it says.
    """
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError:
        raise _address_error(text, pointer) from None
    if len(text) > LONGEST or not _is_unambiguous_address(text, parts):
        raise _address_error(text, pointer)
    host = (parts.hostname or "").removesuffix(".")
    if not all(host.split(".")):
        raise _address_error(text, pointer)
    return WebhookAddress(parts.scheme, host, port or _PORTS[parts.scheme], parts.path or "/")


def require_valid_setting(settings: Settings) -> None:
    """Raise InputError unless TOUCHLINE_WEBHOOKS lists addresses that messages can be sent to."""
    for item in settings.webhooks:
        try:
            parse_address(item)
        except InputError as error:
            raise InputError(f"TOUCHLINE_WEBHOOKS: {error.message}", hint=error.hint) from None


def require_allowed_address(text: str, allowed: Iterable[str], pointer: str | None = None) -> None:
    """Raise unless the operator lets the server send to an address.

    Raises:
        InputError: It is no address, or none that is allowed.
        ConflictError: None is allowed at all.
    """
    address, places = parse_address(text, pointer), [parse_address(item) for item in allowed]
    if not places:
        raise ConflictError(
            "this server is not allowed to send webhooks",
            hint="The operator of the server can allow addresses with the setting"
            " TOUCHLINE_WEBHOOKS.",
        )
    if not any(address.is_same_or_below(place) for place in places):
        raise InputError(
            "the operator of this server does not allow webhooks to this address",
            hint=f"It may begin with: {', '.join(sorted(allowed))}",
            pointer=pointer,
        )


def _is_unambiguous_address(text: str, parts: SplitResult) -> bool:
    # Some servers cut parameters off a segment (RFC 3986, 3.3): "..;x" is ".." to them.
    decoded = parts.path.lower().replace("%2e", ".").replace("%3b", ";")
    segments = [segment.partition(";")[0] for segment in decoded.split("/")]
    return (
        text.isascii()
        and text.isprintable()
        and parts.scheme in _PORTS
        and bool(parts.hostname)
        and parts.username is None
        and not parts.fragment
        and "\\" not in text
        and " " not in text
        and "%2f" not in text.lower()
        and not {".", ".."} & set(segments)
    )


def _address_error(text: str, pointer: str | None) -> InputError:
    return InputError(
        f"{text[:100]!r} is not an address that messages can be sent to",
        hint="Like https://hooks.example.org/touchline: http or https, without a user name, a # part, or . and .. in the path.",
        pointer=pointer,
    )


log = structlog.get_logger("touchline.webhooks")

RETRY_DELAYS = tuple(
    timedelta(seconds=5) if minutes == 0 else timedelta(minutes=minutes)
    for minutes in (0, 5, 30, 120, 300, 600, 840, 1200, 1440)
)
"""Time to wait after each failed try (5 s to 24 h), as standardwebhooks.com recommends; then the message
is given up."""
SECONDS = 15.0
"""So long a receiver may take for all of its answer."""
TOGETHER, OF_ONE = 32, 4
"""Messages that are under way at a time, and of them to one webhook: a slow one holds up its own alone."""
GLANCE_SECONDS = 0.1
"""Between two looks whether the server stops."""
LOOK_SECONDS = 1.0
"""Between two looks at the log."""
STALLS_SECONDS = 300.0
"""Between two looks whether a batch has stalled."""
POLL_SECONDS = 30.0
"""At most so long, for what other processes have done."""
GONE = 410
"""By this answer a receiver says that it wants nothing more."""


@dataclass(frozen=True)
class DeliveryAttempt:
    """What came of one try: ``problem`` is None where it arrived."""

    status: int | None
    problem: str | None


class WebhookSender:
    """A thread that follows the log, and a few that send.

    Args:
        store: Where webhooks are and what they are told of.
        clock: Says what time it is, in UTC.
        leads: Whether it is this process that sends; asked at every look.
    """

    def __init__(
        self,
        store: Store,
        clock: Callable[[], datetime] = lambda: datetime.now(UTC),
        leads: Callable[[], bool] = lambda: True,
    ):
        self._leads = leads
        self._store, self._clock = store, clock
        self._wake, self._closing = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._stalls_at: datetime | None = None

    def start(self) -> None:
        """Begin to follow the log."""
        self._store.listen(self._wake.set)
        self._thread = threading.Thread(
            target=self._run_until_stopped, name="webhooks", daemon=True
        )
        self._thread.start()

    def wake(self) -> None:
        """Look soon."""
        self._wake.set()

    def stop(self) -> None:
        """Tell it to end; what waits is sent by the next server."""
        self._closing.set()
        self._wake.set()

    def close(self, seconds: float = SECONDS) -> None:
        """Stop, and wait so long for it."""
        self.stop()
        if self._thread is not None:
            self._thread.join(seconds)

    def queue_new_messages(self) -> int:
        """Write down what webhooks have not been told yet; returns how many messages that makes."""
        self._turn_off_of_people_who_left()
        with self._store.read() as session:
            rows = list_active_webhooks(session)
            names = read_dataset_names(session) if rows else {}
            found = [(row, make_new_messages(session, row, names[row.dataset_id])) for row in rows]
        if not any(messages for _, messages in found):
            return 0
        with self._store.write() as session:
            still = {row.id: row for row in list_active_webhooks(session)}
            return sum(
                _queue_messages(session, row, messages)
                for row, messages in found
                # Who was changed meanwhile is told at the next look.
                if messages and still.get(row.id) == row
            )

    def _turn_off_of_people_who_left(self) -> None:
        """Tell nothing more where whoever made a webhook may no longer lead its dataset."""

        def find_reasons(session: Session) -> dict[int, str]:
            found = {
                row.id: find_stop_reason(
                    self._store.settings, session, row.dataset_id, row.created_by
                )
                for row in list_active_webhooks(session)
            }
            return {key: reason for key, reason in found.items() if reason is not None}

        with self._store.read() as session:
            if not find_reasons(session):
                return
        with self._store.write() as session:
            for webhook_id, reason in find_reasons(session).items():
                update_webhook(session, webhook_id, {"off": reason})

    def queue_stall_messages(self) -> int:
        """Write down which batches have stalled, now and then; returns how many messages that makes."""
        at, last = self._clock(), self._stalls_at
        if last is not None and (at - last).total_seconds() < STALLS_SECONDS:
            return 0
        self._stalls_at = at
        return notify_of_stalled_batches(self._store, at)

    def send_due_messages(self, look: Callable[[], object] | None = None) -> int:
        """Send what is due, as much as goes at a time; returns how many tries came to an end.

        Each answer is kept when it comes. What is still under way when the server stops is sent again by the next one.

        Args:
            look: Called every ``LOOK_SECONDS`` while tries are under way; what is due then is sent beside them.
        """
        if self._seconds_until_next_due() > 0:
            return 0
        return asyncio.run(self._send_all_due(look))

    async def _send_all_due(self, look: Callable[[], object] | None) -> int:
        ended, tries = 0, dict[asyncio.Task[DeliveryAttempt], DueDelivery]()
        async with httpx.AsyncClient(
            timeout=SECONDS, follow_redirects=False, trust_env=False, verify=_tls_context()
        ) as client:

            def begin_due_tries() -> None:
                busy = {row.id for row in tries.values()}
                with self._store.read() as session:
                    most, now = TOGETHER + len(busy), format_utc_time(self._clock())
                    due = list_due_deliveries(session, now, most, OF_ONE)
                free = [row for row in due if row.id not in busy][: TOGETHER - len(busy)]
                tries.update(
                    {asyncio.ensure_future(self._send_delivery(client, row)): row for row in free}
                )

            begin_due_tries()
            looked = time.monotonic()
            while tries and not self._closing.is_set():
                done, _ = await asyncio.wait(
                    tries, timeout=GLANCE_SECONDS, return_when=asyncio.FIRST_COMPLETED
                )
                if done:
                    with self._store.write() as session:
                        for task in done:
                            self._save_attempt(session, tries[task], task.result())
                    for task in done:
                        del tries[task]
                    ended += len(done)
                if look is not None and time.monotonic() - looked >= LOOK_SECONDS:
                    looked = time.monotonic()
                    try:
                        look()
                        begin_due_tries()
                    except ReviewError as error:
                        # The tries under way go on.
                        log.warning("new webhook messages could not be read", error=str(error))
            for task in tries:
                task.cancel()
            await asyncio.gather(*tries, return_exceptions=True)
        return ended

    def _run_until_stopped(self) -> None:
        while not self._closing.is_set():
            self._wake.clear()
            wait = POLL_SECONDS
            try:
                if self._leads():
                    wait = self._run_once()
            except ReviewError as error:
                log.warning("webhook messages could not be sent", error=str(error))
            except Exception:
                log.exception("webhook messages could not be sent")
            self._closing.wait(LOOK_SECONDS)
            self._wake.wait(wait)

    def _run_once(self) -> float:
        """Tell and send all that can be; seconds until the next look."""
        self._look()
        while not self._closing.is_set() and self.send_due_messages(self._look):
            pass
        return self._seconds_until_next_due()

    def _look(self) -> None:
        """Write down what is new."""
        self.queue_new_messages()
        self.queue_stall_messages()

    def _seconds_until_next_due(self) -> float:
        """Seconds until something waits to be sent again."""
        with self._store.read() as session:
            due = find_next_delivery_time(session)
        if due is None:
            return POLL_SECONDS
        seconds = (datetime.fromisoformat(due) - self._clock()).total_seconds()
        return min(max(seconds, 0.0), POLL_SECONDS)

    async def _send_delivery(self, client: httpx.AsyncClient, row: DueDelivery) -> DeliveryAttempt:
        """One try; whatever goes wrong with one address is its own answer."""
        try:
            async with asyncio.timeout(SECONDS):
                status = await self._post_delivery(client, row)
        except ReviewError as error:
            return DeliveryAttempt(None, error.message)
        except (TimeoutError, httpx.TimeoutException):
            return DeliveryAttempt(None, f"no answer within {SECONDS:.0f} s")
        except httpx.HTTPError as error:
            return DeliveryAttempt(None, f"it could not be reached: {error}"[:300])
        except Exception as error:
            log.exception("a message could not be sent", webhook=row.webhook_id)
            return DeliveryAttempt(None, f"it could not be sent: {error}"[:300])
        if 200 <= status < 300:
            return DeliveryAttempt(status, None)
        redirected = " (redirects are not followed)" if 300 <= status < 400 else ""
        return DeliveryAttempt(status, f"it answered {status}{redirected}")

    async def _post_delivery(self, client: httpx.AsyncClient, row: DueDelivery) -> int:
        settings = self._store.settings
        require_allowed_address(row.url, settings.webhooks)
        headers = sign_message(
            derive_webhook_secret(settings, row.salt), row.message, self._clock(), row.body
        )
        headers["Content-Type"] = "application/json"
        async with client.stream("POST", row.url, content=row.body, headers=headers) as answer:
            return answer.status_code

    def _save_attempt(self, session: Session, row: DueDelivery, answer: DeliveryAttempt) -> None:
        now = self._clock()
        tried = {
            "attempts": row.attempts + 1,
            "tried": format_utc_time(now),
            "status": answer.status,
        }
        values: dict[str, Any] = {**tried, "problem": answer.problem, "next_at": None}
        if answer.problem is None:
            values["state"] = DELIVERED
        elif row.attempts < len(RETRY_DELAYS) and answer.status != GONE:
            values["next_at"] = format_utc_time(now + RETRY_DELAYS[row.attempts])
        else:
            values["state"] = FAILED
        update_delivery(session, row.id, values)
        if values.get("state") == FAILED:
            self._turn_off_if_failing(session, row, answer)

    def _turn_off_if_failing(
        self, session: Session, row: DueDelivery, answer: DeliveryAttempt
    ) -> None:
        """Tell nobody any more who wants nothing, or has taken nothing for as long as one tries."""
        if answer.status == GONE:
            update_webhook(
                session, row.webhook_id, {"off": "it answered 410: it wants no further messages"}
            )
        elif not has_delivered_since(session, row.webhook_id, row.created):
            reason = f"nothing arrived since {row.created[:16].replace('T', ' ')} UTC"
            update_webhook(session, row.webhook_id, {"off": reason})


def find_stop_reason(
    settings: Settings, session: Session, dataset_id: int, created_by: str
) -> str | None:
    """Why the webhook of somebody is told nothing more; None: it is.

    Made on a server without accounts, or on its own machine, it is the operator's.
    """
    name = person_of_actor(created_by)
    person = find_person_by_name(session, name) if settings.team else None
    if person is None:
        return None
    if person.disabled:
        return f"the account of {name}, who made it, is disabled"
    role = read_roles(session, person.id, Role(person.role)).find_role_in(dataset_id)
    if dataset_id > COPIES or not role_allows(role, Action.LEAD):
        return f"{name}, who made it, no longer leads this dataset"
    return None


@cache
def _tls_context() -> ssl.SSLContext:
    """Certificates of public authorities, read once: that takes some 20 ms of a processor."""
    return httpx.create_ssl_context(trust_env=False)


def _queue_messages(session: Session, row: Any, messages: Sequence[WebhookMessage]) -> int:
    wanted = set(parse_json_column(row.kinds))
    made = 0
    for message in messages:
        if message.kind in wanted:
            made += insert_delivery(session, row.id, message.id, message.kind, message.body)
    logged = max((message.log_id for message in messages), default=0)
    ended = max((message.ended, message.job_id) for message in messages)
    until, job = max((row.jobs_until, row.job_id), ended)
    position = {"log_id": max(row.log_id, logged), "jobs_until": until, "job_id": job}
    update_webhook(session, row.id, position)
    return made
