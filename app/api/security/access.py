"""Access: on a server of a team, nobody comes further than their role. The one place that decides.

Every request is looked up in one table; what does not stand there is refused. Routes decide
nothing of this kind, and see to it that the table has decided about them (``require_decided``).
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from typing import Any

import structlog
from anyio import CapacityLimiter
from anyio.to_thread import run_sync
from fastapi import Request
from starlette.datastructures import Headers
from starlette.routing import compile_path
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.problem import SCHEME, make_problem, problem_response
from app.api.security.rules import OPEN, RULES
from app.errors import ForbiddenError, StorageError
from app.review.people.logins import Login, Logins
from app.review.people.roles import Action, require

log = structlog.get_logger("touchline.access")

API = "/api/v1"
LOGIN = "touchline.login"
"""Where a request's scope says who is logged in."""
RULE = "touchline.rule"
"""Where it says which row of the table has let it through."""
LOOK_SECONDS = 2.0
"""Between two looks whether whoever reads an endless answer still may."""
THREADS = 8
"""So many sessions are looked up at a time."""
STREAMS = frozenset({"GET /api/v1/events"})


def login_of(scope: Mapping[str, Any]) -> Login | None:
    """Who is logged in; None on a server that somebody runs alone."""
    found: Login | None = scope.get(LOGIN)
    return found


def actor_of(scope: Mapping[str, Any], otherwise: str) -> str:
    """The name of who is logged in, or another where nobody has to be."""
    login = login_of(scope)
    return otherwise if login is None else login.name


async def require_decided(request: Request) -> None:
    """Refuse a request that reached a route which the table did not decide about.

    Raises:
        ForbiddenError: The table has taken it for another one, or was never asked.
    """
    if request.app.state.team is None:
        return
    # A route knows its address without the prefix of its router.
    own = request.scope["route"].path_format
    decided = {f"{request.scope['method']} {prefix}{own}" for prefix in ("", API)}
    if request.scope.get(RULE) not in decided:
        raise ForbiddenError("nobody has decided who may do this")


class _Rules:
    """The table, ready to be asked."""

    def __init__(self) -> None:
        plain = sorted(RULES, key=lambda name: ("elsewhere" in name, name.count("{")))
        self._rows = []
        for name in plain:
            method, template = name.split(" ", 1)
            pattern = compile_path(template)[0]
            self._rows.append((method, pattern, name, RULES[name]))

    def find(self, method: str, path: str) -> tuple[str, Action | None] | None:
        """Row and action of a request; None where there is no row. Fixed addresses come first."""
        for wanted, pattern, name, action in self._rows:
            if wanted == method and pattern.match(path):
                return name, action
        return None


class Access:
    """Lets a request through whose session and role allow it: 401, 403, and 404 for what no row has.

    Args:
        app: Answers those that may.
        logins: Sessions.
        cookie: Name of the cookie that holds a session's token.
    """

    def __init__(self, app: ASGIApp, logins: Logins, cookie: str):
        self.app, self._logins, self._cookie = app, logins, cookie
        self._rules = _Rules()
        self._threads = CapacityLimiter(THREADS)
        self._touching: dict[int, asyncio.Task[None]] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        row = self._rules.find(scope["method"], scope["path"])
        if row is not None and row[1] is OPEN:
            scope[RULE] = row[0]
            await self.app(scope, receive, send)
            return
        token = cookie_of(scope, self._cookie)
        try:
            login = await self._find(token)
        except StorageError as error:
            problem = make_problem(503, error.message, hint=error.hint)
            await problem_response(problem, {"Retry-After": "5"})(scope, receive, send)
            return
        if login is None:
            problem = make_problem(401, "nobody is logged in here", hint="Log in first.")
            headers = {"WWW-Authenticate": SCHEME}
            await problem_response(problem, headers)(scope, receive, send)
            return
        if row is None or row[1] is None:
            problem = make_problem(404, "there is nothing at this address")
            await problem_response(problem)(scope, receive, send)
            return
        await self._ask(row[0], row[1], login, token or "", scope, receive, send)

    async def _ask(
        self,
        name: str,
        action: Action,
        login: Login,
        token: str,
        scope: Scope,
        receive: Receive,
        send: Send,
    ) -> None:
        try:
            require(login.role, action)
        except ForbiddenError as error:
            problem = make_problem(403, error.message, hint=error.hint)
            await problem_response(problem)(scope, receive, send)
            return
        scope[RULE], scope[LOGIN] = name, login
        self._note_use(login)
        if name in STREAMS:
            await self._stream(token, action, scope, receive, send)
        else:
            await self.app(scope, receive, send)

    async def _find(self, token: str | None) -> Login | None:
        if not token:
            return None
        return await run_sync(self._logins.find, token, limiter=self._threads)

    def _note_use(self, login: Login) -> None:
        """Write down that a session is used, seldom and while nobody waits for it."""
        if login.id in self._touching or not self._logins.is_stale(login):
            return
        task = asyncio.ensure_future(self._touch(login))
        self._touching[login.id] = task
        task.add_done_callback(lambda _task: self._touching.pop(login.id, None))

    async def _touch(self, login: Login) -> None:
        try:
            await run_sync(self._logins.touch, login, limiter=self._threads)
        except StorageError as error:
            log.warning("the use of a session could not be noted", error=str(error))

    async def _stream(
        self, token: str, action: Action, scope: Scope, receive: Receive, send: Send
    ) -> None:
        """An answer without an end; it ends when its reader is logged out, or may no more."""
        ended = asyncio.Event()

        async def look() -> None:
            while not ended.is_set():
                await asyncio.sleep(LOOK_SECONDS)
                if not await self._still_may(token, action):
                    ended.set()

        async def heard() -> Message:
            waiting = [asyncio.ensure_future(receive()), asyncio.ensure_future(ended.wait())]
            try:
                await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
                first = waiting[0]
                done = first.done() and not ended.is_set()
                return first.result() if done else {"type": "http.disconnect"}  # type: ignore[return-value]
            finally:
                for task in waiting:
                    task.cancel()

        begun = over = False

        async def told(message: Message) -> None:
            nonlocal begun, over
            if ended.is_set():
                return
            begun = begun or message["type"] == "http.response.start"
            over = message["type"] == "http.response.body" and not message.get("more_body", False)
            await send(message)

        looking = asyncio.ensure_future(look())
        try:
            await self.app(scope, heard, told)
        finally:
            looking.cancel()
        if begun and not over:
            await send({"type": "http.response.body", "body": b"", "more_body": False})

    async def _still_may(self, token: str, action: Action) -> bool:
        try:
            login = await self._find(token)
            if login is not None:
                require(login.role, action)
        except ForbiddenError:
            return False
        except StorageError:
            # Nobody knows; what is told is read from the same database.
            return True
        return login is not None


def cookie_of(scope: Scope, name: str) -> str | None:
    """The value of one cookie; None where there is none, or two that could be meant."""
    sent = Headers(scope=scope).getlist("cookie")
    found = re.findall(rf"(?:^|;)\s*{re.escape(name)}=([^;]*)", ";".join(sent))
    if len(found) != 1:
        return None
    try:
        morsel = SimpleCookie(f"{name}={found[0]}").get(name)
    except CookieError:
        return None
    return None if morsel is None else morsel.value
