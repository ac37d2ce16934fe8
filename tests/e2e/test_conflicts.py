"""Two people at once: what one changes appears with the other, and nobody overwrites unseen."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.e2e.screen import (
    Document,
    Screen,
    go_offline,
    hears,
    interior_point,
    on_present,
    passing,
    settled,
)

OpenPage = Callable[..., Page]
GONE = ("ERR_INTERNET_DISCONNECTED", "ERR_NETWORK_CHANGED", "ERR_FAILED", "ERR_NETWORK_IO")
MORE_THAN_CONNECTIONS = 7
"""Windows: a browser opens six connections to a server in all of them together."""


@pytest.fixture
def both(open_page: OpenPage) -> Iterator[tuple[Screen, Screen]]:
    """One group in two browsers; its balls and lines are put back afterwards."""
    first = open_page(None)
    group = passing(first, 2)
    second = open_page(None)
    for page in (first, second):
        page.goto(f"/review/{group}")
        Screen(page).ready()
        hears(page)
    screen = Screen(first)
    before = screen.document()["views"][0]
    yield screen, Screen(second)
    for page in (first, second):
        settled(page)
    put_back(screen, before)


def put_back(screen: Screen, view: Document) -> None:
    """Give a view its ball and lines back."""
    request = screen.page.request
    address = f"/api/v1/views/{view['id']}"
    for part, body in (
        ("ball", {"box": view["balls"][0]["box"]}),
        ("lines", {"lines": view["lines"]}),
    ):
        on_present(
            screen.page,
            screen.group,
            lambda headers, part=part, body=body: request.patch(  # type: ignore[misc]
                f"{address}/{part}", data=body, headers=headers
            ),
        )


def move_ball(screen: Screen, by: float, *, drop: bool = True) -> None:
    """Drag the ball of the first view to the right, in window pixels."""
    view = screen.document()["views"][0]
    x, y, width, height = view["balls"][0]["box"]
    screen.drag(screen.place(view, x + width / 2, y + height / 2), by, 0, drop=drop)


def box(screen: Screen) -> list[float]:
    """The ball of the first view, as the server has it."""
    ball: list[float] = screen.document()["views"][0]["balls"][0]["box"]
    return ball


def meet(mine: Screen, theirs: Screen, change: Callable[[], None]) -> Locator:
    """Change something in the other browser while this one holds the ball; then let it go."""
    move_ball(mine, 8, drop=False)
    change()
    theirs.saved()
    mine.page.mouse.up()
    bar = mine.page.get_by_role("alert", name="Conflict")
    expect(bar).to_be_visible()
    return bar


def see(page: Page, seen: bool) -> None:
    """Bring a window to the front, or behind others."""
    page.evaluate(
        """(hidden) => {
          Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });
          document.dispatchEvent(new Event('visibilitychange'));
        }""",
        not seen,
    )


class TestLiveUpdates:
    def test_an_edit_in_one_browser_appears_in_the_other(self, both: tuple[Screen, Screen]) -> None:
        mine, theirs = both
        before = mine.number("A", "error")
        move_ball(theirs, 6)
        expect(mine.page.locator('[data-row="A"] [data-number="error"]')).not_to_have_text(before)
        theirs.saved()
        expect(mine.page.locator('[data-row="A"] [data-number="error"]')).to_have_text(
            theirs.number("A", "error")
        )

    def test_a_verdict_in_one_browser_appears_in_the_other(
        self, both: tuple[Screen, Screen]
    ) -> None:
        mine, theirs = both
        theirs.press("s")
        expect(mine.page.locator('.pill[data-status="deferred"]')).to_be_visible()
        theirs.saved()
        theirs.press("Control+z")
        expect(mine.page.locator('.pill[data-status="deferred"]')).to_have_count(0)

    def test_a_window_that_nobody_saw_shows_what_it_missed(
        self, both: tuple[Screen, Screen]
    ) -> None:
        mine, theirs = both
        see(mine.page, False)
        theirs.press("s")
        theirs.saved()
        deferred = mine.page.locator('.pill[data-status="deferred"]')
        expect(deferred).to_have_count(0)
        see(mine.page, True)
        expect(deferred).to_be_visible()
        theirs.press("Control+z")
        expect(deferred).to_have_count(0)

    def test_windows_that_nobody_sees_leave_their_connections_to_others(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/jobs")
        for _ in range(MORE_THAN_CONNECTIONS):
            page.wait_for_selector(".page__main > :nth-child(2)")
            hears(page)
            with page.expect_event("requestfailed", lambda gone: "/api/v1/events" in gone.url):
                see(page, False)
            page = page.context.new_page()
            page.goto("/jobs")
        expect(page.locator(".page__main > :nth-child(2)").first).to_be_visible()


class TestConflict:
    def test_my_edit_can_be_kept(self, both: tuple[Screen, Screen], console: Any) -> None:
        console.expect("412")
        mine, theirs = both
        x = box(mine)[0]
        bar = meet(mine, theirs, lambda: move_ball(theirs, -6))
        expect(bar).to_contain_text("both changed it")
        assert box(mine)[0] < x
        bar.get_by_role("button", name="Keep mine").click()
        expect(bar).to_have_count(0)
        mine.saved()
        assert box(mine)[0] > x + 3
        expect(theirs.page.locator('[data-row="A"] [data-number="error"]')).to_have_text(
            mine.number("A", "error")
        )

    def test_their_edit_can_be_taken(self, both: tuple[Screen, Screen], console: Any) -> None:
        console.expect("412")
        mine, theirs = both
        bar = meet(mine, theirs, lambda: move_ball(theirs, -6))
        now = box(mine)
        bar.get_by_role("button", name="Take theirs").click()
        expect(bar).to_have_count(0)
        assert box(mine) == now
        expect(mine.page.locator(".save")).to_have_attribute("data-unsaved", "0")

    def test_what_does_not_overlap_is_kept_of_both(
        self, both: tuple[Screen, Screen], console: Any
    ) -> None:
        console.expect("412")
        mine, theirs = both
        view = mine.document()["views"][0]
        x = box(mine)[0]
        marking, index, point = interior_point(view)

        def move_point() -> None:
            theirs.drag(theirs.place(view, point["x"], point["y"]), 3, 15)

        bar = meet(mine, theirs, move_point)
        expect(bar).to_contain_text("only you changed it")
        bar.get_by_role("button", name="Keep mine").click()
        mine.saved()
        after = mine.document()["views"][0]
        assert after["lines"][marking][index]["y"] > point["y"] + 8
        assert after["balls"][0]["box"][0] > x + 3

    def test_merging_gives_them_what_overlaps_and_me_the_rest(
        self, both: tuple[Screen, Screen], console: Any
    ) -> None:
        for part in ("412", *GONE):
            console.expect(part)
        mine, theirs = both
        view = mine.document()["views"][0]
        marking, index, point = interior_point(view)
        go_offline(mine.page)
        move_ball(mine, 8)
        mine.drag(mine.place(view, point["x"], point["y"]), 3, 15)
        expect(mine.page.locator(".save")).to_contain_text("2 changes wait")
        move_ball(theirs, -6)
        theirs.saved()
        now = box(theirs)
        mine.page.context.set_offline(False)
        bar = mine.page.get_by_role("alert", name="Conflict")
        expect(bar).to_contain_text("both changed it")
        expect(bar).to_contain_text("only you changed it")
        bar.get_by_role("button", name="Keep both, theirs where they overlap").click()
        expect(bar).to_have_count(0)
        mine.saved()
        after = mine.document()["views"][0]
        assert after["balls"][0]["box"] == now
        assert after["lines"][marking][index]["y"] > point["y"] + 8

    def test_a_verdict_meets_what_the_other_person_changed(
        self, both: tuple[Screen, Screen], console: Any
    ) -> None:
        for part in ("412", *GONE):
            console.expect(part)
        mine, theirs = both
        group = mine.group
        go_offline(mine.page)
        mine.press("s")
        mine.page.wait_for_url(lambda url: f"/review/{group}" not in url)
        move_ball(theirs, -6)
        theirs.saved()
        mine.page.context.set_offline(False)
        mine.page.wait_for_url(f"**/review/{group}*")
        bar = mine.page.get_by_role("alert", name="Conflict")
        row = bar.get_by_role("row", name="Ball of A")
        expect(row).to_contain_text(re.compile("moved .* px"))
        expect(row).to_contain_text("only they changed it")
        bar.get_by_role("button", name="Take theirs").click()
        expect(bar).to_have_count(0)

    def test_a_conflict_survives_a_reload(self, both: tuple[Screen, Screen], console: Any) -> None:
        console.expect("412")
        mine, theirs = both
        meet(mine, theirs, lambda: move_ball(theirs, -6))
        mine.page.reload()
        mine.ready()
        bar = mine.page.get_by_role("alert", name="Conflict")
        expect(bar).to_contain_text("Ball of A")
        mine.press("a")
        expect(mine.page).to_have_url(mine.page.url)
        mine.press("i")
        expect(mine.page.locator(".object-list")).to_have_count(0)
        mine.page.goto("/jobs")
        expect(mine.page.locator(".save")).to_have_text(re.compile("Not saved: conflict"))
        mine.page.get_by_role("link", name="Go to the conflict").click()
        mine.ready()
        bar.get_by_role("button", name="Take theirs").click()
        expect(bar).to_have_count(0)
