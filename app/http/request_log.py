"""The request log: one line for each change, under an id that its other lines carry as well.

It has the last word on mistakes of ours, too: they become a problem with an id, and a line with
the rest.
"""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import Callable
from contextvars import Context
from math import inf
from typing import Any

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.access import ASKS
from app.http.headers import SAFE_METHODS
from app.http.problem import make_problem, problem_response
from app.http.team import TeamLogin
from app.soccer.actors import LOCAL_USER

log = structlog.get_logger("touchline.requests")

HEADER = "X-Request-ID"
"""Tells the caller under which id the log speaks of its request."""


MOST_REFUSALS = 20
"""Refused requests of one second that are told of one by one; of the others the number is told."""


def _call_after_one_second(work: Callable[[], None]) -> None:
    # What is told then is of no request alone.
    asyncio.get_running_loop().call_later(1.0, work, context=Context())


class RefusalLogLimiter:
    """How many refusals the log tells of: whoever sends what is refused does not fill a disk.

    Args:
        clock: Seconds.
        later: Has something done in a second.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        later: Callable[[Callable[[], None]], Any] = _call_after_one_second,
    ):
        self._clock, self._later = clock, later
        self._began = -inf
        self._told = self._untold = 0

    def should_log(self) -> bool:
        """Whether one more is told of; only the event loop asks."""
        if self._clock() - self._began >= 1.0:
            self._began, self._told = self._clock(), 0
        if self._told < MOST_REFUSALS:
            self._told += 1
            return True
        if not self._untold:
            self._later(self._log_refused_count)
        self._untold += 1
        return False

    def _log_refused_count(self) -> None:
        log.warning("more requests were refused", count=self._untold)
        self._untold = 0


def find_client_address(scope: Scope) -> str:
    """Where a request comes from: behind a proxy of ours, the address that it forwards."""
    team: TeamLogin | None = getattr(scope["app"].state, "team", None)
    if team is not None:
        return team.find_client_address(Request(scope))
    client = scope.get("client")
    return client[0] if client else ""


def find_person_of_request(scope: Scope) -> str | None:
    """The actor of the request, as named in the log of changes; None without a login on a team's server."""
    is_team = getattr(scope["app"].state, "team", None) is not None
    found: str | None = scope.get(ASKS, None if is_team else LOCAL_USER)
    return found


def make_request_id() -> str:
    """An id that no other request has."""
    return uuid.uuid4().hex[:16]


class RequestLog:
    """Names each request; logs those that change something, and those that the server failed, of
    refused ones so many a second.

    With the Idempotency-Key of the browser's click and the ETag of what was committed, an edit can
    be followed from one to the other.

    Answers 500 for whatever nobody caught, and says nothing of stack, path or SQL to the caller.
    Starlette's own handler of that kind stands outside of every middleware, where the answer
    would go out without the security headers.
    """

    def __init__(self, app: ASGIApp):
        self.app = app
        self._refusals = RefusalLogLimiter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        name, start = make_request_id(), time.perf_counter()
        status, etag = 0, None

        async def watch(message: Message) -> None:
            nonlocal status, etag
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers[HEADER] = name
                status, etag = message["status"], headers.get("etag")
            await send(message)

        with structlog.contextvars.bound_contextvars(request=name):
            try:
                await self.app(scope, receive, watch)
            except Exception:
                problem = make_problem(
                    500,
                    "something went wrong inside the server",
                    hint="Nothing was saved. The server's log has the details under this instance.",
                )
                log.exception("request failed", instance=problem.instance, path=scope["path"])
                if status:
                    raise
                await problem_response(problem)(scope, receive, watch)
            if scope["method"] in SAFE_METHODS and status < 500:
                return
            refused = 400 <= status < 500 or status == 503
            if refused and not self._refusals.should_log():
                return
            log.info(
                "request answered",
                method=scope["method"],
                path=scope["path"],
                person=find_person_of_request(scope),
                address=find_client_address(scope),
                status=status,
                milliseconds=round(1000 * (time.perf_counter() - start), 1),
                key=Headers(scope=scope).get("idempotency-key"),
                etag=etag,
            )
