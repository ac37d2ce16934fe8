"""Server of a team: sessions, tokens and sign-on of its people, and limits on attempts to log in."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from ipaddress import IPv4Network, IPv6Network, ip_address, ip_network
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Depends, Request
from limits import RateLimitItem, parse
from limits.storage import MemoryStorage
from limits.strategies import MovingWindowRateLimiter

from app.config import Settings
from app.db.store import Store
from app.errors import ConflictError, NotLoggedInError, TooManyTriesError
from app.features.people.access_tokens import AccessTokens
from app.features.people.devices import AttemptWindow, DeviceTokens
from app.features.people.logins import Login, LoginMethod, LoginSessions
from app.features.people.passkeys import Passkeys, PasskeySite
from app.features.people.second_factor import SecondFactors
from app.features.people.sign_on import SignOn
from app.features.people.sign_on_rules import read_rules
from app.http.cookies import Cookies
from app.mail import MailServer, read_mail_server

NAME_LIMIT = parse("10/minute")
"""From one address, or from one browser in which the person has logged in before."""
NAME_LIMIT_ALL_ADDRESSES = parse("100/hour")
"""From all addresses together: a password is guessed no faster by many machines. Browsers in which the
person has logged in before are not counted, and not refused, so nobody can lock them out."""
ADDRESS_LIMIT = parse("60/minute")
"""Many people may come from one address in the morning; each name has a limit of its own."""
CODE_LIMIT = parse("20/hour")
"""Codes of second factors: there are but a million, and three of them are right at a time."""
TOKEN_LIMIT = parse("60/minute")
"""Tokens that are none. Apart from passwords: a forgotten script keeps nobody from logging in."""
CHALLENGE_LIMIT = parse("120/minute")
"""Challenges for passkeys, which cost the server some bytes for five minutes."""


LANDING = "/login"
"""The page to which the provider sends people back."""


class AttemptLimits:
    """Counts attempts to log in, in the memory of this process, or in the database where others take them, too."""

    def __init__(self, store: Store | None = None) -> None:
        shared = store is not None and store.sharing.is_shared
        self._shared = AttemptWindow(store) if store is not None and shared else None
        self._windows = MovingWindowRateLimiter(MemoryStorage())

    def count_login(self, address: str, name: str | None = None, device: str | None = None) -> None:
        """Count an attempt; whether it would have been right makes no difference.

        Args:
            address: Where it comes from.
            name: Whose password it is.
            device: The browser that it comes from, if the person has logged in there before.

        Raises:
            TooManyTriesError: There were too many of this name, or from this address.
        """
        self._count_attempt(ADDRESS_LIMIT, "address", address)
        if name is None:
            return
        name = name.strip().lower()[:200]
        if device is not None:
            self._count_attempt(NAME_LIMIT, "device", name, device)
            return
        self._count_attempt(NAME_LIMIT, "name", name, address)
        self._count_attempt(NAME_LIMIT_ALL_ADDRESSES, "name", name)

    def count_second_factor_attempt(self, name: str) -> None:
        """Count a code of a second factor.

        Raises:
            TooManyTriesError: There were too many of this name.
        """
        self._count_attempt(CODE_LIMIT, "code", name.strip().lower()[:200])

    def count_invalid_token(self, address: str) -> None:
        """Count a token that is not valid; those that are count nothing.

        Raises:
            TooManyTriesError: There were too many from this address.
        """
        self._count_attempt(TOKEN_LIMIT, "token", address)

    def count_challenge(self, address: str) -> None:
        """Count a challenge for a passkey.

        Raises:
            TooManyTriesError: There were too many from this address.
        """
        self._count_attempt(CHALLENGE_LIMIT, "challenge", address)

    def _count_attempt(self, limit: RateLimitItem, *key: str) -> None:
        if self._shared is not None:
            wait = self._shared.count_attempt_or_get_wait(
                "/".join(key), limit.amount, limit.get_expiry()
            )
            if wait is not None:
                raise TooManyTriesError(max(1, math.ceil(wait)))
        elif not self._windows.hit(limit, *key):
            ends = self._windows.get_window_stats(limit, *key).reset_time
            raise TooManyTriesError(max(1, math.ceil(ends - time.time())))


@dataclass(frozen=True)
class TeamLogin:
    """The way in.

    Attributes:
        logins: Sessions of people in browsers.
        tokens: Tokens of their scripts.
        factors: Their second factors.
        passkeys: With which they need no password.
        sign_on: The provider by which they come in; None: there is none.
        url: The address that people open; None: the one that they came by.
        proxies: Who is believed whom they forward.
        attempts: Limits how often passwords, codes and tokens are tried.
        devices: Browsers in which people have logged in before.
        mail: Sends invitations; None: links are shown.
    """

    logins: LoginSessions
    tokens: AccessTokens
    factors: SecondFactors
    passkeys: Passkeys
    sign_on: SignOn | None
    url: str | None
    proxies: tuple[IPv4Network | IPv6Network, ...]
    attempts: AttemptLimits
    devices: DeviceTokens
    mail: MailServer | None

    @staticmethod
    def of(settings: Settings, store: Store) -> TeamLogin | None:
        """Of a server of a team; None for one that somebody runs alone.

        Raises:
            InputError: The settings of single sign-on, or of mail, are there by half.
        """
        rules = read_rules(settings)
        if not settings.team:
            return None
        logins = LoginSessions(store, only=LoginMethod.SIGN_ON if rules and rules.only else None)
        return TeamLogin(
            logins,
            AccessTokens(store),
            SecondFactors(store),
            Passkeys(store, logins),
            SignOn(store, logins, rules) if rules else None,
            settings.url,
            tuple(ip_network(text, strict=False) for text in settings.proxies),
            AttemptLimits(store),
            DeviceTokens(store),
            read_mail_server(settings),
        )

    @property
    def uses_tls(self) -> bool:
        """Whether people come by TLS."""
        return (self.url or "").startswith("https://")

    @property
    def cookies(self) -> Cookies:
        """The cookies of its server."""
        return Cookies(self.uses_tls, self.devices)

    def count_login_attempt(self, request: Request, name: str | None = None) -> None:
        """Count that somebody asks whether a password is right.

        Raises:
            TooManyTriesError: There were too many.
        """
        device = None if name is None else self.cookies.find_known_device(request.scope, name)
        self.attempts.count_login(self.find_client_address(request), name, device)

    def make_sign_on_return_url(self, request: Request) -> str:
        """The address to which the provider sends people back."""
        return self.get_base_url(request) + LANDING

    def require_sign_on_provider(self) -> SignOn:
        """The provider by which people come in; raises ConflictError where there is none."""
        if self.sign_on is None:
            raise ConflictError(
                "single sign-on is not set up on this server",
                hint="The operator can set it up as docs/teams.md describes.",
            )
        return self.sign_on

    def require_password_login_allowed(self) -> None:
        """Raise ConflictError where people come by single sign-on alone."""
        if self.sign_on is not None and self.sign_on.rules.only:
            label = self.sign_on.rules.label
            raise ConflictError(
                f"on this server people log in only with {label}", hint=f"Log in with {label}."
            )

    def make_passkey_site(self, request: Request) -> PasskeySite:
        """For whom passkeys are: the address that people open, as the operator said, or this machine.

        Raises:
            ConflictError: Browsers make no passkeys for it.
        """
        url = urlsplit(self.get_base_url(request))
        name = url.hostname or ""
        if name == "localhost" or (url.scheme == "https" and not _is_ip_address(name)):
            port = f":{url.port}" if url.port not in (None, 80, 443) else ""
            return PasskeySite(name, f"{url.scheme}://{name}{port}")
        raise ConflictError(
            "browsers do not support passkeys at this address",
            hint="Open Touchline by https and a host name (the operator sets it with"
            " touchline serve --team --url), or on localhost.",
        )

    def get_session_token(self, request: Request) -> str | None:
        """The token that a browser sent."""
        return self.cookies.read_session_token(request.scope)

    def find_login(self, request: Request) -> Login | None:
        """The login of the request, on a route that is open to all."""
        token = self.get_session_token(request)
        return self.logins.find(token) if token else None

    def find_login_by_token(self, token: str, request: Request) -> Login:
        """The login of a request with a token.

        Raises:
            NotLoggedInError: It is not valid.
            TooManyTriesError: Nor were too many before, from the same address.
        """
        try:
            return self.tokens.find_login_of_token(token)
        except NotLoggedInError:
            self.attempts.count_invalid_token(self.find_client_address(request))
            raise

    def get_base_url(self, request: Request) -> str:
        """The beginning of addresses that are shown to people."""
        return self.url or f"{request.url.scheme}://{request.headers['host']}"

    def find_client_address(self, request: Request) -> str:
        """Where a request comes from: the last address that a proxy of ours has seen."""
        peer = request.client.host if request.client else ""
        forwarded = request.headers.getlist("x-forwarded-for")
        if self.url is None or not forwarded or not self._is_proxy(peer):
            return peer
        return forwarded[-1].rpartition(",")[2].strip()[:60] or peer

    def _is_proxy(self, peer: str) -> bool:
        return _is_ip_address(peer) and any(ip_address(peer) in one for one in self.proxies)


def _is_ip_address(name: str) -> bool:
    """Whether that is an address of numbers, which no passkey is for."""
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def list_allowed_hosts(settings: Settings) -> list[str]:
    """Names that the server answers to."""
    own = urlsplit(settings.url).hostname if settings.url else None
    name = f"[{own}]" if own and ":" in own else own
    return [*settings.allowed_hosts, *([name] if name else [])]


async def get_team_login(request: Request) -> TeamLogin:
    """The way in.

    Raises:
        ConflictError: Somebody runs this server alone.
    """
    team: TeamLogin | None = request.app.state.team
    if team is None:
        raise ConflictError(
            "this server is run by one person alone: it has no accounts",
            hint="touchline serve --team requires a login.",
        )
    return team


AppTeam = Annotated[TeamLogin, Depends(get_team_login)]
