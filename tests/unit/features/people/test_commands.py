"""Commands on accounts, and which servers are refused to whom."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pyotp
import pytest
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher
from typer.testing import CliRunner, Result

from app.command_line import app
from app.config import Settings
from app.db.locks import hold_server_lock
from app.db.store import Store
from app.errors import ConflictError, InputError, NotLoggedInError
from app.features.audit.queries import AuditQuery
from app.features.audit.service import read_audit
from app.features.imports.ingest import ensure_dataset
from app.features.people import links
from app.features.people import links as passwords
from app.features.people.access_tokens import AccessTokens
from app.features.people.login_queries import put_identity
from app.features.people.logins import Login, LoginSessions
from app.features.people.roles import Role, Scope
from app.features.people.second_factor import SecondFactors
from app.features.people.service import list_people
from app.features.people.visibility_queries import EVERYTHING
from tests.smtp import MailBox, serving

SECRET = "three plain words"


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty home, where hashes take no time, and nothing is served for long."""
    for name in [name for name in os.environ if name.startswith("TOUCHLINE_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("TOUCHLINE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(
        "app.http.server.serve_application", lambda app, _: app.state.services.close()
    )
    cheap = Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1)
    monkeypatch.setattr(passwords, "HASHER", PasswordHash((cheap,)))
    return tmp_path / "home"


@pytest.fixture
def store(home: Path) -> Iterator[Store]:
    with closing(Store.open(Settings())) as opened:
        yield opened


def run(*words: str) -> Result:
    return CliRunner().invoke(app, list(words))


def token_in(text: str) -> str:
    return text.partition("/join#")[2].split()[0].strip('",')


def found(logins: LoginSessions, name: str) -> Login:
    login = logins.find(logins.log_in(name, SECRET))
    assert login is not None
    return login


class TestUsers:
    def test_an_invitation_is_a_link_that_logs_in(self, store: Store) -> None:
        done = run("users", "add", "anna", "--role", "lead")
        assert done.exit_code == 0, done.output
        links.set_password_by_link(store, token_in(done.stdout), SECRET)
        logins = LoginSessions(store)
        login = logins.find(logins.log_in("anna", SECRET))
        assert login is not None
        assert login.role is Role.LEAD

    def test_a_link_has_the_address_of_the_running_server_or_says_that_it_is_assumed(
        self, home: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        alone = run("users", "add", "anna")
        assert "http://127.0.0.1:8000/join#" in alone.stdout
        assert "http://127.0.0.1:8000 in links is assumed" in alone.stderr
        with hold_server_lock(Settings()) as tell_address:
            tell_address("http://127.0.0.1:8471")
            beside = run("users", "reset", "anna")
        assert "http://127.0.0.1:8471/join#" in beside.stdout and beside.stderr == ""
        monkeypatch.setenv("TOUCHLINE_URL", "https://x.org")
        named = run("users", "reset", "anna")
        assert "https://x.org/join#" in named.stdout and named.stderr == ""

    def test_a_link_goes_by_mail_where_an_address_is_given(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert list_people(store) == []
        with serving(MailBox()) as box:
            for name, value in {
                "URL": "https://touchline.example.org",
                "SMTP_HOST": "127.0.0.1",
                "SMTP_PORT": str(box.port),
                "SMTP_SECURITY": "none",
                "SMTP_FROM": "box@example.org",
            }.items():
                monkeypatch.setenv(f"TOUCHLINE_{name}", value)
            for command in ("add", "reset"):
                done = run("users", command, "anna", "--email", "anna@example.org", "--json")
                told = json.loads(done.stdout)
                assert told["mailed"] is True
                assert "link" not in told
        assert [to for _, to in box.envelopes] == 2 * ["anna@example.org"]

    def test_many_are_invited_from_a_file(self, tmp_path: Path, store: Store) -> None:
        file = tmp_path / "people.csv"
        file.write_text("name,role,email\nanna,lead,\nbob,boss,\n")
        dry = run("users", "invite-many", str(file), "--dry-run")
        assert dry.exit_code == 1
        assert "1 possible, 1 refused" in dry.stdout
        assert json.loads(run("users", "list", "--json").stdout) == []
        done = run("users", "invite-many", str(file))
        assert '"boss" is not a role' in done.stdout
        links.set_password_by_link(store, token_in(done.stdout), SECRET)
        assert found(LoginSessions(store), "anna").role is Role.LEAD

    def test_a_list_that_is_no_utf8_is_named(self, tmp_path: Path) -> None:
        file = tmp_path / "people.csv"
        file.write_bytes("name,role\nJosé,lead\n".encode("latin-1"))
        with pytest.raises(InputError, match=r"people\.csv is not UTF-8 text") as refused:
            CliRunner().invoke(app, ["users", "invite-many", str(file)], catch_exceptions=False)
        assert "CSV UTF-8" in (refused.value.hint or "")

    def test_the_list_says_where_everybody_is(self, store: Store) -> None:
        for name in ("anna", "bob"):
            links.set_password_by_link(store, token_in(run("users", "add", name).stdout), SECRET)
        run("users", "add", "carl")
        run("users", "disable", "bob")
        run("users", "role", "anna", "viewer")
        found = json.loads(run("users", "list", "--json").stdout)
        told = [(one["name"], one["role"], one["state"]) for one in found]
        assert told == [
            ("anna", "viewer", "active"),
            ("bob", "reviewer", "disabled"),
            ("carl", "reviewer", "invited"),
        ]
        run("users", "enable", "bob")
        assert "disabled" not in run("users", "list").stdout

    def test_a_reset_gives_another_password(self, store: Store) -> None:
        links.set_password_by_link(store, token_in(run("users", "add", "anna").stdout), SECRET)
        links.set_password_by_link(
            store, token_in(run("users", "reset", "anna").stdout), "other plain words"
        )
        assert LoginSessions(store).log_in("anna", "other plain words")

    def test_a_role_in_one_dataset_is_granted_and_taken(self, store: Store) -> None:
        for dataset in ("issia", "league"):
            ensure_dataset(store, dataset, "local")
        links.set_password_by_link(
            store, token_in(run("users", "add", "anna", "--role", "none").stdout), SECRET
        )
        assert run("users", "grant", "anna", "issia", "reviewer").exit_code == 0
        logins = LoginSessions(store)
        roles = found(logins, "anna").roles
        assert [roles.find_role_in(key) for key in (1, 2)] == [Role.REVIEWER, Role.NONE]
        listed = json.loads(run("users", "list", "--json").stdout)
        assert listed[0]["datasets"] == {"issia": "reviewer"}
        assert "issia: reviewer" in run("users", "list").stdout
        assert run("users", "take", "anna", "issia").exit_code == 0
        assert found(logins, "anna").roles.find_role_in(1) is Role.NONE
        assert "the whole server" in str(run("users", "grant", "anna", "1", "admin").exception)

    def test_what_was_done_before_there_were_accounts_is_given_to_one_person_once(
        self, store: Store
    ) -> None:
        ensure_dataset(store, "league", "local")
        run("users", "add", "anna")
        given = run("users", "adopt", "anna")
        assert given.exit_code == 0
        assert "what was done until now as local" in given.stdout
        entries = read_audit(store, AuditQuery(), EVERYTHING).items
        assert [one.actor for one in entries if one.kind == "dataset"] == ["anna"]
        run("users", "add", "bob")
        again = run("users", "adopt", "bob")
        assert isinstance(again.exception, ConflictError)
        assert "the work of the user local is already assigned to anna" in str(again.exception)
        assert str(run("users", "adopt", "carl").exception) == "there is no user carl"

    def test_a_second_factor_is_required_and_taken_away(self, store: Store) -> None:
        links.set_password_by_link(store, token_in(run("users", "add", "anna").stdout), SECRET)
        logins, factors = LoginSessions(store), SecondFactors(store)
        login = logins.find(logins.log_in("anna", SECRET))
        assert login is not None and not login.must_enrol
        assert run("users", "require-second-factor", "on").exit_code == 0
        login = logins.find(logins.log_in("anna", SECRET))
        assert login is not None and login.must_enrol
        factors.confirm(login, pyotp.TOTP(factors.begin(login, SECRET).secret).now())
        links.set_password_by_link(store, token_in(run("users", "reset", "anna").stdout), SECRET)
        with pytest.raises(NotLoggedInError, match="second factor"):
            logins.log_in("anna", SECRET)
        assert run("users", "reset", "anna", "--second-factor").exit_code == 0
        assert run("users", "require-second-factor", "off").exit_code == 0
        assert logins.log_in("anna", SECRET)

    def test_an_account_of_the_provider_is_listed_and_unlinked(self, store: Store) -> None:
        run("users", "add", "anna")
        values = {"issuer": "https://club.example", "subject": "s", "shown": "anna@club.example"}
        with store.write() as session:
            put_identity(session, {**values, "person_id": 1, "created": "2026-11-01"})
        assert "active" in run("users", "list").stdout
        assert "anna@club.example" in run("users", "list").stdout
        assert run("users", "unlink", "anna").exit_code == 0
        assert "club.example" not in run("users", "list").stdout
        assert "no account of a provider" in str(run("users", "unlink", "anna").exception)

    def test_the_last_admin_who_can_log_in_keeps_it(self, store: Store) -> None:
        run("users", "add", "anna", "--role", "admin")
        values = {"issuer": "https://club.example", "subject": "s", "shown": "anna@club.example"}
        with store.write() as session:
            put_identity(session, {**values, "person_id": 1, "created": "2026-11-01"})
        assert "/join#" not in run("serve", "--team", "--port", "0").stdout, "anna can log in"
        assert "who can log in" in str(run("users", "unlink", "anna").exception)
        assert "anna@club.example" in run("users", "list").stdout

    def test_tokens_are_listed_and_ended(self, store: Store) -> None:
        for name in ("anna", "bob"):
            links.set_password_by_link(store, token_in(run("users", "add", name).stdout), SECRET)
            logins, tokens = LoginSessions(store), AccessTokens(store)
            login = logins.find(logins.log_in(name, SECRET))
            assert login is not None
            made, text = tokens.make(login, "deploy", [Scope.EXPORT])
        found = json.loads(run("users", "tokens", "--json").stdout)
        assert [(one["person"], one["name"]) for one in found] == [
            ("anna", "deploy"),
            ("bob", "deploy"),
        ]
        assert "export" in run("users", "tokens", "anna").stdout
        assert text not in run("users", "tokens").stdout
        assert run("users", "tokens", "anna", "--end", str(made.id)).exit_code == 1, "it is bob's"
        assert run("users", "tokens", "--end", str(made.id)).exit_code == 0
        assert "bob" not in run("users", "tokens").stdout
        with pytest.raises(NotLoggedInError):
            tokens.find_login_of_token(text)

    @pytest.mark.parametrize("role", ["boss", ""])
    def test_a_role_that_is_none_is_wrong_usage(self, role: str) -> None:
        done = run("users", "add", "anna", "--role", role)
        assert done.exit_code == 2
        assert "viewer, annotator" in done.output


class TestServe:
    @pytest.mark.parametrize(
        ("words", "told"),
        [
            (("--host", "0.0.0.0"), "serve a team with --team"),
            (("--host", "0.0.0.0", "--url", "https://x.org"), "serve a team with --team"),
            (("--host", "0.0.0.0", "--team"), "--url https://NAME"),
            (("--host", "::", "--team", "--url", "http://x.org"), "--url https://NAME"),
            (("--team", "--url", "http://x.org"), "is not encrypted"),
            (("--team", "--url", "javascript:alert(1)"), "must be the base URL of the server"),
        ],
    )
    def test_what_strangers_could_reach_or_read_is_refused(
        self, home: Path, words: tuple[str, ...], told: str
    ) -> None:
        done = run("serve", *words)
        assert done.exit_code == 2
        assert told in " ".join(done.output.replace("│", " ").split())
        assert not home.exists()

    def test_half_a_single_sign_on_is_refused(
        self, home: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("TOUCHLINE_SSO_ISSUER", "https://accounts.club.example")
        done = run("serve", "--team")
        assert done.exit_code == 1
        assert "needs the settings TOUCHLINE_SSO_CLIENT_ID and" in str(done.exception)
        assert not home.exists()

    def test_the_first_start_prints_a_link_for_an_admin_until_there_is_one(
        self, store: Store
    ) -> None:
        first = run("serve", "--team", "--port", "0").stdout
        second = run("serve", "--team", "--port", "0", "--url", "https://x.org").stdout
        assert "https://x.org/join#" in second
        with pytest.raises(Exception, match="no longer valid"):
            links.find_link_holder(store, token_in(first))
        links.set_password_by_link(store, token_in(second), SECRET, "ada")
        assert "/join#" not in run("serve", "--team", "--port", "0").stdout

    def test_a_home_of_a_team_is_not_served_to_everybody(self) -> None:
        run("users", "add", "anna")
        refused = run("serve", "--port", "0")
        assert refused.exit_code == 1
        assert "has accounts" in str(refused.exception)
        assert run("serve", "--port", "0", "--alone").exit_code == 0
