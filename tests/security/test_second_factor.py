"""Second factors over the wire: codes and passkeys are asked for, counted, required and taken away."""

from __future__ import annotations

import json
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import pyotp
import pytest
from fastapi import Request
from limits import parse

from app.config import Settings
from app.db.store import Store
from app.errors import ConflictError
from app.features.people.passkeys import PasskeySite
from app.features.people.roles import Role
from app.features.people.second_factor import SecondFactors
from app.features.people.service import find_person
from app.http.team import TeamLogin as WayIn
from tests.authenticator import Authenticator
from tests.security.asking import Answer, assert_guarded
from tests.security.team import API, GUARDED, SECRET, Team, asked, cookie_in

ENROLLING = (
    "/second-factor",
    "/confirm",
    "/session/password",
    "/session/passkeys",
    "/session/passkeys/begin",
)
"""What somebody may ask who needs a second factor and has none."""


class TestSecondFactor:
    def enrolled(self, team: Team, name: str) -> tuple[pyotp.TOTP, list[str]]:
        """Somebody new with an authenticator, and their recovery codes."""
        team.add(name, Role.VIEWER)
        target = f"{API}/session/second-factor"
        made = team.ask("POST", target, {"password": SECRET}, role=name)
        totp = pyotp.TOTP(json.loads(made.body)["secret"])
        code = {"code": totp.now()}
        done = team.ask("POST", f"{target}/confirm", code, role=name)
        assert done.status == 200, done.body
        return totp, json.loads(done.body)["codes"]

    def tell(self, team: Team, name: str, **more: str) -> Answer:
        body = {"name": name, "password": SECRET, **more}
        return team.ask("POST", f"{API}/session", body)

    def test_the_code_is_asked_for_and_its_tries_are_counted(
        self, team: Team, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.http.team.CODE_LIMIT", parse("4/hour"))
        totp, codes = self.enrolled(team, "wary")
        asked = self.tell(team, "wary")
        assert (asked.status, json.loads(asked.body)["pointer"]) == (401, "/code")
        unknown = json.loads(self.tell(team, "nobody").body)
        assert unknown["pointer"] is None
        assert self.tell(team, "wary", code=totp.at(time.time() + 30)).status == 200
        assert self.tell(team, "wary", code=codes[0]).status == 200
        told = [self.tell(team, "wary", code=codes[0]).status for _ in "12"]
        assert told == [401, 429]

    def test_an_admin_takes_it_away(self, team: Team) -> None:
        self.enrolled(team, "careless")
        person = find_person(team.store, "careless")
        assert person.second_factor
        target = f"{API}/users/{person.id}/second-factor"
        assert team.ask("DELETE", target, role="admin").status == 204
        assert self.tell(team, "careless").status == 200
        own = f"{API}/users/{find_person(team.store, 'admin').id}/second-factor"
        bearer = team.bearer("admin")
        for way in ({"role": "admin"}, {"Authorization": bearer, "Origin": ""}):
            assert team.ask("DELETE", own, **way).status == 403

    def test_where_everybody_needs_one_who_has_none_may_do_nothing_else(self, team: Team) -> None:
        team.add("late", Role.LEAD)
        bearer = team.bearer("read", role="late")
        team.ask("PUT", f"{API}/team", {"require_second_factor": True}, role="admin")
        try:
            for row in GUARDED:
                answer = asked(team, row, "late")
                free = row.path.endswith(ENROLLING)
                free = free and "/users/" not in row.path
                assert (b"second factor" in answer.body) is not free or row.kind == "stream", row
                assert answer.status == 403 or free, (row, answer.body)
            assert json.loads(team.ask("GET", f"{API}/session", role="late").body)["enrol"]
            scripted = team.ask("GET", f"{API}/datasets", Authorization=bearer, Origin="")
            assert scripted.status == 200, "a token is no login"
        finally:
            SecondFactors(team.store).set_required(False, actor="local")
        assert team.ask("GET", f"{API}/datasets", role="late").status == 200


class TestPasskeys:
    """At localhost, the one name for which browsers make passkeys without TLS."""

    def ask(self, team: Team, method: str, path: str, body: Any = None, **more: str) -> Answer:
        there = team.address.replace("127.0.0.1", "localhost")
        near = {"Host": there.partition("//")[2], "Origin": there}
        return team.ask(method, f"{API}/session/{path}", body, **{**near, **more})

    def device(self, team: Team, name: str) -> Authenticator:
        """Of somebody new, with a passkey."""
        cookie = team.add(name, Role.VIEWER)
        there = team.address.replace("127.0.0.1", "localhost")
        device = Authenticator(origin=there, credential=name.encode())
        begun = self.ask(team, "POST", "passkeys/begin", {"password": SECRET}, Cookie=cookie)
        credential = device.make(json.loads(begun.body)["options"])
        body = {"name": "phone", "credential": credential}
        made = self.ask(team, "POST", "passkeys", body, Cookie=cookie)
        assert made.status == 201, made.body
        return device

    def test_one_logs_in_from_the_browser_that_was_asked_and_from_no_other(
        self, team: Team
    ) -> None:
        device = self.device(team, "keen")
        begun = self.ask(team, "POST", "passkey/begin")
        said = begun.headers["set-cookie"].lower()
        assert "httponly" in said and "samesite=strict" in said and "max-age=300" in said
        signed = {"credential": device.sign(json.loads(begun.body)["options"])}
        other = cookie_in(self.ask(team, "POST", "passkey/begin"))
        for cookie in ("", other):
            assert self.ask(team, "POST", "passkey", signed, Cookie=cookie).status == 401
        signed = {"credential": device.sign(json.loads(begun.body)["options"])}
        entered = self.ask(team, "POST", "passkey", signed, Cookie=cookie_in(begun))
        assert json.loads(entered.body)["name"] == "keen"
        assert "touchline_session=" in entered.headers["set-cookie"]
        again = self.ask(team, "POST", "passkey", signed, Cookie=cookie_in(begun))
        assert again.status == 401
        assert_guarded(again, "a passkey that was used")

    def test_an_address_of_numbers_says_why_it_has_none(self, team: Team) -> None:
        told = json.loads(team.ask("GET", f"{API}/session/passkeys", role="viewer").body)
        assert "localhost" in told["unavailable"]
        refused = team.ask("POST", f"{API}/session/passkey/begin")
        assert refused.status == 409
        there = json.loads(self.ask(team, "GET", "passkeys", Cookie=team.cookies["viewer"]).body)
        assert there["unavailable"] is None

    def test_the_site_is_the_one_that_the_operator_said(self, tmp_path: Path) -> None:
        """Whatever a request calls the server, or a proxy passes on."""
        for url, site in (
            (
                "https://touchline.example.org",
                PasskeySite("touchline.example.org", "https://touchline.example.org"),
            ),
            (
                "https://touchline.example.org:443",
                PasskeySite("touchline.example.org", "https://touchline.example.org"),
            ),
            (
                "https://ball.example.org:8443",
                PasskeySite("ball.example.org", "https://ball.example.org:8443"),
            ),
            ("http://ball.example.org", None),
            ("https://192.0.2.7", None),
            ("https://[2001:db8::1]", None),
        ):
            settings = Settings(home=tmp_path / "home", team=True, url=url)
            with closing(Store.open(settings)) as store:
                way_in = WayIn.of(settings, store)
                assert way_in is not None
                request = Request({"type": "http", "headers": [(b"host", b"localhost")]})
                if site is not None:
                    assert way_in.make_passkey_site(request) == site
                    continue
                with pytest.raises(ConflictError):
                    way_in.make_passkey_site(request)
