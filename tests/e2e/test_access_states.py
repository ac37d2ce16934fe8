"""Everybody can use what opens on the review screen too, and it fits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.screen import Screen, go_offline, rows
from tests.e2e.test_access import fits, serious_in_both

OpenPage = Callable[..., Page]
STATES = {
    "chooser": (["n"], ".chooser"),
    "keys": (["?"], "dialog[open]"),
    "comment": (["Shift+n"], "#comment-new:focus"),
    "margins": (["g"], ".gates__margin"),
    "alone": (["2", "2"], ".image-panel__stage[data-ready=true]"),
}


class TestAxe:
    def test_finds_nothing_serious_in_what_opens(self, open_page: OpenPage) -> None:
        page = open_page("/review/1")
        screen = Screen(page)
        screen.ready()
        found: dict[str, list[str]] = {}
        for name, (keys, waited) in STATES.items():
            screen.press(*keys)
            page.wait_for_selector(waited)
            found[name] = serious_in_both(page)
            screen.press("Escape")
        page.get_by_role("button", name="Brightness and contrast of view A").click()
        found["adjust"] = serious_in_both(page)
        assert {name: faults for name, faults in found.items() if faults} == {}


class TestStates:
    def test_a_group_with_findings_fits(self, open_page: OpenPage) -> None:
        page = open_page(None)
        flagged = next(row["id"] for row in rows(page) if row["findings"])
        page.goto(f"/review/{flagged}")
        Screen(page).ready()
        expect(page.locator(".verdict-card__over")).not_to_have_text("Passes every gate")
        fits(page)

    @pytest.mark.parametrize("views", [2, 3, 4])
    def test_every_number_of_views_fits_folded_too(self, open_page: OpenPage, views: int) -> None:
        page = open_page(None)
        group = next(row["id"] for row in rows(page) if row["views"] == views)
        page.goto(f"/review/{group}")
        screen = Screen(page)
        screen.ready()
        expect(page.locator(".image-panel")).to_have_count(views)
        fits(page)
        screen.press("l")
        expect(page.locator(".review__main[data-collapsed=true]")).to_be_visible()
        fits(page)

    def test_an_edit_that_waits_for_the_network_fits(
        self, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("ERR_")
        page = open_page("/review/1")
        screen = Screen(page)
        screen.ready()
        included = screen.document()["views"][1]["included"]
        go_offline(page)
        screen.press("Shift+2")
        expect(page.locator(".save")).to_contain_text("Offline · 1 change waits")
        fits(page)
        screen.press("Shift+2")
        page.context.set_offline(False)
        screen.saved()
        assert screen.document()["views"][1]["included"] == included

    def test_a_group_that_is_not_there_says_so(self, open_page: OpenPage, console: Any) -> None:
        console.expect("404")
        page = open_page("/review/999999")
        expect(page.locator("main, [role=alert]").first).to_contain_text("999999")
        fits(page)
