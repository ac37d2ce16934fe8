"""A phone, 390 pixels wide, with a finger: queue, review, comments and notifications are usable."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.crew import Crew
from tests.e2e.screen import Screen, passing, until
from tests.e2e.team import REFUSED, log_in
from tests.e2e.test_access import TOO_WIDE, serious_in_both, soon
from tests.e2e.windows import TIMEOUT_MS, Windows

PHONE = {"width": 390, "height": 844}
MAIN = ".header__nav a, .verdicts .button, .talk__form .button, .bell > .button, .reasons button"

OpenPhone = Callable[..., Page]

MAIN_TOO_WIDE = """() => [...document.querySelectorAll('main')]
  .filter((main) => main.scrollWidth > main.clientWidth).map((main) => `main: ${main.scrollWidth}`)"""

TOO_SMALL = f"""() => [...document.querySelectorAll('button, a.button, select, input, {MAIN}')]
  .filter((element) => element.checkVisibility({{ visibilityProperty: true, opacityProperty: true }})
    && !element.closest('.hidden-text, p, li p, td, th, .gates, .queue-table'))
  .map((element) => {{
    const box = (element.closest('label') ?? element).getBoundingClientRect();
    const least = element.matches('{MAIN}') ? 44 : 24;
    return [element, box, least];
  }})
  .filter(([, box, least]) => box.width > 0 && (box.height < least - 0.5 || box.width < 24))
  .map(([element, box, least]) =>
    `${{element.className}} ${{element.textContent.trim()}}: ${{box.width}} x ${{box.height}}, not ${{least}}`)"""


@pytest.fixture
def phone(windows: Windows, server: str, console: Any) -> Iterator[OpenPhone]:
    """A function that opens a page as a phone does."""
    with ExitStack() as opened:

        def open_one(path: str, address: str = server) -> Page:
            context = windows.browser.new_context(
                base_url=address,
                viewport=PHONE,  # type: ignore[arg-type]
                has_touch=True,
                is_mobile=True,
            )
            opened.callback(context.close)
            page = context.new_page()
            page.set_default_timeout(TIMEOUT_MS)
            page.on("console", console.hear)
            page.goto(path)
            return page

        yield open_one


def fits(page: Page) -> dict[str, list[str]]:
    """What a phone's page does not fit, or is too small to be hit."""
    faults = {
        "wide": soon(page, TOO_WIDE) + soon(page, MAIN_TOO_WIDE),
        "small": soon(page, TOO_SMALL),
        "axe": serious_in_both(page),
    }
    return {name: found for name, found in faults.items() if found}


def open_review(phone: OpenPhone, place: int = 0) -> Screen:
    """The review of a group that passes."""
    page = phone("/groups")
    page.goto(f"/review/{passing(page, place)}")
    screen = Screen(page)
    screen.ready()
    return screen


class TestPages:
    @pytest.mark.parametrize(
        ("path", "there"),
        [
            ("/groups", ".queue-row a"),
            ("/review/1", ".verdict-card h1"),
            ("/work", "main h2"),
            ("/datasets", "main h2"),
            ("/import", "main h2"),
            ("/help/keys", "main .help"),
            ("/datasets/sample/yield", "main h2"),
            ("/datasets/sample/evaluation", "main h2"),
            ("/audit", "main td"),
        ],
    )
    def test_fit_and_can_be_hit(self, phone: OpenPhone, path: str, there: str) -> None:
        page = phone(path)
        page.locator(there).first.wait_for()
        expect(page.locator('[aria-busy="true"]')).to_have_count(0)
        assert fits(page) == {}

    def test_the_menu_leads_to_every_page(self, phone: OpenPhone) -> None:
        page = phone("/groups")
        page.get_by_role("button", name="Dataset and pages").tap()
        page.get_by_role("link", name="Statistics").tap()
        expect(page).to_have_url(re.compile("/statistics$"))
        assert soon(page, TOO_WIDE) == []


