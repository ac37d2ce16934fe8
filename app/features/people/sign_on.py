"""Single sign-on: who comes by an account of the provider that the operator trusts (OpenID Connect).

An account becomes a person's by an act of theirs alone: they link it while they are logged in, or they
follow a link that an admin gave them. Neither name nor e-mail address makes it anybody's.
"""

from __future__ import annotations

import json
import re
import secrets
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from hmac import compare_digest
from typing import Any

from app.db.session import Session, format_utc_time
from app.db.store import Store
from app.errors import ConflictError, InputError, NotLoggedInError
from app.features.people.devices import make_pending_action_store, verify_and_use_code
from app.features.people.links import consume_link, find_link_holder, hash_token, make_random_token
from app.features.people.login_queries import (
    delete_logins,
    find_identity,
    put_identity,
    update_identity_use,
)
from app.features.people.logins import ASK_CODE, LOST, WRONG_CODE, Login, LoginMethod, LoginSessions
from app.features.people.provider import Provider, ProviderLoginRequest
from app.features.people.queries import (
    find_person_by_id,
    find_person_by_name,
    has_second_factor,
    insert_person,
)
from app.features.people.roles import log_account_event, normalize_user_name
from app.features.people.second_factor import require_password
from app.features.people.sign_on_rules import SignOnRules, make_identity_label, require_no_identity
from app.json_text import json_text

LASTS = timedelta(minutes=10)
"""So long somebody may take to log in at the provider."""
LATE = "this login has expired, was completed already, or began in another browser"
FACTOR = "/factor"
"""Pointer of a refusal that asks for the code of a second factor."""
_OWN = re.compile(r"/(?![/\\])[!-\[\]-~]*")
_LONGEST = 2000


@dataclass(frozen=True)
class _PendingLogin:
    """A login that somebody has begun.

    Attributes:
        browser: Hash of what their browser alone knows.
        asked: What the provider was asked.
        to: The page to which they go then.
        link: The token of a link that they follow, and ``name``, which the first admin chooses.
        session: The key of the session whose person links an account; None: somebody logs in.
        claims: What the provider said, where only the code of a second factor is still missing.
    """

    browser: str
    asked: ProviderLoginRequest
    to: str
    link: str | None = None
    name: str | None = None
    session: str | None = None
    claims: Mapping[str, Any] | None = None

    def to_json_bytes(self) -> bytes:
        """As JSON."""
        return json_text(asdict(self)).encode()

    @staticmethod
    def from_json_bytes(text: bytes) -> _PendingLogin:
        """What ``text`` made."""
        values = json.loads(text)
        return _PendingLogin(**{**values, "asked": ProviderLoginRequest(**values["asked"])})


@dataclass(frozen=True)
class SignOnResult:
    """How it ended: the token of a new session, None where an account was linked; and the page to show."""

    token: str | None
    to: str


