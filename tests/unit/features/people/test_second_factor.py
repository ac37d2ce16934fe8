"""Second factors, in a real database: enrolling, codes that count once, recovery, and being required."""

from __future__ import annotations

import base64
import stat
from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime, timedelta

import pyotp
import pytest
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from app.config import Settings
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError, NotLoggedInError
from app.features.people import links
from app.features.people import links as passwords
from app.features.people.devices import AttemptWindow
from app.features.people.logins import Login, LoginSessions
from app.features.people.roles import Role
from app.features.people.second_factor import SecondFactors
from app.features.people.service import find_person, invite
from tests.databases import all_that_is_kept

SECRET = "correct horse battery"


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hash that takes no time."""
    cheap = Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1)
    monkeypatch.setattr(passwords, "HASHER", PasswordHash((cheap,)))
    passwords._make_placeholder_hash.cache_clear()


class Clock:
    def __init__(self) -> None:
        self.at = datetime.now(UTC).replace(second=10)

    def __call__(self) -> datetime:
        return self.at


class Desk:
    """Anna, her authenticator, and the server's side of it."""

    def __init__(self, store: Store):
        self.store, self.clock = store, Clock()
        self.logins, self.factors = (
            LoginSessions(store, self.clock),
            SecondFactors(store, self.clock),
        )
        _, link = invite(store, "anna", Role.LEAD, actor="local")
        links.set_password_by_link(store, link.token, SECRET)
        self.totp = pyotp.TOTP(pyotp.random_base32())
        self.codes: list[str] = []

    def login(self, code: str | None = None) -> Login:
        login = self.logins.find(self.logins.log_in("anna", SECRET, code=code))
        assert login is not None
        return login

    def enrol(self) -> Login:
        login = self.login()
        self.totp = pyotp.TOTP(self.factors.begin(login, SECRET).secret)
        self.codes = self.factors.confirm(login, self.code())
        self.clock.at += timedelta(seconds=60)
        return login

    def code(self, later: float = 0.0) -> str:
        return self.totp.at(self.clock.at + timedelta(seconds=later))

    def refused(self, code: str | None, word: str) -> None:
        with pytest.raises(NotLoggedInError, match=word) as refusal:
            self.login(code)
        assert refusal.value.pointer == "/code"


@pytest.fixture
def desk(tmp_path) -> Iterator[Desk]:
    with closing(Store.open(Settings(home=tmp_path / "home"))) as store:
        yield Desk(store)


class TestLogin:
    def test_asks_for_a_code_after_the_password(self, desk: Desk) -> None:
        desk.enrol()
        desk.refused(None, "is missing")
        assert desk.login(desk.code()).name == "anna"

    def test_a_wrong_password_hears_nothing_of_it(self, desk: Desk) -> None:
        desk.enrol()
        with pytest.raises(NotLoggedInError) as refused:
            desk.logins.log_in("anna", "wrong wrong wrong", code=desk.code())
        assert refused.value.pointer is None
        assert desk.login(desk.code()), "the code was not used up"

    def test_a_code_counts_once_and_so_does_none_before_it(self, desk: Desk) -> None:
        desk.enrol()
        before, code = desk.code(-30), desk.code()
        desk.login(code)
        desk.refused(code, "used before")
        desk.refused(before, "used before")
        desk.clock.at += timedelta(seconds=30)
        desk.login(desk.code())

    @pytest.mark.parametrize(
        ("later", "good"), [(-31, True), (30, True), (-61, False), (61, False)]
    )
    def test_clocks_may_differ_by_a_code(self, desk: Desk, later: float, good: bool) -> None:
        desk.enrol()
        desk.clock.at = desk.clock.at.replace(second=15) + timedelta(minutes=5)
        if good:
            desk.login(desk.code(later))
        else:
            desk.refused(desk.code(later), "code is wrong")

    @pytest.mark.parametrize("code", ["", "000000", "12345", "１２３４５６", "abcdef", "a" * 40])
    def test_what_is_no_code_is_refused(self, desk: Desk, code: str) -> None:
        desk.enrol()
        desk.refused(code if code != desk.code() else "000001", "code is wrong")

    def test_each_try_is_counted_and_none_before_the_password(self, desk: Desk) -> None:
        desk.enrol()
        counted: list[int] = []
        for password in (SECRET, "wrong wrong wrong"):
            with pytest.raises(NotLoggedInError):
                desk.logins.log_in(
                    "anna", password, code="000000", on_code=lambda: counted.append(1)
                )
        assert counted == [1]

    def test_a_try_is_counted_in_the_database_too_where_processes_share_it(
        self, desk: Desk
    ) -> None:
        desk.enrol()
        attempts = AttemptWindow(desk.store)

        def count() -> None:
            assert attempts.count_attempt_or_get_wait("code/anna", 1, 3600.0) is None

        code = desk.code()
        assert desk.logins.log_in("anna", SECRET, code=code, on_code=count)
        assert attempts.count_attempt_or_get_wait("code/anna", 1, 3600.0) is not None

    def test_a_recovery_code_takes_its_place_once(self, desk: Desk) -> None:
        desk.enrol()
        assert len(set(desk.codes)) == 10
        desk.login(f" {desk.codes[3].upper().replace('-', ' ')} ")
        desk.refused(desk.codes[3], "used before")
        assert desk.factors.state(find_person(desk.store, "anna").id).codes_left == 9


