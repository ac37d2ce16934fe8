"""Cookies of a team's server: of the session, of passkeys, of known browsers and of single sign-on."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import timedelta
from http.cookies import CookieError, SimpleCookie
from typing import Any

from starlette.datastructures import Headers
from starlette.types import Scope

from app.features.people.devices import CHALLENGE_LASTS, DeviceTokens
from app.features.people.devices import LASTS as DEVICE_LASTS
from app.features.people.logins import LASTS as SESSION_LASTS
from app.features.people.sign_on import LASTS as SIGN_ON_LASTS

SESSION = "touchline_session"
"""The session of a person who is logged in."""
PASSKEY = "touchline_passkey"
"""The browser that was asked to sign with a passkey."""
SIGN_ON = "touchline_sign_on"
"""The browser that was sent to the provider of single sign-on."""
DEVICE = "touchline_device"
"""A browser in which somebody has logged in before."""


@dataclass(frozen=True)
class Cookies:
    """What browsers keep for a server: how each cookie is read from a request, and the arguments of
    ``Response.set_cookie`` with which it is set. Scripts cannot read one, other sites cannot send it.

    Attributes:
        secure: Whether people come by TLS: names then have a prefix with which browsers refuse cookies of other names.
        devices: The browsers in which people have logged in before.
    """

    secure: bool
    devices: DeviceTokens

    @property
    def session_name(self) -> str:
        """Name of the session cookie."""
        return self._make_cookie_name(SESSION)

    def read_session_token(self, scope: Scope) -> str | None:
        """The token of the session that a browser sent."""
        return read_cookie(scope, self.session_name)

    def make_session_cookie(self, token: str | None) -> dict[str, Any]:
        """How the session cookie of a token is set; None: how it is removed."""
        return self._make_cookie_arguments(SESSION, token, SESSION_LASTS)

    def read_passkey_secret(self, scope: Scope) -> str:
        """What a browser alone knows that was asked to sign with a passkey; empty: it was not."""
        return read_cookie(scope, self._make_cookie_name(PASSKEY)) or ""

    def make_passkey_cookie(self, secret: str) -> dict[str, Any]:
        """How a browser is given it."""
        return self._make_cookie_arguments(PASSKEY, secret, CHALLENGE_LASTS)

    def read_sign_on_secret(self, scope: Scope) -> str:
        """What a browser alone knows that was sent to single sign-on; empty: it was not."""
        return read_cookie(scope, self._make_cookie_name(SIGN_ON)) or ""

    def make_sign_on_cookie(self, secret: str | None) -> dict[str, Any]:
        """How a browser is given that; None: how it is removed."""
        return self._make_cookie_arguments(SIGN_ON, secret, SIGN_ON_LASTS)

    def find_known_device(self, scope: Scope, person: str) -> str | None:
        """The browser that sent a request, if the person has logged in there before."""
        token = read_cookie(scope, self._make_device_cookie_name(person))
        return self.devices.recognise(person, token) if token else None

    def make_known_device_cookie(self, person: str) -> dict[str, Any]:
        """How a browser is made a known one of a person, who has just logged in there."""
        values = self._make_cookie_arguments(DEVICE, self.devices.make(person), DEVICE_LASTS)
        return {**values, "key": self._make_device_cookie_name(person)}

    def was_used_by_others(self, scope: Scope, person: str) -> bool:
        """Whether somebody else has logged in before in the browser that sent a request."""
        sent = ";".join(Headers(scope=scope).getlist("cookie"))
        begins = re.escape(self._make_cookie_name(DEVICE))
        names = re.findall(rf"(?:^|;)\s*({begins}_[0-9a-f]+)=", sent)
        return any(name != self._make_device_cookie_name(person) for name in names)

    def _make_device_cookie_name(self, person: str) -> str:
        return f"{self._make_cookie_name(DEVICE)}_{self.devices.make_cookie_suffix(person)}"

    def _make_cookie_name(self, name: str) -> str:
        return f"__Host-{name}" if self.secure else name

    def _make_cookie_arguments(
        self, name: str, value: str | None, lasts: timedelta
    ) -> dict[str, Any]:
        age = int(lasts.total_seconds()) if value else 0
        full = {
            "key": self._make_cookie_name(name),
            "value": value or "",
            "path": "/",
            "httponly": True,
        }
        return {**full, "samesite": "strict", "secure": self.secure, "max_age": age}


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
