"""Rules of single sign-on: which provider the operator trusts, and whom of those that it knows to let in.

Everything stands in the settings; no request changes any of it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

from app.config import Settings
from app.errors import InputError, NotLoggedInError
from app.private_file import read_private
from app.review.people.roles import Role

ALL = "*"
"""In the place of a domain: whoever the provider knows."""
LOOPBACK = frozenset({"127.0.0.1", "::1", "localhost"})
_PREFIX = "sso_"
_HINT = "docs/teams.md says which settings belong together."
_PORTS = {"http": 80, "https": 443}


@dataclass(frozen=True)
class SignOnRules:
    """What the operator has said.

    Attributes:
        issuer: The provider, as it calls itself.
        hosts: Origins that may be asked: the provider's own, and those beside it.
        new_role: What somebody becomes whom nobody here knows; None: they do not come in.
        only: There is no other way in.
        trusted: Values of ``amr`` and ``acr`` that stand for our second factor.
    """

    issuer: str
    client_id: str
    client_secret: str = field(repr=False)
    label: str
    hosts: frozenset[str]
    scope: str
    name_claim: str
    domains: frozenset[str]
    group_claim: str | None
    groups: frozenset[str]
    new_role: Role | None
    only: bool
    trusted: frozenset[str]

    def require_admitted(self, claims: Mapping[str, Any]) -> None:
        """Raise unless who that is may come in, by domain and by group.

        Raises:
            NotLoggedInError: They may not.
        """
        if self.domains and ALL not in self.domains and _domain(claims) not in self.domains:
            raise NotLoggedInError(
                f"{self.label} does not vouch for an e-mail address of yours that may come in here",
                hint="Use the account of your work, and see that its address is verified.",
            )
        if self.group_claim and self.groups.isdisjoint(_texts(claims.get(self.group_claim))):
            raise NotLoggedInError(
                f"at {self.label} you are in none of the groups that may come in here",
                hint="Whoever runs this server can say which one it takes.",
            )

    def name_for(self, claims: Mapping[str, Any]) -> str:
        """What somebody new would be called here: small letters, digits, dots and dashes."""
        said = str(claims.get(self.name_claim) or "").strip().lower().partition("@")[0]
        return re.sub(r"[^a-z0-9._-]+", "-", said)[:40].strip("._-")

    def is_vouched(self, claims: Mapping[str, Any]) -> bool:
        """Whether the provider says that it has asked for a second factor, as the operator wants it."""
        said = {*_texts(claims.get("amr")), *_texts(claims.get("acr"))}
        return not self.trusted.isdisjoint(said)


def shown_of(claims: Mapping[str, Any]) -> str:
    """By what people know an account of the provider."""
    said = (claims.get(name) for name in ("email", "preferred_username", "name", "sub"))
    return next(str(one) for one in said if one)[:100]


def origin_of(address: str) -> str:
    """Scheme, host and port of an address.

    Raises:
        ValueError: It is none of https, or of http on this machine.
    """
    parts = urlsplit(address)
    host = parts.hostname or ""
    secure = parts.scheme == "https" or (parts.scheme == "http" and host in LOOPBACK)
    if not secure or not host or parts.username is not None or not address.isprintable():
        raise ValueError(f"{address[:200]!r} is no address with TLS")
    return f"{parts.scheme}://{host}:{parts.port or _PORTS[parts.scheme]}"


def read_rules(settings: Settings) -> SignOnRules | None:
    """What the settings say; None where there is no single sign-on.

    Raises:
        InputError: They say it by half, or contradict themselves.
    """
    if not any(
        getattr(settings, name)
        for name in settings.model_fields_set
        if name.startswith(_PREFIX) and name != "sso_label"
    ):
        return None
    secret = _secret(settings)
    issuer, client = settings.sso_issuer or "", settings.sso_client_id or ""
    if not (issuer and client and secret):
        absent = [
            _variable(name)
            for name, value in (
                ("issuer", issuer),
                ("client_id", client),
                ("client_secret", secret),
            )
            if not value
        ]
        raise _half(f"single sign-on lacks {' and '.join(absent)}")
    if not settings.team:
        raise InputError(
            "single sign-on is for the server of a team", hint="Serve with --team, or unset it."
        )
    if not (client + secret).isascii():
        raise _half("the client's id and secret have letters that no provider gives")
    _require_whole(settings)
    return SignOnRules(
        issuer,
        client,
        secret,
        settings.sso_label.strip(),
        _hosts([issuer, *settings.sso_hosts]),
        settings.sso_scope,
        settings.sso_name_claim,
        frozenset(one.strip().lower().lstrip("@") for one in settings.sso_domains),
        settings.sso_group_claim,
        frozenset(settings.sso_groups),
        _new_role(settings),
        settings.sso_only,
        frozenset(settings.sso_second_factor),
    )


def _require_whole(settings: Settings) -> None:
    if bool(settings.sso_group_claim) != bool(settings.sso_groups):
        raise _half("TOUCHLINE_SSO_GROUP_CLAIM and TOUCHLINE_SSO_GROUPS belong together")
    if "openid" not in settings.sso_scope.split():
        raise _half("TOUCHLINE_SSO_SCOPE needs the word openid")
    if settings.sso_new_role and not (settings.sso_domains or settings.sso_groups):
        raise _half(
            "TOUCHLINE_SSO_NEW_ROLE lets in whom nobody here knows: say of which TOUCHLINE_SSO_DOMAINS"
            f' or TOUCHLINE_SSO_GROUPS (["{ALL}"] as domains: whoever the provider knows)'
        )


def _new_role(settings: Settings) -> Role | None:
    if not settings.sso_new_role:
        return None
    known = [role.value for role in Role if role is not Role.ADMIN]
    if settings.sso_new_role not in known:
        raise _half(f"TOUCHLINE_SSO_NEW_ROLE is one of {', '.join(known)}")
    return Role(settings.sso_new_role)


def _hosts(addresses: Sequence[str]) -> frozenset[str]:
    try:
        found = [(urlsplit(one), origin_of(one)) for one in addresses]
    except ValueError as error:
        raise _half(f"{error}, as TOUCHLINE_SSO_ISSUER and TOUCHLINE_SSO_HOSTS need") from None
    if any(parts.query or parts.fragment for parts, _ in found):
        raise _half("an address of the provider has neither ? nor #")
    return frozenset(origin for _, origin in found)


def _secret(settings: Settings) -> str:
    path, given = settings.sso_client_secret_file, settings.sso_client_secret
    if path is None:
        return given.get_secret_value().strip() if given else ""
    if given:
        raise _half("the client's secret is given twice, by a file and without")
    return read_private(path, _variable("client_secret_file"))


def _domain(claims: Mapping[str, Any]) -> str | None:
    """Of the e-mail address that the provider has verified; None: of none."""
    if claims.get("email_verified") not in (True, "true"):
        return None
    return str(claims.get("email") or "").rpartition("@")[2].lower() or None


def _texts(claim: object) -> list[str]:
    if isinstance(claim, str):
        return [claim]
    return [one for one in claim if isinstance(one, str)] if isinstance(claim, list) else []


def _variable(name: str) -> str:
    return f"TOUCHLINE_{_PREFIX}{name}".upper()


def _half(sentence: str) -> InputError:
    return InputError(sentence, hint=_HINT)