class TestEnrolling:
    def test_nothing_is_asked_before_it_is_confirmed(self, desk: Desk) -> None:
        login = desk.login()
        desk.factors.begin(login, SECRET)
        with pytest.raises(InputError, match="code is wrong"):
            desk.factors.confirm(login, "000000")
        assert desk.login()
        assert not find_person(desk.store, "anna").second_factor

    def test_it_takes_the_password_and_ends_other_sessions(self, desk: Desk) -> None:
        other = desk.logins.log_in("anna", SECRET)
        with pytest.raises(InputError, match="the password is wrong"):
            desk.factors.begin(desk.login(), "wrong wrong wrong")
        login = desk.enrol()
        assert desk.logins.find(other) is None
        assert [item.id for item in desk.logins.sessions(login)] == [login.id]
        with pytest.raises(ConflictError):
            desk.factors.begin(login, SECRET)
        with pytest.raises(NotFoundError):
            desk.factors.confirm(login, desk.code())

    def test_the_code_that_confirmed_it_does_not_log_in(self, desk: Desk) -> None:
        login = desk.login()
        desk.totp = pyotp.TOTP(desk.factors.begin(login, SECRET).secret)
        desk.factors.confirm(login, desk.code())
        desk.refused(desk.code(), "used before")

    def test_the_picture_is_a_png_and_the_address_names_the_person(self, desk: Desk) -> None:
        made = desk.factors.begin(desk.login(), SECRET)
        kind, _, data = made.picture.partition(",")
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data).startswith(b"\x89PNG")
        assert made.uri.startswith("otpauth://totp/Touchline:anna?secret=")

    def test_it_is_taken_away_by_oneself_or_an_admin(self, desk: Desk) -> None:
        login = desk.enrol()
        with pytest.raises(InputError):
            desk.factors.remove(login, "wrong wrong wrong")
        desk.factors.remove(login, SECRET)
        desk.enrol()
        desk.factors.clear(login.person_id, actor="local")
        assert desk.login()

    def test_a_stolen_database_makes_no_codes(self, desk: Desk) -> None:
        desk.enrol()
        home = desk.store.settings.home
        desk.store.close()
        key = home / "second-factor.key"
        assert stat.S_IMODE(key.stat().st_mode) == 0o600
        kept = all_that_is_kept(home, but=key)
        secret = base64.b32decode(desk.totp.secret)
        texts = (desk.totp.secret.encode(), secret, secret.hex().encode(), key.read_bytes())
        for text in (*texts, *(code.replace("-", "").encode() for code in desk.codes)):
            assert text not in kept
        key.unlink()
        with closing(Store.open(desk.store.settings)) as store:
            logins = LoginSessions(store, desk.clock)
            with pytest.raises(NotLoggedInError):
                logins.log_in("anna", SECRET, code=desk.code())
            assert logins.log_in("anna", SECRET, code=desk.codes[0])


class TestRequired:
    def test_who_has_none_must_make_one(self, desk: Desk) -> None:
        desk.factors.set_required(True, actor="local")
        assert desk.login().must_enrol
        login = desk.enrol()
        found = desk.login(desk.code())
        assert not found.must_enrol
        with pytest.raises(ConflictError, match="requires a second factor"):
            desk.factors.remove(login, SECRET)
        desk.factors.set_required(False, actor="local")
        desk.factors.remove(login, SECRET)
        assert not desk.login().must_enrol
