"""Lanes: how many requests of a kind are at work at a time, and how many may wait.

Threads are few. A request waits for its turn on the event loop, where waiting costs next to
nothing, so that changes behind a held write lock never take the threads that reads need. People have
their turns one after the other, however many requests each of them sends.

Lanes of what is computed are narrow: threads that compute take turns within one process, and each
more makes all of them slower, with the event loop (decision 0049).
"""

from __future__ import annotations

import asyncio
import os
from collections import Counter, deque
from collections.abc import AsyncIterator, Callable, Collection
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import anyio
from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, Response
from starlette.types import Scope

from app.admission import hold_admission
from app.http.access import current_login
from app.http.headers import SAFE_METHODS
from app.http.problem import make_problem, problem_response

E = TypeVar("E", bound=Callable[..., Any])
PATIENCE = 10.0
"""Seconds that a request waits for its turn."""
RETRY_SECONDS = "2"
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
    """Requests of one kind.

    Args:
        name: What they are called in the metrics.
        width: How many are at work at a time, each in a thread of its own.
        queue: How many more may wait for their turn.
        served: How many are at work where a server of databases is waited for at each statement; None:
            as many as elsewhere.
        apart: How many are at work where each has a process that does it; None: as many as elsewhere.
        each: How many of them one person of a team may have at work; None: all.
        pause: Seconds until who cannot even wait is told so. A refusal costs the event loop about as
            much as any answer, and who has hundreds of them at once asks again at once.
    """

    name: str
    width: int
    queue: int
    served: int | None = None
    apart: int | None = None
    each: int | None = None
    pause: float = 0.0


LOOKS = RequestClass("looks", 2, 200)
"""What one group, view or camera is, and what a window asks again and again."""
PAGES = RequestClass("pages", 2, 200)
"""The page of the browser application, whichever address it is asked for under."""
READS = RequestClass("reads", min(4, max(2, os.cpu_count() or 2)), 200, each=1)
"""All other reading: lists and counts of many groups, which the database takes a processor for. What one
person of a team asks is read one after the other: two long lists at once take the server from all others."""
EDITS = RequestClass("edits", 1, 100, served=3)
"""What people do to one group, view or lease all day: read, solved and encoded one after the other. Who
waits for the disk or a picture has left already (``app.admission``)."""
CHANGES = RequestClass("changes", 3, 100)
"""All others; they may take their time."""
PREVIEWS = RequestClass("previews", 1, 100, apart=2, each=1)
"""What a drag asks: some milliseconds of solving, dozens where lines are dragged. A person drags one thing at
a time."""
LARGE = RequestClass("large", 1, 50)
"""Edits and previews of hundreds of points, each of which is solved for as long as dozens of others, and
edits of many views at once."""
QUESTIONS = RequestClass("questions", 2, 100)
"""What is answered by solving many times, or many groups; it takes up to seconds."""
STREAMS = RequestClass("streams", 1, 200)
"""Those that begin: who listens takes nobody's place. All windows of a team come back at the same
moment when a server starts again, and what each asks first would keep readers waiting."""
IMAGES = RequestClass("images", 6, 200)
UPLOADS = RequestClass("uploads", 8, 8, each=4, pause=4.0)
ZIPS = RequestClass("zips", 16, 100)
"""Those of exports, which a request may find still being written."""
LOGINS = RequestClass("logins", 4, 50)
"""Passwords, whose hashes take some tenths of a second of a processor."""
SIGN_ONS = RequestClass("sign-ons", 4, 50)
"""Single sign-on, whose provider may take its time, or never answer."""
REQUEST_CLASSES = (
    LOOKS,
    PAGES,
    READS,
    EDITS,
    CHANGES,
    PREVIEWS,
    LARGE,
    QUESTIONS,
    STREAMS,
    IMAGES,
    UPLOADS,
    ZIPS,
    LOGINS,
    SIGN_ONS,
)
LARGE_BYTES = 8 * 1024
"""A body beyond these draws hundreds of points."""
AWAY = 8
"""So many of a lane may have left it before they were done."""
THREADS = (
    sum(max(lane.width, lane.served or 0, lane.apart or 0) for lane in REQUEST_CLASSES)
    + 2 * AWAY
    + 6
)
"""A thread for each request at work, for as many edits and changes as may have left, and some for files
of the browser application."""

