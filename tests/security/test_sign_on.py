"""Single sign-on over the wire: who comes in by the provider, and every way in which somebody must not."""

from __future__ import annotations

import json
from datetime import timedelta
from typing import Any

import httpx
import pyotp
import pytest

from app.features.people.devices import Attempts
from app.features.people.links import make_first_link
from app.features.people.logins import LoginMethod
from app.features.people.roles import Role
from app.features.people.second_factor import SecondFactors
from app.features.people.service import change_person, find_person
from app.features.people.sign_on import LASTS
from tests.security.door import BEGIN, FINISH, ClassLimiter, assert_refused, name_in, session_in
from tests.security.team import API, SECRET, cookie_in


class TestComingIn:
    def test_an_invitation_links_the_account_which_logs_in_from_then_on(
        self, door: ClassLimiter
    ) -> None:
        link = door.invite("anna")
        entered = door.enter(link=link, to="/review/3?q=ball:low")
        assert name_in(entered) == "anna"
        assert json.loads(entered.body)["to"] == "/review/3?q=ball:low"
        assert json.loads(entered.body)["session"]["way"] == "sign_on"
        again = door.enter()
        assert name_in(again) == "anna"
        assert session_in(again) != session_in(entered), "every login has a session of its own"
        assert_refused(door.team.ask("POST", BEGIN, {"link": link}), 404, "no longer valid")
        people = json.loads(door.team.ask("GET", f"{API}/users", role="admin").body)["items"]
        assert {one["name"]: one["sign_on"] for one in people}["anna"] == "anna"
        said = json.loads(door.team.ask("GET", f"{API}/audit", role="admin").body)["items"]
        assert "anna: logged in by single sign-on" in [one["sentence"] for one in said]

    def test_the_session_that_a_browser_had_before_ends(self, door: ClassLimiter) -> None:
        door.join("pinned")
        before = session_in(door.enter())
        address, cookie = door.begin()
        after = door.finish(door.back(address), f"{cookie}; {before}")
        assert session_in(after) != before
        assert door.team.ask("GET", f"{API}/sessions", Cookie=before).status == 401
        assert door.team.ask("GET", f"{API}/sessions", Cookie=session_in(after)).status == 200

    def test_somebody_links_their_own_account_and_unlinks_it(self, door: ClassLimiter) -> None:
        cookie = door.team.add("lena", Role.LEAD)
        door.provider.who = {"sub": "s-lena", "email": "lena@club.example"}
        own = f"{API}/session/identity"
        wrong = door.team.ask("POST", f"{own}/begin", {"password": "x"}, Cookie=cookie)
        assert_refused(wrong, 400, "not your password")
        begun = door.team.ask("POST", f"{own}/begin", {"password": SECRET}, Cookie=cookie)
        told = door.back(json.loads(begun.body)["address"])
        other = f"{cookie_in(begun)}; {door.team.cookies['viewer']}"
        assert_refused(door.finish(told, other), 400, "has ended")
        begun = door.team.ask("POST", f"{own}/begin", {"password": SECRET}, Cookie=cookie)
        told = door.back(json.loads(begun.body)["address"])
        assert name_in(door.finish(told, f"{cookie_in(begun)}; {cookie}")) == "lena"
        ways = json.loads(door.team.ask("GET", own, Cookie=cookie).body)
        assert ways["identity"]["shown"] == "lena@club.example"
        entered = session_in(door.enter())
        gone = door.team.ask("DELETE", own, {"password": SECRET}, Cookie=cookie)
        assert gone.status == 204, gone.body
        assert door.team.ask("GET", own, Cookie=entered).status == 401, "it began with the account"
        assert_refused(door.enter(), word="no person here is linked")

    def test_the_first_admin_may_come_by_it(self, door: ClassLimiter, monkeypatch: Any) -> None:
        monkeypatch.setattr("app.features.people.links.count_people_who_can_log_in", lambda *_: 0)
        link = make_first_link(door.team.store, actor="local")
        assert link is not None
        door.provider.who = {"sub": "s-root"}
        assert_refused(door.team.ask("POST", BEGIN, {"link": link.token}), 400, "/name")
        assert name_in(door.enter(link=link.token, name="root")) == "root"
        assert find_person(door.team.store, "root").role is Role.ADMIN

    def test_who_is_linked_is_taken_from_them_by_an_admin_or_with_their_rights(
        self, door: ClassLimiter
    ) -> None:
        door.join("gone")
        session = session_in(door.enter())
        person = find_person(door.team.store, "gone")
        asked = door.team.ask("DELETE", f"{API}/users/{person.id}/identity", role="admin")
        assert asked.status == 204
        assert door.team.ask("GET", f"{API}/sessions", Cookie=session).status == 401
        assert_refused(door.enter(), word="no person here is linked")
        assert_refused(
            door.team.ask("DELETE", f"{API}/users/{person.id}/identity", role="admin"), 404
        )


