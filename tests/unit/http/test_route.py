"""The way of a request to its route: who asks, its body, whether they may."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from fastapi import APIRouter, FastAPI, Request

from app.errors import ForbiddenError, NotLoggedInError
from app.http.errors import install_error_handlers
from app.http.permissions import Action, OwnedKind, RoleScope, may, open_to_all
from app.http.request_limits import RequestLimits
from app.http.requests import MAX_STRANGERS_BYTES
from app.http.route import (
    RequestPipeline,
    Route,
    list_routes,
    require_permissions,
    respond_to_unknown_route,
)

JSON = [(b"content-type", b"application/json")]
BYTES = {"requestBody": {"content": {"application/octet-stream": {}}}}


class Nobody:
    """A team that nobody has logged in to."""

    async def authenticate(self, scope: Any) -> Any:
        raise NotLoggedInError("nobody is logged in here")


class Somebody:
    """A team whose only member may do nothing."""

    async def authenticate(self, scope: Any) -> Any:
        return object()

    async def authorize(self, asked: Any, login: Any) -> Any:
        names = [mention.named.by for mention in asked.mentions]
        raise ForbiddenError(f"not that of {names}")


class Exchange:
    """One request to an application of a few routes, chunk by chunk."""

    def __init__(
        self,
        chunks: list[bytes],
        headers: list[tuple[bytes, bytes]],
        method: str,
        path: str = "/changes/1",
    ):
        self.chunks, self.taken = chunks, 0
        self.reached: bytes | list[bytes] | None = None
        self.status, self.answer = 0, b""
        self.scope = {"type": "http", "method": method, "headers": headers, "path": path}
        self.scope |= {"query_string": b"dataset=7", "scheme": "http", "server": ("x", 80)}

    async def receive(self) -> dict[str, Any]:
        chunk = self.chunks[self.taken]
        self.taken += 1
        more = self.taken < len(self.chunks)
        return {"type": "http.request", "body": chunk, "more_body": more}

    async def send(self, message: dict[str, Any]) -> None:
        self.status = message.get("status", self.status)
        self.answer += message.get("body", b"")

    def app(self, most: int, access: Any) -> FastAPI:
        made = FastAPI(openapi_url=None)
        made.router.route_class, made.router.default = Route, respond_to_unknown_route
        keyless: Any = KeyLess()
        made.state.gate = RequestPipeline(access, keyless, RequestLimits(), most)
        install_error_handlers(made)

        async def read(request: Request) -> None:
            self.reached = await request.body()

        async def stream(request: Request) -> None:
            self.reached = [chunk async for chunk in request.stream() if chunk]

        names = {"change": OwnedKind.GROUP, "dataset": OwnedKind.GROUP}
        changes = may(Action.ANNOTATE, body={"a": OwnedKind.VIEW}, **names)
        for methods in (["POST"], ["PATCH"]):
            made.add_api_route(
                "/changes/{change}", changes(_copy(read)), methods=methods, status_code=204
            )
        made.add_api_route("/open", open_to_all(_copy(read)), methods=["POST"], status_code=204)
        made.add_api_route(
            "/up",
            may(Action.LEAD, where=RoleScope.SOMEWHERE)(stream),
            methods=["POST"],
            status_code=204,
            openapi_extra=BYTES,
        )
        return made

    def run(self, most: int = 100, access: Any = None) -> Exchange:
        asyncio.run(self.app(most, access)(self.scope, self.receive, self.send))
        return self


class KeyLess:
    """Repetitions, of requests that have no key."""

    async def answer_once(
        self, request: Any, digest: Any, actor: str, hidden: Any, work: Any
    ) -> Any:
        return await work()


def _copy(read: Any) -> Any:
    async def endpoint(request: Request) -> None:
        await read(request)

    return endpoint


class TestBody:
    def test_arrives_whole(self) -> None:
        done = Exchange([b'{"a"', b": 1}"], JSON, "PATCH").run()
        assert (done.status, done.reached) == (204, b'{"a": 1}')

    def test_of_the_very_cap_passes_and_one_byte_more_does_not(self) -> None:
        assert Exchange([b'"' + b"a" * 8 + b'"'], JSON, "POST").run(10).status == 204
        assert Exchange([b'"' + b"a" * 9 + b'"'], JSON, "POST").run(10).status == 413

    def test_of_an_honest_length_is_refused_before_a_byte_is_read(self) -> None:
        headers = [*JSON, (b"content-length", b"11")]
        done = Exchange([b"a" * 11], headers, "POST").run(10)
        assert (done.status, done.taken) == (413, 0)

    def test_in_chunks_is_cut_off_at_the_cap(self) -> None:
        done = Exchange([b"a" * 4] * 1000, JSON, "POST").run(10)
        assert (done.status, done.taken) == (413, 3)

    @pytest.mark.parametrize(("path", "status"), [("/open", 413), ("/changes/1", 204)])
    def test_who_is_not_known_yet_brings_less(self, path: str, status: int) -> None:
        body = b'"' + b"a" * MAX_STRANGERS_BYTES + b'"'
        asked = Exchange([body], JSON, "POST", path)
        assert asked.run(2 * MAX_STRANGERS_BYTES).status == status
        asked = Exchange([body[:-3] + b'"'], JSON, "POST", path)
        assert asked.run(2 * MAX_STRANGERS_BYTES).status == 204

    @pytest.mark.parametrize(
        ("length", "status"), [(b"-1", 400), (b"1e9", 400), (b"\xb2", 400), (b"9" * 30, 413)]
    )
    def test_of_a_length_that_no_body_has_is_refused(self, length: bytes, status: int) -> None:
        headers = [*JSON, (b"content-length", length)]
        assert Exchange([b"1"], headers, "POST").run(10).status == status

    def test_that_is_not_there_needs_no_type(self) -> None:
        assert Exchange([b""], [], "POST").run(10).status == 204

    @pytest.mark.parametrize("kind", [b"application/json", b"Application/JSON; charset=UTF-8"])
    def test_of_json_in_utf_8_arrives(self, kind: bytes) -> None:
        done = Exchange([b'"\xc3\xa4"'], [(b"content-type", kind)], "POST").run(10)
        assert (done.status, done.reached) == (204, b'"\xc3\xa4"')

    def test_of_another_type_never_arrives(self) -> None:
        done = Exchange([b"a=1"], [(b"content-type", b"text/plain")], "POST").run(10)
        assert (done.status, done.reached) == (415, None)

    def test_of_bytes_passes_as_it_comes_on_the_route_that_takes_them(self) -> None:
        def ask(path: str, kind: bytes) -> Exchange:
            return Exchange([b"\0{no", b"more"], [(b"content-type", kind)], "POST", path).run()

        assert ask("/up", b"application/octet-stream").reached == [b"\0{no", b"more"]
        assert ask("/up", b"application/json").status == 415
        assert ask("/up", b"application/octet-stream; charset=x").status == 415
        assert ask("/changes/1", b"application/octet-stream").status == 415


class TestWhoAsks:
    @pytest.mark.parametrize("path", ["/changes/1", "/up", "/nothing"])
    def test_a_stranger_is_refused_before_a_byte_is_read(self, path: str) -> None:
        done = Exchange([b"{}"], JSON, "POST", path).run(access=Nobody())
        assert (done.status, done.taken, done.reached) == (401, 0, None)
        other = Exchange([b"{}"], JSON, "PUT", path).run(access=Nobody())
        assert (other.status, other.taken) == (401, 0)

    def test_a_stranger_may_ask_what_is_open(self) -> None:
        assert Exchange([b"{}"], JSON, "POST", "/open").run(access=Nobody()).status == 204

    def test_all_that_a_request_names_is_looked_at(self) -> None:
        done = Exchange([b'{"a": 3}'], JSON, "POST").run(access=Somebody())
        assert (done.status, done.reached) == (403, None)
        assert b"not that of [1, 7, 3]" in done.answer


class TestPermissions:
    def test_a_route_that_does_not_say_who_may_ask_it_is_not_made(self) -> None:
        app = FastAPI(openapi_url=None)
        app.router.route_class = Route
        with pytest.raises(TypeError, match="has no permission: add @may"):
            app.add_api_route("/hidden", lambda: {"secret": 1})
        with pytest.raises(TypeError, match="a permission needs a resource that the route names"):
            may(Action.READ)

    def test_an_application_has_no_other_routes(self) -> None:
        router = APIRouter()
        router.add_api_route("/hidden", open_to_all(lambda: {"secret": 1}))
        plain = FastAPI(openapi_url=None)
        require_permissions(plain)
        plain.include_router(router)
        with pytest.raises(TypeError, match="route_class=Route"):
            require_permissions(plain)
        mounted = FastAPI(openapi_url=None)
        mounted.mount("/hidden", plain, name="hidden")
        with pytest.raises(TypeError, match="route_class=Route"):
            require_permissions(mounted)

    def test_every_route_of_the_application_is_known_by_its_address(self, app: FastAPI) -> None:
        routes = dict(list_routes(app))
        assert len(routes) > 200
        ball = routes["PATCH /api/v1/views/{view}/ball"].permission
        assert (ball.action, dict(ball.names)) == (Action.ANNOTATE, {"view": OwnedKind.VIEW})
