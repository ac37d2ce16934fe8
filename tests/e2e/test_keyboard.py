"""From opening the site to an exported dataset without a mouse."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Page, expect

from tests.e2e.screen import Screen, rows, withdraw_verdict

OpenPage = Callable[..., Page]
FARTHEST = 60
"""Presses of Tab within which everything on a page must be reached."""


def tab_to(page: Page, name: str) -> None:
    """Press Tab until something of that name has the focus."""
    for _ in range(FARTHEST):
        page.keyboard.press("Tab")
        focused = page.evaluate(
            "() => { const e = document.activeElement;"
            " return (e?.getAttribute('aria-label') || e?.textContent || '').trim(); }"
        )
        if focused.startswith(name):
            return
    raise AssertionError(f"Tab does not reach “{name}”")


class TestKeyboardAlone:
    def test_leads_from_the_queue_over_a_verdict_to_a_file(
        self, open_page: OpenPage, tmp_path: Path
    ) -> None:
        page = open_page("/")
        page.wait_for_selector(".queue-row a")
        page.keyboard.press("/")
        expect(page.locator(".field--query")).to_be_focused()
        page.keyboard.type("passes:yes sort:value-desc")
        page.keyboard.press("Enter")
        page.wait_for_url("**q=passes*")
        expect(page.locator(".queue-row[data-active=true]")).to_be_visible()
        expect(page.locator(".field--query")).not_to_be_focused()
        page.keyboard.press("Enter")
        page.wait_for_url("**/review/*")
        screen = Screen(page)
        screen.ready()
        group = screen.group
        page.keyboard.press("a")
        page.wait_for_url(lambda url: f"/review/{group}" not in url)
        screen.saved()
        tab_to(page, "Queue")
        page.keyboard.press("Enter")
        page.wait_for_url("**/groups*")
        page.wait_for_selector(".queue-row a")
        tab_to(page, "Export")
        page.keyboard.press("Enter")
        dialog = page.locator("dialog[open]")
        expect(dialog).to_contain_text("Accepted groups")
        tab_to(page, "Export")
        with page.expect_download() as download:
            page.keyboard.press("Enter")
        target = tmp_path / "export.zip"
        download.value.save_as(target)
        with zipfile.ZipFile(target) as archive:
            assert "manifest.json" in archive.namelist()
        accepted = [row["id"] for row in rows(page) if row["status"] == "accepted"]
        assert group in accepted
        withdraw_verdict(page, group)


class TestAudit:
    def test_its_filters_keep_the_keyboard_and_take_a_day_when_it_is_typed(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/audit")
        words, day = page.get_by_label("Words"), page.get_by_label("From")
        words.fill("verdict")
        page.keyboard.press("Enter")
        page.wait_for_url("**/audit?q=verdict")
        expect(words).to_be_focused()
        what = page.get_by_label("What", exact=True)
        what.focus()
        what.select_option("verdict")
        page.wait_for_url("**/audit?q=verdict&family=verdict")
        expect(what).to_be_focused()
        day.focus()
        page.keyboard.type("11282026")
        expect(day).to_have_value("2026-11-28")
        assert "since" not in page.url
        page.keyboard.press("Enter")
        page.wait_for_url("**&since=2026-11-28")
        expect(day).to_be_focused()
        page.go_back()
        expect(day).to_have_value("")
        page.go_back()
        expect(what).to_have_value("")
        expect(words).to_have_value("verdict")
