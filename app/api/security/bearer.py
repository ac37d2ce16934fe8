"""Bearer: the token that a script sends instead of a cookie."""

from __future__ import annotations

from starlette.datastructures import Headers
from starlette.types import Scope

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
