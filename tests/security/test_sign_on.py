"""Single sign-on over the wire: who comes in by the provider, and every way in which somebody must not."""

from __future__ import annotations

import json
from datetime import timedelta
from typing import Any

import httpx
import pyotp
import pytest

from app.features.people.devices import AttemptWindow
from app.features.people.links import make_first_admin_link
from app.features.people.logins import LoginMethod
from app.features.people.roles import Role
from app.features.people.second_factor import SecondFactors
from app.features.people.service import change_person, find_person
from app.features.people.sign_on import LASTS
from tests.security.sign_on_visitor import (
    BEGIN,
    FINISH,
    SignOnVisitor,
    assert_refused,
    name_in,
    session_in,
)
from tests.security.team import API, DEVICE, SECRET, cookie_in


class TestComingIn:
    def test_an_invitation_links_the_account_which_logs_in_from_then_on(
        self, visitor: SignOnVisitor
    ) -> None:
        link = visitor.invite("anna")
        entered = visitor.enter(link=link, to="/review/3?q=ball:low")
        assert name_in(entered) == "anna"
        assert json.loads(entered.body)["to"] == "/review/3?q=ball:low"
        assert json.loads(entered.body)["session"]["way"] == "sign_on"
        again = visitor.enter()
        assert name_in(again) == "anna"
        assert session_in(again) != session_in(entered), "every login has a session of its own"
        assert_refused(visitor.team.ask("POST", BEGIN, {"link": link}), 404, "no longer valid")
        people = json.loads(visitor.team.ask("GET", f"{API}/users", role="admin").body)["items"]
        assert {one["name"]: one["sign_on"] for one in people}["anna"] == "anna"
        said = json.loads(visitor.team.ask("GET", f"{API}/audit", role="admin").body)["items"]
        assert "anna: logged in by single sign-on" in [one["sentence"] for one in said]

    def test_the_session_that_a_browser_had_before_ends(self, visitor: SignOnVisitor) -> None:
        visitor.join("pinned")
        before = session_in(visitor.enter())
        address, cookie = visitor.begin()
        after = visitor.finish(visitor.back(address), f"{cookie}; {before}")
        assert session_in(after) != before
        assert visitor.team.ask("GET", f"{API}/sessions", Cookie=before).status == 401
        assert visitor.team.ask("GET", f"{API}/sessions", Cookie=session_in(after)).status == 200

    def test_somebody_links_their_own_account_and_unlinks_it(self, visitor: SignOnVisitor) -> None:
        cookie = visitor.team.add("lena", Role.LEAD)
        visitor.provider.who = {"sub": "s-lena", "email": "lena@club.example"}
        own = f"{API}/session/identity"
        wrong = visitor.team.ask("POST", f"{own}/begin", {"password": "x"}, Cookie=cookie)
        assert_refused(wrong, 400, "the password is wrong")
        begun = visitor.team.ask("POST", f"{own}/begin", {"password": SECRET}, Cookie=cookie)
        told = visitor.back(json.loads(begun.body)["address"])
        other = f"{cookie_in(begun)}; {visitor.team.cookies['viewer']}"
        assert_refused(visitor.finish(told, other), 400, "has ended")
        begun = visitor.team.ask("POST", f"{own}/begin", {"password": SECRET}, Cookie=cookie)
        told = visitor.back(json.loads(begun.body)["address"])
        assert name_in(visitor.finish(told, f"{cookie_in(begun)}; {cookie}")) == "lena"
        ways = json.loads(visitor.team.ask("GET", own, Cookie=cookie).body)
        assert ways["identity"]["shown"] == "lena@club.example"
        entered = session_in(visitor.enter())
        gone = visitor.team.ask("DELETE", own, {"password": SECRET}, Cookie=cookie)
        assert gone.status == 204, gone.body
        assert visitor.team.ask("GET", own, Cookie=entered).status == 401, (
            "it began with the account"
        )
        assert_refused(visitor.enter(), word="no person here is linked")

    def test_an_account_is_not_linked_with_whoever_gets_the_id_of_a_session_that_ended(
        self, visitor: SignOnVisitor
    ) -> None:
        visitor.team.add("left", Role.LEAD)
        visitor.team.add("next", Role.LEAD)
        visitor.provider.who = {"sub": "s-left"}
        cookie = cookie_in(visitor.team.log_in("left"))
        own = f"{API}/session/identity"
        begun = visitor.team.ask("POST", f"{own}/begin", {"password": SECRET}, Cookie=cookie)
        told = visitor.back(json.loads(begun.body)["address"])
        out = visitor.team.ask("DELETE", f"{API}/session", Cookie=cookie)
        assert "touchline_sign_on=;" in out.headers["set-cookie"].replace('""', "")
        other = cookie_in(visitor.team.log_in("next"))
        assert_refused(visitor.finish(told, f"{cookie_in(begun)}; {other}"), 400, "has ended")

    def test_a_browser_is_a_known_one_of_whoever_comes_in(self, visitor: SignOnVisitor) -> None:
        visitor.join("known")
        assert cookie_in(visitor.enter(), DEVICE).startswith(DEVICE)

    def test_the_first_admin_may_come_by_it(self, visitor: SignOnVisitor, monkeypatch: Any) -> None:
        monkeypatch.setattr("app.features.people.links.count_people_who_can_log_in", lambda *_: 0)
        link = make_first_admin_link(visitor.team.store, actor="local")
        assert link is not None
        visitor.provider.who = {"sub": "s-root"}
        assert_refused(visitor.team.ask("POST", BEGIN, {"link": link.token}), 400, "/name")
        assert name_in(visitor.enter(link=link.token, name="root")) == "root"
        assert find_person(visitor.team.store, "root").role is Role.ADMIN

    def test_who_is_linked_is_taken_from_them_by_an_admin_or_with_their_rights(
        self, visitor: SignOnVisitor
    ) -> None:
        visitor.join("gone")
        session = session_in(visitor.enter())
        person = find_person(visitor.team.store, "gone")
        asked = visitor.team.ask("DELETE", f"{API}/users/{person.id}/identity", role="admin")
        assert asked.status == 204
        assert visitor.team.ask("GET", f"{API}/sessions", Cookie=session).status == 401
        assert_refused(visitor.enter(), word="no person here is linked")
        assert_refused(
            visitor.team.ask("DELETE", f"{API}/users/{person.id}/identity", role="admin"), 404
        )


