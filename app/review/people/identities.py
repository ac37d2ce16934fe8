"""Identities: which account of the provider of single sign-on is whose, and taking it away again."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from app.errors import ConflictError, ForbiddenError, NotFoundError
from app.review.people.logins import Login, Way
from app.review.people.names import note, require_no_token
from app.review.people.roles import Role
from app.review.people.second_factor import require_password
from app.review.people.sign_on_rules import SignOnRules
from app.store.identities import count_linked, delete_identity, identity_of
from app.store.logins import delete_logins
from app.store.people import all_people, count_able, person_by_id
from app.store.session import Session
from app.store.store import Store


@dataclass(frozen=True)
class Identity:
    """The account of somebody, as they are shown it.

    Attributes:
        shown: What people know it by.
        used: When they came by it last; None: never.
    """

    issuer: str
    shown: str
    created: str
    used: str | None


@dataclass(frozen=True)
class OwnWays:
    """How somebody can come in: by a password, and by an account of the provider."""

    password: bool
    identity: Identity | None


def ways_of(store: Store, person_id: int) -> OwnWays:
    """How a person can come in."""
    with store.read() as session:
        person, row = person_by_id(session, person_id), identity_of(session, person_id)
    found = None if row is None else Identity(row.issuer, row.shown, row.created, row.used)
    return OwnWays(person is not None and person.password is not None, found)


def require_none(session: Session, person_id: int, rules: SignOnRules) -> None:
    """Raise ConflictError where somebody has an account of the provider already."""
    found = identity_of(session, person_id)
    if found is not None and found.issuer == rules.issuer:
        raise ConflictError(
            f"an account of {rules.label} is linked with yours already",
            hint="Unlink that one first.",
        )


def unlink(store: Store, login: Login, password: str | None, at: datetime) -> None:
    """Take one's account away; other sessions that began with it end.

    Raises:
        InputError: That is not the password.
        NotFoundError: There is none.
        ConflictError: There is no other way in.
    """
    require_password(store, login, password, at)
    with store.write() as session:
        person = person_by_id(session, login.person_id)
        if person is not None and person.password is None:
            raise ConflictError(
                "you have no password: you could not log in any more",
                hint="An admin can send you a link with which you choose one.",
            )
        if delete_identity(session, login.person_id) is None:
            raise NotFoundError("no account of a provider is linked with yours")
        delete_logins(session, login.person_id, but=login.id, way=Way.SIGN_ON)
        note(session, login.name, login.name, "single sign-on unlinked", login.role)


def unlink_person(store: Store, person_id: int, *, actor: str) -> None:
    """Take somebody's account away; their sessions that began with it end.

    Raises:
        NotFoundError: There is nobody of that id, or they have none.
        ForbiddenError: It is one's own, which takes the password; or a token asks.
        ConflictError: No admin would be left who can log in.
    """
    require_no_token(actor)
    with store.write() as session:
        person = person_by_id(session, person_id)
        if person is not None and person.name == actor:
            raise ForbiddenError("nobody unlinks themselves so", hint="Do it under Account.")
        if person is None or delete_identity(session, person_id) is None:
            raise NotFoundError("no account of a provider is linked with that person")
        if person.role == Role.ADMIN and not count_able(session, Role.ADMIN):
            raise ConflictError(
                f"{person.name} is the last admin who can log in", hint="Make another one first."
            )
        delete_logins(session, person_id, way=Way.SIGN_ON)
        note(session, actor, person.name, "single sign-on unlinked", person.role)


def linked_admins(store: Store, rules: SignOnRules) -> int:
    """How many admins can come by the provider."""
    with store.read() as session:
        admins = [
            one.id for one in all_people(session) if one.role == Role.ADMIN and not one.disabled
        ]
        return count_linked(session, rules.issuer, admins)
