"""The cookie of a request."""

from __future__ import annotations

import re
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers
from starlette.types import Scope


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