_LANE = "lane"


def limit(lane: RequestClass | None) -> Callable[[E], E]:
    """Say of which kind the requests of a route are; None: they need no thread for long.

    A route that does not say it is of ``READS``, or of ``CHANGES``.
    """

    def decorate(endpoint: E) -> E:
        setattr(endpoint, _LANE, lane)
        return endpoint

    return decorate


def request_class(endpoint: Callable[..., Any], methods: Collection[str]) -> RequestClass | None:
    """The lane of a route, by the function that answers and its methods."""
    otherwise = READS if set(methods) <= SAFE_METHODS else CHANGES
    found: RequestClass | None = getattr(endpoint, _LANE, otherwise)
    return found


def is_large(scope: Scope) -> bool:
    """Whether a request brings far more than a person draws; one that does not say how much may."""
    headers = Headers(scope=scope)
    size = headers.get("content-length", "")
    return int(size) > LARGE_BYTES if size.isdecimal() else "transfer-encoding" in headers


class FairLimiter:
    """Places on one event loop, given to those who wait person by person.

    Whoever sends a hundred requests at once waits for them himself; others wait for one of them each.

    Args:
        width: How many there are.
        queue: How many requests may wait for one.
        each: How many one person may have at a time; None: all. Who has no name, as on a server that
            somebody runs alone, may have all.
    """

    def __init__(self, width: int, queue: int, each: int | None = None):
        self.width, self.free, self.waiting = width, width, 0
        self._queue, self._each = queue, width if each is None else each
        self._at_work = Counter[str]()
        self._of: dict[str, deque[asyncio.Future[bool]]] = {}
        """Those who wait, with their requests: whose turn is next comes first."""

    def take(self, who: str) -> bool:
        """Take a place where one is free for somebody."""
        if not self._may_start(who):
            return False
        self.free -= 1
        self._at_work[who] += 1
        return True

    def has_room(self, who: str) -> bool:
        """Whether somebody may wait. Where all may not, somebody with few requests displaces the
        newest of whoever waits with the most."""
        if self.waiting < self._queue:
            return True
        most = max(self._of.values(), key=len, default=deque[asyncio.Future[bool]]())
        if len(most) <= len(self._of.get(who, ())) + 1:
            return False
        most.pop().set_result(False)
        self.waiting -= 1
        return True

    async def wait(self, who: str, seconds: float) -> bool:
        """Whether a place was given in time; without, the request was displaced or waited too long."""
        mine = asyncio.get_running_loop().create_future()
        self._of.setdefault(who, deque()).append(mine)
        self.waiting += 1
        try:
            await asyncio.wait((mine,), timeout=seconds)
        except asyncio.CancelledError:
            if mine.done() and mine.result():
                self.give(who)
            raise
        finally:
            if not mine.done():
                self._remove_waiting(who, mine)
        return mine.done() and mine.result()

    def give(self, who: str) -> None:
        """Give somebody's place back, to whose turn it is."""
        self.free += 1
        self._at_work[who] -= 1
        if not self._at_work[who]:
            del self._at_work[who]
        following = next(filter(self._may_start, self._of), None)
        if following is None:
            return
        waiting = self._of.pop(following)
        self.take(following)
        waiting.popleft().set_result(True)
        self.waiting -= 1
        if waiting:
            self._of[following] = waiting

    def _may_start(self, who: str) -> bool:
        return self.free > 0 and (not who or self._at_work[who] < self._each)

    def _remove_waiting(self, who: str, mine: asyncio.Future[bool]) -> None:
        self._of[who].remove(mine)
        self.waiting -= 1
        if not self._of[who]:
            del self._of[who]


