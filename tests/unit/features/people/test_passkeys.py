"""Passkeys, in a real database, with a device made of its keys: made, used, refused, taken away."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pyotp
import pytest
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from app.config import Settings
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError, NotLoggedInError
from app.features.people import links
from app.features.people import links as passwords
from app.features.people.devices import CHALLENGE_LASTS as LASTS
from app.features.people.devices import MOST, InMemoryPendingActions, PasskeyChallenges
from app.features.people.logins import Login, LoginSessions
from app.features.people.passkeys import Passkeys, PasskeySite
from app.features.people.roles import Role
from app.features.people.second_factor import SecondFactors
from app.features.people.service import change_person, find_person, invite
from tests.authenticator import PRESENT, VERIFIED, Authenticator, b64

SECRET = "correct horse battery"
SITE = PasskeySite("localhost", "http://localhost")
BROWSER = "a browser of anna's"


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hash that takes no time."""
    cheap = Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1)
    monkeypatch.setattr(passwords, "HASHER", PasswordHash((cheap,)))
    passwords._make_placeholder_hash.cache_clear()


class Desk:
    """Anna, her device, and the server's side of it."""

    def __init__(self, store: Store):
        self.store, self.at = store, datetime.now(UTC)
        self.logins = LoginSessions(store, lambda: self.at)
        self.factors = SecondFactors(store, lambda: self.at)
        self.passkeys = Passkeys(store, self.logins, lambda: self.at)
        self.device = Authenticator()
        self.join("anna")

    def join(self, name: str) -> None:
        _, link = invite(self.store, name, Role.LEAD, actor="local")
        links.set_password_by_link(self.store, link.token, SECRET)

    def login(self, name: str = "anna", code: str | None = None) -> Login:
        found = self.logins.find(self.logins.log_in(name, SECRET, code=code))
        assert found is not None
        return found

    def made(
        self, login: Login, device: Authenticator | None = None, name: str = "phone"
    ) -> list[str]:
        """Recovery codes of making a passkey."""
        options = self.passkeys.begin_creation(login, SECRET, SITE)
        credential = (device or self.device).make(options)
        return self.passkeys.make(login, name, credential, SITE)[1]

    def enter(self, credential: dict[str, Any] | None = None, browser_token: str = BROWSER) -> str:
        """Who is logged in by what the device signs."""
        if credential is None:
            credential = self.device.sign(self.passkeys.begin_login(browser_token, SITE))
        found = self.logins.find(self.passkeys.log_in(browser_token, credential, SITE))
        assert found is not None
        return found.name

    def refused(self, *args: Any) -> None:
        with pytest.raises(NotLoggedInError):
            self.enter(*args)


@pytest.fixture
def desk(tmp_path) -> Iterator[Desk]:
    with closing(Store.open(Settings(home=tmp_path / "home"))) as store:
        yield Desk(store)


class TestLogin:
    def test_takes_no_password_and_no_code(self, desk: Desk) -> None:
        desk.made(desk.login())
        assert desk.enter() == "anna"
        assert desk.passkeys.list_of_person(1)[0].used is not None

    def test_a_device_without_a_signature_counter_is_accepted(self, desk: Desk) -> None:
        desk.made(desk.login())
        for _ in "12":
            desk.device.count = -1
            assert desk.enter() == "anna"

    def test_an_answer_counts_once(self, desk: Desk) -> None:
        desk.made(desk.login())
        desk.device.count = -1
        signed = desk.device.sign(desk.passkeys.begin_login(BROWSER, SITE))
        desk.enter(signed)
        desk.refused(signed)
        desk.passkeys.begin_login(BROWSER, SITE)
        desk.refused(signed)

    def test_an_answer_is_of_the_browser_that_was_asked_and_soon(self, desk: Desk) -> None:
        desk.made(desk.login())
        desk.refused(desk.device.sign(desk.passkeys.begin_login(BROWSER, SITE)), "another browser")
        desk.refused(desk.device.sign(desk.passkeys.begin_login("", SITE)), BROWSER)
        signed = desk.device.sign(desk.passkeys.begin_login(BROWSER, SITE))
        desk.at += LASTS
        desk.refused(signed)

    @pytest.mark.parametrize(
        "wrong",
        [
            {"origin": "https://localhost.example.org"},
            {"origin": "http://localhost:8001"},
            {"site": "example.org"},
            {"flags": PRESENT},
            {"flags": VERIFIED},
            {"user": b"2"},
            {"key": Authenticator().key},
            {"credential": b"another device"},
        ],
        ids=lambda wrong: " ".join(f"{name} {str(value)[:30]}" for name, value in wrong.items()),
    )
    def test_what_is_not_for_this_site_or_not_verified_is_refused(
        self, desk: Desk, wrong: dict[str, Any]
    ) -> None:
        desk.made(desk.login())
        before = vars(desk.device).copy()
        vars(desk.device).update(wrong)
        desk.refused()
        vars(desk.device).update(before)
        assert desk.enter() == "anna"

    def test_a_copy_is_known_by_its_count(self, desk: Desk) -> None:
        desk.made(desk.login())
        desk.device.count = 7
        desk.enter()
        desk.device.count = 7
        desk.refused()

    @pytest.mark.parametrize("end", ["disabled", "removed", "cleared"])
    def test_it_ends_with_the_account_or_when_it_is_taken_away(self, desk: Desk, end: str) -> None:
        login = desk.login()
        desk.made(login)
        signed = desk.device.sign(desk.passkeys.begin_login(BROWSER, SITE))
        ends: dict[str, Callable[[], Any]] = {
            "disabled": lambda: change_person(desk.store, 1, actor="local", disabled=True),
            "removed": lambda: desk.passkeys.remove(login, 1, SECRET),
            "cleared": lambda: desk.factors.clear(1, actor="local"),
        }
        ends[end]()
        desk.refused(signed)

    @pytest.mark.parametrize("field", ["clientDataJSON", "authenticatorData", "signature"])
    def test_bytes_that_are_none_of_this_are_a_refusal(self, desk: Desk, field: str) -> None:
        desk.made(desk.login())
        signed = desk.device.sign(desk.passkeys.begin_login(BROWSER, SITE))
        signed["response"][field] = "A"
        desk.refused(signed)


