"""Access tokens: with them scripts ask a team's server, in the name of a person and for less.

A token is ``tl_`` with 8 characters that may be shown, 40 that are secret and 6 of checksum. Whoever
searches files for secrets knows it by its look, and one that was not copied whole is known without
asking the database.
"""

from __future__ import annotations

import re
import secrets
import string
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from app.db.session import Session, format_utc_time
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError, NotLoggedInError
from app.features.people.links import hash_token
from app.features.people.login_queries import (
    TokenRow,
    delete_access_token,
    delete_expired_token,
    find_access_token,
    insert_access_token,
    list_access_tokens,
    update_access_token_last_use,
)
from app.features.people.logins import LEADING, Login, UsedToken, dataset_roles_from_rights
from app.features.people.queries import find_person_by_id, rights_from_row
from app.features.people.roles import Role, Scope, log_account_event

PREFIX = "tl_"
SHOWN, SECRET, CHECK = 8, 40, 6
"""Characters of each part; 40 of 62 kinds are 238 bits."""
LOOKS = re.compile(rf"{PREFIX}[0-9A-Za-z]{{{SHOWN + SECRET + CHECK}}}")
"""What every token looks like."""
DAYS, MOST_DAYS = 90, 365
MOST = 50
"""Tokens of one person."""
NOTED_AFTER = timedelta(minutes=5)
"""When a token was used is written down no more often."""
INVALID = "this token is unknown, expired or ended"
CUT = "this token is incomplete or mistyped"
ANOTHER = "Make another one under Account, in the browser."
_LETTERS = string.digits + string.ascii_uppercase + string.ascii_lowercase
_NAME = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9 ._-]{0,38}[A-Za-z0-9])?")


@dataclass(frozen=True)
class AccessToken:
    """A token as it is listed; its text is known to whoever made it alone.

    Attributes:
        start: Its first characters.
        dataset: The one dataset that it is for; None: all that its person may see.
        used: When it was used last, to some minutes; None: never.
        expired: It is no longer valid.
    """

    id: int
    person: str
    name: str
    start: str
    scopes: tuple[Scope, ...]
    dataset: str | None
    created: str
    expires: str
    used: str | None
    expired: bool


def make_access_token_text() -> str:
    """The text of a new token."""
    body = PREFIX + "".join(secrets.choice(_LETTERS) for _ in range(SHOWN + SECRET))
    return body + _checksum(body)


def has_valid_checksum(text: str) -> bool:
    """Whether a text is one that ``make_access_token_text`` can have made: no letter is missing or mistyped."""
    return LOOKS.fullmatch(text) is not None and _checksum(text[:-CHECK]) == text[-CHECK:]


def _checksum(body: str) -> str:
    number, letters = zlib.crc32(body.encode()), ""
    for _ in range(CHECK):
        number, left = divmod(number, len(_LETTERS))
        letters = _LETTERS[left] + letters
    return letters


