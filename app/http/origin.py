"""Whom the server listens to: the Host that was meant, and the Origin that sent the request."""

from __future__ import annotations

import re
from collections.abc import Iterable

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from app.http.headers import bearer_of
from app.http.problem import make_problem, problem_response

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
_HOST = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(?::([0-9]{1,5}))?")
_ORIGIN = re.compile(r"(https?)://([^/?#@\\\s]+)")


def host_name(host: str) -> str:
    """The name in a Host header, without the port, in lower case; brackets of IPv6 stay.

    Empty where it is no host with a port from 1 to 65535 or without one (RFC 9110, 7.2).
    """
    found = _HOST.fullmatch(host.lower())
    if found is None or (found[2] is not None and not 1 <= int(found[2]) <= 65535):
        return ""
    return found[1]


def same_origin(origin: str, host: str, scheme: str) -> bool:
    """Whether an Origin header names the very scheme, host and port that the request was sent to."""
    match = _ORIGIN.fullmatch(origin.lower())
    if match is None or match[1] != scheme:
        return False
    return _with_port(match[2], scheme) == _with_port(host, scheme)


def _with_port(host: str, scheme: str) -> str:
    default = {"http": ":80", "https": ":443"}[scheme]
    host = host.strip().lower()
    return host if host.rpartition(":")[2].isdigit() and not host.endswith("]") else host + default


def _without_default_port(url: str) -> str:
    """An address as browsers write it in Origin: without ``:443`` of https and ``:80`` of http."""
    scheme, _, host = url.partition("://")
    default = {"http": ":80", "https": ":443"}.get(scheme, "")
    return f"{scheme}://{host.removesuffix(default) if default else host}"


class KnownHosts:
    """Refuses a request for another host name than this server's: DNS rebinding reaches nothing."""

    def __init__(self, app: ASGIApp, allowed: Iterable[str]):
        self.app = app
        self.allowed = frozenset(name.lower() for name in allowed)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            hosts = Headers(scope=scope).getlist("host")
            if len(hosts) != 1 or host_name(hosts[0]) not in self.allowed:
                problem = make_problem(
                    400,
                    "this server does not answer to that Host",
                    hint="TOUCHLINE_ALLOWED_HOSTS lists the names it answers to.",
                )
                await problem_response(problem)(scope, receive, send)
                return
        await self.app(scope, receive, send)


class SameOrigin:
    """Refuses a request that changes something and comes from another site's page.

    Args:
        app: Answers the others.
        url: The address that people open, where a proxy stands in front: under its name a change
            comes from this very address, with its scheme and port.
        required: A change must say where it comes from, as browsers always do; one that brings a
            token instead of a cookie need not.
    """

    def __init__(self, app: ASGIApp, url: str | None = None, *, required: bool = False):
        self.app = app
        self.url, self.required = url and _without_default_port(url.lower()), required
        self._name = "" if self.url is None else host_name(self.url.partition("://")[2])

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and not self._is_same_origin(scope):
            problem = make_problem(403, "requests from pages of another site are refused")
            await problem_response(problem)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    def _is_same_origin(self, scope: Scope) -> bool:
        if scope["method"] in SAFE_METHODS:
            return True
        headers, scheme = Headers(scope=scope), scope.get("scheme", "http")
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            return False
        host = headers.get("host", "")
        origins = headers.getlist("origin")
        if self.required and not origins and bearer_of(scope) is None:
            return False
        if self._name and host_name(host) == self._name:
            return all(origin.lower() == self.url for origin in origins)
        return all(
            same_origin(origin, host, scheme) or origin.lower() == self.url for origin in origins
        )
