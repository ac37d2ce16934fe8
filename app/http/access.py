"""Access: on a server of a team, who asks, and whether they may ask what a route gives.

Routes say who may ask them (``http/permissions.py``); here it is found out who that is.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import structlog
from anyio import CapacityLimiter
from anyio.to_thread import run_sync
from fastapi import Request
from starlette.responses import Response
from starlette.types import Message, Receive, Scope, Send

from app.db.store import Store
from app.errors import AccessError, ForbiddenError, NotLoggedInError, StorageError
from app.features.people.access_tokens import AccessTokens
from app.features.people.logins import Login, LoginSessions
from app.features.people.roles import DatasetRoles, require_scope
from app.features.people.visibility_queries import EVERYTHING, READER, Visibility
from app.http.headers import read_bearer_token
from app.http.permissions import (
    OwnedMention,
    RequestSubject,
    find_missing_error,
    is_any_mention_hidden,
    needs_database,
    require_allowed,
)
from app.http.team import TeamLogin

log = structlog.get_logger("touchline.access")

ASKS = "touchline.asks"
"""Where a request's scope says whose it is, also where it is refused."""
LOGIN = "touchline.login"
"""Where a request's scope says who is logged in."""
LOOK_SECONDS = 1.0
"""Between two looks whether whoever reads an endless answer still may."""
THREADS = 8
"""So many sessions are looked up at a time."""


def get_current_login(scope: Mapping[str, Any]) -> Login | None:
    """The login of the request; None on a server without accounts."""
    found: Login | None = scope.get(LOGIN)
    return found


def find_actor_name(scope: Mapping[str, Any], otherwise: str) -> str:
    """What the log calls who asks, or another name where nobody has to be logged in."""
    login = get_current_login(scope)
    return otherwise if login is None else login.actor


def get_current_visibility(scope: Mapping[str, Any]) -> Visibility:
    """What whoever asks sees; everything on a server that somebody runs alone."""
    login = get_current_login(scope)
    return EVERYTHING if login is None else login.visibility


def get_current_visibility_of_whole_datasets(scope: Mapping[str, Any]) -> Visibility:
    """The same without the datasets of which some groups are hidden from whoever asks."""
    login = get_current_login(scope)
    return EVERYTHING if login is None else login.visibility_without_hidden_groups


