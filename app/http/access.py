"""Access: on a server of a team, nobody comes further than their role. The one place that decides.

Every request is looked up in one table; what does not stand there is refused. Routes decide
nothing of this kind, and see to it that the table has decided about them (``require_decided``).
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import structlog
from anyio import CapacityLimiter
from anyio.to_thread import run_sync
from fastapi import Request
from starlette.responses import Response
from starlette.routing import compile_path
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.db.store import Store
from app.errors import (
    AccessError,
    ForbiddenError,
    NotLoggedInError,
    StorageError,
    TooManyTriesError,
)
from app.features.people.access_tokens import AccessTokens
from app.features.people.logins import Login, Logins
from app.features.people.roles import Action, DatasetRoles, require_scope
from app.features.people.visibility_queries import EVERYTHING, READER, Sight
from app.http.datasets_of_request import (
    AskedAbout,
    OwnedMention,
    datasets_of,
    is_hidden,
    is_known,
    require_allowed,
    takes_looking,
)
from app.http.headers import SCHEME as BEARER
from app.http.headers import bearer_of, cookie_of
from app.http.hide_existence import HIDDEN, Concealment
from app.http.problem import SCHEME, make_problem, problem_response
from app.http.rules import OPEN, RULES
from app.http.team import Team

log = structlog.get_logger("touchline.access")

API = "/api/v1"
ASKS = "touchline.asks"
"""Where a request's scope says whose it is, also where it is refused."""
LOGIN = "touchline.login"
"""Where a request's scope says who is logged in."""
RULE = "touchline.rule"
"""Where it says which row of the table has let it through."""
UNDECIDED = "Nobody is let through. It is a fault of Touchline: report it."
LOOK_SECONDS = 1.0
"""Between two looks whether whoever reads an endless answer still may."""
THREADS = 8
"""So many sessions are looked up at a time."""
ENROLLING = (
    "/session/second-factor",
    "/session/second-factor/confirm",
    "/session/passkeys",
    "/session/passkeys/begin",
    "/session/password",
)
"""What somebody may ask who needs a second factor and has none."""
STREAMS = frozenset({"GET /api/v1/events"})


def login_of(scope: Mapping[str, Any]) -> Login | None:
    """Who is logged in; None on a server that somebody runs alone."""
    found: Login | None = scope.get(LOGIN)
    return found


def actor_of(scope: Mapping[str, Any], otherwise: str) -> str:
    """What the log calls who asks, or another name where nobody has to be logged in."""
    login = login_of(scope)
    return otherwise if login is None else login.actor


def sight_of(scope: Mapping[str, Any]) -> Sight:
    """What whoever asks sees; everything on a server that somebody runs alone."""
    login = login_of(scope)
    return EVERYTHING if login is None else login.sight


def sight_of_whole(scope: Mapping[str, Any]) -> Sight:
    """The same without the datasets of which some groups are hidden from whoever asks."""
    login = login_of(scope)
    return EVERYTHING if login is None else login.sight_of_whole


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
        raise ForbiddenError("no permission is defined for this address", hint=UNDECIDED)


@dataclass(frozen=True)
class RuleRow:
    """A row of the table that a request fits, with the parameters of its address."""

    name: str
    action: Action | None
    path: Mapping[str, str]


class _Rules:
    """The table, ready to be asked: rows by method, length, third word and last word."""

    def __init__(self) -> None:
        self._fixed: dict[str, Action | None] = {}
        self._rows: dict[_Key, list[tuple[re.Pattern[str], str, Action | None]]] = {}
        for name in sorted(RULES, key=lambda name: ("elsewhere" in name, name.count("{"))):
            method, template = name.split(" ", 1)
            if "{" not in template:
                self._fixed[name] = RULES[name]
                continue
            parts = template.split("/")
            words = (_word(part) for part in (*parts[3:4], parts[-1]))
            key: _Key = (method,) if ":" in template else (method, len(parts), *words)
            found = compile_path(template)[0], name, RULES[name]
            self._rows.setdefault(key, []).append(found)

    def find(self, method: str, path: str) -> RuleRow | None:
        """Row of a request; None where there is none. Fixed addresses come first."""
        name = f"{method} {path}"
        if name in self._fixed:
            return RuleRow(name, self._fixed[name], {})
        parts = path.split("/")
        size: _Key = (method, len(parts), *parts[3:4])
        keys: tuple[_Key, ...] = ((*size, parts[-1]), (*size, ""), (method,))
        for key in keys:
            for pattern, name, action in self._rows.get(key, ()):
                if fits := pattern.match(path):
                    return RuleRow(name, action, fits.groupdict())
        return None


_Key = tuple[str | int, ...]


def _word(part: str) -> str:
    return "" if "{" in part else part


@dataclass(frozen=True)
class _Let:
    """Who asks, and where everything is that the request mentions, as far as they may know."""

    login: Login
    owned: list[OwnedMention]


