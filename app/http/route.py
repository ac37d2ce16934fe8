"""A route: the way of every request from its address to the function that answers it.

Who asks, the body, whether they may, whether it was answered before, a turn, and then the function. What
of it applies to a route stands with the route: ``@may``, ``@limit``, its body, its class.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from fastapi import FastAPI, Request
from fastapi.routing import APIRoute, iter_route_contexts
from starlette.exceptions import HTTPException
from starlette.requests import Request as StarletteRequest
from starlette.responses import Response, StreamingResponse
from starlette.routing import Mount
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocketClose

from app.features.people.logins import Login
from app.http.access import AccessControl, find_actor_name
from app.http.headers import SAFE_METHODS
from app.http.idempotency import IdempotencyHandler, RequestDigest
from app.http.permissions import OwnedMention, Permission, RequestSubject, find_permission
from app.http.request_limits import RequestLimits, find_request_class
from app.http.requests import (
    BYTES,
    MAX_STRANGERS_BYTES,
    BodyError,
    read_body,
    read_json,
    require_bytes_type,
    require_json_type,
)
from app.soccer.actors import LOCAL_USER

Handler = Callable[[Request], Coroutine[Any, Any, Response]]


@dataclass(frozen=True)
class RequestPipeline:
    """What the requests of one server share on their way.

    Attributes:
        access: Who asks; None on a server that somebody runs alone.
        idempotency: What was answered before.
        limits: Who is at work, and who waits.
        max_json_bytes: Of a body.
    """

    access: AccessControl | None
    idempotency: IdempotencyHandler
    limits: RequestLimits
    max_json_bytes: int


def get_request_pipeline(scope: Scope) -> RequestPipeline:
    """That of the application that a request came to."""
    gate: RequestPipeline = scope["app"].state.gate
    return gate


class Route(APIRoute):
    """A route that says who may ask it; raises TypeError where it does not.

    Its operation id is the name of its function in camel case, unless it is given another one.
    """

    stores_response = True
    """Whether its response is stored for a repetition under the same key."""
    permission: Permission

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any):
        permission = find_permission(endpoint)
        if permission is None:
            raise TypeError(
                f"the route {path} has no permission: add @may or @open_to_all to its function"
            )
        self.permission = permission
        self.request_class = find_request_class(endpoint, options.get("methods") or ("GET",))
        content = (options.get("openapi_extra") or {}).get("requestBody", {}).get("content", {})
        self._takes_bytes = BYTES in content
        options["operation_id"] = options.get("operation_id") or _camel_case(endpoint.__name__)
        super().__init__(path, endpoint, **options)

    def get_route_handler(self) -> Handler:
        """What answers a request, all told."""
        return partial(self._answer_request, super().get_route_handler())

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer; a method that is not answered here is nothing that a stranger is told."""
        if self.methods and scope["method"] not in self.methods:
            await require_logged_in(scope)
        await super().handle(scope, receive, send)

    async def _answer_request(self, handler: Handler, request: Request) -> Response:
        gate, access, login = get_request_pipeline(request.scope), None, None
        if self.permission.action is not None and (access := gate.access) is not None:
            login = await access.authenticate(request.scope)
        try:
            body = ReadBody()
            if request.method not in SAFE_METHODS:
                body = await self._read_request_body(gate, request)
            if access is None or login is None:
                return await self._answer_once_per_key(gate, request, body, handler)
            return await self._answer_logged_in(access, login, gate, request, body, handler)
        except BodyError as error:
            return error.response()

    async def _answer_logged_in(
        self,
        access: AccessControl,
        login: Login,
        gate: RequestPipeline,
        request: Request,
        body: ReadBody,
        handler: Handler,
    ) -> Response:
        """The answer to somebody, if they may have it."""
        scope = request.scope
        asked = RequestSubject.of(
            self.permission,
            request.path_params,
            scope["query_string"].decode("latin-1"),
            body.value,
        )
        owned = await access.authorize(asked, login)
        access.attach_login(scope, login)
        _replace_names_by_ids(scope, owned)

        async def answer_if_existing(request: Request) -> Response:
            await access.require_all_found(owned)
            return await handler(request)

        hidden = partial(access.is_any_hidden, owned)
        response = await self._answer_once_per_key(gate, request, body, answer_if_existing, hidden)
        if isinstance(response, StreamingResponse) and response.media_type == "text/event-stream":
            return access.end_stream_when_not_allowed(response, asked, login)
        return response

    async def _answer_once_per_key(
        self,
        gate: RequestPipeline,
        request: Request,
        body: ReadBody,
        handler: Handler,
        hidden: Callable[[], Coroutine[Any, Any, bool]] | None = None,
    ) -> Response:
        """The answer that was given before, else a new one."""
        if request.method in SAFE_METHODS or not self.stores_response:
            return await self._answer_within_limits(
                gate, RequestWithReadBody(request, body), handler
            )
        digest = RequestDigest(
            request, body.value, has_value=body.has_value, is_streamed=self._takes_bytes
        )
        read = RequestWithReadBody(request, body, digest.receive if self._takes_bytes else None)
        return await gate.idempotency.answer_once(
            request,
            digest,
            find_actor_name(request.scope, LOCAL_USER),
            hidden or _return_not_hidden,
            partial(self._answer_within_limits, gate, read, handler),
        )

    async def _read_request_body(self, gate: RequestPipeline, request: Request) -> ReadBody:
        """The body of a request that may change something.

        Raises:
            BodyError: It cannot be used.
        """
        types = request.headers.getlist("content-type")
        if self._takes_bytes:
            require_bytes_type(types)
            return ReadBody()
        most = gate.max_json_bytes
        if self.permission.action is None:
            most = min(most, MAX_STRANGERS_BYTES)
        sent = await read_body(request.headers, request.receive, most)
        if not sent:
            return ReadBody(sent)
        require_json_type(types)
        return ReadBody(sent, read_json(sent), has_value=True)

    async def _answer_within_limits(
        self, gate: RequestPipeline, request: Request, handler: Handler
    ) -> Response:
        async with gate.limits.admit(self.request_class, request.scope) as refusal:
            return refusal or await handler(request)