class AccessControl:
    """Finds out who asks, by session or token, and whether they may. A token counts before a cookie.

    Args:
        team: Knows sessions and tokens.
        store: Says which dataset something belongs to.
    """

    def __init__(self, team: TeamLogin, store: Store):
        self._team, self._store = team, store
        self._threads = CapacityLimiter(THREADS)
        self._touching: dict[tuple[bool, int], asyncio.Task[None]] = {}

    async def authenticate(self, scope: Scope) -> Login:
        """Whose request it is.

        Raises:
            NotLoggedInError: Nobody's.
            TooManyTriesError: Nobody's, with one of many tokens that are none.
        """
        if read_bearer_token(scope) is None and not self._team.cookies.read_session_token(scope):
            raise _not_logged_in_error()
        login = self._find_login_without_waiting(scope)
        if login is None:
            login = await run_sync(self._find_login, scope, limiter=self._threads)
        scope[ASKS] = login.actor
        return login

    async def authorize(self, subject: RequestSubject, login: Login) -> list[OwnedMention]:
        """Where everything is that a request names, as far as its reader may know.

        Raises:
            ForbiddenError: They see it, and may not do that.
        """
        action = subject.permission.action
        if login.token is not None and action is not None:
            require_scope(login.token.scopes, action)
        if login.must_enrol and not subject.permission.to_enrol:
            raise ForbiddenError(
                "this server requires a second factor, and you have none yet",
                hint="Set one up on the page Account first.",
            )
        if not needs_database(subject, login):
            return require_allowed(self._store, subject, login)
        return await run_sync(require_allowed, self._store, subject, login, limiter=self._threads)

    async def require_all_found(self, owned: list[OwnedMention]) -> None:
        """Raise NotFoundError where something is not there, or not for whoever asks."""
        if any(item.ownership is None for item in owned):
            error = await run_sync(find_missing_error, self._store, owned, limiter=self._threads)
            if error is not None:
                raise error

    async def is_any_hidden(self, owned: list[OwnedMention]) -> bool:
        """Whether anything is there that is not for whoever asks."""
        if all(item.ownership is not None for item in owned):
            return False
        return await run_sync(is_any_mention_hidden, self._store, owned, limiter=self._threads)

    def attach_login(self, scope: Scope, login: Login) -> None:
        """Let a request be its sender's from here on."""
        scope[LOGIN] = login
        READER.set(login.restricted_reader)
        self._record_use_later(login)

    def end_stream_when_not_allowed(
        self, response: Response, subject: RequestSubject, login: Login
    ) -> Response:
        """An answer without an end, which ends when its reader is logged out, or has other rights."""
        return _PermissionBoundStream(response, self, subject, login.roles)

    async def is_still_allowed(
        self, scope: Scope, subject: RequestSubject, roles: DatasetRoles
    ) -> bool:
        """Whether somebody may go on reading, with the rights that they had when they began."""
        try:
            login = await self.authenticate(scope)
            await self.authorize(subject, login)
        except AccessError:
            return False
        except StorageError:
            # Nobody knows; what is told is read from the same database.
            return True
        return login.roles == roles

    def _find_login_without_waiting(self, scope: Scope) -> Login | None:
        """Whose session it is, where that can be said without waiting; else a thread says it.

        On a busy machine the way to a thread and back takes longer than the answer.
        """
        if read_bearer_token(scope) is not None:
            return None
        with suppress(StorageError):
            return self._team.logins.find(
                self._team.cookies.read_session_token(scope) or "", at_once=True
            )
        return None

    def _find_login(self, scope: Scope) -> Login:
        bearer = read_bearer_token(scope)
        if bearer is not None:
            return self._team.find_login_by_token(bearer, Request(scope))
        login = self._team.logins.find(self._team.cookies.read_session_token(scope) or "")
        if login is None:
            raise _not_logged_in_error()
        return login

    def _record_use_later(self, login: Login) -> None:
        """Write down that a session or token is used, seldom and while nobody waits for it."""
        key = (login.token is not None, login.id)
        if key in self._touching or not self._get_login_store(login).should_log_use(login):
            return
        task = asyncio.ensure_future(self._save_use(login))
        self._touching[key] = task
        task.add_done_callback(lambda _task: self._touching.pop(key, None))

    async def _save_use(self, login: Login) -> None:
        try:
            await run_sync(self._get_login_store(login).touch, login, limiter=self._threads)
        except StorageError as error:
            log.warning("the use of a session or token could not be noted", error=str(error))

    def _get_login_store(self, login: Login) -> LoginSessions | AccessTokens:
        return self._team.logins if login.token is None else self._team.tokens


class _PermissionBoundStream(Response):
    """A stream for as long as its reader may; whoever may read on comes back, and is told what they
    see from then on."""

    def __init__(
        self, inner: Response, access: AccessControl, subject: RequestSubject, roles: DatasetRoles
    ):
        self._inner, self._access, self._asked, self._roles = inner, access, subject, roles
        self.status_code, self.background = inner.status_code, inner.background

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        ended = asyncio.Event()

        async def watch_permission() -> None:
            # However the looking ends: nobody reads on whom nobody looks at.
            try:
                while not ended.is_set():
                    await asyncio.sleep(LOOK_SECONDS)
                    if not await self._access.is_still_allowed(scope, self._asked, self._roles):
                        return
            finally:
                ended.set()

        async def receive_until_ended() -> Message:
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

        async def send_until_ended(message: Message) -> None:
            nonlocal begun, over
            if ended.is_set():
                return
            begun = begun or message["type"] == "http.response.start"
            over = message["type"] == "http.response.body" and not message.get("more_body", False)
            await send(message)

        looking = asyncio.ensure_future(watch_permission())
        try:
            await self._inner(scope, receive_until_ended, send_until_ended)
        finally:
            looking.cancel()
        if begun and not over:
            await send({"type": "http.response.body", "body": b"", "more_body": False})


def _not_logged_in_error() -> NotLoggedInError:
    return NotLoggedInError("you are not logged in", hint="Log in first.")