class TestStrangers:
    def test_nobody_is_let_in_whom_nobody_here_knows(self, door: ClassLimiter) -> None:
        door.provider.who = {"sub": "s-stranger", "preferred_username": "stranger"}
        assert_refused(door.enter(), word="no person here is linked")

    def test_neither_name_nor_address_takes_over_an_account(
        self, door: ClassLimiter, ruled: Any
    ) -> None:
        door.team.add("victim", Role.LEAD)
        claims = {"preferred_username": "victim", "name": "victim", "email": "victim@club.example"}
        for verified in (False, True):
            door.provider.who = {"sub": "s-thief", **claims, "email_verified": verified}
            assert_refused(door.enter(), word="no person here is linked")
            ruled(new_role=Role.VIEWER)
            assert_refused(door.enter(), word="there is already a user victim")
            ruled(new_role=None)

    def test_somebody_new_gets_the_role_that_the_operator_said(
        self, door: ClassLimiter, ruled: Any
    ) -> None:
        ruled(new_role=Role.VIEWER, domains=frozenset({"club.example"}))
        door.provider.who = {"sub": "s-new", "preferred_username": "Nora.New@club.example"}
        door.provider.who |= {"email": "nora@club.example", "email_verified": True}
        assert name_in(door.enter()) == "nora.new"
        assert find_person(door.team.store, "nora.new").role is Role.VIEWER
        assert name_in(door.enter()) == "nora.new"

    def test_only_a_verified_address_counts(self, door: ClassLimiter, ruled: Any) -> None:
        ruled(new_role=Role.VIEWER, domains=frozenset({"club.example"}))
        for claims in (
            {"email": "eve@club.example", "email_verified": False},
            {"email": "eve@club.example"},
            {"email": "eve@club.example.org", "email_verified": True},
            {"email": "eve@evil.example", "email_verified": True},
            {},
        ):
            door.provider.who = {"sub": "s-eve", "preferred_username": "eve", **claims}
            assert_refused(door.enter(), word="e-mail address")

    def test_who_leaves_the_group_comes_in_no_more(self, door: ClassLimiter, ruled: Any) -> None:
        door.join("greta")
        ruled(group_claim="groups", groups=frozenset({"football"}))
        door.provider.who["groups"] = ["staff", "football"]
        assert name_in(door.enter()) == "greta"
        door.provider.who["groups"] = ["staff"]
        assert_refused(door.enter(), word="groups")

    def test_who_is_disabled_stays_out(self, door: ClassLimiter) -> None:
        door.join("dora")
        person = find_person(door.team.store, "dora")
        change_person(door.team.store, person.id, actor="local", disabled=True)
        assert_refused(door.enter(), word="disabled")

    def test_an_account_is_one_persons(self, door: ClassLimiter) -> None:
        door.join("one")
        link = door.invite("two")
        assert_refused(door.enter(link=link), 409, "another person")
        assert door.team.ask("POST", BEGIN, {"link": link}).status == 200, "the link stays good"
        cookie = door.team.add("three", Role.LEAD)
        body = {"password": SECRET}
        begun = door.team.ask("POST", f"{API}/session/identity/begin", body, Cookie=cookie)
        told = door.back(json.loads(begun.body)["address"])
        both = f"{cookie_in(begun)}; {cookie}"
        assert_refused(door.finish(told, both), 409, "another person")


