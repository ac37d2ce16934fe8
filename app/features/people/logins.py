"""Logins: sessions that the server keeps, and that a person can look at and end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum

from app.db.session import Session, format_utc_time
from app.db.store import Store
from app.errors import InputError, NotFoundError, NotLoggedInError
from app.features.people.devices import verify_and_use_code
from app.features.people.links import (
    LONGEST,
    hash_password,
    hash_token,
    make_random_token,
    verify_password,
)
from app.features.people.login_queries import (
    delete_expired_logins,
    delete_login,
    delete_logins,
    find_login,
    insert_login,
    list_sessions,
    update_login_last_use,
)
from app.features.people.queries import (
    DatasetRights,
    delete_person_links,
    find_person_by_id,
    find_person_by_name,
    find_rights,
    has_second_factor,
    rights_from_row,
    update_person,
)
from app.features.people.roles import (
    Action,
    DatasetRoles,
    Role,
    Scope,
    log_account_event,
    role_allows,
)
from app.features.people.visibility_queries import RestrictedReader, Visibility
from app.soccer.actors import make_token_actor

LEADING = tuple(role for role in Role if role_allows(role, Action.LEAD))
"""Roles that lead a dataset."""
IDLE = timedelta(hours=12)
"""A session that nobody has used for so long has ended."""
LASTS = timedelta(days=14)
"""And every session after so long."""
NOTED_AFTER = timedelta(minutes=5)
"""When a session was used is written down no more often."""
WRONG = "the name or the password is wrong"
ASK_CODE = "the code of your second factor is missing"
WRONG_CODE = "this code is wrong, expired, or was used before"
LOST = "You can also use a passkey or a recovery code. If you have none, an admin can remove the second factor."
MOST = 20
"""Sessions of one person; the one that was used longest ago makes room."""


class LoginMethod(StrEnum):
    """How somebody came in."""

    PASSWORD = "password"
    PASSKEY = "passkey"
    SIGN_ON = "sign_on"
    """By the provider of single sign-on."""


@dataclass(frozen=True)
class UsedToken:
    """The token with which a script asks.

    Attributes:
        fresh: It was never used before.
    """

    name: str
    scopes: tuple[Scope, ...]
    fresh: bool = False


@dataclass(frozen=True)
class Login:
    """The person of a request, the session or token (``id``) that it comes with, and its rights."""

    id: int
    person_id: int
    name: str
    roles: DatasetRoles
    seen: datetime
    token: UsedToken | None = None
    must_enrol: bool = False
    """They need a second factor, and have none: they may do nothing before they have."""
    way: LoginMethod | None = None
    """How the session began; None: there is none."""
    created: datetime | None = None
    """When it began."""

    @property
    def session_key(self) -> str:
        """What no other session is called, also when this one has ended: an id may come back."""
        began = "" if self.created is None else format_utc_time(self.created)
        return f"{self.person_id} {self.id} {began}"

    @property
    def actor(self) -> str:
        """What the log calls them: a person, or a person with the name of a token."""
        return self.name if self.token is None else make_token_actor(self.name, self.token.name)

    @property
    def role(self) -> Role:
        """The role in every dataset without a role of its own."""
        return self.roles.everywhere

    @property
    def ownership_name(self) -> str:
        """Under which name it is theirs what belongs to no dataset: a token of one has its own."""
        return self.actor if self.roles.limited else self.name

    @property
    def visibility(self) -> Visibility:
        """What they see."""
        return self.roles.visibility(self.ownership_name)

    @property
    def visibility_without_hidden_groups(self) -> Visibility:
        """What they see and nothing of which is hidden from them."""
        return self.roles.visibility_without_hidden_groups(self.ownership_name)

    @property
    def restricted_reader(self) -> RestrictedReader | None:
        """What is hidden from them; None: nothing."""
        if self.roles.is_admin:
            return None
        return RestrictedReader(
            self.name,
            self.roles.blind,
            lambda one: role_allows(self.roles.find_role_in(one), Action.REVIEW),
        )


@dataclass(frozen=True)
class OpenSession:
    """One session of a person, as they are shown it."""

    id: int
    browser: str
    address: str
    created: str
    seen: str
    expires: str


class LoginSessions:
    """Everything that is asked of sessions.

    Args:
        store: Where they are.
        clock: Says what time it is, in UTC.
        only: Sessions that began in another way are none; None: all are.
    """

    def __init__(
        self,
        store: Store,
        clock: Callable[[], datetime] = lambda: datetime.now(UTC),
        *,
        only: LoginMethod | None = None,
    ):
        self._store, self._clock, self._only = store, clock, only

    def log_in(
        self,
        name: str,
        password: str,
        *,
        code: str | None = None,
        on_code: Callable[[], None] = lambda: None,
        browser: str = "",
        address: str = "",
        before: str | None = None,
    ) -> str:
        """Begin a session; returns its token. The one that the browser had ``before`` ends.

        A name that nobody has takes as long as a wrong password, and gets the same answer. A code is
        looked at after the password alone; ``on_code`` is called before, to count it (in a
        transaction of its own, which another that writes would wait for).

        Raises:
            NotLoggedInError: Name and password do not belong together, or the account is disabled; or
                a code is missing or wrong (``pointer`` is then ``/code``).
        """
        name = name.strip().lower()[:LONGEST]
        with self._store.read() as session:
            person = find_person_by_name(session, name)
            is_asked = person is not None and has_second_factor(session, person.id)
        able = person is not None and not person.disabled
        if not verify_password(password, person.password if person and able else None):
            raise NotLoggedInError(WRONG, hint="An admin can send you a link for a new password.")
        assert person is not None
        if is_asked and code is not None:
            on_code()

        def require_code(session: Session) -> None:
            if has_second_factor(session, person.id):
                # What was not counted, for the account had no second factor yet, is asked for.
                if code is None or not is_asked:
                    raise NotLoggedInError(ASK_CODE, hint=LOST, pointer="/code")
                if not verify_and_use_code(session, self._store, person.id, code, self._clock()):
                    raise NotLoggedInError(WRONG_CODE, hint=LOST, pointer="/code")

        return self.begin(
            person.id, person.password, browser, address, before, require_code, LoginMethod.PASSWORD
        )

    def begin(
        self,
        person_id: int,
        password: str | None,
        browser: str,
        address: str,
        before: str | None,
        require: Callable[[Session], None] = lambda _session: None,
        way: LoginMethod = LoginMethod.PASSWORD,
        *,
        vouched: bool = False,
    ) -> str:
        """Begin a session of somebody who has shown who they are; returns its token.

        Args:
            person_id: Who it is.
            password: The hash of their password as it was then; None: they had none.
            browser: What their browser calls itself.
            address: Where it is.
            before: The token of the session that the browser had, which ends.
            require: Raises in the transaction of the new session, unless they may.
            way: How they have shown it.
            vouched: The provider of single sign-on has asked for a second factor.

        Raises:
            NotLoggedInError: The password was changed meanwhile, or the account disabled.
        """
        token, at = make_random_token(), self._clock()
        values = {
            "token_hash": hash_token(token),
            "person_id": person_id,
            "created": format_utc_time(at),
            "seen": format_utc_time(at),
            "expires": format_utc_time(at + LASTS),
            "browser": browser[:200],
            "address": address[:60],
            "way": way,
            "vouched": vouched,
        }
        with self._store.write() as session:
            person = find_person_by_id(session, person_id)
            # The password may have been changed, or the account disabled, since it was asked for.
            if person is None or person.disabled or person.password != password:
                raise NotLoggedInError(WRONG)
            require(session)
            delete_expired_logins(
                session, at=format_utc_time(at), idle_since=format_utc_time(at - IDLE)
            )
            if before and (
                old := find_login(
                    session, hash_token(before), leading=LEADING, **self._compute_expiry_limits(at)
                )
            ):
                delete_login(session, old.id, old.person_id)
            for unassigned in list_sessions(session, person_id, **self._compute_expiry_limits(at))[
                MOST - 1 :
            ]:
                delete_login(session, unassigned.id, person_id)
            insert_login(session, values)
            details = {"address": address[:60], "way": way.value}
            log_account_event(
                session, person.name, person.name, "logged in", person.role, **details
            )
        return token

    def find(self, token: str, *, at_once: bool = False) -> Login | None:
        """The person of a session token; None where the session has ended.

        Raises:
            BusyError: It had to be said ``at_once``, and cannot be without waiting.
        """
        alive = self._compute_expiry_limits(self._clock())
        with (
            self._store.read_without_waiting()
            if at_once
            else self._store.read_for_one_statement() as session
        ):
            row = find_login(session, hash_token(token), leading=LEADING, **alive)
        if row is None or self._only not in (None, row.way):
            return None
        roles = dataset_roles_from_rights(Role(row.role), rights_from_row(row))
        seen, created = datetime.fromisoformat(row.seen), datetime.fromisoformat(row.created)
        enrol = row.must_enrol and not row.vouched
        way = LoginMethod(row.way)
        return Login(
            row.id, row.person_id, row.name, roles, seen, None, enrol, way=way, created=created
        )

    def should_log_use(self, login: Login) -> bool:
        """Whether it should be written down that a session is used."""
        return self._clock() - login.seen > NOTED_AFTER

    def touch(self, login: Login) -> None:
        """Write down that a session is used."""
        with self._store.write(lasting=False) as session:
            update_login_last_use(session, login.id, format_utc_time(self._clock()))

    def sessions(self, login: Login) -> list[OpenSession]:
        """Every session of a person, the one that was used last first."""
        with self._store.read() as session:
            rows = list_sessions(
                session, login.person_id, **self._compute_expiry_limits(self._clock())
            )
        return [
            OpenSession(row.id, row.browser, row.address, row.created, row.seen, row.expires)
            for row in rows
        ]

    def end(self, login: Login, session_id: int) -> None:
        """End a session of one's own.

        Raises:
            NotFoundError: There is none of that id, or it is another person's.
        """
        with self._store.write() as session:
            if not delete_login(session, session_id, login.person_id):
                raise NotFoundError(f"you have no session {session_id}")
            did = "logged out" if session_id == login.id else "session ended"
            log_account_event(session, login.actor, login.name, did, login.role)

    def end_others(self, login: Login) -> None:
        """End every session of a person but the one that asks."""
        with self._store.write() as session:
            delete_logins(session, login.person_id, but=login.id)
            log_account_event(session, login.actor, login.name, "other sessions ended", login.role)

    def change_password(self, login: Login, old: str, new: str) -> str:
        """Give oneself another password; every session ends, and a new one begins.

        Returns:
            The token of the new one.

        Raises:
            InputError: The old one is wrong, or the new one cannot be one.
        """
        with self._store.read() as session:
            person = find_person_by_id(session, login.person_id)
        if person is None or not verify_password(old, person.password):
            raise InputError("this is not your current password", pointer="/old")
        hashed = hash_password(new, login.name, pointer="/new")
        with self._store.write() as session:
            found = list_sessions(
                session, login.person_id, **self._compute_expiry_limits(self._clock())
            )
            mine = next((row for row in found if row.id == login.id), None)
            if mine is None:
                raise NotLoggedInError("your session has ended")
            update_person(session, login.person_id, password=hashed)
            delete_logins(session, login.person_id)
            delete_person_links(session, login.person_id)
            log_account_event(session, login.name, login.name, "password", login.role)
        way, vouched = LoginMethod(mine.way), mine.vouched
        return self.begin(
            login.person_id, hashed, mine.browser, mine.address, None, way=way, vouched=vouched
        )

    def _compute_expiry_limits(self, at: datetime) -> dict[str, str]:
        return {"at": format_utc_time(at), "idle_since": format_utc_time(at - IDLE)}


def read_roles(session: Session, person_id: int, everywhere: Role) -> DatasetRoles:
    """The rights of a person, who is that everywhere."""
    if everywhere is Role.ADMIN:
        return DatasetRoles(everywhere)
    return dataset_roles_from_rights(everywhere, find_rights(session, person_id, LEADING))


def dataset_roles_from_rights(everywhere: Role, rights: DatasetRights) -> DatasetRoles:
    """The rights of somebody who is that everywhere; in copies they are what they are in what those
    are of."""
    if everywhere is Role.ADMIN:
        return DatasetRoles(everywhere)
    single = {key: Role(role) for key, role in rights.roles.items()}
    roles = DatasetRoles(everywhere, single)
    copies = {key: roles.find_role_in(of_id) for key, of_id in rights.copies.items()}
    return DatasetRoles(
        everywhere, {**single, **copies}, blind=_map_blind_batches_by_dataset(roles, rights)
    )


def _map_blind_batches_by_dataset(
    roles: DatasetRoles, rights: DatasetRights
) -> dict[int, frozenset[int]]:
    """The batches in which somebody annotates blind, by dataset.

    Leads see everything. Who judges decides where people differ: also in a batch of their own, once
    they have nothing left to annotate in it.
    """
    found: dict[int, frozenset[int]] = {}
    for batch, dataset, waits in rights.blind:
        role = roles.find_role_in(dataset)
        if role_allows(role, Action.LEAD) or (role_allows(role, Action.REVIEW) and not waits):
            continue
        found[dataset] = found.get(dataset, frozenset()) | {batch}
    return found
