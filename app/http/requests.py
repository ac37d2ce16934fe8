"""Requests brought into the one form that the routes expect: one length, one Range, HEAD as GET."""

from __future__ import annotations

import re

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.problem import make_problem, problem_response

_HEAD = "touchline.head"
_ONE_RANGE = re.compile(rb"bytes=(\d{1,18}-\d{0,18}|-\d{1,18})")


class HeadAsGet:
    """Answers HEAD wherever GET is answered, with the same headers and no body."""

    def __init__(self, app: ASGIApp):
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return

        async def send_without_body(message: Message) -> None:
            if message["type"] == "http.response.body":
                message = {**message, "body": b""}
            await send(message)

        await self.app({**scope, "method": "GET", _HEAD: True}, receive, send_without_body)


def is_head(scope: Scope) -> bool:
    """Whether a request that looks like GET was HEAD: what has no end must end at once."""
    return bool(scope.get(_HEAD))


class OneLength:
    """Refuses a request that says twice how long it is: proxies differ in whom they believe."""

    def __init__(self, app: ASGIApp):
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        names = {name for name, _ in scope["headers"]} if scope["type"] == "http" else set()
        if {b"content-length", b"transfer-encoding"} <= names:
            problem = make_problem(400, "Content-Length and Transfer-Encoding exclude each other")
            await problem_response(problem, {"Connection": "close"})(scope, receive, send)
            return
        await self.app(scope, receive, send)


def _is_one_range(value: bytes) -> bool:
    """Whether a Range names one part that ends where it begins, or later."""
    found = _ONE_RANGE.fullmatch(value)
    if found is None:
        return False
    first, _, last = found[1].partition(b"-")
    return not first or not last or int(first) <= int(last)


class OneRange:
    """Lets one Range through; many small ones would cost more than the whole file."""

    def __init__(self, app: ASGIApp):
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or "range" not in Headers(scope=scope):
            await self.app(scope, receive, send)
            return
        ranges = [value for name, value in scope["headers"] if name == b"range"]
        if len(ranges) != 1 or not _is_one_range(ranges[0]):
            rest = [(name, value) for name, value in scope["headers"] if name != b"range"]
            await self.app({**scope, "headers": rest}, receive, send)
            return
        refused = False

        async def send_or_refuse(message: Message) -> None:
            nonlocal refused
            if message["type"] == "http.response.start" and message["status"] == 416:
                refused = True
                size = Headers(raw=message["headers"]).get("content-range", "bytes */*")
                problem = make_problem(416, "the file ends before that range begins")
                await problem_response(problem, {"Content-Range": size})(scope, receive, send)
            elif not refused:
                await send(message)

        await self.app(scope, receive, send_or_refuse)