class TestStrangers:
    def test_nobody_is_let_in_whom_nobody_here_knows(self, visitor: SignOnVisitor) -> None:
        visitor.provider.who = {"sub": "s-stranger", "preferred_username": "stranger"}
        assert_refused(visitor.enter(), word="no person here is linked")

    def test_neither_name_nor_address_takes_over_an_account(
        self, visitor: SignOnVisitor, ruled: Any
    ) -> None:
        visitor.team.add("victim", Role.LEAD)
        claims = {"preferred_username": "victim", "name": "victim", "email": "victim@club.example"}
        for verified in (False, True):
            visitor.provider.who = {"sub": "s-thief", **claims, "email_verified": verified}
            assert_refused(visitor.enter(), word="no person here is linked")
            ruled(new_role=Role.VIEWER)
            assert_refused(visitor.enter(), word="there is already a user victim")
            ruled(new_role=None)

    def test_somebody_new_gets_the_role_that_the_operator_said(
        self, visitor: SignOnVisitor, ruled: Any
    ) -> None:
        ruled(new_role=Role.VIEWER, domains=frozenset({"club.example"}))
        visitor.provider.who = {"sub": "s-new", "preferred_username": "Nora.New@club.example"}
        visitor.provider.who |= {"email": "nora@club.example", "email_verified": True}
        assert name_in(visitor.enter()) == "nora.new"
        assert find_person(visitor.team.store, "nora.new").role is Role.VIEWER
        assert name_in(visitor.enter()) == "nora.new"

    def test_only_a_verified_address_counts(self, visitor: SignOnVisitor, ruled: Any) -> None:
        ruled(new_role=Role.VIEWER, domains=frozenset({"club.example"}))
        for claims in (
            {"email": "eve@club.example", "email_verified": False},
            {"email": "eve@club.example"},
            {"email": "eve@club.example.org", "email_verified": True},
            {"email": "eve@evil.example", "email_verified": True},
            {},
        ):
            visitor.provider.who = {"sub": "s-eve", "preferred_username": "eve", **claims}
            assert_refused(visitor.enter(), word="e-mail address")

    def test_who_leaves_the_group_comes_in_no_more(
        self, visitor: SignOnVisitor, ruled: Any
    ) -> None:
        visitor.join("greta")
        ruled(group_claim="groups", groups=frozenset({"football"}))
        visitor.provider.who["groups"] = ["staff", "football"]
        assert name_in(visitor.enter()) == "greta"
        visitor.provider.who["groups"] = ["staff"]
        assert_refused(visitor.enter(), word="groups")

    def test_who_is_disabled_stays_out(self, visitor: SignOnVisitor) -> None:
        visitor.join("dora")
        person = find_person(visitor.team.store, "dora")
        change_person(visitor.team.store, person.id, actor="local", disabled=True)
        assert_refused(visitor.enter(), word="disabled")

    def test_an_account_is_one_persons(self, visitor: SignOnVisitor) -> None:
        visitor.join("one")
        link = visitor.invite("two")
        assert_refused(visitor.enter(link=link), 409, "another person")
        assert visitor.team.ask("POST", BEGIN, {"link": link}).status == 200, "the link stays good"
        cookie = visitor.team.add("three", Role.LEAD)
        body = {"password": SECRET}
        begun = visitor.team.ask("POST", f"{API}/session/identity/begin", body, Cookie=cookie)
        told = visitor.back(json.loads(begun.body)["address"])
        both = f"{cookie_in(begun)}; {cookie}"
        assert_refused(visitor.finish(told, both), 409, "another person")


