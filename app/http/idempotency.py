"""Idempotency-Key: a request that is sent again gets the response that it got the first time.

A route stores its response in the transaction of its work (``http.respond``), so that wherever the
server is stopped a repetition finds either both or neither. The responses of other routes are
stored here, before they are sent.
"""

from __future__ import annotations

import asyncio
import hashlib
import re
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

import structlog
from anyio import CancelScope, CapacityLimiter
from anyio.to_thread import run_sync
from fastapi import Request
from starlette.responses import Response
from starlette.types import Message

from app.db.idempotency import (
    IdempotencyKey,
    KeyedRequest,
    StoredResponse,
    claim_key,
    find_stored_response,
    release_key,
    store_sent_response,
)
from app.db.store import Store
from app.errors import BusyError, OverloadedError, StorageError
from app.http.deps import ACTOR_HEADER
from app.http.documents import KEYED_REQUEST, make_stored_response
from app.http.problem import make_problem, problem_response
from app.http.requests import TimedBody
from app.json_text import canonical_json_text

log = structlog.get_logger("touchline.api")

HEADER = "Idempotency-Key"
KEY = re.compile(r"[\x21-\x7e]{1,200}")
REPLAYED = "Idempotency-Replayed"
"""Says that a response is not a new one."""
MAX_ANSWER_BYTES = 8 * 1024 * 1024
"""Larger responses are not stored; no route that changes something gives one."""
PATIENCE = 60.0
"""Seconds that a repetition waits for the first one to be answered."""
AGAIN_SECONDS = 0.02
"""Between two looks whether another process has answered."""
THREADS = 4
"""So many responses are looked up at a time, and as many are stored."""
Hidden = Callable[[], Awaitable[bool]]
Work = Callable[[], Awaitable[Response]]


class RequestDigest:
    """What a request asks for: its method, address, body, actor and If-Match.

    Args:
        request: The request.
        value: Its JSON body, read already; JSON in another order is the same.
        has_value: Whether it has one.
        is_streamed: Whether its body is of bytes instead, which are digested as they pass.
    """

    def __init__(
        self,
        request: Request,
        value: object = None,
        *,
        has_value: bool = False,
        is_streamed: bool = False,
    ):
        self.is_streamed = is_streamed
        self._request, self._value, self._has_value = request, value, has_value
        self._sum, self._ended = hashlib.sha256(), not is_streamed
        self._body = TimedBody(request.receive)

    async def receive(self) -> Message:
        """The next message of a body of bytes; raises ``BodyError`` where it does not come in time."""
        message = await self._body.receive()
        if message["type"] == "http.request":
            self._sum.update(message.get("body", b""))
            self._ended = self._ended or not message.get("more_body", False)
        else:
            self._ended = True
        return message

    async def compute_digest(self) -> str:
        """The digest, once all of the body has passed."""
        while not self._ended:
            await self.receive()
        scope, headers = self._request.scope, self._request.headers
        place = [scope["method"], scope["path"], scope["query_string"].decode()]
        place += headers.getlist(ACTOR_HEADER)
        # The same change of another state is another request.
        place += [f"If-Match: {tag}" for tag in headers.getlist("if-match")]
        if self.is_streamed:
            body = self._sum.hexdigest()
        else:
            body = canonical_json_text(self._value) if self._has_value else ""
        return hashlib.sha256(canonical_json_text([*place, body]).encode()).hexdigest()


