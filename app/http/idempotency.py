"""Idempotency-Key: a request that is sent again gets the response that it got the first time.

A route stores its response in the transaction of its work (``http.respond``), so that wherever the
server is stopped a repetition finds either both or neither. The responses of other routes are
stored here, once they are sent.
"""

from __future__ import annotations

import asyncio
import hashlib
import re
import time

import structlog
from anyio import CancelScope, CapacityLimiter
from anyio.to_thread import run_sync
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.canonical import canonical
from app.db.idempotency import KeyedRequest, claim, end_claim, find_stored, store_sent
from app.db.store import Store
from app.db.stored_responses import IdempotencyKey, StoredResponse
from app.errors import BusyError, OverloadedError, ReviewError, StorageError
from app.http.access import actor_of
from app.http.bodies import BYTES, VALUE
from app.http.deps import ACTOR_HEADER
from app.http.errors import RETRY_SECONDS, status_of
from app.http.hide_existence import HIDDEN, SENT
from app.http.origin import SAFE_METHODS
from app.http.problem import make_problem, problem_response
from app.http.respond import KEYED_REQUEST, STORED_HEADERS

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
UNKEPT = re.compile(
    r"/api/v\d+/(?:session|sessions|links|tokens|users|datasets/[^/]+/webhooks)(?:/|$)"
)
"""Responses that hold a secret are shown once, and stored nowhere."""
THREADS = 4
"""So many responses are looked up at a time, and as many are stored."""


class Idempotency:
    """Answers a repetition with the first response, and the same key with another request with 422.

    Args:
        app: What answers for the first time.
        actor: Whose keys they are, where nobody is logged in.
    """

    def __init__(self, app: ASGIApp, actor: str):
        self.app, self._actor = app, actor
        self._under_way: dict[tuple[str, str], asyncio.Event] = {}
        self._finding, self._storing = CapacityLimiter(THREADS), CapacityLimiter(THREADS)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        if scope["type"] != "http" or scope["method"] in SAFE_METHODS:
            await self.app(scope, receive, send)
            return
        if UNKEPT.match(scope["path"]):
            await self.app(scope, receive, send)
            return
        keys = Headers(scope=scope).getlist(HEADER)
        if not keys:
            await self.app(scope, receive, send)
        elif len(keys) > 1 or not KEY.fullmatch(keys[0]):
            problem = make_problem(400, f"{HEADER} must be 1 to 200 visible ASCII characters")
            await problem_response(problem)(scope, receive, send)
        else:
            await self._once(keys[0], scope, receive, send)

    async def _once(self, key: str, scope: Scope, receive: Receive, send: Send) -> None:
        whose = (actor_of(scope, self._actor), key)
        try:
            while (first := self._under_way.get(whose)) is not None:
                await asyncio.wait_for(first.wait(), PATIENCE)
        except TimeoutError:
            await _refuse(_still(), scope, receive, send)
            return
        done = self._under_way[whose] = asyncio.Event()
        try:
            await self._alone(*whose, _Request(scope, receive), send)
        finally:
            del self._under_way[whose]
            done.set()

    async def _alone(self, actor: str, key: str, request: _Request, send: Send) -> None:
        """Answer while no other process does, where there may be some."""
        if not request.store.sharing.is_shared:
            await self._answer(actor, key, request, send)
            return
        try:
            claimed = await self._claim(request.store, key, actor)
        except StorageError as error:
            await _refuse(error, request.scope, request.receive, send)
            return
        if not claimed:
            await _refuse(_still(), request.scope, request.receive, send)
            return
        try:
            await self._answer(actor, key, request, send)
        finally:
            with CancelScope(shield=True):
                await run_sync(end_claim, request.store, key, actor, limiter=self._storing)

    async def _claim(self, store: Store, key: str, actor: str) -> bool:
        """Whether it could be had before patience was at its end."""
        until = time.monotonic() + PATIENCE
        while not await run_sync(claim, store, key, actor, limiter=self._finding):
            if time.monotonic() > until:
                return False
            await asyncio.sleep(AGAIN_SECONDS)
        return True

    async def _answer(self, actor: str, key: str, request: _Request, send: Send) -> None:
        try:
            known = await self._find(request, key, actor)
        except StorageError as error:
            await _refuse(error, request.scope, request.receive, send)
            return
        if known is not None and not (known.under_way and await request.asks_for(known)):
            await _again(known, request, send)
        else:
            await self._carry_out(actor, key, request, send)

    async def _find(self, request: _Request, key: str, actor: str) -> StoredResponse | None:
        """What is stored under a key; in a thread only where there is something to wait for.

        Nothing for who has lost sight, meanwhile, of what it is about.
        """
        try:
            found = find_stored(request.store, key, actor, at_once=True)
        except BusyError:
            found = await run_sync(find_stored, request.store, key, actor, limiter=self._finding)
        hidden = None if found is None else request.scope.get(HIDDEN)
        if hidden is not None and await run_sync(hidden, limiter=self._finding):
            return None
        return found

    async def _carry_out(self, actor: str, key: str, request: _Request, send: Send) -> None:
        if request.streamed:
            # What is asked for is known once its bytes have passed.
            keyed = None
        else:
            await request.read()
            keyed = KeyedRequest(IdempotencyKey(key, actor, request.digest()))
            request.scope[KEYED_REQUEST] = keyed
        recorded = _Recorded(send)
        await self.app(request.scope, request.receive, recorded.send)
        if recorded.is_whole and not (keyed and keyed.stored):
            try:
                sent = recorded.stored_form(request.digest())
                await run_sync(store_sent, request.store, key, actor, sent, limiter=self._storing)
            except StorageError as error:
                # It is sent already; a repetition is answered with the state as it is then.
                log.warning("a response could not be stored", error=str(error))


