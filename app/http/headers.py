"""Headers: those of security, Host and Origin of requests, and bearer tokens."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from urllib.parse import quote

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.problem import make_problem, problem_response

FIXED = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    # Not "no-referrer": with it browsers send "Origin: null" on some same-origin requests.
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


SCHEME = 'Bearer realm="Touchline", error="invalid_token"'
"""What a 401 says to a script whose token is not valid."""
_BEARER = "bearer"


SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
_HOST = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(?::([0-9]{1,5}))?")
_ORIGIN = re.compile(r"(https?)://([^/?#@\\\s]+)")


def make_content_security_policy(script_hashes: tuple[str, ...] = ()) -> str:
    """The Content-Security-Policy; the hashes admit inline scripts, which is the import map."""
    scripts = " ".join(["'self'", *(f"'{digest}'" for digest in script_hashes)])
    return "; ".join(
        [
            "default-src 'self'",
            "img-src 'self' blob: data:",
            f"script-src {scripts}",
            "object-src 'none'",
            "base-uri 'none'",
            "form-action 'self'",
            "frame-ancestors 'none'",
        ]
    )


class SecurityHeaders:
    """Adds the headers to every response; what a route did not mark as cacheable is not stored.

    Args:
        policy: Gives the Content-Security-Policy of this moment.
    """

    def __init__(self, app: ASGIApp, policy: Callable[[], str]):
        self.app = app
        self.policy = policy

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update({**FIXED, "Content-Security-Policy": self.policy()})
                headers.setdefault("Cache-Control", "no-store")
            await send(message)

        await self.app(scope, receive, send_with_headers)


def read_bearer_token(scope: Scope) -> str | None:
    """The token of a request: None without one, empty where it is not clear which one is meant.

    Another scheme than Bearer is between a browser and the proxy before us: it is not looked at. A
    page of another site cannot send this header, which is why no Origin is asked for beside it.
    """
    sent = [text.strip().partition(" ") for text in Headers(scope=scope).getlist("authorization")]
    tokens = [token.strip() for scheme, _, token in sent if scheme.lower() == _BEARER]
    if not tokens:
        return None
    return tokens[0] if len(tokens) == 1 else ""


def make_content_disposition(name: str, how: str = "attachment") -> str:
    """The header Content-Disposition of a file, whatever letters its name has (RFC 6266)."""
    plain = re.sub(r'[^\x20-\x7e]|["\\%]', "_", name)
    exact = "" if plain == name else f"; filename*=UTF-8''{quote(name, safe='')}"
    return f'{how}; filename="{plain}"{exact}'


def parse_host_name(host: str) -> str:
    """The name in a Host header, without the port, in lower case; brackets of IPv6 stay.

    Empty where it is no host with a port from 1 to 65535 or without one (RFC 9110, 7.2).
    """
    found = _HOST.fullmatch(host.lower())
    if found is None or (found[2] is not None and not 1 <= int(found[2]) <= 65535):
        return ""
    return found[1]


def is_same_origin(origin: str, host: str, scheme: str) -> bool:
    """Whether an Origin header names the very scheme, host and port that the request was sent to."""
    match = _ORIGIN.fullmatch(origin.lower())
    if match is None or match[1] != scheme:
        return False
    return _add_default_port(match[2], scheme) == _add_default_port(host, scheme)


def _add_default_port(host: str, scheme: str) -> str:
    default = {"http": ":80", "https": ":443"}[scheme]
    host = host.strip().lower()
    return host if host.rpartition(":")[2].isdigit() and not host.endswith("]") else host + default


def _remove_default_port(url: str) -> str:
    """An address as browsers write it in Origin: without ``:443`` of https and ``:80`` of http."""
    scheme, _, host = url.partition("://")
    default = {"http": ":80", "https": ":443"}.get(scheme, "")
    return f"{scheme}://{host.removesuffix(default) if default else host}"


class HostNameGuard:
    """Refuses a request for another host name than this server's: DNS rebinding reaches nothing."""

    def __init__(self, app: ASGIApp, allowed: Iterable[str]):
        self.app = app
        self.allowed = frozenset(name.lower() for name in allowed)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            hosts = Headers(scope=scope).getlist("host")
            if len(hosts) != 1 or parse_host_name(hosts[0]) not in self.allowed:
                problem = make_problem(
                    400,
                    "the Host of this request is not a name of this server",
                    hint="The operator lists the names of the server in TOUCHLINE_ALLOWED_HOSTS.",
                )
                await problem_response(problem)(scope, receive, send)
                return
        await self.app(scope, receive, send)


class SameOriginGuard:
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
        self.url, self.required = url and _remove_default_port(url.lower()), required
        self._name = "" if self.url is None else parse_host_name(self.url.partition("://")[2])

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
        if self.required and not origins and read_bearer_token(scope) is None:
            return False
        if self._name and parse_host_name(host) == self._name:
            return all(origin.lower() == self.url for origin in origins)
        return all(
            is_same_origin(origin, host, scheme) or origin.lower() == self.url for origin in origins
        )
