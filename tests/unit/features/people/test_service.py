"""Accounts, their links and their sessions, in a real database."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime, timedelta

import pytest
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from app.config import Settings
from app.db.log import read_log
from app.db.session import now
from app.db.store import Store
from app.errors import (
    ConflictError,
    ForbiddenError,
    InputError,
    NotFoundError,
    NotLoggedInError,
)
from app.features.groups.replay import replay_log
from app.features.people import links
from app.features.people import links as passwords
from app.features.people.login_queries import put_identity
from app.features.people.logins import IDLE, LASTS, Login, LoginSessions
from app.features.people.queries import update_person
from app.features.people.roles import (
    Action,
    DatasetRoles,
    Role,
    normalize_user_name,
    require_permission,
    role_allows,
)
from app.features.people.service import change_person, find_person, invite, list_people, renew_link
from app.features.people.sign_on_rules import unlink_person
from tests.databases import all_that_is_kept

SECRET = "correct horse battery"


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hash that takes no time."""
    cheap = Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1)
    monkeypatch.setattr(passwords, "HASHER", PasswordHash((cheap,)))
    passwords._make_placeholder_hash.cache_clear()


@pytest.fixture
def home(tmp_path) -> Iterator[Store]:
    with closing(Store.open(Settings(home=tmp_path / "home"))) as store:
        yield store


class Clock:
    def __init__(self) -> None:
        self.at = datetime.now(UTC)

    def __call__(self) -> datetime:
        return self.at


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def logins(home, clock) -> LoginSessions:
    return LoginSessions(home, clock)


def join(store: Store, name: str, role: Role = Role.REVIEWER) -> None:
    """Somebody who was invited and has come."""
    _, link = invite(store, name, role, actor="local")
    links.set_password_by_link(store, link.token, SECRET)


def found(logins: LoginSessions, token: str) -> Login:
    login = logins.find(token)
    assert login is not None
    return login


class TestRoles:
    def test_each_role_may_what_those_before_it_may(self) -> None:
        for action in Action:
            allowed = [role_allows(role, action) for role in Role]
            assert allowed == sorted(allowed)
            assert allowed[-1]

    def test_a_refusal_says_what_is_missing(self) -> None:
        with pytest.raises(ForbiddenError, match="needs the role lead; yours is viewer"):
            require_permission(Role.VIEWER, Action.LEAD)


class TestNames:
    @pytest.mark.parametrize(
        "name", ["", "local", "script", "a b", "script:x", "-a", "é", "a" * 41]
    )
    def test_no_name_passes_for_a_script_or_the_local_user(self, name: str) -> None:
        with pytest.raises(InputError):
            normalize_user_name(name)

    def test_capitals_are_the_same_person(self) -> None:
        assert normalize_user_name(" Anna ") == "anna"


