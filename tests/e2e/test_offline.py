"""The network goes away and comes back: what a person said in between is not lost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from playwright.sync_api import Page, Route, expect

from tests.e2e.screen import (
    Screen,
    go_offline,
    lie_ready,
    refusing,
    rows,
    undo_edit,
    until,
    withdraw_verdict,
)

OpenPage = Callable[..., Page]
GONE = ("ERR_INTERNET_DISCONNECTED", "ERR_NETWORK_CHANGED", "ERR_FAILED", "ERR_NETWORK_IO")
OCCUPY = """() => new Promise((occupied) => {
  // However late this machine is, the page does not lose its patience.
  const timer = setTimeout;
  window.setTimeout = (go, wait, ...told) => timer(go, wait === 5000 ? 1e8 : wait, ...told);
  indexedDB.open('touchline').onsuccess = ({ target: { result: database } }) => {
    const store = database.transaction('writes', 'readwrite').objectStore('writes');
    const goOn = () => {
      occupied();
      if (!window.letGo) store.count().onsuccess = goOn;
    };
    goOn();
  };
})"""
"""Keep everybody else from writing to what the page keeps, as a busy disk does."""


def at_last_groups(open_page: OpenPage, console: Any) -> tuple[Screen, list[int]]:
    """The review screen before the last groups, with those that follow loaded."""
    for part in GONE:
        console.expect(part)
    page = open_page(None)
    chain = [int(row["id"]) for row in rows(page)][-5:]
    page.goto(f"/review/{chain[0]}")
    screen = Screen(page)
    screen.ready()
    lie_ready(page, chain)
    return screen, chain


class TestOutbox:
    def test_edits_and_verdicts_wait_for_the_network(
        self, open_page: OpenPage, console: Any
    ) -> None:
        screen, chain = at_last_groups(open_page, console)
        page = screen.page
        box = screen.document()["views"][0]["balls"][0]["box"]
        go_offline(page)
        screen.press("i", "Shift+ArrowRight", "s")
        page.wait_for_url(f"**/review/{chain[1]}")
        expect(page.locator(".save")).to_contain_text("Offline · 2 changes wait")
        screen.press("x", "4")
        page.wait_for_url(f"**/review/{chain[2]}")
        expect(page.locator(".save")).to_contain_text("Offline · 3 changes wait")
        page.context.set_offline(False)
        screen.saved()
        verdicts = {row["id"]: row["status"] for row in rows(page)}
        assert [verdicts[group] for group in chain[:2]] == ["deferred", "rejected"]
        first = page.request.get(f"/api/v1/groups/{chain[0]}").json()
        assert first["views"][0]["balls"][0]["box"][0] == box[0] + 5
        leave_as_found(page, chain[:2], edited=chain[0])

    def test_an_edit_that_a_busy_server_refuses_is_sent_in_a_moment(
        self, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("503")
        screen, chain = at_last_groups(open_page, console)
        page = screen.page
        box = screen.document()["views"][0]["balls"][0]["box"]
        busy = {"title": "Busy", "status": 503, "detail": "too many requests at once"}
        page.route(
            "**/api/v1/views/**",
            lambda route: route.fulfill(status=503, json=busy, headers={"Retry-After": "2"}),
            times=1,
        )
        screen.press("i", "Shift+ArrowLeft")
        expect(page.locator(".save")).to_contain_text("Server busy · 1 change waits")
        expect(page.get_by_role("alert")).to_have_count(0)
        screen.saved()
        assert screen.document()["views"][0]["balls"][0]["box"][0] == box[0] - 5
        leave_as_found(page, [], edited=chain[0])

    def test_what_waits_survives_a_reload(self, open_page: OpenPage, console: Any) -> None:
        screen, chain = at_last_groups(open_page, console)
        page = screen.page
        box = screen.document()["views"][0]["balls"][0]["box"]
        with refusing(page, "**/api/v1/views/**"):
            screen.press("i", "Shift+ArrowLeft")
            expect(page.locator(".save")).to_contain_text("Offline · 1 change waits")
            page.reload()
            expect(page.locator(".save")).to_contain_text("Offline · 1 change waits")
        screen.saved()
        assert screen.document()["views"][0]["balls"][0]["box"][0] == box[0] - 5
        leave_as_found(page, [], edited=chain[0])

    def test_what_a_window_leaves_is_sent_by_another_when_it_closes(
        self, open_page: OpenPage, console: Any
    ) -> None:
        screen, chain = at_last_groups(open_page, console)
        page, box = screen.page, screen.document()["views"][0]["balls"][0]["box"]
        page.route("**/api/v1/views/**", lambda route: route.abort())
        screen.press("i", "Shift+ArrowLeft")
        expect(page.locator(".save")).to_contain_text("Offline · 1 change waits")
        other = Screen(page.context.new_page())
        other.page.goto(f"/review/{chain[0]}")
        expect(other.page.locator(".save")).to_contain_text("No changes")
        other.page.wait_for_timeout(2500)
        page.close()
        other.saved()
        assert other.document()["views"][0]["balls"][0]["box"][0] == box[0] - 5
        leave_as_found(other.page, [], edited=chain[0])

    def test_an_edit_is_kept_in_the_browser_before_it_is_sent(
        self, open_page: OpenPage, console: Any
    ) -> None:
        screen, chain = at_last_groups(open_page, console)
        page = screen.page
        sent: list[str] = []
        page.on("request", lambda request: sent.append(request.url))
        page.evaluate(OCCUPY)
        screen.press("1", "q")
        page.wait_for_timeout(500)
        assert not [url for url in sent if url.endswith("/ball")]
        page.evaluate("() => { window.letGo = true; }")
        screen.saved()
        leave_as_found(page, [], edited=chain[0])

    def test_an_answer_that_comes_again_brings_nothing_old_back(
        self, open_page: OpenPage, console: Any
    ) -> None:
        screen, chain = at_last_groups(open_page, console)
        page = screen.page

        def occluded() -> bool:
            return bool(screen.document()["views"][0]["balls"][0]["occluded"])

        before = occluded()
        sent: list[Route] = []

        def lose_the_first(route: Route) -> None:
            """The server hears of the edit, the page never of its answer."""
            sent.append(route)
            if len(sent) == 1:
                route.fetch()
            else:
                route.continue_()

        page.route("**/api/v1/views/*/ball", lose_the_first)
        screen.press("1", "q")
        until(page, lambda: occluded() != before)
        undo_edit(page, chain[0])
        page.reload()
        screen.saved()
        screen.ready()
        assert occluded() == before
        screen.press("1", "q")
        screen.saved()
        assert occluded() != before
        leave_as_found(page, [], edited=chain[0])

    def test_an_unsent_edit_can_be_undone(self, open_page: OpenPage, console: Any) -> None:
        screen, _ = at_last_groups(open_page, console)
        page = screen.page
        box = screen.document()["views"][0]["balls"][0]["box"]
        go_offline(page)
        screen.press("i", "Shift+ArrowRight")
        expect(page.locator(".save")).to_contain_text("Offline · 1 change waits")
        screen.press("ArrowUp")
        expect(page.locator(".save")).to_contain_text("Offline · 2 changes wait")
        screen.press("Control+z")
        expect(page.locator(".save")).to_contain_text("Offline · 1 change waits")
        page.context.set_offline(False)
        screen.saved()
        now = screen.document()["views"][0]["balls"][0]["box"]
        assert now == [box[0] + 5, *box[1:]]
        leave_as_found(page, [], edited=screen.group)


BUSY = {"title": "Busy", "status": 503, "detail": "the database cannot be reached"}


class TestArrival:
    """The database is away, or the session has ended: a group is read once more."""

    def test_a_group_that_could_not_be_read_is_shown_when_it_can(
        self, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("503")
        page = open_page(None)
        group = int(rows(page)[0]["id"])
        page.route(f"**/api/v1/groups/{group}", lambda route: route.fulfill(status=503, json=BUSY))
        page.goto(f"/review/{group}")
        expect(page.get_by_role("heading", name=f"Group {group} cannot be shown")).to_be_visible()
        page.unroute(f"**/api/v1/groups/{group}")
        page.get_by_role("main").get_by_role("button", name="Try again").click()
        Screen(page).ready()
        expect(page.get_by_role("alert")).to_have_count(0)

    def test_no_bar_stands_over_a_group_that_is_shown(
        self, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("503")
        screen, chain = at_last_groups(open_page, console)
        page = screen.page
        asked: list[str] = []

        def refuse(route: Route) -> None:
            asked.append(route.request.url)
            route.fulfill(status=503, json=BUSY)

        page.route(f"**/api/v1/groups/{chain[1]}/neighbours**", refuse)
        page.route(f"**/api/v1/groups/{chain[1]}", refuse)
        screen.press("s")
        page.wait_for_url(f"**/review/{chain[1]}")
        until(page, lambda: asked)
        screen.saved()
        expect(page.get_by_role("alert")).to_have_count(0)
        page.unroute_all()
        withdraw_verdict(page, chain[0])


def leave_as_found(page: Page, judged: list[int], *, edited: int) -> None:
    """Take back what a test has said."""
    for group in judged:
        withdraw_verdict(page, group)
    undo_edit(page, edited)