class Access:
    """Lets a request through whose session or token, and role, allow it.

    Others get 401, 403, and 404 for what no row has. A token counts before a cookie.

    Args:
        app: Answers those that may.
        team: Knows sessions and tokens.
        store: Says which dataset something belongs to.
    """

    def __init__(self, app: ASGIApp, team: Team, store: Store):
        self.app, self._team, self._store = app, team, store
        self._rules = _Rules()
        self._threads = CapacityLimiter(THREADS)
        self._touching: dict[tuple[bool, int], asyncio.Task[None]] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        row = self._rules.find(scope["method"], scope["path"])
        if row is not None and row.action is OPEN:
            scope[RULE] = row.name
            await self.app(scope, receive, send)
            return
        asked = None if row is None else AskedAbout.of(row.name, scope, row.path)
        action = None if row is None else row.action
        try:
            let = await self._ask(scope, asked, action)
        except (StorageError, AccessError) as error:
            await _refuse(error, scope)(scope, receive, send)
            return
        if asked is None or action is None:
            problem = make_problem(404, "there is nothing at this address")
            await problem_response(problem)(scope, receive, send)
            return
        self._note_use(let.login)
        concealment = Concealment(asked, let.owned)
        if concealment:
            told = concealment.scope(scope)
            told[HIDDEN] = partial(is_hidden, self._store, let.owned)
            receive, send, scope = concealment.receive(receive, told), concealment.send(send), told
        scope[RULE], scope[LOGIN] = asked.route, let.login
        READER.set(let.login.reader)
        if asked.route in STREAMS:
            await self._stream(asked, action, scope, receive, send)
        else:
            await self.app(scope, receive, send)

    async def _ask(self, scope: Scope, asked: AskedAbout | None, action: Action | None) -> _Let:
        """Who that is, and what they may know of what they ask.

        Raises:
            NotLoggedInError: Nobody.
            TooManyTriesError: Nobody, with one of many tokens that are none.
            ForbiddenError: They see it, and may not do that.
        """
        if bearer_of(scope) is None and not cookie_of(scope, self._team.cookie):
            raise _nobody()
        login = self._login_at_once(scope)
        if login is None or (asked is not None and takes_looking(asked, login)):
            return await run_sync(self._look, scope, asked, action, limiter=self._threads)
        scope[ASKS] = login.actor
        return self._let(login, asked, action)

    def _look(self, scope: Scope, asked: AskedAbout | None, action: Action | None) -> _Let:
        login = self._login(scope)
        scope[ASKS] = login.actor
        return self._let(login, asked, action)

    def _login_at_once(self, scope: Scope) -> Login | None:
        """Whose session it is, where that can be said without waiting; else a thread says it.

        On a busy machine the way to a thread and back takes longer than the answer.
        """
        if bearer_of(scope) is not None:
            return None
        with suppress(StorageError):
            return self._team.logins.find(cookie_of(scope, self._team.cookie) or "", at_once=True)
        return None

    def _let(self, login: Login, asked: AskedAbout | None, action: Action | None) -> _Let:
        if asked is None or action is None:
            return _Let(login, [])
        if login.token is not None:
            require_scope(login.token.scopes, action)
        if login.must_enrol and not asked.route.endswith(ENROLLING):
            raise ForbiddenError(
                "everybody needs a second factor here, and you have none yet",
                hint="Make one under Account, before anything else.",
            )
        if action is not Action.ACCOUNT and not _is_decided(asked.route, action):
            raise ForbiddenError(
                "no rule says which datasets this address is about", hint=UNDECIDED
            )
        owned = datasets_of(self._store, asked, login)
        require_allowed(asked, owned, login, action)
        return _Let(login, owned)

    def _login(self, scope: Scope) -> Login:
        bearer = bearer_of(scope)
        if bearer is not None:
            return self._team.login_with(bearer, Request(scope))
        login = self._team.logins.find(cookie_of(scope, self._team.cookie) or "")
        if login is None:
            raise _nobody()
        return login

    def _note_use(self, login: Login) -> None:
        """Write down that a session or token is used, seldom and while nobody waits for it."""
        key = (login.token is not None, login.id)
        if key in self._touching or not self._kind(login).is_stale(login):
            return
        task = asyncio.ensure_future(self._touch(login))
        self._touching[key] = task
        task.add_done_callback(lambda _task: self._touching.pop(key, None))

    async def _touch(self, login: Login) -> None:
        try:
            await run_sync(self._kind(login).touch, login, limiter=self._threads)
        except StorageError as error:
            log.warning("the use of a session or token could not be noted", error=str(error))

    def _kind(self, login: Login) -> Logins | AccessTokens:
        return self._team.logins if login.token is None else self._team.tokens

    async def _stream(
        self,
        asked: AskedAbout,
        action: Action,
        scope: Scope,
        receive: Receive,
        send: Send,
    ) -> None:
        """An answer without an end; it ends when its reader is logged out, or has other rights.

        Whoever may read on comes back, and is told what they see from then on.
        """
        ended = asyncio.Event()
        roles = scope[LOGIN].roles

        async def look() -> None:
            # However the looking ends: nobody reads on whom nobody looks at.
            try:
                while not ended.is_set():
                    await asyncio.sleep(LOOK_SECONDS)
                    if not await self._still_may(scope, asked, action, roles):
                        return
            finally:
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

    async def _still_may(
        self, scope: Scope, asked: AskedAbout, action: Action, roles: DatasetRoles
    ) -> bool:
        """Whether somebody may go on reading, with the rights that they had when they began."""
        try:
            let = await self._ask(scope, asked, action)
        except AccessError:
            return False
        except StorageError:
            # Nobody knows; what is told is read from the same database.
            return True
        return let.login.roles == roles


def _is_decided(route: str, action: Action) -> bool:
    """Whether somebody has decided which datasets a route is about; admins' routes are about none."""
    return action is Action.ADMINISTER or is_known(route)


def _nobody() -> NotLoggedInError:
    return NotLoggedInError("you are not logged in", hint="Log in first.")


def _refuse(error: StorageError | AccessError, scope: Scope) -> Response:
    status, headers = 503, {"Retry-After": "5"}
    if isinstance(error, TooManyTriesError):
        status, headers = 429, {"Retry-After": str(error.seconds)}
    elif isinstance(error, NotLoggedInError):
        status = 401
        headers = {"WWW-Authenticate": SCHEME if bearer_of(scope) is None else BEARER}
    elif isinstance(error, AccessError):
        status, headers = 403, {}
    return problem_response(make_problem(status, error.message, hint=error.hint), headers)
