"""The queue as a tool: completion, sorting, saved views, verdicts for everything that matches."""

from __future__ import annotations

from collections.abc import Callable

from playwright.sync_api import Page, expect

OpenPage = Callable[..., Page]


def opened(open_page: OpenPage, query: str = "") -> Page:
    """The queue with its rows there."""
    page = open_page(f"/groups?q={query}")
    page.wait_for_selector(".queue-row a")
    return page


def statuses(page: Page) -> list[str]:
    """What the pills of the rows say."""
    return [text.split()[-1] for text in page.locator(".queue-row .pill").all_text_contents()]


class TestQueryBox:
    def test_completion_fills_in_a_field_and_its_value(self, open_page: OpenPage) -> None:
        page = opened(open_page)
        page.keyboard.press("/")
        page.keyboard.type("number<=9 spl")
        expect(page.get_by_role("option", name="split:")).to_be_visible()
        page.keyboard.press("ArrowDown")
        page.keyboard.press("Enter")
        expect(page.get_by_role("option", name="train")).to_be_visible()
        page.get_by_role("option", name="train").click()
        expect(page.locator(".field--query")).to_have_value("number<=9 split:train ")
        page.wait_for_url("**split**")

    def test_a_status_button_filters_and_a_header_sorts(self, open_page: OpenPage) -> None:
        page = opened(open_page)
        page.get_by_role("button", name="rejected").click()
        expect(page.locator(".field--query")).to_have_value("status:rejected")
        page.get_by_role("button", name="rejected").click()
        expect(page.locator(".field--query")).to_have_value("")
        page.get_by_role("button", name="margin").click()
        head = page.get_by_role("columnheader", name="margin")
        expect(head).to_have_attribute("aria-sort", "ascending")
        page.get_by_role("button", name="margin").click()
        expect(head).to_have_attribute("aria-sort", "descending")
        expect(page.locator(".save")).to_contain_text("14 of 14 match")

    def test_the_ends_of_a_histogram_move_by_keyboard(self, open_page: OpenPage) -> None:
        page = opened(open_page)
        page.get_by_role("slider", name="min JaC 0.5 % from").focus()
        page.keyboard.press("ArrowRight")
        expect(page.locator(".field--query")).to_have_value("jac>=0.05 jac<=1")


class TestBulkVerdicts:
    def test_everything_that_matches_is_decided_and_taken_back_in_one_go(
        self, open_page: OpenPage
    ) -> None:
        page = opened(open_page, "number<=3")
        expect(page.locator(".save")).to_contain_text("3 of 14 match")
        before = statuses(page)
        page.keyboard.press("b")
        page.get_by_label("Defer").check()
        decide = page.get_by_role("button", name="Defer 3 groups")
        expect(page.locator(".bulk__outcome")).to_contain_text("3 of 3 groups change")
        decide.click()
        expect(page.locator(".bar")).to_contain_text("3 groups deferred")
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(3)
        page.locator(".bar").get_by_role("button", name="Undo").click()
        expect(page.locator(".bar")).to_contain_text("3 verdicts are taken back")
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(0)
        assert statuses(page) == before


class TestSavedViews:
    def test_a_query_is_saved_opened_and_deleted(self, open_page: OpenPage) -> None:
        page = opened(open_page, "number<=4")
        views = page.get_by_role("button", name="Views", exact=True)
        views.click()
        page.get_by_label("Save number<=4 as").fill("First four")
        page.get_by_role("button", name="Save", exact=True).click()
        expect(page.locator(".saved-views")).to_contain_text("First four")
        page.goto("/groups")
        page.wait_for_selector(".queue-row a")
        views.click()
        page.get_by_role("button", name="First four 4 groups").click()
        expect(page.locator(".save")).to_contain_text("4 of 14 match")
        views.click()
        page.get_by_role("button", name="Delete the view First four").click()
        expect(page.get_by_text("None yet.")).to_be_visible()


class TestFollowing:
    def test_what_another_window_decides_appears(self, open_page: OpenPage) -> None:
        page = opened(open_page, "number<=2")
        other = opened(open_page, "number<=2")
        # The stream must be open before the other window acts.
        page.wait_for_function(
            "async () => (await import("
            "document.querySelector('script[src]').src.replace('main.js', 'api/events.js')"
            ")).connected.value"
        )
        other.keyboard.press("b")
        other.get_by_label("Defer").check()
        other.get_by_role("button", name="Defer 2 groups").click()
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(2)
        other.locator(".bar").get_by_role("button", name="Undo").click()
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(0)
