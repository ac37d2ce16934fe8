"""The server of a team: the first admin, what people say to each other, what they did and may do."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, expect

from app.features.guidelines.service import read_guidelines, write_guidelines
from app.features.people.roles import Role
from app.features.people.service import list_people
from tests.e2e.screen import Screen, hears, holding, refusing, until
from tests.e2e.team import (
    REFUSED,
    SECRET,
    OpenPage,
    give,
    in_store,
    join,
    log_in,
    log_out,
    verdict,
)
from tests.e2e.test_access import serious_in_both

WHO_IS_THERE = """async () => (await import(
  document.querySelector('script[src$="main.js"]').src.replace('main.js', 'state/me.js')
)).loadSession()"""


class TestPeople:
    def test_the_first_admin_comes_by_the_link_that_the_server_printed(
        self, open_page: OpenPage, team: str, team_home: Path
    ) -> None:
        page = open_page(None, address=team)
        log = team_home / "server.log"
        until(page, lambda: "/join#" in log.read_text())
        address = next(word for word in log.read_text().split() if "/join#" in word)
        page.goto(address.removeprefix(team))
        expect(page.get_by_role("heading", name="Become the first admin")).to_be_visible()
        # The token leaves the address bar.
        until(page, lambda: "#" not in page.url)
        assert serious_in_both(page) == []
        page.get_by_label("Name").fill("Ada")
        page.get_by_label("Password").fill(SECRET)
        page.keyboard.press("Enter")
        expect(page.get_by_role("link", name="ada")).to_be_visible()
        expect(page.locator(".queue-row a").first).to_be_visible()

        page.goto("/people")
        # The table of datasets, which comes later, has a row for her as well.
        expect(page.get_by_role("rowheader", name="ada (you) first admin")).to_be_visible()
        page.get_by_label("Name", exact=True).fill("bob")
        page.get_by_role("button", name="Make a link").click()
        link = page.get_by_label("Link", exact=True)
        until(page, lambda: link.count() and "/join#" in link.input_value())
        expect(page.get_by_role("button", name="Disable bob")).to_be_visible()
        expect(page.get_by_role("button", name="Disable ada")).to_be_disabled()
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Disable bob").click()
        expect(page.get_by_role("button", name="Enable bob")).to_be_visible()
        told = in_store(team_home, list_people)
        assert [(one.name, one.disabled) for one in told] == [("ada", False), ("bob", True)]

        page.goto("/account")
        expect(page.get_by_text("(this one)")).to_be_visible()
        assert serious_in_both(page) == []
        log_out(page)
        assert serious_in_both(page) == []

    def test_a_mention_rings_in_the_other_window_and_leads_to_its_words(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        for name, role in (("mia", Role.REVIEWER), ("noa", Role.ANNOTATOR), ("olga", Role.NONE)):
            join(team_home, name, role)
        mia = open_page("/review/4", address=team)
        log_in(mia, "mia")
        Screen(mia).ready()
        noa = open_page("/groups", address=team)
        log_in(noa, "noa")
        bell = noa.get_by_role("button", name="Notifications")
        expect(bell).to_contain_text("nothing new")
        hears(noa)
        hears(mia)

        mia.keyboard.press("Shift+c")
        expect(mia.locator("#comment-new")).to_be_focused()
        mia.keyboard.type("<b>Look</b> @n")
        expect(mia.get_by_role("option", name="@noa")).to_be_visible()
        mia.keyboard.press("Backspace")
        mia.keyboard.type("ol")
        expect(mia.get_by_role("option")).to_have_count(0)
        mia.keyboard.press("Backspace")
        mia.keyboard.press("Backspace")
        mia.keyboard.type("no")
        expect(mia.get_by_role("option", name="@noa")).to_be_visible()
        mia.keyboard.press("Enter")
        with holding(mia, "**/groups/4/threads") as held:
            mia.keyboard.press("Control+Enter")
            held.arrive()
            # What is typed while it is sent is the next one's beginning.
            mia.keyboard.type(" And")
        expect(mia.locator(".talk__text")).to_have_text("<b>Look</b> @noa")
        expect(mia.locator("#comment-new")).to_have_value("And")
        assert serious_in_both(mia) == []

        expect(bell).to_contain_text("1")
        noa.keyboard.press("Shift+b")
        ring = noa.get_by_role("link", name="mia mentioned you")
        expect(ring).to_be_visible()
        assert serious_in_both(noa) == []
        ring.press("Enter")
        expect(noa.locator(".talk__thread[data-named=true]")).to_contain_text("Look")
        expect(bell).to_contain_text("nothing new")
        noa.get_by_role("button", name="Resolve").click()
        expect(mia.get_by_text("show 1 resolved")).to_be_visible()

    def test_the_history_shows_an_edit_before_and_after_and_the_audit_who_did_it(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "lena", Role.LEAD)
        page = open_page("/review/5", address=team)
        log_in(page, "lena")
        Screen(page).ready()
        page.keyboard.press("Shift+2")
        until(page, lambda: not view_of(page, 5, 1)["included"])
        page.keyboard.press("Shift+t")
        entry = page.get_by_role("button", name="Left view B out")
        expect(entry).to_contain_text("lena")
        page.keyboard.press("ArrowDown")
        expect(entry).to_be_focused()
        page.keyboard.press("Enter")
        expect(page.get_by_role("img", name="View B before")).to_be_visible()
        expect(page.get_by_role("img", name="View B after")).to_be_visible()
        expect(page.get_by_text("After · not used")).to_be_visible()
        assert serious_in_both(page) == []
        page.keyboard.press("Escape")
        expect(page).to_have_url(f"{team}/review/5")

        page.goto("/audit?family=edit")
        row = page.get_by_role("row").filter(has_text="leaving out")
        expect(row).to_contain_text("lena")
        console.expect("a status of 422")
        page.goto("/audit?family=edit&until=soon")
        expect(page.get_by_text("The audit cannot be shown")).to_be_visible()
        page.goto("/audit?family=edit")
        assert serious_in_both(page) == []
        row.get_by_role("link").click()
        expect(page.get_by_role("img", name="View B after")).to_be_visible()

    def test_a_role_that_is_taken_away_amid_the_work_loses_nothing(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        for refused in (REFUSED, "a status of 403", "net::ERR_"):
            console.expect(refused)
        join(team_home, "vera", Role.NONE)
        in_store(team_home, lambda store: give(store, "vera", Role.REVIEWER))
        page = open_page("/review/3", address=team)
        log_in(page, "vera")
        screen = Screen(page)
        screen.ready()
        accept = page.get_by_role("button", name="Accept A")
        expect(accept).not_to_have_attribute("aria-disabled", "true")

        # What it has asked before is answered, and it does not hear more before it asks for something.
        hears(page)
        page.evaluate(WHO_IS_THERE)
        with refusing(page, "**/api/v1/session", "**/api/v1/events*"):
            in_store(team_home, lambda store: give(store, "vera", Role.VIEWER))
            page.keyboard.press("s")
            bar = page.get_by_role("alert").filter(has_text="not saved:")
            expect(bar).to_contain_text("needs the role reviewer")
            assert verdict(page, 3)["state"] is None
        page.evaluate("() => dispatchEvent(new Event('focus'))")
        expect(page.get_by_text("Your role was changed: viewer in ")).to_be_visible()
        expect(accept).to_have_attribute("aria-disabled", "true")
        expect(accept).to_have_attribute("title", re.compile("needs the role reviewer"))
        page.keyboard.press("x")
        expect(page.get_by_text("Reviewing or exporting needs the role reviewer")).to_be_visible()
        assert serious_in_both(page) == []

        in_store(team_home, lambda store: give(store, "vera", Role.REVIEWER))
        page.evaluate("() => dispatchEvent(new Event('focus'))")
        expect(bar).to_be_hidden()
        until(page, lambda: verdict(page, 3)["state"] == "deferred")
        assert verdict(page, 3)["by"] == "vera"

    def test_an_older_version_of_the_guidelines_is_read_compared_and_taken_back(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "gwen", Role.LEAD)
        page = open_page("/groups", address=team)
        log_in(page, "gwen")
        expect(page.get_by_role("link", name="gwen")).to_be_visible()
        for number, text in enumerate(("Draw tight boxes.", "Draw very tight boxes.")):
            in_store(
                team_home,
                lambda store, n=number, said=text: write_guidelines(
                    store, "sample", said, based_on=n, actor="gwen"
                ),
            )
        page.goto("/datasets/sample/statistics")
        page.get_by_text("Versions, and what each changed").click()
        page.get_by_role("button", name="What it changed in version 2").click()
        expect(page.locator(".guidelines__changes ins")).to_have_text("added: very")
        page.get_by_role("button", name="Read version 1").click()
        expect(page.locator(".guidelines__shown")).to_contain_text("Draw tight boxes.")
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Restore version 1").click()
        expect(page.get_by_text("3 versions, the last by gwen")).to_be_visible()
        now = in_store(team_home, lambda store: read_guidelines(store, "sample"))
        assert (now.number, now.text) == (3, "Draw tight boxes.")


def view_of(page: Page, group: int, index: int) -> Any:
    return page.request.get(f"/api/v1/groups/{group}").json()["views"][index]