class TestLinks:
    def test_a_link_is_good_once(self, home, logins) -> None:
        _, link = invite(home, "anna", Role.VIEWER, actor="local")
        assert links.find_link_holder(home, link.token) == links.LinkHolder("anna", False)
        assert links.set_password_by_link(home, link.token, SECRET) == "anna"
        with pytest.raises(NotFoundError, match="no longer valid"):
            links.set_password_by_link(home, link.token, SECRET)
        assert found(logins, logins.log_in("anna", SECRET)).role is Role.VIEWER

    def test_a_new_one_ends_the_one_before(self, home) -> None:
        person, first = invite(home, "anna", Role.VIEWER, actor="local")
        _, second = renew_link(home, person.id, actor="local")
        with pytest.raises(NotFoundError):
            links.find_link_holder(home, first.token)
        assert links.find_link_holder(home, second.token).name == "anna"

    def test_it_is_too_old_after_its_days(self, home) -> None:
        with home.write() as session:
            from app.features.people.links import insert_password_link
            from app.features.people.queries import insert_person

            person = insert_person(session, "anna", Role.VIEWER, by="local")
            past = datetime.now(UTC) - links.LASTS - timedelta(seconds=1)
            link = insert_password_link(session, person, by="local", at=past)
        with pytest.raises(NotFoundError):
            links.set_password_by_link(home, link.token, SECRET)

    def test_a_reset_ends_every_session(self, home, logins) -> None:
        join(home, "anna")
        token = logins.log_in("anna", SECRET)
        _, link = renew_link(home, find_person(home, "anna").id, actor="local")
        assert logins.find(token), "a link that nobody has used ends nothing"
        links.set_password_by_link(home, link.token, SECRET + "!")
        assert logins.find(token) is None
        with pytest.raises(NotLoggedInError):
            logins.log_in("anna", SECRET)

    def test_the_first_admin_chooses_a_name_and_the_link_is_gone(self, home, logins) -> None:
        link = links.make_first_admin_link(home, actor="local")
        assert link is not None
        assert links.find_link_holder(home, link.token).name is None
        assert links.set_password_by_link(home, link.token, SECRET, "Anna") == "anna"
        assert found(logins, logins.log_in("anna", SECRET)).role is Role.ADMIN
        assert links.make_first_admin_link(home, actor="local") is None
        with pytest.raises(NotFoundError):
            links.set_password_by_link(home, link.token, SECRET, "eve")

    def test_the_link_of_the_first_admin_ends_once_there_is_another(self, home) -> None:
        link = links.make_first_admin_link(home, actor="local")
        assert link is not None
        join(home, "anna", Role.ADMIN)
        with pytest.raises(NotFoundError):
            links.set_password_by_link(home, link.token, SECRET, "eve")

    def test_a_password_that_cannot_be_one_leaves_the_link_good(self, home) -> None:
        _, link = invite(home, "anna.of.the.north", Role.VIEWER, actor="local")
        for bad in ("short", "x" * 201, "Anna.of.the.North"):
            with pytest.raises(InputError):
                links.set_password_by_link(home, link.token, bad)
        links.set_password_by_link(home, link.token, SECRET)


