"""The queue as a tool: completion, sorting, saved views, verdicts for everything that matches."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit

import pytest
from playwright.sync_api import Locator, Page, Request, Route, expect

from tests.e2e.screen import (
    at_rest,
    hears,
    holding,
    judge,
    on_present,
    rows,
    undo_edit,
    until,
    withdraw_verdict,
)
from tests.e2e.season import SEASON
from tests.e2e.test_access import serious

OpenPage = Callable[..., Page]
ROW_HEIGHT = 72
MILLION = 1_000_000
TYPE_WHILE_VALUES_ARRIVE = """async () => {
  const { facets } = await import(
    document.querySelector('script[src$="main.js"]').src.replace('main.js', 'state/facets.js'));
  const type = (text) => {
    const field = document.querySelector('.field--query');
    field.value = text;
    field.dispatchEvent(new InputEvent('input', { bubbles: true }));
  };
  type('number<=9 s');
  facets.value = { ...facets.value };
  type('number<=9 sp');
  // It is drawn, and what follows a drawing is still to come.
  await new Promise(requestAnimationFrame);
  type('number<=9 spl');
}"""


CHOOSE_VERDICT = """async (verb) => {
  [...document.querySelectorAll('.choice label')].find((one) => one.textContent.startsWith(verb)).click();
  // It is drawn, and what follows a drawing is still to come.
  for (let turn = 0; turn < 5; turn += 1) await undefined;
  const button = document.querySelector('dialog[open] .button--primary');
  return [button.textContent, button.getAttribute('aria-disabled')];
}"""


CHOOSE_WHILE_VALUES_ARRIVE = """async () => {
  const { facets } = await import(
    document.querySelector('script[src$="main.js"]').src.replace('main.js', 'state/facets.js'));
  const field = document.querySelector('.field--query');
  facets.value = { ...facets.value };
  // It is drawn, and what follows a drawing is still to come.
  for (let turn = 0; turn < 5; turn += 1) await undefined;
  field.dispatchEvent(new KeyboardEvent('keydown', { key: 'Enter', bubbles: true }));
}"""


def opened(open_page: OpenPage, query: str = "") -> Page:
    """The queue with its rows there."""
    page = open_page(f"/groups?q={query}")
    page.wait_for_selector(".queue-row a")
    return page


def verdict(page: Page, number: int) -> Locator:
    """The pill that says what people decided; others say that there is no picture."""
    return row(page, number).locator('.pill:not([data-status="no-picture"])')


def statuses(page: Page) -> list[str]:
    """What the pills of the rows say."""
    return [text.split()[-1] for text in page.locator(".queue-row .pill").all_text_contents()]


# The row is opened at the end of the pause after typing, and the pause ends before the next page is painted.
HOLD_THE_PAUSE = """() => {
  const [set, clear] = [setTimeout, clearTimeout];
  window.setTimeout = (run, pause, ...rest) => {
    if (pause !== 250) return set(run, pause, ...rest);
    window.typed = run;
    return -1;
  };
  window.clearTimeout = (timer) => { if (timer === -1) window.typed = null; else clear(timer); };
}"""
OPEN_AS_IT_ENDS = """async () => {
  document.querySelector('.queue-row[data-active=true]').focus();
  document.activeElement.dispatchEvent(new KeyboardEvent('keydown', { key: 'Enter', bubbles: true }));
  for (let turn = 0; turn < 20; turn += 1) await null;
  window.typed?.();
}"""


class TestQueryBox:
    def test_a_query_that_was_just_typed_leads_nobody_back_from_a_group(
        self, open_page: OpenPage
    ) -> None:
        page = opened(open_page)
        expect(page.locator(".queue-row[data-active=true]")).to_be_visible()
        page.evaluate(HOLD_THE_PAUSE)
        page.locator(".field--query").press_sequentially("sort:jac")
        page.wait_for_function("Boolean(window.typed)")
        page.evaluate(OPEN_AS_IT_ENDS)
        page.wait_for_url("**/review/*")
        page.wait_for_selector('.image-panel__stage[data-ready="true"]')
        assert "/review/" in page.url

    def test_completion_fills_in_a_field_and_its_value(self, open_page: OpenPage) -> None:
        page = opened(open_page)
        page.keyboard.press("/")
        expect(page.locator(".field--query")).to_be_focused()
        page.keyboard.type("number<=9 spl")
        expect(page.get_by_role("option", name="split:")).to_be_visible()
        page.keyboard.press("ArrowDown")
        expect(page.locator('[role="option"][aria-selected="true"]')).to_contain_text("split:")
        page.keyboard.press("Enter")
        expect(page.get_by_role("option", name="train", exact=True)).to_be_visible()
        page.get_by_role("option", name="train", exact=True).click()
        expect(page.locator(".field--query")).to_have_value("number<=9 split:train ")
        page.wait_for_url("**split**")

    def test_completion_replaces_the_word_however_fast_it_is_typed(
        self, open_page: OpenPage
    ) -> None:
        page = opened(open_page)
        page.keyboard.press("/")
        box = page.locator(".field--query")
        expect(box).to_be_focused()
        page.evaluate(TYPE_WHILE_VALUES_ARRIVE)
        expect(page.get_by_role("option", name="split:")).to_be_visible()
        page.keyboard.press("ArrowDown")
        page.keyboard.press("Enter")
        expect(box).to_have_value("number<=9 split:")

    def test_values_follow_a_field_that_is_chosen_while_they_arrive(
        self, open_page: OpenPage
    ) -> None:
        page = opened(open_page)
        page.keyboard.press("/")
        page.keyboard.type("number<=9 spl")
        expect(page.get_by_role("option", name="split:")).to_be_visible()
        page.keyboard.press("ArrowDown")
        expect(page.locator('[role="option"][aria-selected="true"]')).to_contain_text("split:")
        page.evaluate(CHOOSE_WHILE_VALUES_ARRIVE)
        expect(page.locator(".field--query")).to_have_value("number<=9 split:")
        expect(page.get_by_role("option", name="train", exact=True)).to_be_visible()

    def test_a_status_button_filters_and_a_header_sorts(self, open_page: OpenPage) -> None:
        page = opened(open_page)
        rejected = page.get_by_role("button", name="rejected")
        expect(page.locator(".histogram svg").first).to_be_visible()
        place = at_rest(rejected)
        rejected.click()
        expect(page.locator(".field--query")).to_have_value("status:rejected")
        expect(page.locator(".save")).to_contain_text("0 of 14 match")
        # Whoever clicks once more hits it again.
        assert at_rest(rejected) == place
        rejected.click()
        expect(page.locator(".field--query")).to_have_value("")
        page.get_by_role("button", name="margin").click()
        head = page.get_by_role("columnheader", name="margin")
        expect(head).to_have_attribute("aria-sort", "ascending")
        page.get_by_role("button", name="margin").click()
        expect(head).to_have_attribute("aria-sort", "descending")
        expect(page.locator(".save")).to_contain_text("14 of 14 match")

    @pytest.mark.parametrize("control", ["filter", "column"])
    def test_enter_opens_a_group_after_a_control_was_clicked(
        self, open_page: OpenPage, control: str
    ) -> None:
        page = opened(open_page)
        if control == "filter":
            page.get_by_role("button", name="unreviewed").click()
            expect(page.locator(".field--query")).to_have_value("status:unreviewed")
        else:
            page.get_by_role("button", name="margin").click()
            expect(page.locator(".field--query")).to_have_value("sort:margin")
        expect(page.locator(".save")).to_contain_text("match")
        page.keyboard.press("Enter")
        page.wait_for_url("**/review/**")

    def test_a_filter_that_the_keyboard_turned_on_keeps_the_focus(
        self, open_page: OpenPage
    ) -> None:
        page = opened(open_page)
        button = page.get_by_role("button", name="unreviewed")
        page.keyboard.press("Tab")
        button.focus()
        page.keyboard.press("Enter")
        expect(page.locator(".field--query")).to_have_value("status:unreviewed")
        expect(button).to_be_focused()

    def test_the_ends_of_a_histogram_move_by_keyboard(self, open_page: OpenPage) -> None:
        page = opened(open_page)
        slider = page.get_by_role("slider", name="min JaC 0.5 % from")
        slider.focus()
        slider.press("ArrowRight")
        expect(page.locator(".field--query")).to_have_value("jac>=0.05 jac<=1")


class TestLowWindow:
    def test_scrolls_to_its_rows_and_shows_three_at_once(self, open_page: OpenPage) -> None:
        page = open_page("/groups?dataset=sample", size={"width": 720, "height": 450})
        expect(page.get_by_role("region", name="First steps")).to_be_visible()
        row = page.locator(".queue-row:not(.queue-row--head)")
        row.nth(2).wait_for()
        page.mouse.move(360, 80)
        page.mouse.wheel(0, 2000)
        for place in range(3):
            expect(row.nth(place)).to_be_in_viewport(ratio=1)

    def test_the_parts_above_its_rows_stand_below_each_other(self, open_page: OpenPage) -> None:
        page = open_page("/groups?dataset=sample", size={"width": 720, "height": 450})
        expect(page.get_by_role("region", name="First steps")).to_be_visible()
        parts = [page.locator(f".queue > {part}") for part in (".header", ".bars", ".queue__main")]
        boxes = [box for part in parts if (box := part.bounding_box())]
        assert len(boxes) == 3
        for above, below in pairwise(boxes):
            assert above["y"] + above["height"] <= below["y"] + 0.5
        field = page.locator(".field--query").bounding_box()
        assert field
        assert field["y"] + field["height"] <= boxes[1]["y"] + 0.5

    def test_the_active_row_stays_in_sight_of_keys(self, open_page: OpenPage) -> None:
        page = open_page("/groups?dataset=sample", size={"width": 720, "height": 450})
        active = page.locator(".queue-row[data-active=true]")
        active.wait_for()
        for key in ("ArrowDown", "ArrowDown", "End", "ArrowUp"):
            page.keyboard.press(key)
            expect(active).to_be_focused()
            expect(active).to_be_in_viewport(ratio=0.9)


class TestVerdicts:
    def test_a_rejected_group_says_why(self, open_page: OpenPage) -> None:
        page = opened(open_page, "number<=1")
        found = page.request.get("/api/v1/groups?dataset=sample&q=number<=1").json()
        group = found["items"][0]["id"]
        try:
            judge(page, group, "rejected", "not_same_instant")
            page.reload()
            expect(page.locator(".queue-cell__by").first).to_have_text("not the same instant")
        finally:
            withdraw_verdict(page, group)

    def test_the_group_edited_last_comes_first_in_that_order(self, open_page: OpenPage) -> None:
        page = opened(open_page)
        found = page.request.get("/api/v1/groups?dataset=sample&q=number=7").json()["items"][0]
        group = page.request.get(f"/api/v1/groups/{found['id']}").json()
        view = group["views"][0]["id"]
        leave_out = {"included": False}
        on_present(
            page,
            group["id"],
            lambda tag: page.request.patch(f"/api/v1/views/{view}", data=leave_out, headers=tag),
        )
        try:
            page.get_by_label("Order", exact=True).select_option("Newest change first")
            expect(row(page, 1)).to_contain_text(found["label"])
        finally:
            undo_edit(page, group["id"])


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
        expect(page.locator(".bar")).to_contain_text("3 verdicts are undone")
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(0)
        until(page, lambda: statuses(page) == before)

    def test_it_says_which_verdicts_are_replaced_and_which_groups_stay_as_they_are(
        self, open_page: OpenPage
    ) -> None:
        page = opened(open_page, "number<=3")
        before = statuses(page)
        first, second = (group["id"] for group in rows(page) if group["number"] in (1, 2))
        judge(page, first, "rejected", "not_same_instant")
        judge(page, second, "deferred")
        page.keyboard.press("b")
        outcome = page.locator(".bulk__outcome")
        page.get_by_label("Defer").check()
        expect(outcome).to_contain_text("2 of 3 groups change")
        expect(outcome).to_contain_text("1 is rejected now; its verdict is replaced.")
        expect(outcome).to_contain_text("1 group has this verdict already.")
        page.get_by_label("Withdraw").check()
        expect(outcome).to_contain_text("1 is deferred now; its verdict is removed.")
        expect(outcome).to_contain_text("1 group has no verdict.")
        page.keyboard.press("Escape")
        for group in (first, second):
            withdraw_verdict(page, group)
        until(page, lambda: statuses(page) == before)

    def test_the_bar_says_why_groups_were_left_alone(self, open_page: OpenPage) -> None:
        page = open_page(None)
        fails = next(group for group in rows(page) if group["passes"] is False)
        good = next(group for group in rows(page) if group["passes"] and not group["findings"])
        page = opened(open_page, f"id:{fails['id']},{good['id']}")
        before = statuses(page)
        page.keyboard.press("b")
        why = "it fails a gate, and accepting that needs a note"
        expect(page.locator(".bulk__refused")).to_have_text(f"1 group not changed: {why}")
        page.get_by_role("button", name="Accept 1 group").click()
        expect(page.locator(".bar")).to_contain_text(f"1 group accepted. 1 is unchanged: {why}.")
        page.locator(".bar").get_by_role("button", name="Undo").click()
        until(page, lambda: statuses(page) == before)

    def test_another_number_is_counted_again_and_can_be_decided(
        self, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("a status of 409")
        page = opened(open_page, "number<=3")
        before = statuses(page)
        opener = page.locator(".queue-tools > [data-needs=review]")
        opener.focus()
        page.keyboard.press("b")
        page.get_by_label("Defer").check()
        decide = page.get_by_role("button", name="Defer 3 groups")
        expect(decide).to_be_enabled()
        (first,) = (group for group in rows(page) if group["number"] == 1)
        judge(page, first["id"], "deferred")
        decide.click()
        expect(page.locator(".bulk__outcome")).to_contain_text("would change, not 3")
        page.get_by_role("button", name="Defer 2 groups").click()
        expect(page.locator(".bar")).to_contain_text("2 groups deferred")
        expect(opener).to_be_focused()
        page.locator(".bar").get_by_role("button", name="Undo").click()
        expect(page.locator(".bar")).to_contain_text("2 verdicts are undone")
        withdraw_verdict(page, first["id"])
        until(page, lambda: statuses(page) == before)

    def test_what_is_below_the_answer_stays_where_it_is_when_it_comes(
        self, open_page: OpenPage
    ) -> None:
        page = opened(open_page)
        with holding(page, "**/verdicts*") as verdicts:
            page.keyboard.press("b")
            verdicts.arrive()
            decide = page.locator("dialog[open] .dialog__buttons [type=submit]")
            expect(page.locator(".bulk__outcome")).to_have_text("Counting…")
            before = at_rest(decide)
        expect(page.locator(".bulk__sample li")).to_have_count(5)
        after = at_rest(decide)
        assert (after["y"], after["x"] + after["width"]) == (
            before["y"],
            before["x"] + before["width"],
        )


class TestWhatOthersDo:
    def test_a_key_pressed_while_rows_are_read_again_is_not_lost(self, open_page: OpenPage) -> None:
        page = opened(open_page)
        hears(page)
        active = page.locator('.queue-row[data-active="true"]')
        with holding(page, "**/api/v1/groups?*") as rows:
            judge(page, 5, "deferred")
            try:
                rows.arrive()
                page.keyboard.press("ArrowDown")
                expect(active).to_have_attribute("aria-rowindex", "3")
                rows.release()
                expect(verdict(page, 5)).to_have_attribute("data-status", "deferred")
                expect(active).to_have_attribute("aria-rowindex", "3")
            finally:
                withdraw_verdict(page, 5)


def pages_asked(page: Page) -> list[str]:
    """Addresses of the pages of rows that are asked for from now on."""
    asked: list[str] = []

    def hear(request: Request) -> None:
        if "/groups?" in request.url:
            asked.append(request.url)

    page.on("request", hear)
    return asked


def row(page: Page, number: int) -> Locator:
    """The row of a group in the order of the dataset."""
    return page.locator(f'.queue-row[aria-rowindex="{number + 1}"]')


def of_a_million(route: Route) -> None:
    """The rows of the season again and again, under numbers up to a million."""
    asked = urlsplit(route.request.url)
    query = dict(parse_qsl(asked.query))
    start = int(query["from"])
    query["from"] = str(start % 1000)
    found = route.fetch(url=asked._replace(query=urlencode(query)).geturl()).json()
    for place, item in enumerate(found["items"]):
        item["number"] = item["id"] = start + place + 1
    route.fulfill(json={**found, "total": MILLION})


def top_of(element: Locator) -> float:
    """Where an element begins, px below the top of the window."""
    return at_rest(element)["y"]


@pytest.fixture
def long_list(open_page: OpenPage, season: str) -> Page:
    """The queue of a season."""
    page = open_page(None)
    page.goto(f"{season}/groups")
    expect(row(page, 1).get_by_role("link", name="1", exact=True)).to_be_visible()
    # Nothing of the beginning comes later and is taken for an answer to what a test does.
    hears(page)
    return page


class TestFarJumps:
    def test_the_end_of_a_season_is_one_page_away(self, long_list: Page) -> None:
        height = long_list.locator(".queue-table__space").bounding_box()
        assert height is not None
        assert height["height"] == SEASON * ROW_HEIGHT
        asked = pages_asked(long_list)
        long_list.keyboard.press("End")
        last = row(long_list, SEASON)
        expect(last.get_by_role("link")).to_have_text(str(SEASON))
        expect(last).to_be_focused()
        assert len(asked) <= 2, asked
        long_list.keyboard.press("Home")
        expect(row(long_list, 1)).to_be_focused()
        assert len(asked) <= 2, asked

    def test_what_is_scrolled_past_is_not_read(self, long_list: Page) -> None:
        asked = pages_asked(long_list)
        # As the scroll bar does it: through the whole list in steps of a hundred and fifty rows.
        lingered = long_list.locator(".queue-table__rows").evaluate(
            """async (rows, height) => {
                let lingered = 0;
                for (let row = 0; row <= 1900; row += 50) {
                    const began = performance.now();
                    rows.scrollTop = row * height;
                    await new Promise(requestAnimationFrame);
                    lingered += performance.now() - began > 60;
                }
                return lingered;
            }""",
            ROW_HEIGHT,
        )
        expect(row(long_list, 1905).get_by_role("link")).to_have_text("1905")
        # Where a busy machine stood still the page rightly took it for a look.
        assert len(asked) < SEASON / 100 / 2 + 2 * lingered, asked

    def test_paging_on_shows_every_row_in_its_place(self, long_list: Page) -> None:
        for _ in range(30):
            long_list.keyboard.press("PageDown")
        expect(row(long_list, 301)).to_have_attribute("data-active", "true")
        expect(row(long_list, 301).get_by_role("link")).to_have_text("301")
        # Of its 36 pixels a fraction of one may be cut: the head above has no whole height.
        expect(row(long_list, 301)).to_be_in_viewport(ratio=0.99)

    def test_every_row_of_a_million_is_reached(self, long_list: Page) -> None:
        long_list.route("**/api/v1/groups?*", of_a_million)
        long_list.reload()
        rows = long_list.locator(".queue-table__rows")
        expect(row(long_list, 1).get_by_role("link")).to_have_text("1")
        rows.focus()
        long_list.keyboard.press("End")
        expect(row(long_list, MILLION)).to_be_focused()
        expect(row(long_list, MILLION).get_by_role("link")).to_have_text(str(MILLION))
        long_list.keyboard.press("PageUp")
        expect(row(long_list, MILLION - 10)).to_be_focused()
        rows.evaluate("(rows) => { rows.scrollTop = (rows.scrollHeight - rows.clientHeight) / 2; }")
        expect(row(long_list, MILLION // 2)).to_be_visible()
        before = top_of(row(long_list, MILLION // 2))
        rows.hover()
        long_list.mouse.wheel(0, 36)
        until(long_list, lambda: top_of(row(long_list, MILLION // 2)) == before - 36)
        long_list.reload()
        expect(row(long_list, MILLION // 2)).to_be_in_viewport()

    def test_the_place_survives_a_reload_and_a_visit_to_a_group(self, long_list: Page) -> None:
        page = long_list
        page.goto(page.url + "?q=sort:number-desc")
        expect(row(page, 1).get_by_role("link")).to_have_text(str(SEASON))
        page.locator(".queue-table__rows").evaluate(
            "(rows, top) => { rows.scrollTop = top; }", 700 * ROW_HEIGHT
        )
        expect(row(page, 705).get_by_role("link")).to_have_text(str(SEASON - 704))
        page.reload()
        expect(row(page, 705).get_by_role("link")).to_have_text(str(SEASON - 704))
        expect(row(page, 705)).to_be_in_viewport(ratio=1)
        verdict(page, 707).click()
        page.wait_for_url("**/review/*")
        expect(page.locator(".header__place")).to_contain_text(f"707 of {SEASON:,}")
        page.reload()
        expect(page.locator(".header__place")).to_contain_text(f"707 of {SEASON:,}")
        page.keyboard.press("d")
        expect(page.locator(".header__place")).to_contain_text(f"706 of {SEASON:,}")
        page.get_by_role("link", name="Queue", exact=True).click()
        expect(row(page, 706)).to_have_attribute("data-active", "true")
        expect(row(page, 706)).to_be_in_viewport(ratio=1)


def ticked(page: Page) -> Locator:
    """What the tools say about ticks."""
    return page.locator(".ticked")


class TestTicks:
    def test_rows_are_ticked_by_keyboard_decided_and_taken_back_after_a_reload(
        self, open_page: OpenPage
    ) -> None:
        page = opened(open_page, "number<=6")
        before = statuses(page)
        page.keyboard.press("ArrowDown")
        page.keyboard.press("Space")
        expect(ticked(page)).to_have_text("1 ticked")
        for key in ("Shift+ArrowDown", "Shift+ArrowDown", "Shift+ArrowUp"):
            page.keyboard.press(key)
        expect(ticked(page)).to_have_text("2 ticked")
        assert serious(page) == []
        page.keyboard.press("b")
        expect(page.get_by_label("2 ticked")).to_be_checked()
        page.get_by_label("Defer").check()
        expect(page.locator(".bulk__outcome")).to_contain_text("2 of 2 groups change")
        assert serious(page) == []
        page.get_by_role("button", name="Defer 2 groups").click()
        expect(page.locator(".bar")).to_contain_text("2 groups deferred")
        expect(ticked(page)).to_have_text("")
        for number in (2, 3):
            expect(verdict(page, number)).to_have_attribute("data-status", "deferred")
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(2)
        page.reload()
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(2)
        page.keyboard.press("Control+z")
        expect(page.locator(".bar")).to_contain_text("2 verdicts are undone")
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(0)
        until(page, lambda: statuses(page) == before)

    def test_a_verdict_cannot_be_given_with_the_count_of_another_one(
        self, open_page: OpenPage
    ) -> None:
        page = opened(open_page, "number<=2")
        page.keyboard.press("b")
        expect(page.locator(".bulk__outcome")).to_contain_text("of 2 groups")
        with holding(page, re.compile(r"/verdicts\?dry_run")):
            # As soon as it is drawn, before anything is asked.
            words, disabled = page.evaluate(CHOOSE_VERDICT, "Defer")
            assert (words.split()[0], disabled) == ("Defer", "true")
        expect(page.get_by_role("button", name="Defer 2 groups")).to_be_enabled()

    def test_a_click_with_shift_ticks_all_in_between_and_another_query_nothing(
        self, long_list: Page
    ) -> None:
        page = long_list
        row(page, 2).get_by_role("checkbox").click()
        page.keyboard.press("End")
        last = row(page, SEASON).get_by_role("checkbox", name=f"Tick group {SEASON}")
        last.click(modifiers=["Shift"])
        expect(ticked(page)).to_have_text(f"{SEASON - 1:,} ticked")
        expect(last).to_be_checked()
        page.get_by_role("button", name="Group", exact=False).first.click()
        expect(row(page, 1).get_by_role("checkbox")).to_be_checked()
        expect(ticked(page)).to_have_text(f"{SEASON - 1:,} ticked")
        page.get_by_role("button", name="Clear the ticks").click()
        expect(ticked(page)).to_have_text("")
        row(page, 1).get_by_role("checkbox").click()
        page.get_by_role("button", name="failing", exact=True).click()
        expect(page.locator(".field--query")).to_have_value("sort:number-desc passes:no")
        expect(ticked(page)).to_have_text("")

    def test_all_that_match_but_one_are_decided_in_one_go(self, long_list: Page) -> None:
        page = long_list
        everything = page.get_by_role("checkbox", name="Tick all groups that match")
        everything.click()
        expect(ticked(page)).to_have_text(f"{SEASON:,} ticked")
        row(page, 3).get_by_role("checkbox").click()
        expect(ticked(page)).to_have_text(f"{SEASON - 1:,} ticked")
        until(page, lambda: everything.evaluate("(box) => box.indeterminate"))
        page.get_by_role("button", name=f"Verdict on {SEASON - 1:,} ticked").click()
        page.get_by_label("Defer").check()
        page.get_by_role("button", name=f"Defer {SEASON - 1:,} groups").click()
        expect(page.locator(".bar")).to_contain_text(f"{SEASON - 1:,} groups deferred")
        expect(verdict(page, 2)).to_have_attribute("data-status", "deferred")
        expect(verdict(page, 3)).not_to_have_attribute("data-status", "deferred")
        page.get_by_role("button", name="Reviewers").click()
        entry = page.locator(".batches li").filter(has_text=f"{SEASON - 1:,} groups deferred")
        entry.get_by_role("button", name="Undo").click()
        expect(entry).to_contain_text("undone by local")
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(0)


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
        hears(page)
        hears(other)
        other.keyboard.press("b")
        other.get_by_label("Defer").check()
        other.get_by_role("button", name="Defer 2 groups").click()
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(2)
        other.locator(".bar").get_by_role("button", name="Undo").click()
        expect(page.locator(".pill[data-status=deferred]")).to_have_count(0)
