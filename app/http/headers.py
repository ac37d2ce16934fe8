"""Headers of security, and tokens in requests."""

from __future__ import annotations

import re
from collections.abc import Callable
from urllib.parse import quote

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

FIXED = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    # Not "no-referrer": with it browsers send "Origin: null" on some same-origin requests.
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


def content_security_policy(script_hashes: tuple[str, ...] = ()) -> str:
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


SCHEME = 'Bearer realm="Touchline", error="invalid_token"'
"""What a 401 says to a script whose token is not valid."""
_BEARER = "bearer"


def bearer_of(scope: Scope) -> str | None:
    """The token of a request: None without one, empty where it is not clear which one is meant.

    Another scheme than Bearer is between a browser and the proxy before us: it is not looked at. A
    page of another site cannot send this header, which is why no Origin is asked for beside it.
    """
    sent = [text.strip().partition(" ") for text in Headers(scope=scope).getlist("authorization")]
    tokens = [token.strip() for scheme, _, token in sent if scheme.lower() == _BEARER]
    if not tokens:
        return None
    return tokens[0] if len(tokens) == 1 else ""


def saved_as(name: str, how: str = "attachment") -> str:
    """The header Content-Disposition of a file, whatever letters its name has (RFC 6266)."""
    plain = re.sub(r'[^\x20-\x7e]|["\\%]', "_", name)
    exact = "" if plain == name else f"; filename*=UTF-8''{quote(name, safe='')}"
    return f'{how}; filename="{plain}"{exact}'
