"""Passkeys: key pairs in people's devices (WebAuthn), with which they log in without a password.

One counts as a second factor as well: it takes the device and what unlocks it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import structlog
from webauthn import (
    generate_authentication_options,
    generate_registration_options,
    verify_authentication_response,
    verify_registration_response,
)
from webauthn.helpers import base64url_to_bytes, bytes_to_base64url, options_to_json_dict
from webauthn.helpers.structs import (
    AuthenticatorSelectionCriteria,
    PublicKeyCredentialDescriptor,
    ResidentKeyRequirement,
    UserVerificationRequirement,
)

from app.db.session import Session, format_utc_time
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError, NotLoggedInError
from app.features.people.devices import CHALLENGE_LASTS as LASTS
from app.features.people.devices import PasskeyChallenges, make_pending_action_store
from app.features.people.links import hash_token
from app.features.people.login_queries import (
    delete_logins,
    delete_passkey,
    find_passkey,
    insert_passkey,
    list_passkeys,
    update_passkey_use,
)
from app.features.people.logins import Login, LoginMethod, LoginSessions
from app.features.people.queries import count_recovery_codes, find_person_by_id, put_recovery_codes
from app.features.people.roles import log_account_event
from app.features.people.second_factor import (
    ISSUER,
    drop_codes_if_last_factor_removed,
    hash_recovery_codes,
    make_recovery_codes,
    require_password,
)
from app.json_text import Moment

log = structlog.get_logger("touchline.access")

MOST = 20
"""Passkeys of one person."""
VERIFIED = UserVerificationRequirement.REQUIRED
REFUSED = "this passkey is not accepted"
RETRY_HINT = (
    "Try again; if it fails again, log in with your password and add another passkey under Account."
)
LATE = "the request has expired, or was answered already"


@dataclass(frozen=True)
class PasskeySite:
    """For whom passkeys are: the name that people open, and the origin of its pages.

    Example:
        >>> PasskeySite("touchline.example.org", "https://touchline.example.org").name
        'touchline.example.org'
    """

    name: str
    origin: str


@dataclass(frozen=True)
class Passkey:
    """A passkey as its person is shown it; ``used`` None: never yet.

    Attributes:
        used: When it logged in last; None: never.
    """

    id: int
    name: str
    created: Moment
    used: Moment | None


class Passkeys:
    """Everything that is asked of passkeys.

    Args:
        store: Where they are.
        logins: Begins sessions.
        clock: Says what time it is, in UTC.
    """

    def __init__(
        self,
        store: Store,
        logins: LoginSessions,
        clock: Callable[[], datetime] = lambda: datetime.now(UTC),
    ):
        self._store, self._logins, self._clock = store, logins, clock
        self._challenges = PasskeyChallenges(
            make_pending_action_store(store, clock, LASTS, "passkey")
        )

    def list_of_person(self, person_id: int) -> list[Passkey]:
        """The passkeys of a person, the oldest first."""
        with self._store.read() as session:
            rows = list_passkeys(session, person_id)
        return [Passkey(row.id, row.name, row.created, row.used) for row in rows]

    def begin_creation(
        self, login: Login, password: str | None, site: PasskeySite
    ) -> dict[str, Any]:
        """What a browser needs to make a passkey (PublicKeyCredentialCreationOptionsJSON).

        Raises:
            InputError: That is not the password.
            ConflictError: There are too many already.
        """
        require_password(self._store, login, password, self._clock())
        with self._store.read() as session:
            rows = list_passkeys(session, login.person_id)
        _require_passkey_limit(rows)
        options = generate_registration_options(
            rp_id=site.name,
            rp_name=ISSUER,
            user_id=_user_handle(login.person_id),
            user_name=login.name,
            challenge=self._challenges.make(_session_challenge_key(login)),
            authenticator_selection=AuthenticatorSelectionCriteria(
                resident_key=ResidentKeyRequirement.REQUIRED, user_verification=VERIFIED
            ),
            exclude_credentials=[
                PublicKeyCredentialDescriptor(base64url_to_bytes(row.credential)) for row in rows
            ],
        )
        return options_to_json_dict(options)

    def make(
        self, login: Login, name: str, credential: dict[str, Any], site: PasskeySite
    ) -> tuple[Passkey, list[str]]:
        """Keep the passkey that a browser has made; every other session ends.

        Returns:
            The passkey, and recovery codes where its person had none: nobody can be shown them again.

        Raises:
            InputError: It does not answer what this session was asked last, or is not for this site.
            ConflictError: There are too many, or one of that name, or it is known already.
        """
        made = self._verify_new_credential(login, credential, site)
        name, at = name.strip(), format_utc_time(self._clock())
        if not name:
            raise InputError("a passkey needs a name", pointer="/name")
        values = {
            "person_id": login.person_id,
            "credential": bytes_to_base64url(made.credential_id),
            "public_key": bytes_to_base64url(made.credential_public_key),
            "sign_count": made.sign_count,
            "name": name,
            "created": at,
        }
        with self._store.write() as session:
            rows = list_passkeys(session, login.person_id)
            _require_passkey_limit(rows)
            if name in {row.name for row in rows}:
                raise ConflictError(
                    f"you have a passkey {name} already", hint="Choose another name."
                )
            if find_passkey(session, values["credential"]) is not None:
                raise ConflictError("this passkey is registered already")
            number = insert_passkey(session, values)
            codes = [] if count_recovery_codes(session, login.person_id) else make_recovery_codes()
            if codes:
                put_recovery_codes(session, login.person_id, hash_recovery_codes(codes))
            delete_logins(session, login.person_id, but=login.id)
            log_account_event(session, login.name, login.name, "passkey", login.role, passkey=name)
        return Passkey(number, name, at, None), codes

    def remove(self, login: Login, passkey_id: int, password: str | None) -> None:
        """Stop accepting a passkey.

        Raises:
            InputError: That is not the password.
            NotFoundError: There is none of that id, or it is another person's.
            ConflictError: Everybody needs a second factor here, and it is the last.
        """
        require_password(self._store, login, password, self._clock())
        with self._store.write() as session:
            name = delete_passkey(session, passkey_id, login.person_id)
            if name is None:
                raise NotFoundError(f"you have no passkey {passkey_id}")
            drop_codes_if_last_factor_removed(session, login)
            log_account_event(
                session, login.name, login.name, "no passkey", login.role, passkey=name
            )

    def begin_login(self, browser_token: str, site: PasskeySite) -> dict[str, Any]:
        """What a browser needs to log in with a passkey (PublicKeyCredentialRequestOptionsJSON).

        Args:
            browser_token: The random token in this browser's cookie.
            site: For whom.
        """
        options = generate_authentication_options(
            rp_id=site.name,
            challenge=self._challenges.make(_browser_challenge_key(browser_token)),
            user_verification=VERIFIED,
        )
        return options_to_json_dict(options)

    def log_in(
        self,
        browser_token: str,
        credential: dict[str, Any],
        site: PasskeySite,
        *,
        browser: str = "",
        address: str = "",
        before: str | None = None,
    ) -> str:
        """Begin a session of whose passkey it is; returns its token.

        Raises:
            NotLoggedInError: It is nobody's, does not answer what this browser was asked last, is not
                for this site, was copied (its count goes back), or the account is disabled.
        """
        challenge = self._challenges.take(_browser_challenge_key(browser_token))
        if challenge is None:
            raise NotLoggedInError(LATE, hint="Try again.")
        with self._store.read() as session:
            row = find_passkey(session, str(credential.get("id")))
            person = find_person_by_id(session, row.person_id) if row else None
        if row is None or person is None:
            raise NotLoggedInError(REFUSED, hint=RETRY_HINT)

        def verify_signature_and_record_use(session: Session) -> None:
            # Read again: another login with it may have counted meanwhile, or it was taken away.
            found = find_passkey(session, row.credential)
            if found is None or found.person_id != row.person_id:
                raise NotLoggedInError(REFUSED, hint=RETRY_HINT)
            count = _verify_signature_and_get_count(found, credential, challenge, site)
            update_passkey_use(session, found.id, count, format_utc_time(self._clock()))

        return self._logins.begin(
            row.person_id,
            person.password,
            browser,
            address,
            before,
            verify_signature_and_record_use,
            LoginMethod.PASSKEY,
        )

    def _verify_new_credential(
        self, login: Login, credential: dict[str, Any], site: PasskeySite
    ) -> Any:
        challenge = self._challenges.take(_session_challenge_key(login))
        if challenge is None:
            raise InputError(LATE, hint="Begin again.", pointer="/credential")
        try:
            return verify_registration_response(
                credential=credential,
                expected_challenge=challenge,
                expected_rp_id=site.name,
                expected_origin=site.origin,
                require_user_verification=True,
            )
        except (
            Exception
        ) as error:  # What the library raises on any bytes is no part of its promise.
            log.warning("a new passkey was refused", reason=str(error)[:200])
            raise InputError(REFUSED, hint="Begin again.", pointer="/credential") from error


def _verify_signature_and_get_count(
    row: Any, credential: dict[str, Any], challenge: bytes, site: PasskeySite
) -> int:
    """How often the device says that it has signed; raises NotLoggedInError unless it has, this."""
    try:
        if base64url_to_bytes(credential["response"]["userHandle"]) != _user_handle(row.person_id):
            raise ValueError("this passkey belongs to another person")
        return verify_authentication_response(
            credential=credential,
            expected_challenge=challenge,
            expected_rp_id=site.name,
            expected_origin=site.origin,
            credential_public_key=base64url_to_bytes(row.public_key),
            credential_current_sign_count=row.sign_count,
            require_user_verification=True,
        ).new_sign_count
    except Exception as error:  # As above.
        log.warning("a passkey was refused", passkey=row.id, reason=str(error)[:200])
        raise NotLoggedInError(REFUSED, hint=RETRY_HINT) from error


def _require_passkey_limit(rows: Any) -> None:
    if len(rows) >= MOST:
        raise ConflictError(f"you have {MOST} passkeys", hint="Delete one of them first.")


def _user_handle(person_id: int) -> bytes:
    """Under which name a device keeps the passkey of a person."""
    return str(person_id).encode()


def _session_challenge_key(login: Login) -> str:
    return f"session {login.session_key}"


def _browser_challenge_key(browser_token: str) -> str:
    return f"browser {hash_token(browser_token)}"