class TestMaking:
    def test_it_takes_the_password_and_ends_other_sessions(self, desk: Desk) -> None:
        other, login = desk.logins.log_in("anna", SECRET), desk.login()
        with pytest.raises(InputError, match="the password is wrong"):
            desk.passkeys.begin_creation(login, "wrong wrong wrong", SITE)
        desk.made(login)
        assert desk.logins.find(other) is None
        assert [item.id for item in desk.logins.sessions(login)] == [login.id]

    def test_a_passkey_of_another_session_site_or_challenge_is_not_kept(self, desk: Desk) -> None:
        login = desk.login()
        options = desk.passkeys.begin_creation(login, SECRET, SITE)
        with pytest.raises(InputError, match="answered already"):
            desk.passkeys.make(desk.login(), "phone", desk.device.make(options), SITE)
        for wrong in ({"origin": "http://evil"}, {"site": "evil"}, {"flags": PRESENT}):
            options = desk.passkeys.begin_creation(login, SECRET, SITE)
            with pytest.raises(InputError, match="not accepted"):
                desk.passkeys.make(login, "phone", Authenticator(**wrong).make(options), SITE)
        with pytest.raises(InputError, match="answered already"):
            desk.passkeys.make(login, "phone", desk.device.make(options), SITE)
        desk.passkeys.begin_creation(login, SECRET, SITE)
        with pytest.raises(InputError, match="not accepted"):
            desk.passkeys.make(login, "phone", desk.device.make(options), SITE)
        garbage = desk.device.make(desk.passkeys.begin_creation(login, SECRET, SITE))
        garbage["response"]["attestationObject"] = b64(b"\xa1" * 300)
        with pytest.raises(InputError, match="not accepted"):
            desk.passkeys.make(login, "phone", garbage, SITE)
        assert desk.passkeys.list_of_person(1) == []

    def test_what_a_session_began_is_not_the_next_ones_with_its_id(self, desk: Desk) -> None:
        desk.join("berta")
        before = desk.login()
        credential = desk.device.make(desk.passkeys.begin_creation(before, SECRET, SITE))
        desk.logins.end(before, before.id)
        after = replace(desk.login("berta"), id=before.id)
        with pytest.raises(InputError, match="answered already"):
            desk.passkeys.make(after, "phone", credential, SITE)

    def test_one_person_may_have_several_named_ones_and_none_has_two_owners(
        self, desk: Desk
    ) -> None:
        login = desk.login()
        assert len(desk.made(login)) == 10
        second = Authenticator(credential=b"a key on a ring")
        with pytest.raises(ConflictError, match="phone already"):
            desk.made(login, second)
        assert desk.made(login, second, "ring") == [], "the recovery codes stay"
        assert [one.name for one in desk.passkeys.list_of_person(1)] == ["phone", "ring"]
        desk.join("berta")
        with pytest.raises(ConflictError, match="registered already"):
            desk.made(desk.login("berta"), second)
        with pytest.raises(NotFoundError):
            desk.passkeys.remove(desk.login("berta"), 1, SECRET)


class TestSecondFactor:
    def test_a_password_alone_no_longer_suffices(self, desk: Desk) -> None:
        codes = desk.made(desk.login())
        with pytest.raises(NotLoggedInError) as refusal:
            desk.login()
        assert refusal.value.pointer == "/code"
        assert desk.login(code=codes[0])
        with pytest.raises(NotLoggedInError):
            desk.login(code="123456")
        assert find_person(desk.store, "anna").second_factor

    def test_it_is_one_where_everybody_needs_one(self, desk: Desk) -> None:
        desk.factors.set_required(True, actor="local")
        login = desk.login()
        assert login.must_enrol
        codes = desk.made(login)
        assert not desk.login(code=codes[0]).must_enrol
        with pytest.raises(ConflictError, match="requires a second factor"):
            desk.passkeys.remove(login, 1, SECRET)
        assert desk.enter() == "anna", "it was not taken away"

    def test_the_last_of_both_kinds_takes_the_recovery_codes_with_it(self, desk: Desk) -> None:
        login = desk.login()
        desk.made(login)
        totp = pyotp.TOTP(desk.factors.begin(login, SECRET).secret)
        assert desk.factors.state(1).codes_left == 10, "a beginning takes nothing away"
        desk.factors.confirm(login, totp.at(desk.at))
        assert desk.factors.state(1).authenticator
        desk.factors.remove(login, SECRET)
        state = desk.factors.state(1)
        assert (state.on, state.authenticator, state.codes_left) == (True, False, 10)
        desk.passkeys.remove(login, 1, SECRET)
        assert (desk.factors.state(1).on, desk.factors.state(1).codes_left) == (False, 0)
        assert desk.login()


class TestChallenges:
    def test_old_ones_make_room(self) -> None:
        at = [datetime.now(UTC)]
        waiting = InMemoryPendingActions(lambda: at[0], LASTS)
        challenges = PasskeyChallenges(waiting)
        for number in range(MOST + 2):
            challenges.make(str(number))
        assert len(waiting._open) == MOST
        assert challenges.take("0") is None
        at[0] += LASTS + timedelta(seconds=1)
        challenges.make("late")
        assert list(waiting._open) == ["late"]