class TestState:
    def test_an_answer_is_of_the_browser_that_asked_and_counts_once(
        self, door: ClassLimiter
    ) -> None:
        door.join("sam")
        address, cookie = door.begin()
        told = door.back(address)
        assert_refused(door.finish({**told, "state": "x" * 43}, cookie), word="another browser")
        _, other = door.begin()
        assert_refused(door.finish(told, other), word="another browser")
        assert_refused(door.finish(told, cookie), word="another browser")
        address, cookie = door.begin()
        told = door.back(address)
        assert name_in(door.finish(told, cookie)) == "sam"
        assert_refused(door.finish(told, cookie), word="another browser")

    def test_a_code_counts_once_and_only_with_the_secret_of_its_login(
        self, door: ClassLimiter
    ) -> None:
        door.join("cody")
        first, mine = door.begin()
        used = door.back(first)
        assert name_in(door.finish(used, mine)) == "cody"
        second, cookie = door.begin()
        fresh = door.back(second)
        assert_refused(door.finish({**fresh, "code": used["code"]}, cookie), word="not confirm")
        third, cookie = door.begin()
        assert_refused(door.finish({**door.back(third), "code": fresh["code"]}, cookie))

    def test_it_waits_ten_minutes(
        self, door: ClassLimiter, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        door.join("tim")
        address, cookie = door.begin()
        told, clock = door.back(address), door.sign_on._begun._clock
        monkeypatch.setattr(door.sign_on._begun, "_clock", lambda: clock() + LASTS)
        assert_refused(door.finish(told, cookie), word="has expired")

    def test_its_cookie_is_out_of_reach_and_short(self, door: ClassLimiter) -> None:
        sent = door.team.ask("POST", BEGIN, {}).headers["set-cookie"].lower()
        assert "httponly" in sent and "samesite=strict" in sent
        assert f"max-age={LASTS // timedelta(seconds=1)}" in sent
        door.join("max")
        address, cookie = door.begin()
        headers = {"Origin": door.team.address, "Cookie": cookie}
        ended = httpx.post(door.team.address + FINISH, json=door.back(address), headers=headers)
        assert ended.headers.get_list("set-cookie")[0].startswith('touchline_sign_on=""; ')
        assert "Max-Age=0" in ended.headers.get_list("set-cookie")[0]

    def test_nobody_is_sent_elsewhere_then(self, door: ClassLimiter) -> None:
        outside = ("https://evil.example", "//evil.example", "/\\evil.example", "/\t/evil.example")
        for to in (*outside, "groups"):
            assert_refused(door.team.ask("POST", BEGIN, {"to": to}), 400, "/to")

    def test_another_provider_does_not_answer_in_its_place(self, door: ClassLimiter) -> None:
        door.join("ida")
        address, cookie = door.begin()
        told = door.back(address)
        assert_refused(door.finish(told, cookie, iss="https://evil.example"), word="another")
        address, cookie = door.begin()
        assert name_in(door.finish(door.back(address), cookie, iss=door.provider.address)) == "ida"


class TestSecondFactor:
    @pytest.fixture
    def codes(self, door: ClassLimiter) -> list[str]:
        """Recovery codes of fay, who comes by the provider."""
        door.join("fay", Role.LEAD)
        cookie = session_in(door.enter())
        own = f"{API}/session/second-factor"
        begun = door.team.ask("POST", own, {}, Cookie=cookie)
        assert begun.status == 200, "she has just come in, and has no password"
        code = pyotp.TOTP(json.loads(begun.body)["secret"]).now()
        made = door.team.ask("POST", f"{own}/confirm", {"code": code}, Cookie=cookie)
        found: list[str] = json.loads(made.body)["codes"]
        return found

    def test_is_asked_for_as_after_a_password_unless_the_provider_vouches(
        self, door: ClassLimiter, ruled: Any, codes: list[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # Counted in the database, as processes do that share one.
        attempts = Attempts(door.team.store)
        monkeypatch.setattr(door.team.app.state.team.attempts, "_shared", attempts)
        door.provider.who |= {"amr": ["pwd", "mfa"], "acr": "high"}
        address, cookie = door.begin()
        told = door.back(address)
        first = door.finish(told, cookie)
        assert_refused(first, word="/factor")
        assert_refused(door.finish(told, cookie, factor="000000"), word="/factor")
        assert_refused(door.finish({**told, "code": "x"}, cookie, factor="1"), word="/factor")
        assert name_in(door.finish(told, cookie, factor=codes[0])) == "fay"
        assert attempts.hit("code/fay", 1, 3600.0) is not None
        assert_refused(door.finish(told, cookie, factor=codes[1]), word="another browser")
        ruled(trusted=frozenset({"hwk"}))
        assert_refused(door.enter(), word="/factor")
        ruled(trusted=frozenset({"mfa"}))
        assert name_in(door.enter()) == "fay"
        ruled(trusted=frozenset({"high"}))
        assert name_in(door.enter()) == "fay"

    def test_one_that_is_required_is_enrolled_first_unless_the_provider_vouches(
        self, door: ClassLimiter, ruled: Any
    ) -> None:
        door.join("ned")
        factors = SecondFactors(door.team.store)
        factors.require(True, actor="local")
        try:
            assert json.loads(door.enter().body)["session"]["enrol"] is True
            ruled(trusted=frozenset({"mfa"}))
            door.provider.who["amr"] = ["mfa"]
            assert json.loads(door.enter().body)["session"]["enrol"] is False
        finally:
            factors.require(False, actor="local")

    def test_takes_a_fresh_login_where_there_is_no_password(
        self, door: ClassLimiter, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        door.join("fresh")
        cookie, own = session_in(door.enter()), f"{API}/session/second-factor"
        clock = door.team.app.state.team.factors._clock
        later = lambda: clock() + timedelta(minutes=11)  # noqa: E731
        monkeypatch.setattr(door.team.app.state.team.factors, "_clock", later)
        assert_refused(door.team.ask("POST", own, {}, Cookie=cookie), 400, "ten minutes")
        assert_refused(door.team.ask("POST", own, {}, role="viewer"), 400, "needs your password")


class TestOnly:
    def test_nothing_else_lets_in_and_what_did_ends(self, door: ClassLimiter, ruled: Any) -> None:
        door.join("oksana")
        entered = session_in(door.enter())
        asked = {
            f"{API}/session": {"name": "viewer", "password": SECRET},
            f"{API}/links/use": {"token": door.invite("otto"), "password": SECRET},
            f"{API}/session/passkey/begin": None,
        }
        ruled(only=True)
        for target, body in asked.items():
            assert_refused(door.team.ask("POST", target, body), 409, "by Club alone")
        ways = json.loads(door.team.ask("GET", f"{API}/session").body)["ways"]
        assert ways == {"password": False, "sign_on": "Club"}
        logins = door.team.app.state.team.logins
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(logins, "_only", LoginMethod.SIGN_ON)
            assert door.team.ask("GET", f"{API}/sessions", role="viewer").status == 401
            assert door.team.ask("GET", f"{API}/sessions", Cookie=entered).status == 200
