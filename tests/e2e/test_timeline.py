"""The timeline of static cameras: what it shows, scrubbing, playing, jumping to the worst."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.film import FRAMES, SEEN_BY_TWO, WORST
from tests.e2e.screen import at_rest, holding
from tests.e2e.test_access import CUT_OFF, NESTED_SCROLLERS, SIZES, serious, soon

OpenPage = Callable[..., Page]
GROUPS = re.compile(r"/groups/\d+$")


def columns(page: Page, film: str) -> dict[str, Any]:
    """The film as the server has it."""
    answer = page.request.get(f"{film}/api/v1/datasets/film/timeline")
    assert answer.ok
    found: dict[str, Any] = answer.json()
    return found


def open_timeline(page: Page, film: str, frame: int) -> dict[str, Any]:
    """Open a frame's group with the timeline below it."""
    shown = columns(page, film)
    page.goto(f"{film}/review/{shown['id'][shown['frame'].index(frame)]}")
    page.wait_for_selector(".strip__tabs")
    page.keyboard.press("Shift+J")
    page.wait_for_selector('.timeline[data-loaded="true"] .timeline__curve')
    return shown


def expect_frame(page: Page, frame: int) -> None:
    """Wait until that frame is on screen."""
    expect(page.locator(".header__where strong")).to_have_text(f"Frame {frame}")


class TestTimeline:
    def test_counts_what_passes(self, open_page: OpenPage, film: str) -> None:
        page = open_page(None)
        open_timeline(page, film, FRAMES[0])
        passing = len(FRAMES) - len(SEEN_BY_TWO)
        expect(page.locator(".timeline h2")).to_contain_text(f"{passing} of {len(FRAMES)} pass")
        expect(page.locator(".timeline__words")).to_contain_text("passes")

    def test_jumps_to_the_worst_frame_and_on(self, open_page: OpenPage, film: str) -> None:
        page = open_page(None)
        shown = open_timeline(page, film, FRAMES[0])
        page.keyboard.press("j")
        expect_frame(page, WORST)
        expect(page.locator(".timeline__words")).to_contain_text(
            "fails: the views do not agree on one ball"
        )
        page.keyboard.press("j")
        errors = sorted(zip(shown["error_px"], shown["frame"], strict=True), reverse=True)
        expect_frame(page, errors[1][1])

    def test_is_scrubbed_by_keys_and_pointer(self, open_page: OpenPage, film: str) -> None:
        page = open_page(None)
        open_timeline(page, film, FRAMES[5])
        curve = page.get_by_role("slider", name="Frame")
        curve.focus()
        page.keyboard.press("ArrowRight")
        expect_frame(page, FRAMES[6])
        page.keyboard.press("End")
        expect_frame(page, FRAMES[-1])
        box = at_rest(curve)
        page.mouse.click(box["x"] + 3, box["y"] + box["height"] / 2)
        expect_frame(page, FRAMES[0])
        box = at_rest(curve)
        page.mouse.click(box["x"] + box["width"] - 3, box["y"] + box["height"] / 2)
        expect_frame(page, FRAMES[-1])

    def test_scrubbing_keeps_the_keyboard_while_a_frame_is_loaded(
        self, open_page: OpenPage, film: str
    ) -> None:
        page = open_page(None)
        open_timeline(page, film, FRAMES[5])
        curve = page.get_by_role("slider", name="Frame")
        curve.focus()
        with holding(page, GROUPS) as groups:
            page.keyboard.press("End")
            groups.arrive()
            page.wait_for_timeout(200)
            # The frame before stays, and so does the keyboard's focus.
            expect_frame(page, FRAMES[5])
            expect(curve).to_be_focused()
        expect_frame(page, FRAMES[-1])
        with holding(page, GROUPS) as groups:
            page.keyboard.press("Home")
            groups.arrive()
            expect(curve).to_be_focused()
        expect_frame(page, FRAMES[0])

    def test_plays_to_the_end(self, open_page: OpenPage, film: str) -> None:
        page = open_page(None)
        open_timeline(page, film, FRAMES[-4])
        page.keyboard.press("Space")
        expect_frame(page, FRAMES[-1])
        expect(page.locator(".timeline")).to_have_attribute("data-playing", "false")

    def test_shows_a_verdict_at_once(self, open_page: OpenPage, film: str) -> None:
        page = open_page(None)
        open_timeline(page, film, FRAMES[9])
        page.keyboard.press("s")
        expect_frame(page, FRAMES[10])
        page.keyboard.press("d")
        expect_frame(page, FRAMES[9])
        expect(page.locator(".timeline__words")).to_contain_text("deferred")

    @pytest.mark.parametrize("scheme", ["dark", "light"])
    def test_axe_finds_nothing_serious(self, open_page: OpenPage, film: str, scheme: str) -> None:
        page = open_page(None, scheme=scheme)
        open_timeline(page, film, WORST)
        assert serious(page) == []

    @pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
    def test_six_views_and_the_timeline_fit(
        self, open_page: OpenPage, film: str, size: tuple[int, int]
    ) -> None:
        page = open_page(None, size={"width": size[0], "height": size[1]})
        open_timeline(page, film, FRAMES[3])
        expect(page.locator(".image-panel")).to_have_count(6)
        assert soon(page, CUT_OFF) == []
        assert soon(page, NESTED_SCROLLERS) == []
