"""Somebody who comes by single sign-on: a browser that goes to the provider, comes back, and what it is told."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx

from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.people.sign_on import SignOn
from tests.provider import Provider
from tests.security.asking import Answer
from tests.security.team import API, Team, cookie_in

BEGIN, FINISH = f"{API}/session/sign-on/begin", f"{API}/session/sign-on"


@dataclass
class SignOnVisitor:
    """Somebody before the team's server, who comes by the provider."""

    team: Team
    provider: Provider

    @property
    def sign_on(self) -> SignOn:
        found: SignOn = self.team.app.state.team.sign_on
        return found

    def begin(self, **said: Any) -> tuple[str, str]:
        """Address at the provider, and the cookie of the browser."""
        answer = self.team.ask("POST", BEGIN, said)
        return json.loads(answer.body)["address"], cookie_in(answer)

    def back(self, address: str) -> dict[str, str]:
        """What the provider adds to our address once somebody has logged in there."""
        there = httpx.get(address, follow_redirects=False).headers["location"]
        assert there.startswith(f"{self.team.address}/login?"), there
        return {name: values[0] for name, values in parse_qs(urlsplit(there).query).items()}

    def finish(self, told: dict[str, str], cookie: str, **more: str) -> Answer:
        return self.team.ask("POST", FINISH, {**told, **more}, Cookie=cookie)

    def enter(self, **said: Any) -> Answer:
        address, cookie = self.begin(**said)
        return self.finish(self.back(address), cookie)

    def invite(self, name: str, role: Role = Role.ANNOTATOR) -> str:
        """The link of somebody new."""
        return invite(self.team.store, name, role, actor="local")[1].token

    def join(self, name: str, role: Role = Role.ANNOTATOR) -> None:
        """Somebody new, who comes by the provider from now on."""
        self.provider.who = {"sub": f"s-{name}", "preferred_username": name}
        assert name_in(self.enter(link=self.invite(name, role))) == name


def name_in(answer: Answer) -> str:
    assert answer.status == 200, answer.body
    return str(json.loads(answer.body)["session"]["name"])


def session_in(answer: Answer) -> str:
    """The cookie of the session that an answer begins."""
    found = [part.partition(";")[0] for part in answer.headers["set-cookie"].split("\n")]
    return next(part for part in found if part.startswith("touchline_session="))


def assert_refused(answer: Answer, status: int = 401, word: str = "") -> None:
    assert answer.status == status, answer.body
    assert "touchline_session" not in answer.headers.get("set-cookie", "")
    assert word in answer.body.decode(), answer.body
