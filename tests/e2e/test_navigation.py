"""Ways through the queue from the review screen, and back over what was decided."""

from __future__ import annotations

import re
from collections.abc import Callable
from urllib.parse import quote

import pytest
from playwright.sync_api import Page, Route, expect

from tests.e2e.screen import Screen, judge, until, withdraw_verdict

OpenPage = Callable[..., Page]
QUERY = "views>1 -number:3 sort:parallax-desc"
"""Filtered, and in another order than that of the dataset."""


def ids(page: Page, query: str) -> list[int]:
    """The groups of a query in their order."""
    params = {"dataset": "sample", "q": query}
    found: list[int] = page.request.get("/api/v1/groups/ids", params=params).json()["ids"]
    return found


def at(page: Page, group: int, query: str) -> Screen:
    """The review screen of a group in the queue of a query, its place known."""
    page.goto(f"/review/{group}?q={quote(query)}")
    place = page.locator(".header__place")
    expect(place).to_contain_text("of")
    screen = Screen(page)
    screen.ready()
    return screen


def stands(page: Page, queue: list[int], place: int) -> None:
    """Wait for the group of that place, and for the place to be said."""
    page.wait_for_url(f"**/review/{queue[place]}?*")
    expect(page.locator(".header__place")).to_contain_text(f"{place + 1} of {len(queue)}")


@pytest.fixture
def page(open_page: OpenPage) -> Page:
    """A window with nothing in it."""
    return open_page(None)


class TestFarKeys:
    def test_v_and_c_go_ten_groups_on_and_back_in_the_order_of_the_queue(self, page: Page) -> None:
        queue = ids(page, QUERY)
        assert queue != sorted(queue)
        assert len(queue) == 13
        screen = at(page, queue[1], QUERY)
        stands(page, queue, 1)
        screen.press("v")
        stands(page, queue, 11)
        screen.press("c")
        stands(page, queue, 1)

    def test_far_keys_stop_at_the_ends_of_the_queue_and_say_so(self, page: Page) -> None:
        queue = ids(page, QUERY)
        screen = at(page, queue[8], QUERY)
        screen.press("v")
        stands(page, queue, 12)
        screen.press("v")
        expect(page.get_by_text("This is the last group of the queue.")).to_be_attached()
        screen.press("c")
        stands(page, queue, 2)
        screen.press("c")
        stands(page, queue, 0)
        screen.press("c")
        expect(page.get_by_text("This is the first group of the queue.")).to_be_attached()
        stands(page, queue, 0)


class TestHeader:
    def test_names_the_dataset_of_the_group_whose_history_is_shown(
        self, open_page: OpenPage
    ) -> None:
        def put_another_first(route: Route) -> None:
            answer = route.fetch()
            items = answer.json()["items"]
            route.fulfill(json={"items": [{**items[0], "id": 999, "name": "another"}, *items]})

        page = open_page(None)
        page.route("**/api/v1/datasets", put_another_first)
        page.goto("/review/4/history")
        link = page.get_by_role("link", name="Yield", exact=True)
        expect(link).to_have_attribute("href", "/datasets/sample/yield")
        expect(page.get_by_role("button", name="Dataset and pages")).to_contain_text("sample")


class TestNextGroup:
    def test_shows_all_its_views_though_one_was_looked_at_alone(self, page: Page) -> None:
        queue = ids(page, QUERY)
        screen = at(page, queue[1], QUERY)
        page.locator('.image-panel[data-view="A"] .image-panel__stage').dblclick()
        expect(page.locator(".image-panel")).to_have_count(1)
        screen.press("f")
        stands(page, queue, 2)
        views = screen.document()["views"]
        assert len(views) > 1
        expect(page.locator(".image-panel")).to_have_count(len(views))


class TestFlaggedKeys:
    def test_r_and_e_go_from_finding_to_finding_in_the_order_of_the_queue(self, page: Page) -> None:
        queue, flagged = ids(page, QUERY), ids(page, f"{QUERY} -finding:none")
        assert 2 <= len(flagged) < len(queue)
        screen = at(page, flagged[0], QUERY)
        for group in flagged[1:]:
            screen.press("r")
            stands(page, queue, queue.index(group))
        screen.press("r")
        expect(page.get_by_text("No group with a finding comes after this one.")).to_be_attached()
        for group in reversed(flagged[:-1]):
            screen.press("e")
            stands(page, queue, queue.index(group))
        screen.press("e")
        expect(page.get_by_text("No group with a finding comes before this one.")).to_be_attached()

    def test_a_group_without_a_finding_leads_to_the_nearest_with_one(self, page: Page) -> None:
        queue, flagged = ids(page, QUERY), ids(page, f"{QUERY} -finding:none")
        start = next(
            place
            for place, group in enumerate(queue)
            if group not in flagged and any(other in flagged for other in queue[place + 1 :])
        )
        screen = at(page, queue[start], QUERY)
        screen.press("r")
        following = next(place for place in range(start, 13) if queue[place] in flagged)
        stands(page, queue, following)