def _still() -> OverloadedError:
    return OverloadedError("the first request of this key is still being answered")


async def _refuse(error: ReviewError, scope: Scope, receive: Receive, send: Send) -> None:
    problem = make_problem(status_of(error), error.message, hint=error.hint)
    await problem_response(problem, {"Retry-After": RETRY_SECONDS})(scope, receive, send)


async def _again(known: StoredResponse, request: _Request, send: Send) -> None:
    if not await request.asks_for(known):
        problem = make_problem(
            422, f"this {HEADER} was used for another request", hint="Send a new key with it."
        )
        await problem_response(problem)(request.scope, request.receive, send)
        return
    if known.body is None:
        problem = make_problem(
            409,
            "this request was answered before, and its answer is no longer kept",
            hint="It was carried out, once. Load the present state.",
        )
        await problem_response(problem, {REPLAYED: "true"})(request.scope, request.receive, send)
        return
    headers = [(name.encode(), text.encode("latin-1")) for name, text in known.headers.items()]
    headers.append((REPLAYED.lower().encode(), b"true"))
    headers.append((b"content-length", str(len(known.body)).encode()))
    await send({"type": "http.response.start", "status": known.status, "headers": headers})
    await send({"type": "http.response.body", "body": known.body})


class _Request:
    """A request and the digest of what it asks for; an upload's body is digested as it passes."""

    def __init__(self, scope: Scope, receive: Receive):
        self.scope, self._receive = scope, receive
        kind = Headers(scope=scope).get("content-type", "")
        self.streamed = kind.strip().lower() == BYTES
        self._sum = hashlib.sha256()
        self._body: list[bytes] = []
        self._ended = self._replayed = False

    @property
    def store(self) -> Store:
        """Where the application stores its responses."""
        store: Store = self.scope["app"].state.services.store
        return store

    async def read(self) -> None:
        """Read the rest of the body; one that is not streamed can be received once more."""
        while not self._ended:
            await self._next()

    async def asks_for(self, known: StoredResponse) -> bool:
        """Whether it is the request that a response was given to."""
        await self.read()
        return self.digest() == known.request_digest

    async def receive(self) -> Message:
        """The next message for whoever answers."""
        if self.streamed or self._replayed:
            return await self._next()
        self._replayed = True
        return {"type": "http.request", "body": b"".join(self._body), "more_body": False}

    def digest(self) -> str:
        """Digest of method, address, body, actor and If-Match; JSON in another order gives the same one.

        It is that of what was sent: what is deleted is asked for under another name afterwards.
        """
        sent = self.scope.get(SENT, self.scope)
        place = [sent["method"], sent["path"], sent["query_string"].decode()]
        headers = Headers(scope=sent)
        place += headers.getlist(ACTOR_HEADER)
        # The same change of another state is another request.
        place += [f"If-Match: {tag}" for tag in headers.getlist("if-match")]
        if self.streamed:
            body = self._sum.hexdigest()
        else:
            body = canonical(sent[VALUE]) if VALUE in sent else ""
        return hashlib.sha256(canonical([*place, body]).encode()).hexdigest()

    async def _next(self) -> Message:
        message = await self._receive()
        if message["type"] == "http.request":
            part = message.get("body", b"")
            if self.streamed:
                self._sum.update(part)
            else:
                self._body.append(part)
            self._ended = self._ended or not message.get("more_body", False)
        else:
            self._ended = True
        return message


class _Recorded:
    """Passes a response on and remembers it."""

    def __init__(self, send: Send):
        self._send = send
        self._status, self._headers = 0, Headers()
        self._body = bytearray()
        self._ended = False

    @property
    def is_whole(self) -> bool:
        """Whether it is a whole success; what was refused may be tried again."""
        return self._ended and 200 <= self._status < 300 and len(self._body) <= MAX_ANSWER_BYTES

    async def send(self, message: Message) -> None:
        """The next message of the response."""
        if message["type"] == "http.response.start":
            self._status, self._headers = message["status"], Headers(raw=message["headers"])
        elif message["type"] == "http.response.body":
            if len(self._body) <= MAX_ANSWER_BYTES:
                self._body += message.get("body", b"")
            self._ended = not message.get("more_body", False)
        await self._send(message)

    def stored_form(self, digest: str) -> StoredResponse:
        """What is stored."""
        headers = {name: self._headers[name] for name in STORED_HEADERS if name in self._headers}
        return StoredResponse(digest, self._status, headers, bytes(self._body))
