"""Commands on accounts, and which servers are refused to whom."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher
from typer.testing import CliRunner, Result

from app.cli import app
from app.config import Settings
from app.review.people import links, passwords
from app.review.people.logins import Logins
from app.review.people.roles import Role
from app.store.session import Store

SECRET = "three plain words"


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty home, where hashes take no time, and nothing is served for long."""
    for name in [name for name in os.environ if name.startswith("TOUCHLINE_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("TOUCHLINE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr("app.api.server.run", lambda *_: None)
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


class TestUsers:
    def test_an_invitation_is_a_link_that_logs_in(self, store: Store) -> None:
        done = run("users", "add", "anna", "--role", "lead")
        assert done.exit_code == 0, done.output
        links.use(store, token_in(done.stdout), SECRET)
        logins = Logins(store)
        login = logins.find(logins.log_in("anna", SECRET))
        assert login is not None
        assert login.role is Role.LEAD

    def test_the_list_says_where_everybody_is(self, store: Store) -> None:
        for name in ("anna", "bob"):
            links.use(store, token_in(run("users", "add", name).stdout), SECRET)
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
        links.use(store, token_in(run("users", "add", "anna").stdout), SECRET)
        links.use(store, token_in(run("users", "reset", "anna").stdout), "other plain words")
        assert Logins(store).log_in("anna", "other plain words")

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
            (("--team", "--url", "javascript:alert(1)"), "must be the beginning of an address"),
        ],
    )
    def test_what_strangers_could_reach_or_read_is_refused(
        self, home: Path, words: tuple[str, ...], told: str
    ) -> None:
        done = run("serve", *words)
        assert done.exit_code == 2
        assert told in " ".join(done.output.replace("│", " ").split())
        assert not home.exists()

    def test_the_first_start_prints_a_link_for_an_admin_until_there_is_one(
        self, store: Store
    ) -> None:
        first = run("serve", "--team", "--port", "0").stdout
        second = run("serve", "--team", "--port", "0", "--url", "https://x.org").stdout
        assert "https://x.org/join#" in second
        with pytest.raises(Exception, match="not good any more"):
            links.look(store, token_in(first))
        links.use(store, token_in(second), SECRET, "ada")
        assert "/join#" not in run("serve", "--team", "--port", "0").stdout

    def test_a_home_of_a_team_is_not_served_to_everybody(self) -> None:
        run("users", "add", "anna")
        refused = run("serve", "--port", "0")
        assert refused.exit_code == 1
        assert "have accounts here" in str(refused.exception)
        assert run("serve", "--port", "0", "--alone").exit_code == 0
