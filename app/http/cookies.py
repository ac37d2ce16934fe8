"""The cookies of the server: of a session, of a passkey, of single sign-on, of a known browser."""

from __future__ import annotations

import re
from http.cookies import CookieError, SimpleCookie
from typing import Any

from starlette.datastructures import Headers
from starlette.types import Scope

SESSION = "touchline_session"
"""The session of a person who is logged in."""
PASSKEY = "touchline_passkey"
"""The browser that was asked to sign with a passkey."""
SIGN_ON = "touchline_sign_on"
"""The browser that was sent to the provider of single sign-on."""
DEVICE = "touchline_device"
"""A browser in which somebody has logged in before."""


def read_cookie(scope: Scope, name: str) -> str | None:
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


def cookie_name(name: str, secure: bool) -> str:
    """The name in full. Over TLS it has a prefix with which browsers refuse cookies of other names."""
    return f"__Host-{name}" if secure else name


def cookie_values(name: str, value: str, seconds: int, secure: bool) -> dict[str, Any]:
    """Arguments of ``Response.set_cookie``: scripts cannot read it, other sites cannot send it.

    Args:
        name: One of the names above.
        value: What the browser keeps; empty where it forgets the cookie.
        seconds: How long; 0 deletes it.
        secure: Whether people come by TLS.
    """
    full = {"key": cookie_name(name, secure), "value": value, "path": "/", "httponly": True}
    return {**full, "samesite": "strict", "secure": secure, "max_age": seconds}
