"""Request limits: how many requests of a class are at work at a time, and how many may wait.

A request waits on the event loop, where waiting costs next to nothing, so that changes behind a held write lock never take
the threads that reads need. One interpreter computes with one thread at a time: each request more that is at work makes
all of them slower, so that classes are narrow (decision 0072).
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Collection
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from anyio import CapacityLimiter, WouldBlock, move_on_after, sleep
from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, Response
from starlette.types import Scope

from app.http.access import get_current_login
from app.http.headers import SAFE_METHODS
from app.http.problem import make_problem, problem_response

E = TypeVar("E", bound=Callable[..., Any])
PATIENCE = 10.0
"""Seconds that a request waits to be admitted."""
MOST_WAITING = 200
"""Requests of a class that may wait; of one person in a team half of them."""
RETRY_SECONDS = "2"
PAUSE = 4.0
"""Seconds until who cannot even wait is told so: a refusal costs the event loop about as much as an answer, and who has
hundreds of them at once asks again at once."""
BUSY_PAGE = f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta http-equiv="refresh" content="{RETRY_SECONDS}">
<title>Busy · Touchline</title>
<p>The server is busy with other pages. This one tries again by itself; nothing is lost.</p>
</html>
"""


@dataclass(frozen=True)
class RequestClass:
    """Requests that share a limit.

    Args:
        name: What it is called in metrics and errors.
        width: How many are at work at a time, each in a thread of its own.
    """

    name: str
    width: int

    @property
    def per_person_limit(self) -> int:
        """How many of them one person of a team may have at work."""
        return 1 if self.width < 4 else self.width // 2


READ = RequestClass("read", 3)
"""Whatever only reads, and pages of the browser application: milliseconds each."""
WRITE = RequestClass("write", 2)
"""Whatever changes something. One is written at a time; another is read, solved and encoded meanwhile."""
COMPUTE = RequestClass("compute", 4)
"""What is solved to answer: previews, and up to seconds for what solves many times, many groups, or hundreds of points."""
TRANSFER = RequestClass("transfer", 8)
"""What waits for a client, a disk, a worker process or another server, and leaves the interpreter alone: pictures,
uploads, exports, logins."""
REQUEST_CLASSES = (READ, WRITE, COMPUTE, TRANSFER)
LARGE_BYTES = 8 * 1024
"""A body beyond these draws hundreds of points."""
THREADS = sum(one.width for one in REQUEST_CLASSES) + 6
"""A thread for each request at work, and some for files of the browser application."""

_CLASS = "request_class"


def limit(request_class: RequestClass | None) -> Callable[[E], E]:
    """Say of which class the requests of a route are; None: they need no thread for long.

    A route that does not say it is of ``READ``, or of ``WRITE``, by its method.
    """

    def decorate(endpoint: E) -> E:
        setattr(endpoint, _CLASS, request_class)
        return endpoint

    return decorate


def find_request_class(
    endpoint: Callable[..., Any], methods: Collection[str]
) -> RequestClass | None:
    """The class of a route, by the function that answers and its methods."""
    otherwise = READ if set(methods) <= SAFE_METHODS else WRITE
    found: RequestClass | None = getattr(endpoint, _CLASS, otherwise)
    return found


def is_large_request(scope: Scope) -> bool:
    """Whether a request brings far more than a person draws; one that does not say how much may."""
    headers = Headers(scope=scope)
    size = headers.get("content-length", "")
    return int(size) > LARGE_BYTES if size.isdecimal() else "transfer-encoding" in headers


class ClassLimiter:
    """The limit of one class: who is at work, who waits, and how many were refused.

    In a team a person's requests first wait for each other, and one at a time for those of others: whoever sends a hundred
    at once waits for them alone. Strangers are one person.

    Args:
        request_class: Which class.
        team: Whether several people share it.
    """

    def __init__(self, request_class: RequestClass, *, team: bool):
        self.request_class = request_class
        self.refused = self.waiting = 0
        self._team = team
        self._everybody = CapacityLimiter(request_class.width)
        self._people: dict[str, CapacityLimiter] = {}

    @property
    def busy(self) -> int:
        """How many are at work."""
        return int(self._everybody.borrowed_tokens)

    @asynccontextmanager
    async def admit(self, who: str = "") -> AsyncIterator[bool]:
        """Wait to be admitted; False where too many wait, or it took too long.

        Args:
            who: The person whose request it is; empty for a stranger.
        """
        async with AsyncExitStack() as held:
            admitted = False
            with move_on_after(PATIENCE):
                admitted = await self._acquire(who, held)
            self.refused += not admitted
            yield admitted

    async def _acquire(self, who: str, held: AsyncExitStack) -> bool:
        """Whether a request was admitted, until ``held`` ends; False where too many wait."""
        request = object()
        limiters = [(self._everybody, MOST_WAITING)]
        if self._team:
            limiters.insert(0, (self._get_person_limiter(who), MOST_WAITING // 2))
        for limiter, most in limiters:
            try:
                limiter.acquire_on_behalf_of_nowait(request)
            except WouldBlock:
                if self.waiting >= MOST_WAITING or limiter.statistics().tasks_waiting >= most:
                    # Whoever is refused keeps none of their own places meanwhile.
                    await held.aclose()
                    await sleep(PAUSE)
                    return False
                self.waiting += 1
                try:
                    await limiter.acquire_on_behalf_of(request)
                finally:
                    self.waiting -= 1
            held.callback(limiter.release_on_behalf_of, request)
        return True

    def _get_person_limiter(self, who: str) -> CapacityLimiter:
        """As many as there are people in the team at most."""
        if who not in self._people:
            self._people[who] = CapacityLimiter(self.request_class.per_person_limit)
        return self._people[who]


class RequestLimits:
    """The limits of all classes of one server; ``team``: see ``ClassLimiter``."""

    def __init__(self, *, team: bool = False):
        self._of = {one: ClassLimiter(one, team=team) for one in REQUEST_CLASSES}

    @property
    def class_limiters(self) -> Collection[ClassLimiter]:
        """Those of all classes."""
        return self._of.values()

    @asynccontextmanager
    async def admit(
        self, request_class: RequestClass | None, scope: Scope
    ) -> AsyncIterator[Response | None]:
        """Admit a request of a class; yields what its sender is told instead where too many wait already.

        It ends when the answer is there: sending it to a slow client takes nobody's place.
        """
        if request_class is None:
            yield None
            return
        if request_class in (READ, WRITE) and is_large_request(scope):
            # An edit or preview of hundreds of points is solved for as long as dozens of those that people draw.
            request_class = COMPUTE
        login = get_current_login(scope)
        async with self._of[request_class].admit("" if login is None else login.name) as admitted:
            yield None if admitted else _busy_response(scope)


def _busy_response(scope: Scope) -> Response:
    """What who was not admitted is told: a page for people who asked for one, else a problem."""
    later = {"Retry-After": RETRY_SECONDS}
    if "text/html" in Headers(scope=scope).get("accept", ""):
        return HTMLResponse(BUSY_PAGE, 503, {**later, "Cache-Control": "no-store"})
    problem = make_problem(
        503,
        "the server is busy with other requests",
        hint="Nothing was done. Send it again in a moment.",
    )
    return problem_response(problem, later)
