"""Tokens of scripts, in a real database."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime, timedelta

import pytest

from app.config import Settings
from app.db.log import read_log
from app.db.store import Store
from app.errors import ConflictError, ForbiddenError, InputError, NotFoundError, NotLoggedInError
from app.features.datasets.service import dataset_id, delete_dataset
from app.features.imports.ingest import ensure_dataset
from app.features.people import access_tokens
from app.features.people.access_tokens import (
    CUT,
    INVALID,
    AccessTokens,
    has_valid_checksum,
    make_access_token_text,
)
from app.features.people.logins import Login
from app.features.people.queries import update_person
from app.features.people.roles import SCOPES, Action, DatasetRoles, Role, Scope, require_scope
from app.features.people.service import get_person, invite
from app.soccer.actors import person_of_actor
from tests.databases import all_that_is_kept

READ = [Scope.READ]


class Clock:
    def __init__(self) -> None:
        self.at = datetime.now(UTC)

    def __call__(self) -> datetime:
        return self.at


@pytest.fixture
def home(tmp_path) -> Iterator[Store]:
    with closing(Store.open(Settings(home=tmp_path / "home"))) as store:
        yield store


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def tokens(home, clock) -> AccessTokens:
    return AccessTokens(home, clock)


@pytest.fixture
def anna(home, clock) -> Login:
    person, _ = invite(home, "anna", Role.LEAD, actor="local")
    return Login(1, person.id, "anna", DatasetRoles(Role.LEAD), clock.at)


class TestText:
    def test_a_token_with_a_wrong_missing_or_swapped_letter_is_not_whole(self) -> None:
        text = make_access_token_text()
        assert has_valid_checksum(text)
        assert not has_valid_checksum(text + "\n")
        for place in range(len(text)):
            other = "a" if text[place] != "a" else "b"
            assert not has_valid_checksum(text[:place] + other + text[place + 1 :])
            assert not has_valid_checksum(text[:place] + text[place + 1 :])
        swapped = [text[:i] + text[i + 1] + text[i] + text[i + 2 :] for i in range(3, 50)]
        assert not [one for one in swapped if one != text and has_valid_checksum(one)]

    @pytest.mark.parametrize("text", ["", "tl_", "x" * 57, "tl_" + "é" * 54])
    def test_a_text_of_another_shape_is_no_token(self, text: str) -> None:
        assert not has_valid_checksum(text)


class TestFind:
    def test_says_who_it_is_and_what_for(self, tokens, anna) -> None:
        made, text = tokens.make(anna, "deploy", [Scope.EXPORT, Scope.READ])
        login = tokens.find_login_of_token(text)
        assert (login.name, login.role, login.actor) == ("anna", Role.LEAD, "anna (token deploy)")
        assert person_of_actor(login.actor) == "anna"
        assert login.token is not None
        assert login.token.scopes == (Scope.READ, Scope.EXPORT)
        assert text.startswith(made.start)

    def test_ends_on_its_day(self, tokens, anna, clock) -> None:
        _, text = tokens.make(anna, "short", READ, days=7)
        clock.at += timedelta(days=7) - timedelta(seconds=1)
        assert tokens.find_login_of_token(text)
        assert not tokens.list_of_person(anna.person_id)[0].expired
        clock.at += timedelta(seconds=1)
        with pytest.raises(NotLoggedInError) as refused:
            tokens.find_login_of_token(text)
        assert refused.value.message == INVALID
        assert tokens.list_of_person(anna.person_id)[0].expired

    def test_its_use_is_noted_at_once_and_then_seldom(self, tokens, anna, clock) -> None:
        _, text = tokens.make(anna, "used", READ)
        assert tokens.should_log_use(tokens.find_login_of_token(text))
        tokens.touch(tokens.find_login_of_token(text))
        assert tokens.list_of_person(anna.person_id)[0].used is not None
        assert not tokens.should_log_use(tokens.find_login_of_token(text))
        clock.at += timedelta(minutes=6)
        assert tokens.should_log_use(tokens.find_login_of_token(text))

    def test_one_that_was_not_copied_whole_is_told_so(self, tokens) -> None:
        with pytest.raises(NotLoggedInError) as refused:
            tokens.find_login_of_token(make_access_token_text()[:-1])
        assert refused.value.message == CUT

    def test_who_is_disabled_is_refused_whatever_tokens_there_are(self, home, tokens, anna) -> None:
        _, text = tokens.make(anna, "kept", READ)
        with home.write() as session:
            update_person(session, anna.person_id, disabled=True)
        with pytest.raises(NotLoggedInError):
            tokens.find_login_of_token(text)

    def test_one_of_a_dataset_goes_with_it(self, home, tokens, anna) -> None:
        ensure_dataset(home, "small", "local")
        _, text = tokens.make(anna, "small", READ, dataset_id=dataset_id(home, "small"))
        assert tokens.list_of_person(None)[0].dataset == "small"
        delete_dataset(home, "small", confirm="small", actor="local")
        with pytest.raises(NotLoggedInError):
            tokens.find_login_of_token(text)


class TestMake:
    @pytest.mark.parametrize("name", ["", " ", "a" * 41, "a)", "x (token y", "é", "a\nb"])
    def test_no_name_passes_for_another_actor(self, tokens, anna, name: str) -> None:
        with pytest.raises(InputError):
            tokens.make(anna, name, READ)

    @pytest.mark.parametrize("days", [0, -1, 366])
    def test_none_lasts_for_ever(self, tokens, anna, days: int) -> None:
        with pytest.raises(InputError):
            tokens.make(anna, "x", READ, days=days)

    def test_a_name_is_free_again_once_its_token_is_no_more(self, tokens, anna, clock) -> None:
        made, _ = tokens.make(anna, "deploy", READ)
        with pytest.raises(ConflictError, match="already"):
            tokens.make(anna, "deploy", READ)
        tokens.end(made.id, anna.person_id, actor="anna")
        tokens.make(anna, "deploy", READ, days=1)
        clock.at += timedelta(days=1)
        tokens.make(anna, "deploy", READ)

    def test_there_is_an_end_to_how_many(self, tokens, anna, monkeypatch) -> None:
        monkeypatch.setattr(access_tokens, "MOST", 2)
        for name in ("one", "two"):
            tokens.make(anna, name, READ)
        with pytest.raises(ConflictError, match="2 tokens"):
            tokens.make(anna, "three", READ)

    def test_an_operator_ends_anybodys_and_is_told_whose_it_was(self, tokens, anna) -> None:
        made, text = tokens.make(anna, "deploy", READ)
        with pytest.raises(NotFoundError):
            tokens.end(made.id, anna.person_id + 1, actor="ada")
        tokens.find_login_of_token(text)
        ended = tokens.end(made.id, None, actor="ada")
        assert (ended.person, ended.name) == ("anna", "deploy")
        with pytest.raises(NotLoggedInError):
            tokens.find_login_of_token(text)

    def test_the_log_and_the_list_of_people_know_of_it(self, home, tokens, anna) -> None:
        made, _ = tokens.make(anna, "deploy", READ)
        assert get_person(home, anna.person_id).tokens == 1
        tokens.end(made.id, anna.person_id, actor="ada")
        with home.read() as session:
            first, last = list(read_log(session))[-2:]
        assert (first.actor, first.body["did"], first.body["scopes"]) == (
            "anna",
            "token made",
            "read",
        )
        assert (last.actor, last.body["did"], last.body["token"]) == (
            "ada",
            "token ended",
            "deploy",
        )

    def test_the_database_holds_no_secret(self, home, tokens, anna) -> None:
        made, text = tokens.make(anna, "deploy", READ)
        home.close()
        kept = all_that_is_kept(home.settings.home)
        assert made.start.encode() in kept
        assert text[len(made.start) :].encode() not in kept
        assert text[len(made.start) : -6].encode() not in kept


class TestScopes:
    def test_every_action_but_ones_own_account_has_a_scope(self) -> None:
        allowed = frozenset[Action]().union(*SCOPES.values())
        assert allowed == set(Action) - {Action.ACCOUNT}

    def test_a_refusal_says_what_is_missing(self) -> None:
        with pytest.raises(ForbiddenError, match="lacks the scope review; it has read and export"):
            require_scope([Scope.READ, Scope.EXPORT], Action.REVIEW)
        with pytest.raises(ForbiddenError, match="not allowed with a token"):
            require_scope(list(Scope), Action.ACCOUNT)