class UnstoredResponseRoute(Route):
    """A route that shows a secret, or ends one: what it answers is stored nowhere."""

    stores_response = False


@dataclass(frozen=True)
class ReadBody:
    """What a request brings: its bytes, None where they are not read here, and their JSON value."""

    sent: bytes | None = None
    value: Any = None
    has_value: bool = False


class RequestWithReadBody(StarletteRequest):
    """A request whose body has been read, or is read by ``receive`` as it passes."""

    def __init__(self, request: Request, body: ReadBody, receive: Receive | None = None):
        super().__init__(request.scope, receive or request.receive)
        if body.sent is not None:
            self._body = body.sent
        if body.has_value:
            self._json = body.value


async def require_logged_in(scope: Scope) -> None:
    """Raise NotLoggedInError where a stranger asks a server of a team."""
    access = get_request_pipeline(scope).access
    if access is not None:
        await access.authenticate(scope)


async def respond_to_unknown_route(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer where there is no route: that is nothing that a stranger is told.

    Raises:
        NotLoggedInError: A stranger asks a server of a team.
        HTTPException: There is nothing at that address.
    """
    if scope["type"] == "http":
        await require_logged_in(scope)
        raise HTTPException(status_code=404)
    await WebSocketClose()(scope, receive, send)


def require_permissions(app: FastAPI) -> None:
    """Raise TypeError where a route of an application is none that says who may ask it.

    Folders of files are mounted for everybody: those of the browser application, and no others.
    """
    for context in iter_route_contexts(app.routes):
        route = context.original_route
        is_file = isinstance(route, Mount) and route.name in ("assets", "static")
        if not (is_file or isinstance(route, Route)):
            raise TypeError(
                f"the route {context.path} must be made by a router with route_class=Route"
            )


def list_routes(app: FastAPI) -> Iterator[tuple[str, Route]]:
    """Every route of an application, by its methods and its address."""
    for context in iter_route_contexts(app.routes):
        if isinstance(context.original_route, Route):
            for method in sorted((context.methods or set()) - {"HEAD"}):
                yield f"{method} {context.path}", context.original_route


def _camel_case(name: str) -> str:
    """``list_saved_views`` as ``listSavedViews``."""
    first, *others = name.split("_")
    return first + "".join(map(str.capitalize, others))


async def _return_not_hidden() -> bool:
    return False


def _replace_names_by_ids(scope: Scope, owned: list[OwnedMention]) -> None:
    """Ask by its id for what has a name that several have, of which its reader sees one."""
    called = {
        item.mention.field: item.ownership.called
        for item in owned
        if item.mention.place == "path" and item.ownership is not None and item.ownership.called
    }
    if called:
        scope["path_params"] = {**scope["path_params"], **called}
