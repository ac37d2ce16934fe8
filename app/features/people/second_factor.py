"""Second factor: made, confirmed, taken away, and required of everybody.

``codes`` has the codes of an authenticator, ``passkeys`` the other kind.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import segno

from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, ForbiddenError, InputError, NotFoundError
from app.features.people.devices import (
    make_recovery_code,
    make_totp,
    normalize_code,
    verify_and_use_totp,
)
from app.features.people.links import hash_token, verify_password
from app.features.people.login_queries import delete_logins, delete_passkeys
from app.features.people.logins import Login, LoginMethod
from app.features.people.queries import (
    confirm_second_factor,
    count_recovery_codes,
    delete_recovery_codes,
    delete_second_factor,
    find_person_by_id,
    find_second_factor,
    has_second_factor,
    is_second_factor_required,
    put_second_factor,
    set_second_factor_required,
)
from app.features.people.roles import log_account_event, require_no_token

ISSUER = "Touchline"
CODES = 10
"""Recovery codes of a person."""
FRESH = timedelta(minutes=10)
"""So long somebody who came by single sign-on needs no password to show that it is them."""


@dataclass(frozen=True)
class Enrolment:
    """What an authenticator has to know, shown once: as text, as an address, and as a picture of
    that (a data: address of a PNG).

    Attributes:
        picture: The address as a QR code: a PNG, as a ``data:`` address.
    """

    secret: str
    uri: str
    picture: str


@dataclass(frozen=True)
class FactorState:
    """Whether somebody has a second factor, needs one, and how many recovery codes are left.

    Attributes:
        on: There is an authenticator, or a passkey.
        required: Everybody needs a second factor here.
        codes_left: Recovery codes that were not used yet.
        authenticator: It is (also) an authenticator, which shows codes.
    """

    on: bool
    required: bool
    codes_left: int
    authenticator: bool


class SecondFactors:
    """Everything that is asked of second factors.

    Args:
        store: Where they are.
        clock: Says what time it is, in UTC.
    """

    def __init__(self, store: Store, clock: Callable[[], datetime] = lambda: datetime.now(UTC)):
        self._store, self._clock = store, clock

    def state(self, person_id: int) -> FactorState:
        """How it is with somebody."""
        with self._store.read() as session:
            found = find_second_factor(session, person_id)
            return FactorState(
                has_second_factor(session, person_id),
                is_second_factor_required(session),
                count_recovery_codes(session, person_id),
                bool(found and found.confirmed),
            )

    def begin(self, login: Login, password: str | None) -> Enrolment:
        """A secret for an authenticator; nothing is asked for before ``confirm``.

        Raises:
            InputError: That is not the password.
            ConflictError: There is an authenticator already.
        """
        require_password(self._store, login, password, self._clock())
        salt = secrets.token_hex(16)
        with self._store.write() as session:
            found = find_second_factor(session, login.person_id)
            if found is not None and found.confirmed:
                raise ConflictError(
                    "you have an authenticator already", hint="Remove it first, then add a new one."
                )
            put_second_factor(session, login.person_id, salt, now())
        totp = make_totp(self._store, login.person_id, salt)
        uri = totp.provisioning_uri(name=login.name, issuer_name=ISSUER)
        return Enrolment(totp.secret, uri, segno.make(uri, error="m").png_data_uri(scale=5))

    def confirm(self, login: Login, code: str) -> list[str]:
        """Ask for it from now on, once somebody has shown that they have it; their other sessions end.

        Returns:
            The recovery codes, which nobody can be shown again.

        Raises:
            NotFoundError: Nothing was begun.
            InputError: That is not the code of this moment.
        """
        codes = make_recovery_codes()
        with self._store.write() as session:
            found = find_second_factor(session, login.person_id)
            if found is None or found.confirmed:
                raise NotFoundError("there is no second factor to confirm")
            if not verify_and_use_totp(session, self._store, login.person_id, code, self._clock()):
                raise InputError(
                    "this code is wrong or has expired",
                    hint="Check the clock of the device, and type the current code.",
                    pointer="/code",
                )
            confirm_second_factor(session, login.person_id, hash_recovery_codes(codes))
            delete_logins(session, login.person_id, but=login.id)
            log_account_event(session, login.name, login.name, "second factor", login.role)
        return codes

    def remove(self, login: Login, password: str | None) -> None:
        """Stop asking for the codes of an authenticator.

        Raises:
            InputError: That is not the password.
            ConflictError: Everybody needs a second factor here, and it is the last.
        """
        require_password(self._store, login, password, self._clock())
        with self._store.write() as session:
            if delete_second_factor(session, login.person_id):
                drop_codes_if_last_factor_removed(session, login)
                log_account_event(session, login.name, login.name, "no second factor", login.role)

    def clear(self, person_id: int, *, actor: str) -> None:
        """Forget the authenticator, passkeys and recovery codes of somebody who has lost them.

        Raises:
            NotFoundError: There is nobody of that id.
            ForbiddenError: It is one's own, which takes the password; or a token asks.
        """
        require_no_token(actor)
        with self._store.write() as session:
            person = find_person_by_id(session, person_id)
            if person is None:
                raise NotFoundError.person(person_id)
            if person.name == actor:
                raise ForbiddenError(
                    "you cannot remove your own second factor here", hint="Do it under Account."
                )
            had = delete_second_factor(session, person_id)
            if delete_passkeys(session, person_id) or had:
                delete_recovery_codes(session, person_id)
                log_account_event(session, actor, person.name, "no second factor", person.role)

    def required(self) -> bool:
        """Whether everybody needs one."""
        with self._store.read() as session:
            return is_second_factor_required(session)

    def set_required(self, on: bool, *, actor: str) -> None:
        """Let everybody need one: whoever has none makes one before anything else.

        Raises:
            ForbiddenError: A token asks.
        """
        require_no_token(actor)
        with self._store.write() as session:
            if is_second_factor_required(session) != on:
                set_second_factor_required(session, on)
                word = "required" if on else "not required"
                log_account_event(session, actor, "everybody", f"second factor {word}", "")


def make_recovery_codes() -> list[str]:
    """Recovery codes for somebody who has none."""
    return [make_recovery_code() for _ in range(CODES)]


def hash_recovery_codes(codes: list[str]) -> list[str]:
    """The hashes of recovery codes, as stored."""
    return [hash_token(normalize_code(one)) for one in codes]


def drop_codes_if_last_factor_removed(session: Session, login: Login) -> None:
    """What follows when one of somebody's second factors was taken away.

    Raises:
        ConflictError: Everybody needs one here, and it was the last.
    """
    if has_second_factor(session, login.person_id):
        return
    if is_second_factor_required(session):
        raise ConflictError(
            "this server requires a second factor of everybody",
            hint="Add another second factor first.",
        )
    delete_recovery_codes(session, login.person_id)


def require_password(store: Store, login: Login, password: str | None, at: datetime) -> None:
    """Raise InputError unless that is the password of who is logged in.

    Without one they must have come by single sign-on just now.
    """
    if password is None:
        if login.way is LoginMethod.SIGN_ON and login.created and at - login.created < FRESH:
            return
        raise InputError(
            "this action needs your password, or a login by single sign-on within the last ten minutes",
            hint="Without a password: log out, log in again, and come back here.",
            pointer="/password",
        )
    with store.read() as session:
        person = find_person_by_id(session, login.person_id)
    if person is None or not verify_password(password, person.password):
        raise InputError("the password is wrong", pointer="/password")
