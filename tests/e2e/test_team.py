"""The server of a team: coming in by a link, people, and a session that ends amid the work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from app.config import Settings
from app.review.people import links
from app.review.people.people import find_person, invite, list_people
from app.review.people.roles import Role
from app.store.logins import delete_logins
from app.store.session import Store
from tests.e2e.screen import Screen, until
from tests.e2e.service import serving
from tests.e2e.test_access import serious_in_both
from tests.homes import copy_home

OpenPage = Callable[..., Page]
SECRET = "three plain words"
REFUSED = "the server responded with a status of 401"


@pytest.fixture(scope="module")
def team_home(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home that one person worked in alone so far."""
    return copy_home(sample, tmp_path_factory)


@pytest.fixture(scope="module")
def team(team_home: Path) -> Iterator[str]:
    """Address of a team's server over it."""
    with serving(team_home, "--team") as address:
        yield address


def in_store(home: Path, work: Callable[[Store], Any]) -> Any:
    """Do something in the database, as a command beside the server does."""
    with closing(Store.open(Settings(home=home))) as store:
        return work(store)


def join(home: Path, name: str, role: Role) -> None:
    """Somebody who has an account and a password."""

    def come(store: Store) -> None:
        _, link = invite(store, name, role, actor="local")
        links.use(store, link.token, SECRET)

    in_store(home, come)


def log_in(page: Page, name: str) -> None:
    page.get_by_label("Name").fill(name)
    page.get_by_label("Password").fill(SECRET)
    page.keyboard.press("Enter")


class TestTeam:
    def test_the_first_admin_comes_by_the_link_that_the_server_printed(
        self, open_page: OpenPage, team: str, team_home: Path
    ) -> None:
        printed = (team_home / "server.log").read_text().split()
        address = next(word for word in printed if "/join#" in word)
        page = open_page(address.removeprefix(team), address=team)
        expect(page.get_by_role("heading", name="Become the first admin")).to_be_visible()
        assert "#" not in page.url, "the token leaves the address bar"
        assert serious_in_both(page) == []
        page.get_by_label("Name").fill("Ada")
        page.get_by_label("Password").fill(SECRET)
        page.keyboard.press("Enter")
        expect(page.get_by_role("link", name="ada")).to_be_visible()
        expect(page.locator(".queue-row a").first).to_be_visible()

        page.goto("/people")
        page.get_by_label("Name", exact=True).fill("bob")
        page.get_by_role("button", name="Make a link").click()
        link = page.get_by_label("Link", exact=True)
        until(page, lambda: link.count() and "/join#" in link.input_value())
        expect(page.get_by_role("button", name="Disable bob")).to_be_visible()
        assert page.get_by_role("button", name="Disable ada").is_disabled()
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Disable bob").click()
        expect(page.get_by_role("button", name="Enable bob")).to_be_visible()
        told = in_store(team_home, list_people)
        assert [(one.name, one.disabled) for one in told] == [("ada", False), ("bob", True)]

        page.goto("/account")
        expect(page.get_by_text("(this one)")).to_be_visible()
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Log out").click()
        expect(page.get_by_role("heading", name="Log in")).to_be_visible()
        assert serious_in_both(page) == []

    def test_a_session_that_ends_amid_the_work_loses_nothing(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "rita", Role.REVIEWER)
        page = open_page("/review/1", address=team)
        expect(page.get_by_role("heading", name="Log in")).to_be_visible()
        assert page.locator(".image-panel").count() == 0, "nothing is shown before"
        log_in(page, "rita")
        screen = Screen(page)
        screen.ready()
        in_store(team_home, lambda store: end_sessions(store, "rita"))
        page.keyboard.press("s")
        again = page.get_by_role("dialog", name="Your session has ended")
        expect(again).to_be_visible()
        expect(again).to_contain_text("1 change of yours waits")
        assert serious_in_both(page) == []
        page.get_by_label("Password").fill(SECRET)
        page.keyboard.press("Enter")
        expect(again).to_be_hidden()
        until(page, lambda: verdict(page)["state"] == "deferred")
        assert verdict(page)["by"] == "rita"

    def test_nobody_sends_what_another_person_left(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        for name in ("mine", "other"):
            join(team_home, name, Role.REVIEWER)
        page = open_page("/review/2", address=team)
        log_in(page, "mine")
        Screen(page).ready()
        in_store(team_home, lambda store: end_sessions(store, "mine"))
        page.keyboard.press("s")
        expect(page.get_by_role("dialog", name="Your session has ended")).to_be_visible()
        log_in(page, "other")
        expect(page.get_by_role("link", name="other")).to_be_visible()
        page.goto("/review/2")
        Screen(page).ready()
        assert verdict(page, 2)["state"] is None
        page.goto("/account")
        page.get_by_role("button", name="Log out").click()
        log_in(page, "mine")
        expect(page.get_by_role("link", name="mine")).to_be_visible()
        until(page, lambda: verdict(page, 2)["state"] == "deferred")
        assert verdict(page, 2)["by"] == "mine"


def end_sessions(store: Store, name: str) -> None:
    person = find_person(store, name)
    with store.write() as session:
        delete_logins(session, person.id)


def verdict(page: Page, group: int = 1) -> Any:
    """The last word on a group, as history has it."""
    entries = page.request.get(f"/api/v1/groups/{group}/history").json()["items"]
    last = [entry for entry in entries if entry["kind"] == "verdict"]
    return (
        {"state": last[-1]["body"]["state"], "by": last[-1]["actor"]} if last else {"state": None}
    )