class TestReview:
    def test_a_row_of_the_queue_leads_to_the_pictures_and_the_verdict(
        self, phone: OpenPhone
    ) -> None:
        page = phone("/groups")
        page.locator(".queue-row a").first.tap()
        Screen(page).ready()
        for part in (".image-panel", ".verdict-card h1", ".gates"):
            page.locator(part).first.scroll_into_view_if_needed()
            expect(page.locator(part).first).to_be_in_viewport()
            # Wherever one reads, the verdict is at hand.
            expect(page.get_by_role("button", name="Accept")).to_be_in_viewport()

    def test_a_verdict_is_given_with_a_finger(self, phone: OpenPhone) -> None:
        screen = open_review(phone)
        page, number = screen.page, screen.group
        page.locator(".gates").scroll_into_view_if_needed()
        page.get_by_role("button", name="Reject").tap()
        assert fits(page) == {}
        page.get_by_role("button", name="Bad calibration").tap()
        page.wait_for_url(lambda url: f"/review/{number}" not in url)
        group = f"/api/v1/groups/{number}"
        until(page, lambda: page.request.get(group).json()["verdict"]["state"] == "rejected")
        assert page.request.get(group).json()["verdict"]["reason"] == "bad_calibration"
        # The next group begins at its pictures.
        screen.ready()
        expect(page.locator(".image-panel").first).to_be_in_viewport()
        page.get_by_role("button", name="Undo").tap()
        page.wait_for_url(f"**/review/{number}*")
        expect(page.locator(".verdict-card__verdict")).to_have_count(0)

    def test_a_comment_is_written_and_deleted(self, phone: OpenPhone) -> None:
        screen = open_review(phone, 1)
        page = screen.page
        page.get_by_label("Comment on this group").fill("The replay is late.")
        page.get_by_role("button", name="Comment", exact=True).tap()
        expect(page.locator(".talk__text").last).to_have_text("The replay is late.")
        assert fits(page) == {}
        page.get_by_role("button", name="Delete your comment").last.tap()
        page.get_by_role("button", name="Delete for good?").last.tap()
        expect(page.get_by_text("The replay is late.")).to_have_count(0)

    def test_a_finger_moves_the_page_and_no_point(self, phone: OpenPhone) -> None:
        screen = open_review(phone, 2)
        before = screen.document()
        view = before["views"][0]
        x, y, width, height = view["balls"][0]["box"]
        place = screen.place(view, x + width / 2, y + height / 2)
        screen.drag(place, 30, 0)
        screen.drawn()
        assert screen.document()["etag"] == before["etag"]


class TestEditors:
    """What draws says in a sentence that it wants a wider screen."""

    def test_the_calibration_editor(self, phone: OpenPhone) -> None:
        page = phone("/review/1/calibration")
        expect(
            page.get_by_text("The calibration editor needs a wider screen or window.")
        ).to_be_visible()
        expect(page.locator(".editor__main, .editor__rail").first).to_be_hidden()
        assert fits(page) == {}
        page.get_by_role("link", name="Back to the review").tap()
        Screen(page).ready()

    def test_drawing_and_3d(self, phone: OpenPhone) -> None:
        screen = open_review(phone)
        page = screen.page
        expect(page.get_by_text("To draw or move points and balls")).to_be_visible()
        page.keyboard.press("n")
        expect(page.locator(".bar")).to_contain_text("Drawing needs a wider screen")
        expect(page.get_by_placeholder("Ball or marking")).to_have_count(0)
        page.keyboard.press("\\")
        expect(page.get_by_text("The 3D view needs a wider screen or window.")).to_be_visible()
        assert soon(page, TOO_WIDE) == []
        page.get_by_role("button", name="Images").locator("visible=true").tap()
        screen.ready()

    def test_a_computer_draws_in_a_window_at_200_per_cent(
        self, open_page: Callable[..., Page]
    ) -> None:
        page = open_page("/review/1", size={"width": 720, "height": 450})
        Screen(page).ready()
        page.keyboard.press("n")
        expect(page.get_by_placeholder("Ball or marking")).to_be_visible()

    def test_a_computer_is_told_to_make_its_window_larger(
        self, open_page: Callable[..., Page]
    ) -> None:
        page = open_page("/review/1", size={"width": 600, "height": 700})
        Screen(page).ready()
        page.keyboard.press("n")
        expect(page.locator(".bar")).to_contain_text("a larger window, or a smaller zoom")

    def test_they_are_silent_where_there_is_room(self, open_page: Callable[..., Page]) -> None:
        page = open_page("/review/1")
        Screen(page).ready()
        expect(page.locator(".small-note").first).to_be_hidden()


class TestNotifications:
    def test_open_under_a_finger(self, phone: OpenPhone, crew: Crew, console: Any) -> None:
        console.expect(REFUSED)
        page = phone("/groups", crew.address)
        log_in(page, "ada")
        bell = page.get_by_role("button", name="Notifications")
        bell.tap()
        panel = page.locator(".bell__panel")
        expect(panel.get_by_role("heading", name="Notifications")).to_be_visible()
        box = panel.bounding_box()
        assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= PHONE["width"]
        assert fits(page) == {}