class SignOn:
    """Everything that is asked of single sign-on.

    Args:
        store: Where people are.
        logins: Begins sessions.
        rules: What the operator has said.
        clock: Says what time it is, in UTC.
    """

    def __init__(
        self,
        store: Store,
        logins: LoginSessions,
        rules: SignOnRules,
        clock: Callable[[], datetime] = lambda: datetime.now(UTC),
    ):
        self.rules = rules
        self._store, self._logins, self._clock = store, logins, clock
        self._provider = Provider(rules, clock)
        self._begun = make_pending_action_store(store, clock, LASTS, "sign-on")

    def begin(
        self,
        browser_token: str,
        *,
        redirect: str,
        to: str = "/groups",
        link: str | None = None,
        name: str | None = None,
    ) -> str:
        """The address at the provider where somebody logs in.

        Args:
            browser_token: The random token in this browser's cookie.
            redirect: The page of ours to which the provider sends them back.
            to: The page to which they go then.
            link: The token of a link that they follow.
            name: What the first admin wants to be called.

        Raises:
            InputError: ``to`` is no page of ours, or the name cannot be one.
            NotFoundError: The link is not good.
            ConflictError: The provider gave an invalid response.
        """
        if not _OWN.fullmatch(to) or len(to) > _LONGEST:
            raise InputError("this is not a page of this server", pointer="/to")
        if link is not None and find_link_holder(self._store, link).name is None:
            name = normalize_user_name(name or "")
        return self._begin_login(browser_token, redirect, to, link=link, name=name)

    def begin_linking_account(
        self, browser_token: str, login: Login, password: str | None, *, redirect: str
    ) -> str:
        """The address where somebody who is logged in shows which account is theirs.

        Raises:
            InputError: That is not their password.
            ConflictError: They have an account there already, or the provider does not answer.
        """
        require_password(self._store, login, password, self._clock())
        with self._store.read() as session:
            require_no_identity(session, login.person_id, self.rules)
        return self._begin_login(browser_token, redirect, "/account", session=login.session_key)

    def finish(
        self,
        browser_token: str,
        state: str,
        code: str,
        *,
        factor: str | None = None,
        issuer: str | None = None,
        login: Login | None = None,
        browser: str = "",
        address: str = "",
        before: str | None = None,
        on_code: Callable[[str], None] = lambda _name: None,
    ) -> SignOnResult:
        """What follows once somebody comes back from the provider.

        Args:
            browser_token: The random token in this browser's cookie.
            state: Which login it is.
            code: What the provider gave for it.
            factor: A code of their second factor, where the answer before asked for it.
            issuer: Who says so (RFC 9207).
            login: Who is logged in.
            browser: What the browser calls itself.
            address: Where it is.
            before: The token of the session that the browser had, which ends.
            on_code: Is called with their name before a code is looked at, to count it.

        Raises:
            NotLoggedInError: It is not the answer to what this browser was asked, the provider does not
                vouch for it, or who that is may not come in; or a code is missing (``pointer`` is then
                ``FACTOR``: ask again with the same state).
            InputError: The same of an account that is to be linked.
            NotFoundError: The link is no longer valid.
            ConflictError: The account is another person's, a name is taken, or the provider does not answer.
        """
        found = self._begun.take(hash_token(state))
        begun = None if found is None else _PendingLogin.from_json_bytes(found)
        if begun is None or not compare_digest(begun.browser, hash_token(browser_token)):
            raise NotLoggedInError(LATE, hint="Begin again.")
        if issuer is not None and issuer != self.rules.issuer:
            raise NotLoggedInError("the response comes from another provider", hint="Begin again.")
        if begun.session is not None:
            return self._link_account(begun, code, login)
        claims = begun.claims or self._fetch_admitted_claims(begun, code)
        person_id, password = self._find_or_make_person(begun, claims)
        vouched = self.rules.has_trusted_factor(claims)
        if factor is not None and not vouched:
            # In a transaction of its own, which another that writes would wait for.
            on_code(self._read_person_name(person_id))

        def require_account_and_record_use(session: Session) -> None:
            # Read again: the account may have been taken away from them since.
            if not _has_identity(session, self.rules, claims, person_id):
                raise NotLoggedInError(
                    self._unknown_account_sentence(), hint=self._unknown_account_hint()
                )
            if not vouched and has_second_factor(session, person_id):
                self._require_second_factor(session, person_id, factor)
            update_identity_use(
                session, person_id, make_identity_label(claims), format_utc_time(self._clock())
            )

        try:
            token = self._logins.begin(
                person_id,
                password,
                browser,
                address,
                before,
                require_account_and_record_use,
                LoginMethod.SIGN_ON,
                vouched=vouched,
            )
        except NotLoggedInError as error:
            if error.pointer == FACTOR:
                # Whoever followed a link has come by it; what is missing is asked for again.
                waits = replace(begun, claims=claims, link=None)
                self._begun.put(hash_token(state), waits.to_json_bytes())
            raise
        return SignOnResult(token, begun.to)

    def _begin_login(self, browser_token: str, redirect: str, to: str, **more: Any) -> str:
        request = ProviderLoginRequest(
            redirect, make_random_token(), make_random_token(), secrets.token_urlsafe(48)
        )
        address = self._provider.make_login_url(request)
        self._begun.put(
            hash_token(request.state),
            _PendingLogin(hash_token(browser_token), request, to, **more).to_json_bytes(),
        )
        return address

    def _fetch_admitted_claims(self, begun: _PendingLogin, code: str) -> Mapping[str, Any]:
        claims = self._provider.fetch_claims(begun.asked, code)
        self.rules.require_admitted(claims)
        return claims

    def _find_or_make_person(
        self, begun: _PendingLogin, claims: Mapping[str, Any]
    ) -> tuple[int, str | None]:
        """Id of who that is, and the hash of the password that they have.

        Raises:
            NotLoggedInError: Nobody here, or somebody who is disabled.
        """
        with self._store.write() as session:
            found = find_identity(session, self.rules.issuer, claims["sub"])
            if begun.link is not None:
                person_id = self._link_account_by_invitation(
                    session, begun.link, begun.name, claims, found
                )
            elif found is not None:
                person_id = found.person_id
            else:
                person_id = self._make_person(session, claims)
            person = find_person_by_id(session, person_id)
            if person is None or person.disabled:
                raise NotLoggedInError(
                    "your account on this server is disabled", hint="Ask an admin of this server."
                )
            return person_id, person.password

    def _link_account_by_invitation(
        self,
        session: Session,
        link: str,
        name: str | None,
        claims: Mapping[str, Any],
        found: Any | None,
    ) -> int:
        """Whose a link is; the account is theirs from now on, and the password that they had is none."""
        person_id = consume_link(session, link, name, password=None)
        if found is not None and found.person_id != person_id:
            raise self._already_linked_error()
        self._save_identity(session, person_id, claims)
        return person_id

    def _make_person(self, session: Session, claims: Mapping[str, Any]) -> int:
        """Make an account for an unknown person, where the operator allows that."""
        if self.rules.new_role is None:
            raise NotLoggedInError(
                self._unknown_account_sentence(), hint=self._unknown_account_hint()
            )
        try:
            name = normalize_user_name(self.rules.make_user_name(claims))
        except InputError:
            raise NotLoggedInError(
                f"{self.rules.label} sent a user name for you that Touchline does not allow",
                hint=self._unknown_account_hint(),
            ) from None
        if find_person_by_name(session, name) is not None:
            # It may be the same person, and it may not: a name shows nothing.
            raise NotLoggedInError(
                f"there is already a user {name} who is not linked with this account",
                hint=(
                    "If that is you: log in another way and link the account under Account, or ask "
                    "an admin for a link."
                ),
            )
        person_id = insert_person(session, name, self.rules.new_role, by=name)
        log_account_event(session, name, name, "came by single sign-on", self.rules.new_role)
        self._save_identity(session, person_id, claims)
        return person_id

    def _link_account(self, begun: _PendingLogin, code: str, login: Login | None) -> SignOnResult:
        if login is None or login.session_key != begun.session or login.token is not None:
            raise InputError(
                "the session that wanted to link an account has ended", hint="Begin again."
            )
        try:
            claims = self._fetch_admitted_claims(begun, code)
        except NotLoggedInError as error:
            raise InputError(error.message, hint=error.hint) from error
        with self._store.write() as session:
            require_no_identity(session, login.person_id, self.rules)
            if find_identity(session, self.rules.issuer, claims["sub"]) is not None:
                raise self._already_linked_error()
            self._save_identity(session, login.person_id, claims)
            delete_logins(session, login.person_id, but=login.id)
        return SignOnResult(None, begun.to)

    def _save_identity(self, session: Session, person_id: int, claims: Mapping[str, Any]) -> None:
        shown, person = make_identity_label(claims), find_person_by_id(session, person_id)
        assert person is not None
        values = {"issuer": self.rules.issuer, "subject": claims["sub"], "shown": shown}
        put_identity(
            session, {**values, "person_id": person_id, "created": format_utc_time(self._clock())}
        )
        log_account_event(
            session, person.name, person.name, "single sign-on linked", person.role, account=shown
        )

    def _read_person_name(self, person_id: int) -> str:
        with self._store.read() as session:
            person = find_person_by_id(session, person_id)
        assert person is not None
        return str(person.name)

    def _require_second_factor(self, session: Session, person_id: int, factor: str | None) -> None:
        if factor is None:
            raise NotLoggedInError(ASK_CODE, hint=LOST, pointer=FACTOR)
        if not verify_and_use_code(session, self._store, person_id, factor, self._clock()):
            raise NotLoggedInError(WRONG_CODE, hint=LOST, pointer=FACTOR)

    def _unknown_account_sentence(self) -> str:
        return f"no person here is linked with the account that {self.rules.label} names"

    def _unknown_account_hint(self) -> str:
        return "An admin can send you a link; if you have an account, link it under Account."

    def _already_linked_error(self) -> ConflictError:
        return ConflictError(
            f"the account that {self.rules.label} names is linked with another person here",
            hint="Log out at the provider, then log in with your own account.",
        )


def _has_identity(
    session: Session, rules: SignOnRules, claims: Mapping[str, Any], person_id: int
) -> bool:
    found = find_identity(session, rules.issuer, claims["sub"])
    return found is not None and found.person_id == person_id