class TestLogins:
    def test_unknown_disabled_and_wrong_get_the_same_words(self, home, logins) -> None:
        join(home, "anna")
        join(home, "gone")
        change_person(home, find_person(home, "gone").id, actor="local", disabled=True)
        invite(home, "new", Role.VIEWER, actor="local")
        told = set()
        for name in ("anna", "nobody", "gone", "new", "", "x" * 10_000):
            with pytest.raises(NotLoggedInError) as refused:
                logins.log_in(name, SECRET if name != "anna" else "wrong wrong wrong")
            told.add((refused.value.message, refused.value.hint))
        assert len(told) == 1

    def test_an_unknown_name_is_hashed_for_as_well(self, home, logins, monkeypatch) -> None:
        asked = []
        verify = passwords.HASHER.verify
        monkeypatch.setattr(
            passwords.HASHER, "verify", lambda *given: asked.append(given) or verify(*given)
        )
        with pytest.raises(NotLoggedInError):
            logins.log_in("nobody", SECRET)
        assert len(asked) == 1

    def test_who_asks_and_what_they_may_is_one_statement(self, home, logins, counted) -> None:
        join(home, "anna", Role.LEAD)
        token = logins.log_in("anna", SECRET)
        with counted(home) as cost:
            assert found(logins, token).role is Role.LEAD
        assert (cost.statements, cost.reads, cost.writes) == (1, 0, 0)

    def test_it_ends_when_nobody_uses_it(self, home, logins, clock) -> None:
        join(home, "anna")
        token = logins.log_in("anna", SECRET)
        clock.at += IDLE - timedelta(seconds=1)
        login = found(logins, token)
        assert logins.should_log_use(login)
        logins.touch(login)
        clock.at += IDLE - timedelta(seconds=1)
        assert not logins.should_log_use(login) or logins.find(token)
        clock.at += timedelta(seconds=2)
        assert logins.find(token) is None

    def test_it_ends_however_much_it_is_used(self, home, logins, clock) -> None:
        join(home, "anna")
        token = logins.log_in("anna", SECRET)
        end = clock.at + LASTS
        while clock.at + IDLE / 2 < end:
            clock.at += IDLE / 2
            logins.touch(found(logins, token))
        clock.at = end
        assert logins.find(token) is None

    def test_a_login_ends_the_session_that_the_browser_had(self, home, logins) -> None:
        join(home, "anna")
        first = logins.log_in("anna", SECRET)
        second = logins.log_in("anna", SECRET, before=first)
        assert first != second
        assert logins.find(first) is None
        assert logins.find(second)

    def test_nobody_ends_another_persons_session(self, home, logins) -> None:
        for name in ("anna", "bob"):
            join(home, name)
        anna, bob = (found(logins, logins.log_in(name, SECRET)) for name in ("anna", "bob"))
        with pytest.raises(NotFoundError):
            logins.end(anna, bob.id)
        assert [item.id for item in logins.sessions(anna)] == [anna.id]
        assert [item.id for item in logins.sessions(bob)] == [bob.id]

    def test_another_password_ends_every_other_session(self, home, logins) -> None:
        join(home, "anna")
        tokens = [logins.log_in("anna", SECRET) for _ in range(3)]
        login = found(logins, tokens[0])
        with pytest.raises(InputError, match="current password"):
            logins.change_password(login, "wrong wrong wrong", "other other other")
        fresh = logins.change_password(login, SECRET, "other other other")
        assert [logins.find(token) for token in tokens] == [None] * 3
        assert found(logins, fresh).name == "anna"

    def test_the_database_holds_no_secret(self, home, logins) -> None:
        _, link = invite(home, "anna", Role.VIEWER, actor="local")
        _, waiting = invite(home, "bob", Role.VIEWER, actor="local")
        links.set_password_by_link(home, link.token, SECRET)
        token = logins.log_in("anna", SECRET)
        home.close()
        kept = all_that_is_kept(home.settings.home)
        for secret in (SECRET, token, link.token, waiting.token):
            assert secret.encode() not in kept
        assert b"$argon2id$" in kept


