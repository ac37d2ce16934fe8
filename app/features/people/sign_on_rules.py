"""Rules of single sign-on: which provider is trusted, whom it lets in, and which account is whose."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any
from urllib.parse import urlsplit

from app.config import Settings
from app.db.session import Session
from app.db.store import Store
from app.durable import read_private_file
from app.errors import ConflictError, ForbiddenError, InputError, NotFoundError, NotLoggedInError
from app.features.people.login_queries import (
    count_linked_people,
    delete_identity,
    delete_logins,
    find_person_identity,
)
from app.features.people.logins import Login, LoginMethod
from app.features.people.queries import (
    count_people_who_can_log_in,
    find_person_by_id,
    list_people_rows,
)
from app.features.people.roles import Role, log_account_event, require_no_token
from app.features.people.second_factor import require_password
from app.json_text import Moment

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
        if (
            self.domains
            and ALL not in self.domains
            and _find_verified_email_domain(claims) not in self.domains
        ):
            raise NotLoggedInError(
                f"{self.label} did not confirm an e-mail address of yours that may log in here",
                hint="Use your work account, and make sure that its address is verified.",
            )
        if self.group_claim and self.groups.isdisjoint(
            _claim_to_texts(claims.get(self.group_claim))
        ):
            raise NotLoggedInError(
                f"your account of {self.label} is in none of the groups that may log in here",
                hint="Ask the operator of this server which groups may log in.",
            )

    def make_user_name(self, claims: Mapping[str, Any]) -> str:
        """What somebody new would be called here: small letters, digits, dots and dashes."""
        claimed = str(claims.get(self.name_claim) or "").strip().lower().partition("@")[0]
        return re.sub(r"[^a-z0-9._-]+", "-", claimed)[:40].strip("._-")

    def has_trusted_factor(self, claims: Mapping[str, Any]) -> bool:
        """Whether the provider says that it has asked for a second factor, as the operator wants it."""
        methods = {*_claim_to_texts(claims.get("amr")), *_claim_to_texts(claims.get("acr"))}
        return not self.trusted.isdisjoint(methods)


def make_identity_label(claims: Mapping[str, Any]) -> str:
    """By what people know an account of the provider."""
    names = (claims.get(name) for name in ("email", "preferred_username", "name", "sub"))
    return next(str(one) for one in names if one)[:100]


def parse_origin(address: str) -> str:
    """Scheme, host and port of an address.

    Raises:
        ValueError: It is none of https, or of http on this machine.
    """
    parts = urlsplit(address)
    host = parts.hostname or ""
    secure = parts.scheme == "https" or (parts.scheme == "http" and host in LOOPBACK)
    if not secure or not host or parts.username is not None or not address.isprintable():
        raise ValueError(f"{address[:200]!r} is not an https address")
    return f"{parts.scheme}://{host}:{parts.port or _PORTS[parts.scheme]}"


def read_rules(settings: Settings) -> SignOnRules | None:
    """The rules of single sign-on from the settings; None where there is none.

    Raises:
        InputError: They say it by half, or contradict themselves.
    """
    if not any(
        getattr(settings, name)
        for name in settings.model_fields_set
        if name.startswith(_PREFIX) and name != "sso_label"
    ):
        return None
    secret = _read_client_secret(settings)
    issuer, client = settings.sso_issuer or "", settings.sso_client_id or ""
    if not (issuer and client and secret):
        absent = [
            _make_environment_variable_name(name)
            for name, value in (
                ("issuer", issuer),
                ("client_id", client),
                ("client_secret", secret),
            )
            if not value
        ]
        raise _incomplete_error(f"single sign-on needs the settings {' and '.join(absent)}")
    if not settings.team:
        raise InputError(
            "single sign-on works only on a server with accounts",
            hint="Serve with --team, or unset the TOUCHLINE_SSO settings.",
        )
    if not (client + secret).isascii():
        raise _incomplete_error("the client's id and secret must contain only ASCII characters")
    _require_complete_settings(settings)
    return SignOnRules(
        issuer,
        client,
        secret,
        settings.sso_label.strip(),
        _collect_allowed_hosts([issuer, *settings.sso_hosts]),
        settings.sso_scope,
        settings.sso_name_claim,
        frozenset(one.strip().lower().lstrip("@") for one in settings.sso_domains),
        settings.sso_group_claim,
        frozenset(settings.sso_groups),
        _parse_role_of_new_people(settings),
        settings.sso_only,
        frozenset(settings.sso_second_factor),
    )


def _require_complete_settings(settings: Settings) -> None:
    if bool(settings.sso_group_claim) != bool(settings.sso_groups):
        raise _incomplete_error(
            "TOUCHLINE_SSO_GROUP_CLAIM and TOUCHLINE_SSO_GROUPS must be set together"
        )
    if "openid" not in settings.sso_scope.split():
        raise _incomplete_error("TOUCHLINE_SSO_SCOPE must contain openid")
    if settings.sso_new_role and not (settings.sso_domains or settings.sso_groups):
        raise _incomplete_error(
            "TOUCHLINE_SSO_NEW_ROLE creates accounts for new people: set"
            f' TOUCHLINE_SSO_DOMAINS or TOUCHLINE_SSO_GROUPS to limit who gets one (["{ALL}"]'
            " as domains allows everybody whom the provider knows)"
        )


def _parse_role_of_new_people(settings: Settings) -> Role | None:
    if not settings.sso_new_role:
        return None
    known = [role.value for role in Role if role is not Role.ADMIN]
    if settings.sso_new_role not in known:
        raise _incomplete_error(f"TOUCHLINE_SSO_NEW_ROLE is one of {', '.join(known)}")
    return Role(settings.sso_new_role)


def _collect_allowed_hosts(addresses: Sequence[str]) -> frozenset[str]:
    try:
        found = [(urlsplit(one), parse_origin(one)) for one in addresses]
    except ValueError as error:
        raise _incomplete_error(
            f"{error}, which TOUCHLINE_SSO_ISSUER and TOUCHLINE_SSO_HOSTS require"
        ) from None
    if any(parts.query or parts.fragment for parts, _ in found):
        raise _incomplete_error("an address of the provider must not contain ? or #")
    return frozenset(origin for _, origin in found)


def _read_client_secret(settings: Settings) -> str:
    path, given = settings.sso_client_secret_file, settings.sso_client_secret
    if path is None:
        return given.get_secret_value().strip() if given else ""
    if given:
        raise _incomplete_error(
            "the client's secret is given twice: by TOUCHLINE_SSO_CLIENT_SECRET and by"
            " TOUCHLINE_SSO_CLIENT_SECRET_FILE"
        )
    return read_private_file(path, _make_environment_variable_name("client_secret_file"))


def _find_verified_email_domain(claims: Mapping[str, Any]) -> str | None:
    """Of the e-mail address that the provider has verified; None: of none."""
    if claims.get("email_verified") not in (True, "true"):
        return None
    return str(claims.get("email") or "").rpartition("@")[2].lower() or None


def _claim_to_texts(claim: object) -> list[str]:
    if isinstance(claim, str):
        return [claim]
    return [one for one in claim if isinstance(one, str)] if isinstance(claim, list) else []


def _make_environment_variable_name(name: str) -> str:
    return f"TOUCHLINE_{_PREFIX}{name}".upper()


def _incomplete_error(sentence: str) -> InputError:
    return InputError(sentence, hint=_HINT)


@dataclass(frozen=True)
class Identity:
    """The account of somebody, as they are shown it.

    Attributes:
        shown: What people know it by.
        used: When they came by it last; None: never.
    """

    issuer: str
    shown: str
    created: Moment
    used: Moment | None


@dataclass(frozen=True)
class OwnLoginWays:
    """How somebody can come in: by a password, and by an account of the provider."""

    password: bool
    identity: Identity | None


def read_login_ways(store: Store, person_id: int) -> OwnLoginWays:
    """How a person can come in."""
    with store.read() as session:
        person, row = (
            find_person_by_id(session, person_id),
            find_person_identity(session, person_id),
        )
    found = None if row is None else Identity(row.issuer, row.shown, row.created, row.used)
    return OwnLoginWays(person is not None and person.password is not None, found)


def require_no_identity(session: Session, person_id: int, rules: SignOnRules) -> None:
    """Raise ConflictError where somebody has an account of the provider already."""
    found = find_person_identity(session, person_id)
    if found is not None and found.issuer == rules.issuer:
        raise ConflictError(
            f"an account of {rules.label} is linked with yours already",
            hint="Unlink that one first.",
        )


def unlink_identity(store: Store, login: Login, password: str | None, at: datetime) -> None:
    """Take one's account away; other sessions that began with it end.

    Raises:
        InputError: That is not the password.
        NotFoundError: There is none.
        ConflictError: There is no other way in.
    """
    require_password(store, login, password, at)
    with store.write() as session:
        person = find_person_by_id(session, login.person_id)
        if person is not None and person.password is None:
            raise ConflictError(
                "you have no password: you could not log in any more",
                hint="An admin can send you a link with which you choose one.",
            )
        if delete_identity(session, login.person_id) is None:
            raise NotFoundError("no account of a provider is linked with yours")
        delete_logins(session, login.person_id, but=login.id, way=LoginMethod.SIGN_ON)
        log_account_event(session, login.name, login.name, "single sign-on unlinked", login.role)


def unlink_person(store: Store, person_id: int, *, actor: str) -> None:
    """Take somebody's account away; their sessions that began with it end.

    Raises:
        NotFoundError: There is nobody of that id, or they have none.
        ForbiddenError: It is one's own, which takes the password; or a token asks.
        ConflictError: No admin would be left who can log in.
    """
    require_no_token(actor)
    with store.write() as session:
        person = find_person_by_id(session, person_id)
        if person is not None and person.name == actor:
            raise ForbiddenError(
                "you cannot unlink your own account here", hint="Do it under Account."
            )
        if person is None or delete_identity(session, person_id) is None:
            raise NotFoundError("no account of a provider is linked with that person")
        only = find_only_issuer(store.settings)
        left = count_people_who_can_log_in(session, Role.ADMIN, only_issuer=only)
        if person.role == Role.ADMIN and not left:
            raise ConflictError(
                f"there is no admin but {person.name} who can log in, and only by the linked account",
                hint=f"Give {person.name} a password first, or give the role admin to another person who can log in.",
            )
        delete_logins(session, person_id, way=LoginMethod.SIGN_ON)
        log_account_event(session, actor, person.name, "single sign-on unlinked", person.role)


def find_only_issuer(settings: Settings) -> str | None:
    """The provider by which alone people log in; None: there are other ways."""
    return settings.sso_issuer if settings.sso_only else None


def count_active_admins_linked_to_sign_on(store: Store, rules: SignOnRules) -> int:
    """How many admins can come by the provider."""
    with store.read() as session:
        admins = [
            one.id
            for one in list_people_rows(session)
            if one.role == Role.ADMIN and not one.disabled
        ]
        return count_linked_people(session, rules.issuer, admins)
