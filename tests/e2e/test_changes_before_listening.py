"""What others do while a page has read something and does not listen yet."""

from __future__ import annotations

from collections.abc import Callable

from playwright.sync_api import Page, expect

from tests.e2e.screen import Screen, holding, judge, passing, withdraw_verdict

ANEW = "Another person or window changed this group; the page shows the new state."


def test_a_group_that_is_judged_before_the_page_listens_is_shown_as_it_is_then(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(None)
    group = passing(page, 2)
    with holding(page, "**/api/v1/events*") as streams:
        page.goto(f"/review/{group}")
        Screen(page).ready()
        streams.arrive()
        judge(page, group, "deferred")
        expect(page.get_by_text(ANEW)).to_have_count(0)
    expect(page.get_by_text(ANEW)).to_have_count(1)
    withdraw_verdict(page, group)


def test_the_queue_shows_what_was_judged_before_it_listened(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(None)
    group = passing(page, 2)
    row = page.locator(".queue-row").filter(has=page.locator(f'a[href^="/review/{group}"]'))
    with holding(page, "**/api/v1/events*") as streams:
        page.goto("/groups?dataset=sample")
        expect(row).to_be_visible()
        expect(row).not_to_contain_text("deferred")
        streams.arrive()
        judge(page, group, "deferred")
    expect(row).to_contain_text("deferred")
    withdraw_verdict(page, group)