class TestChangePerson:
    def test_who_is_disabled_is_logged_out_and_their_link_ends(self, home, logins) -> None:
        join(home, "anna")
        anna = find_person(home, "anna")
        token = logins.log_in("anna", SECRET)
        _, link = renew_link(home, anna.id, actor="local")
        change_person(home, anna.id, actor="local", disabled=True)
        assert logins.find(token) is None
        with pytest.raises(NotFoundError):
            links.set_password_by_link(home, link.token, SECRET)
        with pytest.raises(ConflictError, match="is disabled"):
            renew_link(home, anna.id, actor="local")
        change_person(home, anna.id, actor="local", disabled=False)
        assert logins.find(token) is None, "an old session does not come back"

    def test_a_session_of_somebody_disabled_is_none_however_it_came_to_be(
        self, home, logins
    ) -> None:
        join(home, "anna")
        token = logins.log_in("anna", SECRET)
        with home.write() as session:
            update_person(session, find_person(home, "anna").id, disabled=True)
        assert logins.find(token) is None

    def test_nobody_changes_their_own_rights(self, home) -> None:
        join(home, "anna", Role.ADMIN)
        with pytest.raises(ForbiddenError, match="your own role"):
            change_person(home, find_person(home, "anna").id, actor="anna", role=Role.VIEWER)

    def test_the_last_admin_cannot_go(self, home) -> None:
        join(home, "anna", Role.ADMIN)
        invite(home, "not-yet", Role.ADMIN, actor="anna")
        anna = find_person(home, "anna").id
        for change in ({"role": Role.LEAD}, {"disabled": True}):
            with pytest.raises(ConflictError, match="who can log in"):
                change_person(home, anna, actor="local", **change)
        join(home, "bob", Role.ADMIN)
        bob = find_person(home, "bob").id
        change_person(home, bob, actor="anna", disabled=True)
        with pytest.raises(ConflictError, match="who can log in"):
            change_person(home, anna, actor="local", disabled=True)
        change_person(home, bob, actor="anna", disabled=False)
        assert change_person(home, anna, actor="bob", role=Role.LEAD).role is Role.LEAD

    def test_with_sign_on_alone_an_admin_with_a_password_only_cannot_log_in(
        self, home, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        issuers = {"anna": "https://now.example", "bob": "https://before.example", "eve": None}
        for name, issuer in issuers.items():
            join(home, name, Role.ADMIN)
            values = {"issuer": issuer, "subject": name, "shown": name, "created": now()}
            if issuer:
                with home.write() as session:
                    put_identity(session, {**values, "person_id": find_person(home, name).id})
        anna = find_person(home, "anna").id
        only = {"sso_only": True, "sso_issuer": issuers["anna"]}
        monkeypatch.setattr(home, "settings", home.settings.model_copy(update=only))
        with pytest.raises(ConflictError, match="who can log in"):
            change_person(home, anna, actor="bob", disabled=True)
        with pytest.raises(ConflictError, match="who can log in"):
            unlink_person(home, anna, actor="bob")
        monkeypatch.setattr(home, "settings", home.settings.model_copy(update={"sso_only": False}))
        assert change_person(home, anna, actor="bob", disabled=True).disabled

    def test_the_log_names_who_did_it_and_still_rebuilds(self, home) -> None:
        join(home, "anna", Role.ADMIN)
        join(home, "bob")
        change_person(home, find_person(home, "bob").id, actor="anna", role=Role.LEAD)
        with home.read() as session:
            entries = [(item.kind, item.actor, item.body) for item in read_log(session)]
            replay_log(session)
        assert entries[-1] == ("person", "anna", {"person": "bob", "did": "role", "role": "lead"})
        assert SECRET not in str(entries)

    def test_everybody_is_listed(self, home) -> None:
        join(home, "anna", Role.ADMIN)
        invite(home, "bob", Role.VIEWER, actor="anna")
        told = [(one.name, one.joined, one.invited, one.created_by) for one in list_people(home)]
        assert told == [("anna", True, False, "local"), ("bob", False, True, "anna")]


class TestDatasetRoles:
    """Store ids 1 and 2; somebody who is reviewer everywhere but in the first."""

    def test_a_single_role_takes_the_place_of_the_one_everywhere(self) -> None:
        for single in (Role.NONE, Role.VIEWER, Role.LEAD):
            roles = DatasetRoles(Role.REVIEWER, {1: single})
            assert [roles.find_role_in(key) for key in (1, 2)] == [single, Role.REVIEWER]
        assert DatasetRoles(Role.ADMIN, {1: Role.NONE}).find_role_in(1) is Role.ADMIN

    def test_rights_in_one_dataset_alone_are_none_elsewhere(self) -> None:
        one = DatasetRoles(Role.ADMIN).restrict_to_dataset(1)
        assert (one.find_role_in(1), one.find_role_in(2), one.is_admin) == (
            Role.ADMIN,
            Role.NONE,
            False,
        )

    @pytest.mark.parametrize(
        ("everywhere", "single", "seen"),
        [
            (Role.VIEWER, {1: Role.NONE}, [False, True]),
            (Role.NONE, {1: Role.VIEWER}, [True, False]),
            (Role.NONE, {}, [False, False]),
        ],
    )
    def test_what_somebody_sees(self, everywhere: Role, single: dict, seen: list[bool]) -> None:
        sight = DatasetRoles(everywhere, single).visibility("anna")
        assert [sight.sees(key) for key in (1, 2)] == seen
        assert [sight.sees(None, name) for name in ("anna", "bob")] == [True, False]