class TestState:
    def test_an_answer_is_of_the_browser_that_asked_and_counts_once(
        self, visitor: SignOnVisitor
    ) -> None:
        visitor.join("sam")
        address, cookie = visitor.begin()
        told = visitor.back(address)
        assert_refused(visitor.finish({**told, "state": "x" * 43}, cookie), word="another browser")
        _, other = visitor.begin()
        assert_refused(visitor.finish(told, other), word="another browser")
        assert_refused(visitor.finish(told, cookie), word="another browser")
        address, cookie = visitor.begin()
        told = visitor.back(address)
        assert name_in(visitor.finish(told, cookie)) == "sam"
        assert_refused(visitor.finish(told, cookie), word="another browser")

    def test_a_code_counts_once_and_only_with_the_secret_of_its_login(
        self, visitor: SignOnVisitor
    ) -> None:
        visitor.join("cody")
        first, mine = visitor.begin()
        used = visitor.back(first)
        assert name_in(visitor.finish(used, mine)) == "cody"
        second, cookie = visitor.begin()
        fresh = visitor.back(second)
        assert_refused(visitor.finish({**fresh, "code": used["code"]}, cookie), word="not confirm")
        third, cookie = visitor.begin()
        assert_refused(visitor.finish({**visitor.back(third), "code": fresh["code"]}, cookie))

    def test_it_waits_ten_minutes(
        self, visitor: SignOnVisitor, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        visitor.join("tim")
        address, cookie = visitor.begin()
        told, clock = visitor.back(address), visitor.sign_on._begun._clock
        monkeypatch.setattr(visitor.sign_on._begun, "_clock", lambda: clock() + LASTS)
        assert_refused(visitor.finish(told, cookie), word="has expired")

    def test_its_cookie_is_out_of_reach_and_short(self, visitor: SignOnVisitor) -> None:
        sent = visitor.team.ask("POST", BEGIN, {}).headers["set-cookie"].lower()
        assert "httponly" in sent and "samesite=strict" in sent
        assert f"max-age={LASTS // timedelta(seconds=1)}" in sent
        visitor.join("max")
        address, cookie = visitor.begin()
        headers = {"Origin": visitor.team.address, "Cookie": cookie}
        ended = httpx.post(
            visitor.team.address + FINISH, json=visitor.back(address), headers=headers
        )
        assert ended.headers.get_list("set-cookie")[0].startswith('touchline_sign_on=""; ')
        assert "Max-Age=0" in ended.headers.get_list("set-cookie")[0]

    def test_nobody_is_sent_elsewhere_then(self, visitor: SignOnVisitor) -> None:
        outside = ("https://evil.example", "//evil.example", "/\\evil.example", "/\t/evil.example")
        for to in (*outside, "groups"):
            assert_refused(visitor.team.ask("POST", BEGIN, {"to": to}), 400, "/to")

    def test_another_provider_does_not_answer_in_its_place(self, visitor: SignOnVisitor) -> None:
        visitor.join("ida")
        address, cookie = visitor.begin()
        told = visitor.back(address)
        assert_refused(visitor.finish(told, cookie, iss="https://evil.example"), word="another")
        address, cookie = visitor.begin()
        assert (
            name_in(visitor.finish(visitor.back(address), cookie, iss=visitor.provider.address))
            == "ida"
        )


class TestSecondFactor:
    @pytest.fixture
    def codes(self, visitor: SignOnVisitor) -> list[str]:
        """Recovery codes of fay, who comes by the provider."""
        visitor.join("fay", Role.LEAD)
        cookie = session_in(visitor.enter())
        own = f"{API}/session/second-factor"
        begun = visitor.team.ask("POST", own, {}, Cookie=cookie)
        assert begun.status == 200, "she has just come in, and has no password"
        code = pyotp.TOTP(json.loads(begun.body)["secret"]).now()
        made = visitor.team.ask("POST", f"{own}/confirm", {"code": code}, Cookie=cookie)
        found: list[str] = json.loads(made.body)["codes"]
        return found

    def test_is_asked_for_as_after_a_password_unless_the_provider_vouches(
        self, visitor: SignOnVisitor, ruled: Any, codes: list[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # Counted in the database, as processes do that share one.
        attempts = AttemptWindow(visitor.team.store)
        monkeypatch.setattr(visitor.team.app.state.team.attempts, "_shared", attempts)
        visitor.provider.who |= {"amr": ["pwd", "mfa"], "acr": "high"}
        address, cookie = visitor.begin()
        told = visitor.back(address)
        first = visitor.finish(told, cookie)
        assert_refused(first, word="/factor")
        assert_refused(visitor.finish(told, cookie, factor="000000"), word="/factor")
        assert_refused(visitor.finish({**told, "code": "x"}, cookie, factor="1"), word="/factor")
        assert name_in(visitor.finish(told, cookie, factor=codes[0])) == "fay"
        assert attempts.count_attempt_or_get_wait("code/fay", 1, 3600.0) is not None
        assert_refused(visitor.finish(told, cookie, factor=codes[1]), word="another browser")
        ruled(trusted=frozenset({"hwk"}))
        assert_refused(visitor.enter(), word="/factor")
        ruled(trusted=frozenset({"mfa"}))
        assert name_in(visitor.enter()) == "fay"
        ruled(trusted=frozenset({"high"}))
        assert name_in(visitor.enter()) == "fay"

    def test_one_that_is_required_is_enrolled_first_unless_the_provider_vouches(
        self, visitor: SignOnVisitor, ruled: Any
    ) -> None:
        visitor.join("ned")
        factors = SecondFactors(visitor.team.store)
        factors.set_required(True, actor="local")
        try:
            assert json.loads(visitor.enter().body)["session"]["enrol"] is True
            ruled(trusted=frozenset({"mfa"}))
            visitor.provider.who["amr"] = ["mfa"]
            assert json.loads(visitor.enter().body)["session"]["enrol"] is False
        finally:
            factors.set_required(False, actor="local")

    def test_takes_a_fresh_login_where_there_is_no_password(
        self, visitor: SignOnVisitor, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        visitor.join("fresh")
        cookie, own = session_in(visitor.enter()), f"{API}/session/second-factor"
        clock = visitor.team.app.state.team.factors._clock
        later = lambda: clock() + timedelta(minutes=11)  # noqa: E731
        monkeypatch.setattr(visitor.team.app.state.team.factors, "_clock", later)
        assert_refused(visitor.team.ask("POST", own, {}, Cookie=cookie), 400, "ten minutes")
        assert_refused(visitor.team.ask("POST", own, {}, role="viewer"), 400, "needs your password")


class TestOnly:
    def test_nothing_else_lets_in_and_what_did_ends(
        self, visitor: SignOnVisitor, ruled: Any
    ) -> None:
        visitor.join("oksana")
        entered = session_in(visitor.enter())
        asked = {
            f"{API}/session": {"name": "viewer", "password": SECRET},
            f"{API}/links/use": {"token": visitor.invite("otto"), "password": SECRET},
            f"{API}/session/passkey/begin": None,
        }
        ruled(only=True)
        for target, body in asked.items():
            assert_refused(visitor.team.ask("POST", target, body), 409, "only with Club")
        ways = json.loads(visitor.team.ask("GET", f"{API}/session").body)["ways"]
        assert ways == {"password": False, "sign_on": "Club"}
        logins = visitor.team.app.state.team.logins
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(logins, "_only", LoginMethod.SIGN_ON)
            assert visitor.team.ask("GET", f"{API}/sessions", role="viewer").status == 401
            assert visitor.team.ask("GET", f"{API}/sessions", Cookie=entered).status == 200
