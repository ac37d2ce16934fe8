"""People of a team with passwords: scripts of theirs log in here, their browsers by ``open_as``."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from time import monotonic

import httpx
import pyotp
from playwright.sync_api import Page

from app.features.people.roles import Role
from tests.e2e.forms import API, Json
from tests.e2e.screen import CHANGED_MEANWHILE
from tests.e2e.team import SECRET, OpenPage
from tests.e2e.windows import TIMEOUT_MS

CREW = {
    "ada": Role.ADMIN,
    "bob": Role.REVIEWER,
    "carl": Role.ANNOTATOR,
    "dora": Role.LEAD,
    "finn": Role.REVIEWER,
    "ines": Role.VIEWER,
    "petra": Role.REVIEWER,
    "tess": Role.LEAD,
}


@dataclass
class Crew:
    """The server of a team; ``log_in`` gives a client of somebody's."""

    address: str
    clients: ExitStack

    def log_in(self, name: str, agent: str = "a script", password: str = SECRET) -> httpx.Client:
        headers = {"Origin": self.address, "User-Agent": agent}
        made = httpx.Client(base_url=self.address + API, headers=headers, timeout=60)
        client = self.clients.enter_context(made)
        sent(client, "POST", "/session", {"name": name, "password": password})
        return client


def sent(client: httpx.Client, method: str, path: str, body: Json = None) -> Json:
    answer = client.request(method, path, json=body)
    assert answer.is_success, answer.text
    return answer.json() if answer.content else None


def open_as(open_page: OpenPage, client: httpx.Client, path: str) -> Page:
    """A page of somebody who is logged in already."""
    address = str(client.base_url).removesuffix(API + "/")
    page = open_page(None, address=address)
    page.context.add_cookies(
        [{"name": one.name, "value": one.value or "", "url": address} for one in client.cookies.jar]
    )
    page.goto(path)
    return page


def enrol(client: httpx.Client) -> None:
    """Give whoever asks a second factor."""
    made = sent(client, "POST", "/session/second-factor", {"password": SECRET})
    code = pyotp.TOTP(made["secret"]).now()
    sent(client, "POST", "/session/second-factor/confirm", {"code": code})


def judged(client: httpx.Client, group: int, state: str, **more: str) -> None:
    """Let somebody judge a group in its present state, which may be solved anew meanwhile."""
    said, end = {"state": state, **more}, monotonic() + TIMEOUT_MS / 1000
    while True:
        etag = client.get(f"/groups/{group}").headers["etag"]
        answer = client.put(f"/groups/{group}/verdict", json=said, headers={"If-Match": etag})
        if answer.status_code != CHANGED_MEANWHILE or monotonic() > end:
            break
    assert answer.is_success, answer.text
