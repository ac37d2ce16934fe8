"""Team: what a server has that many people log in to, and one that somebody runs alone has not."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any
from urllib.parse import urlsplit

from fastapi import Depends, Request

from app.api.security.access import cookie_of
from app.api.security.tries import Tries
from app.config import Settings
from app.errors import ConflictError
from app.review.people.logins import LASTS, Login, Logins
from app.store.session import Store

NAME = "touchline_session"


@dataclass(frozen=True)
class Team:
    """The way in.

    Attributes:
        url: The address that people open; None: the one that they came by.
        proxies: Who is believed whom they forward.
    """

    logins: Logins
    url: str | None
    proxies: frozenset[str]
    tries: Tries = field(default_factory=Tries)

    @staticmethod
    def of(settings: Settings, store: Store) -> Team | None:
        """Of a server of a team; None for one that somebody runs alone."""
        if not settings.team:
            return None
        return Team(Logins(store), settings.url, frozenset(settings.proxies))

    @property
    def secure(self) -> bool:
        """Whether people come by TLS."""
        return (self.url or "").startswith("https://")

    @property
    def cookie(self) -> str:
        """Name of the cookie. With the prefix browsers refuse one that was set by another name, or
        without TLS."""
        return f"__Host-{NAME}" if self.secure else NAME

    def cookie_values(self, token: str | None) -> dict[str, Any]:
        """How the cookie of a token is set; None: how it is taken back."""
        values = {"key": self.cookie, "value": token or "", "path": "/", "httponly": True}
        age = int(LASTS.total_seconds()) if token else 0
        return {**values, "samesite": "strict", "secure": self.secure, "max_age": age}

    def token(self, request: Request) -> str | None:
        """The token that a browser sent."""
        return cookie_of(request.scope, self.cookie)

    def login(self, request: Request) -> Login | None:
        """Who that is, on a route that anybody may ask."""
        token = self.token(request)
        return self.logins.find(token) if token else None

    def base(self, request: Request) -> str:
        """The beginning of addresses that are shown to people."""
        return self.url or f"{request.url.scheme}://{request.headers['host']}"

    def address(self, request: Request) -> str:
        """Where a request comes from: the last address that a proxy of ours has seen."""
        peer = request.client.host if request.client else ""
        forwarded = request.headers.getlist("x-forwarded-for")
        if self.url is None or peer not in self.proxies or not forwarded:
            return peer
        return forwarded[-1].rpartition(",")[2].strip()[:60] or peer


def allowed_hosts(settings: Settings) -> list[str]:
    """Names that the server answers to."""
    own = urlsplit(settings.url).hostname if settings.url else None
    name = f"[{own}]" if own and ":" in own else own
    return [*settings.allowed_hosts, *([name] if name else [])]


async def get_team(request: Request) -> Team:
    """The way in.

    Raises:
        ConflictError: Somebody runs this server alone.
    """
    team: Team | None = request.app.state.team
    if team is None:
        raise ConflictError(
            "this server is run by one person alone: it has no accounts",
            hint="touchline serve --team asks everybody who they are.",
        )
    return team


AppTeam = Annotated[Team, Depends(get_team)]