class TestPlace:
    def test_survives_a_reload_and_leads_back_to_its_row(self, page: Page) -> None:
        queue = ids(page, QUERY)
        screen = at(page, queue[4], QUERY)
        screen.press("f")
        stands(page, queue, 5)
        page.reload()
        stands(page, queue, 5)
        page.get_by_role("link", name="Queue", exact=True).click()
        row = page.locator('.queue-row[data-active="true"]')
        expect(row).to_have_attribute("aria-rowindex", "7")
        page.keyboard.press("ArrowDown")
        expect(row).to_have_attribute("aria-rowindex", "8")
        page.reload()
        expect(row).to_have_attribute("aria-rowindex", "8")
        page.keyboard.press("Enter")
        stands(page, queue, 6)


def state_of(page: Page, group: int) -> str:
    """The verdict that the server has."""
    state: str = page.request.get(f"/api/v1/groups/{group}").json()["verdict"]["state"]
    return state


def become(page: Page, groups: list[int], *states: str) -> None:
    """Wait until the server has these verdicts: a group may have to be read before one is sent."""
    until(page, lambda: [state_of(page, group) for group in groups] == list(states))


class TestTakingVerdictsBack:
    def test_goes_from_group_to_group_also_after_a_reload(self, page: Page) -> None:
        queue = ids(page, QUERY)
        # What tests of other files have left is what would come back.
        for group in queue[6:8]:
            withdraw_verdict(page, group)
        screen = at(page, queue[6], QUERY)
        screen.press("s")
        stands(page, queue, 7)
        screen.press("x", "2")
        stands(page, queue, 8)
        become(page, queue[6:8], "deferred", "rejected")
        screen.saved()
        page.reload()
        stands(page, queue, 8)
        screen.ready()
        screen.press("Control+z")
        stands(page, queue, 7)
        become(page, queue[7:8], "unreviewed")
        screen.saved()
        screen.press("Control+z")
        stands(page, queue, 6)
        become(page, queue[6:8], "unreviewed", "unreviewed")
        screen.press("Control+Shift+z")
        become(page, queue[6:8], "deferred", "unreviewed")
        screen.saved()
        screen.press("Control+z")
        become(page, queue[6:7], "unreviewed")

    def test_a_judged_group_keeps_its_place_among_those_worth_a_review(self, page: Page) -> None:
        order = "sort:value status:unreviewed"
        queue = ids(page, order)
        screen = at(page, queue[3], order)
        screen.press("s")
        expect(page).to_have_url(re.compile(rf"/review/{queue[4]}\b"))
        screen.saved()
        page.goto(f"/review/{queue[3]}?q={quote(order)}")
        screen.ready()
        screen.press("f")
        expect(page).to_have_url(re.compile(rf"/review/{queue[4]}\b"))
        screen.press("Control+z")
        stands(page, queue, 3)
        become(page, queue[3:4], "unreviewed")

    def test_leaves_alone_what_somebody_has_judged_since(self, page: Page) -> None:
        queue = ids(page, QUERY)
        screen = at(page, queue[2], QUERY)
        screen.press("s")
        stands(page, queue, 3)
        screen.saved()
        judge(page, queue[2], "rejected", "duplicate_view")
        page.reload()
        stands(page, queue, 3)
        screen.ready()
        screen.press("Control+z")
        expect(page.locator(".bar")).to_contain_text("was reviewed again since")
        assert state_of(page, queue[2]) == "rejected"
        withdraw_verdict(page, queue[2])

    def test_gives_no_verdict_again_over_one_that_somebody_has_given_since(
        self, page: Page
    ) -> None:
        queue = ids(page, QUERY)
        screen = at(page, queue[2], QUERY)
        screen.press("s")
        stands(page, queue, 3)
        screen.press("Control+z")
        stands(page, queue, 2)
        become(page, queue[2:3], "unreviewed")
        screen.saved()
        judge(page, queue[2], "rejected", "duplicate_view")
        page.reload()
        screen.ready()
        screen.press("Control+Shift+z")
        expect(page.locator(".bar")).to_contain_text("was reviewed since")
        assert state_of(page, queue[2]) == "rejected"
        withdraw_verdict(page, queue[2])