class IdempotencyHandler:
    """Answers a repetition with the first response, and the same key with another request with 422."""

    def __init__(self) -> None:
        self._under_way: dict[tuple[str, str], asyncio.Event] = {}
        self._finding, self._storing = CapacityLimiter(THREADS), CapacityLimiter(THREADS)

    async def answer_once(
        self, request: Request, digest: RequestDigest, actor: str, hidden: Hidden, work: Work
    ) -> Response:
        """The response to a request that changes something.

        Args:
            request: The request.
            digest: Its digest.
            actor: Whose key it is.
            hidden: Says whether its sender has lost sight, meanwhile, of what it is about.
            work: Carries it out.

        Raises:
            OverloadedError: The first of its key is still being answered.
            StorageError: Nobody knows whether it was answered before.
        """
        keys = request.headers.getlist(HEADER)
        if not keys:
            return await work()
        if len(keys) > 1 or not KEY.fullmatch(keys[0]):
            problem = make_problem(400, f"{HEADER} must be 1 to 200 visible ASCII characters")
            return problem_response(problem)
        store: Store = request.app.state.services.store
        async with self._hold_key(store, keys[0], actor):
            known = await self._find_stored_response(store, keys[0], actor)
            if known is None or await hidden():
                return await self._execute_and_store(request, digest, keys[0], actor, work)
            is_same = await digest.compute_digest() == known.request_digest
            if is_same and known.is_in_progress:
                return await self._execute_and_store(request, digest, keys[0], actor, work)
            return _make_replayed_response(known, is_same=is_same)

    @asynccontextmanager
    async def _hold_key(self, store: Store, key: str, actor: str) -> AsyncIterator[None]:
        """Answer while nobody else answers a request of that key, in this process or another."""
        whose = (actor, key)
        try:
            while (first := self._under_way.get(whose)) is not None:
                await asyncio.wait_for(first.wait(), PATIENCE)
        except TimeoutError:
            raise _in_progress_error() from None
        done = self._under_way[whose] = asyncio.Event()
        try:
            if not store.sharing.is_shared:
                yield
                return
            await self._claim_key(store, key, actor)
            try:
                yield
            finally:
                with CancelScope(shield=True):
                    await run_sync(release_key, store, key, actor, limiter=self._storing)
        finally:
            del self._under_way[whose]
            done.set()

    async def _claim_key(self, store: Store, key: str, actor: str) -> None:
        """Let no other process answer; raises OverloadedError where patience comes to its end."""
        until = time.monotonic() + PATIENCE
        while not await run_sync(claim_key, store, key, actor, limiter=self._finding):
            if time.monotonic() > until:
                raise _in_progress_error()
            await asyncio.sleep(AGAIN_SECONDS)

    async def _find_stored_response(
        self, store: Store, key: str, actor: str
    ) -> StoredResponse | None:
        """What is stored under a key; in a thread only where there is something to wait for."""
        try:
            return find_stored_response(store, key, actor, at_once=True)
        except BusyError:
            return await run_sync(find_stored_response, store, key, actor, limiter=self._finding)

    async def _execute_and_store(
        self, request: Request, digest: RequestDigest, key: str, actor: str, work: Work
    ) -> Response:
        keyed = None
        store: Store = request.app.state.services.store
        # What is asked for by bytes is known once they have passed.
        if not digest.is_streamed:
            keyed = KeyedRequest(IdempotencyKey(key, actor, await digest.compute_digest()))
            request.scope[KEYED_REQUEST] = keyed
        response = await work()
        if not (keyed and keyed.stored) and _is_storable(response):
            try:
                sent = make_stored_response(response, await digest.compute_digest())
                await run_sync(store_sent_response, store, key, actor, sent, limiter=self._storing)
            except StorageError as error:
                # The work is done; a repetition is answered with the state as it is then.
                log.warning("a response could not be stored", error=str(error))
        return response


def _is_storable(response: Response) -> bool:
    """Whether it is a success of a size that is stored; what was refused may be tried again."""
    body = getattr(response, "body", None)
    return 200 <= response.status_code < 300 and body is not None and len(body) <= MAX_ANSWER_BYTES


def _in_progress_error() -> OverloadedError:
    return OverloadedError("the first request with this Idempotency-Key is still running")


def _make_replayed_response(known: StoredResponse, *, is_same: bool) -> Response:
    if not is_same:
        problem = make_problem(
            422,
            f"this {HEADER} was used for another request",
            hint="Send this request with a new key.",
        )
        return problem_response(problem)
    if known.body is None:
        problem = make_problem(
            409,
            "this request was carried out before, and its response is no longer stored",
            hint="Do not send it again: load the current state.",
        )
        return problem_response(problem, {REPLAYED: "true"})
    return Response(known.body, known.status, {**known.headers, REPLAYED: "true"})