class AccessTokens:
    """Everything that is asked of tokens.

    Args:
        store: Where they are.
        clock: Says what time it is, in UTC.
    """

    def __init__(self, store: Store, clock: Callable[[], datetime] = lambda: datetime.now(UTC)):
        self._store, self._clock = store, clock

    def make(
        self,
        login: Login,
        name: str,
        scopes: Sequence[Scope],
        *,
        days: int = DAYS,
        dataset_id: int | None = None,
    ) -> tuple[AccessToken, str]:
        """Make a token for whoever is logged in.

        Args:
            login: Whose it is.
            name: What the log calls it, beside their name.
            scopes: What it is for; at least one.
            days: After so many it is no longer valid.
            dataset_id: The one dataset that it is for; None: all.

        Returns:
            The token, and its text, which nobody can be shown again.

        Raises:
            InputError: Name, scopes or days cannot be used.
            ConflictError: They have one of that name that is still good, or too many.
        """
        name, chosen = (
            _validate_token_name(name),
            tuple(scope for scope in Scope if scope in scopes),
        )
        if not chosen:
            raise InputError("a token needs a scope", pointer="/scopes")
        if not 1 <= days <= MOST_DAYS:
            raise InputError(f"a token can last from 1 to {MOST_DAYS} days", pointer="/days")
        at, text = self._clock(), make_access_token_text()
        values = {
            "token_hash": hash_token(text),
            "person_id": login.person_id,
            "dataset_id": dataset_id,
            "name": name,
            "start": text[: len(PREFIX) + SHOWN],
            "scopes": " ".join(chosen),
            "created": format_utc_time(at),
            "expires": format_utc_time(at + timedelta(days=days)),
            "used": None,
        }
        with self._store.write() as session:
            person = find_person_by_id(session, login.person_id)
            if person is None or person.disabled:
                raise NotLoggedInError("the account was disabled meanwhile")
            delete_expired_token(session, person.id, name, format_utc_time(at))
            mine = list_access_tokens(session, person.id)
            _require_unused_name_and_limit([row.name for row in mine], name)
            token_id = insert_access_token(session, values)
            _log_token_event(session, person.name, person, "token made", values | {"id": token_id})
            made = next(row for row in list_access_tokens(session, person.id) if row.id == token_id)
        return self._token_from_row(made), text

    def find_login_of_token(self, text: str) -> Login:
        """The owner of a token, and its scopes.

        Raises:
            NotLoggedInError: It is none, has expired or was ended, or its person is disabled.
        """
        if not has_valid_checksum(text):
            raise NotLoggedInError(CUT, hint="Copy the complete token again.")
        with self._store.read_for_one_statement() as session:
            row = find_access_token(
                session, hash_token(text), format_utc_time(self._clock()), LEADING
            )
        if row is None:
            raise NotLoggedInError(INVALID, hint=ANOTHER)
        roles = dataset_roles_from_rights(Role(row.role), rights_from_row(row))
        if row.dataset_id is not None:
            roles = roles.restrict_to_dataset(row.dataset_id)
        seen = datetime.fromisoformat(row.used or row.created)
        use = UsedToken(row.name, _parse_scopes(row), fresh=row.used is None)
        return Login(row.id, row.person_id, row.person, roles, seen, use)

    def should_log_use(self, login: Login) -> bool:
        """Whether it should be written down that a token is used."""
        fresh = login.token is not None and login.token.fresh
        return fresh or self._clock() - login.seen > NOTED_AFTER

    def touch(self, login: Login) -> None:
        """Write down that a token is used."""
        with self._store.write(lasting=False) as session:
            update_access_token_last_use(session, login.id, format_utc_time(self._clock()))

    def list_of_person(self, person_id: int | None) -> list[AccessToken]:
        """The tokens of a person, or of everybody (None), the newest of each first."""
        with self._store.read() as session:
            return [self._token_from_row(row) for row in list_access_tokens(session, person_id)]

    def end(self, token_id: int, person_id: int | None, *, actor: str) -> AccessToken:
        """End a token: whoever uses it is refused from now on.

        Args:
            token_id: Which.
            person_id: Whose it has to be; None: anybody's.
            actor: Who ends it.

        Returns:
            The token as it was.

        Raises:
            NotFoundError: There is none of that id, or it is another person's.
        """
        with self._store.write() as session:
            rows = list_access_tokens(session, person_id)
            row = next((row for row in rows if row.id == token_id), None)
            person = None if row is None else find_person_by_id(session, row.person_id)
            if row is None or person is None:
                raise NotFoundError(
                    f"there is no token {token_id}",
                    hint="The page Account, or touchline users tokens, lists your tokens.",
                )
            delete_access_token(session, token_id)
            _log_token_event(
                session, actor, person, "token ended", {"id": token_id, "name": row.name}
            )
            return self._token_from_row(row)

    def _token_from_row(self, row: TokenRow) -> AccessToken:
        names = ("id", "person", "name", "start", "dataset", "created", "expires", "used")
        values = {name: getattr(row, name) for name in names}
        expired = row.expires <= format_utc_time(self._clock())
        return AccessToken(**values, scopes=_parse_scopes(row), expired=expired)


def _validate_token_name(text: str) -> str:
    name = text.strip()
    if not _NAME.fullmatch(name):
        raise InputError(
            "the name of a token has 1 to 40 characters (A to Z, a to z, digits, spaces and . _ -), and begins and ends with a letter or digit",
            pointer="/name",
        )
    return name


def _require_unused_name_and_limit(names: Sequence[str], name: str) -> None:
    if name in names:
        raise ConflictError(
            f"you have a token {name} already", hint="Revoke it, or choose another name."
        )
    if len(names) >= MOST:
        raise ConflictError(
            f"you already have {MOST} tokens, the most that one person may have",
            hint="Revoke some of them first.",
        )


def _parse_scopes(row: Any) -> tuple[Scope, ...]:
    return tuple(Scope(name) for name in row.scopes.split())


def _log_token_event(
    session: Session, actor: str, person: Any, did: str, values: dict[str, Any]
) -> None:
    changed = {name: values[name] for name in ("scopes", "expires", "dataset_id") if name in values}
    token = {"token": values["name"], "token_id": values["id"]}
    log_account_event(session, actor, person.name, did, person.role, **token, **changed)