class ClassLimiter:
    """The door of one lane: who is at work, who waits, and how many were turned away.

    Args:
        request_class: The lane.
        served: Whether a server of databases answers.
        apart: Whether there are processes for what takes long.
    """

    def __init__(self, request_class: RequestClass, served: bool = False, apart: bool = False):
        self.lane = request_class
        self.refused = self.away = 0
        width = (
            (served and request_class.served)
            or (apart and request_class.apart)
            or request_class.width
        )
        self._turns = FairLimiter(width, request_class.queue, request_class.each)

    @property
    def busy(self) -> int:
        """How many are at work."""
        return self._turns.width - self._turns.free

    @property
    def waiting(self) -> int:
        """How many wait for their turn."""
        return self._turns.waiting

    async def enter(self, who: str = "") -> bool:
        """Wait for a turn; False where too many wait, or it took too long.

        Args:
            who: The person whose request it is; those of nobody wait together.
        """
        if self._turns.take(who):
            return True
        if not self._turns.has_room(who):
            self.refused += 1
            await anyio.sleep(self.lane.pause)
            return False
        if await self._turns.wait(who, PATIENCE):
            return True
        self.refused += 1
        return False

    def leave(self, who: str = "") -> None:
        """Let the next one in; ``who``: as on entering."""
        self._turns.give(who)


class ClassLimiters:
    """The doors of all lanes of one server; ``served``, ``apart``: see ``ClassLimiter``."""

    def __init__(self, served: bool = False, apart: bool = False) -> None:
        self.all = tuple(
            ClassLimiter(request_class, served, apart) for request_class in REQUEST_CLASSES
        )
        self._of = {limiter.lane: limiter for limiter in self.all}

    def of(self, lane: RequestClass | None, scope: Scope) -> ClassLimiter | None:
        """The door that a request of a lane goes through, if any."""
        if lane in (EDITS, PREVIEWS) and is_large(scope):
            lane = LARGE
        return None if lane is None else self._of[lane]


@asynccontextmanager
async def wait_for_turn(door: ClassLimiter | None, scope: Scope) -> AsyncIterator[Response | None]:
    """A request's turn, once it comes; what its sender is told instead where too many wait already.

    The turn ends when the answer is there, for sending it to a slow client takes nobody's place; and
    before, where the work says that it waits for something else (``release_admission``).
    """
    if door is None:
        yield None
        return
    login = current_login(scope)
    who = "" if login is None else login.name
    if not await door.enter(who):
        yield _busy_response(scope, door.lane)
        return
    place = _AdmittedRequest(door, who)
    hold_admission(place.leave_from_anywhere)
    try:
        yield None
    finally:
        place.end()


def _busy_response(scope: Scope, request_class: RequestClass) -> Response:
    """What who had no turn is told: a page for people who asked for one, else a problem."""
    later = {"Retry-After": RETRY_SECONDS}
    if request_class is PAGES and "text/html" in Headers(scope=scope).get("accept", ""):
        return HTMLResponse(BUSY_PAGE, 503, {**later, "Cache-Control": "no-store"})
    problem = make_problem(
        503,
        f"the server is busy with other {request_class.name}",
        hint="Nothing was done. Send it again in a moment.",
    )
    return problem_response(problem, later)


class _AdmittedRequest:
    """One request's place in its lane; it is given back once."""

    def __init__(self, limiter: ClassLimiter, who: str):
        self._door, self._who, self._has, self._is_over = limiter, who, True, False
        self._loop = asyncio.get_running_loop()

    def leave_from_anywhere(self) -> None:
        """Give the place back before the work is done, from another thread; only so many may do so."""
        # A loop that has stopped lets nobody in any more.
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._give_place_back)

    def _give_place_back(self) -> None:
        if self._has and self._door.away < AWAY:
            self._door.away += 1
            self._has = False
            self._door.leave(self._who)

    def end(self) -> None:
        """The work is done."""
        if self._is_over:
            return
        self._is_over = True
        if self._has:
            self._has = False
            self._door.leave(self._who)
        else:
            self._door.away -= 1
