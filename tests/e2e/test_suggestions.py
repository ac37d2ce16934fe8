"""From what is wrong to the mend: the card, its key, what the picture shows, what is asked before."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from app.soccer.pitch import opposite_marking
from tests.e2e.screen import (
    Document,
    Screen,
    holding,
    rows,
    settled,
    submitted,
    undo_edit,
    until,
)

OpenPage = Callable[..., Page]
SMALL = {"width": 1100, "height": 700}


def said(group: Document) -> list[Any]:
    """What people said of a group's views."""
    return [[view[name] for name in ("lines", "balls", "included")] for view in group["views"]]


class Bench:
    """One group of the sample in which faults are planted; all is undone at the end."""

    def __init__(self, page: Page, group: int):
        self.page, self.group = page, group
        self.screen = Screen(page)
        self.before = said(self.document())

    def document(self) -> Document:
        """The group as the server has it."""
        found: Document = self.page.request.get(f"/api/v1/groups/{self.group}").json()
        return found

    def change(self, place: int, what: str, body: Any) -> Document:
        """Change a view behind the page's back."""
        state = self.document()
        answer = self.page.request.patch(
            f"/api/v1/views/{state['views'][place]['id']}{what}",
            data=body if body is not None else "null",
            headers={"If-Match": state["etag"], "Content-Type": "application/json"},
        )
        assert answer.ok, answer.text()
        changed: Document = answer.json()
        return changed

    def swap(self, place: int) -> Document:
        """Label a view from the other end of the pitch."""
        lines = self.document()["views"][place]["lines"]
        turned: Document = dict.fromkeys(lines)
        turned.update({opposite_marking(name): points for name, points in lines.items()})
        return self.change(place, "/lines", {"lines": turned})

    def open(self) -> Screen:
        """Show the group."""
        self.page.goto(f"/review/{self.group}")
        self.screen.ready()
        return self.screen

    @property
    def card(self) -> Locator:
        """The headline card."""
        return self.page.locator(".verdict-card")

    def undo_all(self) -> None:
        """As if nothing had been; what earlier tests said stays."""
        settled(self.page)
        while said(state := self.document()) != self.before and state["can_undo"]:
            undo_edit(self.page, self.group)


@pytest.fixture
def bench(open_page: OpenPage) -> Iterator[Callable[..., Bench]]:
    """A function that gives the passing group of so many views that comes at some place."""
    made: list[Bench] = []

    def make(views: int, size: dict[str, int] | None = None) -> Bench:
        page = open_page(None, size=size)
        good = [
            row
            for row in rows(page)
            if row["passes"] and not row["findings"] and row["views"] == views
        ]
        made.append(Bench(page, int(good[0]["id"])))
        return made[-1]

    yield make
    for one in made:
        one.undo_all()


class TestHeadline:
    def test_the_view_that_the_card_speaks_about_is_in_focus_though_the_group_came_late(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(2)
        one.swap(1)
        # What follows the first drawing of the page comes after the group.
        one.page.add_init_script(
            "{ const [frame, timer] = [requestAnimationFrame, setTimeout];"
            " const late = (go) => timer(go, Math.max(0, 4000 - performance.now()));"
            " window.requestAnimationFrame = (draw) => late(() => frame(draw));"
            " window.setTimeout = (go, wait, ...told) =>"
            " (wait >= 30 ? late(() => go(...told)) : timer(go, wait, ...told)); }"
        )
        with holding(one.page, f"**/groups/{one.group}") as groups:
            one.page.goto(f"/review/{one.group}")
            groups.arrive()
            expect(one.page.locator("main[aria-busy]")).to_have_count(1)
        expect(one.card.locator("h1")).to_have_text("Left and right are swapped in B")
        expect(one.page.locator('.image-panel[data-view="B"]')).to_have_attribute(
            "data-focused", "true"
        )

    def test_a_swapped_replay_is_named_and_mended_by_enter_in_that_view(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(2)
        before = one.document()["views"][1]["lines"]
        one.swap(1)
        screen = one.open()
        expect(one.card).to_have_attribute("data-tone", "bad")
        expect(one.card.locator("h1")).to_have_text("Left and right are swapped in B")
        expect(one.page.locator('.image-panel[data-view="B"]')).to_have_attribute(
            "data-focused", "true"
        )
        screen.press("Enter")
        screen.saved()
        expect(one.card).to_have_attribute("data-tone", "ok")
        assert one.document()["views"][1]["lines"] == before

    @pytest.mark.parametrize("size", [None, SMALL], ids=["1440x900", "1100x700"])
    def test_the_fix_is_reached_without_scrolling(
        self, bench: Callable[..., Bench], size: dict[str, int] | None
    ) -> None:
        one = bench(2, size)
        one.swap(1)
        one.open()
        button = one.card.get_by_role("button", name="Swap left and right")
        expect(button).to_be_in_viewport(ratio=1)

    def test_one_cause_is_red_once_and_what_the_card_says_is_not_said_again(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(2)
        lines = one.document()["views"][1]["lines"]
        one.change(1, "/lines", {"lines": dict.fromkeys(lines)})
        one.open()
        gates = one.page.locator(".gates li")
        expect(one.page.locator('.gates [data-gate="calibratable"]')).to_have_attribute(
            "data-state", "failed"
        )
        for name in ("two_views", "ball"):
            expect(one.page.locator(f'.gates [data-gate="{name}"]')).to_have_attribute(
                "data-state", "follows"
            )
        expect(gates.and_(one.page.locator('[data-state="failed"]'))).to_have_count(1)
        one.undo_all()
        one.swap(1)
        one.open()
        expect(one.card.locator("h1")).to_have_text("Left and right are swapped in B")
        sentence = one.card.locator(".verdict-card__text").inner_text()
        below = one.page.get_by_label("Findings", exact=True)
        assert sentence[:40] not in "".join(below.all_inner_texts())

    def test_a_failing_group_that_nothing_mends_suggests_the_reason_to_reject(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(2)
        x, y, width, height = one.document()["views"][1]["balls"][0]["box"]
        # Far beyond what a hand slips.
        one.change(
            1, "/ball", {"box": [x, max(y - 300, 1.0) if y > 320 else y + 300, width, height]}
        )
        screen = one.open()
        expect(one.card).to_contain_text("different instants")
        expect(one.card).to_contain_text("not the same instant")
        screen.press("x")
        suggested = one.page.locator('.reasons [data-suggested="true"]')
        expect(suggested).to_contain_text("Not the same instant")
        screen.press("Enter")
        one.page.wait_for_url(lambda url: f"/review/{one.group}" not in url)
        screen.saved()
        assert one.document()["verdict"]["reason"] == "not_same_instant"
        screen.press("Control+z")
        until(one.page, lambda: one.document()["verdict"]["reason"] is None)
        screen.saved()


class TestSwappingSides:
    def test_m_asks_for_the_view_that_the_finding_names(self, bench: Callable[..., Bench]) -> None:
        one = bench(2)
        lines = one.document()["views"][0]["lines"]
        one.swap(1)
        screen = one.open()
        screen.press("1", "m")
        ask = one.page.locator(".ask")
        expect(ask).to_contain_text("The finding is about view B, not A.")
        expect(ask).to_contain_text("main camera")
        screen.press("Enter")
        screen.saved()
        expect(one.card).to_have_attribute("data-tone", "ok")
        assert one.document()["views"][0]["lines"] == lines

    def test_a_main_camera_is_not_sent_across_the_pitch_by_one_key(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(2)
        screen = one.open()
        writes = submitted(one.page)
        screen.press("1", "m")
        expect(one.page.locator(".ask")).to_contain_text("main camera")
        screen.press("Escape")
        expect(one.page.locator(".ask")).to_have_count(0)
        assert writes == []

    def test_views_that_are_all_turned_agree_and_are_never_green(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(2)
        one.swap(0)
        state = one.swap(1)
        assert state["solution"]["passes"]
        screen = one.open()
        expect(one.card).to_have_attribute("data-tone", "warn")
        expect(one.card).to_contain_text("far side")
        screen.press("a")
        expect(one.page.locator(".ask")).to_contain_text("swapped")
        screen.press("Escape", "Enter")
        screen.saved()
        expect(one.card.locator("h1")).to_have_text("Left and right are swapped in B")
        screen.press("Enter")
        screen.saved()
        expect(one.card).to_have_attribute("data-tone", "ok")


class TestMissingBall:
    def test_it_is_shown_where_the_others_see_it_and_placed_by_a_key(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(3)
        before = one.document()["solution"]["ball"]["point"]
        x, y, width, height = one.document()["views"][2]["balls"][0]["box"]
        one.change(2, "/ball", None)
        screen = one.open()
        expect(one.card.locator("h1")).to_have_text("No ball is drawn in C")
        # The crop is filled from that place.
        expect(one.page.locator(".crop").nth(2)).not_to_contain_text("no ball")
        screen.press("3", "z")
        expect(one.page.locator('.image-panel[data-view="C"]')).to_be_visible()
        screen.press("y")
        screen.saved()
        state = one.document()
        (ball,) = state["views"][2]["balls"]
        assert ball["inferred"]
        assert abs(ball["box"][0] + ball["box"][2] / 2 - x - width / 2) < 12
        assert abs(ball["box"][1] + ball["box"][3] / 2 - y - height / 2) < 12
        # It confirms nothing: the ball stays that of the other two.
        assert not state["solution"]["views"][2]["included"]
        assert state["solution"]["ball"]["views"] == [view["key"] for view in state["views"][:2]]
        assert state["solution"]["ball"]["point"] != before
        expect(one.page.locator('.image-panel[data-view="C"] .caption')).to_contain_text(
            "not counted"
        )
        # Moved by a person it is a sight of its own.
        screen.press("ArrowRight")
        expect(one.page.locator('.image-panel[data-view="C"] .caption')).not_to_contain_text(
            "not counted"
        )
        screen.saved()
        assert one.document()["solution"]["views"][2]["included"]

    def test_in_two_views_the_ray_says_where_to_draw_it(self, bench: Callable[..., Bench]) -> None:
        one = bench(2)
        x, y, width, height = one.document()["views"][1]["balls"][0]["box"]
        one.change(1, "/ball", None)
        screen = one.open()
        expect(one.card).to_contain_text("ray of another view")
        screen.press("Enter")
        screen.drawn()
        screen.press("0")
        screen.drawn()
        view = one.document()["views"][1]
        one.page.mouse.click(*screen.place(view, x + width / 2, y + height / 2))
        screen.saved()
        assert len(one.document()["views"][1]["balls"]) == 1
        expect(one.card).not_to_have_attribute("data-tone", "bad")

    def test_a_second_enter_draws_no_ball_where_nobody_pointed(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(2)
        one.change(1, "/ball", None)
        screen = one.open()
        screen.press("Enter")
        panel = one.page.locator('.image-panel[data-view="B"]')
        expect(panel.locator(".drawing-chip")).to_contain_text("Click where the ball is")
        screen.press("Enter", "Enter")
        expect(one.page.locator(".save")).to_contain_text("No changes")
        assert one.document()["views"][1]["balls"] == []
        expect(panel.locator('.drawing-cross[data-moved="false"]')).to_be_visible()
        screen.press("Shift+ArrowLeft", "ArrowUp", "Enter")
        screen.saved()
        assert len(one.document()["views"][1]["balls"]) == 1

    def test_saying_that_a_ball_is_not_visible_takes_one_key(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(3)
        one.change(2, "/ball", None)
        screen = one.open()
        expect(one.card).to_contain_text("press O")
        screen.press("o")
        screen.saved()
        assert one.document()["views"][2]["balls"][0]["out_of_view"]


class TestUndrawnLine:
    def test_draw_it_leads_to_the_line_with_the_marking_chosen(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(2)
        view = one.document()["views"][1]
        fits = one.document()["solution"]["views"][1]["calibration"]["markings"]

        def length(fit: Document) -> float:
            points = fit["polyline"]
            return float(
                sum(((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2) ** 0.5 for a, b in pairwise(points))
            )

        drawn = [fit for fit in fits if fit["marking"] in view["lines"]]
        missing = sorted(drawn, key=length)[-2]["marking"]
        one.change(1, "/lines", {"lines": {missing: None}})
        screen = one.open()
        page = one.page
        fix = page.locator(".suggestion .button--fix")
        for _ in range(6):
            if fix.inner_text().startswith("Draw it"):
                break
            screen.press("Shift+Enter")
            screen.drawn()
        expect(one.card).to_contain_text(missing)
        screen.press("Enter")
        expect(page.locator('.image-panel[data-view="B"] .drawing-chip')).to_contain_text(missing)
        # The card leads to the drawing, and does not offer it once more.
        expect(one.card).to_contain_text("You are drawing")
        expect(page.locator(".suggestion .button--fix")).to_have_count(0)
        # Nobody has looked yet: Enter alone draws nothing.
        screen.press("Enter")
        assert missing not in one.document()["views"][1]["lines"]
        screen.press("ArrowRight", "Enter")
        screen.press("ArrowLeft", "Enter")
        screen.press("Escape")
        screen.saved()
        assert len(one.document()["views"][1]["lines"][missing]) == 2


class TestStates:
    def test_no_state_contradicts_another(self, bench: Callable[..., Bench]) -> None:
        one = bench(2)
        state = one.change(1, "", {"included": False})
        gates = {gate["name"]: gate["sentence"] for gate in state["solution"]["gates"]}
        assert "left out by a person" in gates["two_views"]
        one.open()
        expect(one.card.locator("h1")).to_have_text("Fewer than two views are usable")
        expect(one.card).to_contain_text("left out by a person")
        expect(one.card.get_by_role("button", name="Include it again")).to_be_visible()
        one.screen.press("Enter")
        one.screen.saved()
        expect(one.card).to_have_attribute("data-tone", "ok")

    def test_where_nothing_is_to_mend_enter_leads_to_the_objects(
        self, bench: Callable[..., Bench]
    ) -> None:
        one = bench(2)
        screen = one.open()
        expect(one.card).to_have_attribute("data-tone", "ok")
        screen.press("Enter")
        expect(one.page.locator(".object-list")).to_be_visible()


class TestDismissing:
    def test_a_finding_that_was_checked_flags_nothing_until_it_is_opened_again(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/review/1")
        asked = "/api/v1/groups?dataset=sample&q=finding:any passes:yes status:unreviewed"
        rows = page.request.get(asked).json()["items"]
        one = next(row for row in rows if len(row["findings"]) == 1)
        group = f"/api/v1/groups/{one['id']}"
        page.goto(f"/review/{one['id']}?q=id:{one['id']}")
        screen = Screen(page)
        screen.ready()
        card = page.locator(".verdict-card")
        expect(card).to_have_attribute("data-tone", "warn")
        many = len(page.request.get(group).json()["solution"]["findings"])
        struck = page.locator(".finding[data-dismissed='true']")
        for count in range(1, many + 1):
            page.keyboard.press("Shift+s")
            expect(struck).to_have_count(count)
        screen.saved()
        expect(struck.first).to_contain_text("Dismissed")
        row = page.request.get(f"/api/v1/groups?dataset=sample&q=id:{one['id']}").json()["items"][0]
        assert (row["findings"], row["dismissed"]) == ([], one["findings"])
        # Undone like a verdict, also from a page that is new; and by its button.
        page.reload()
        screen.ready()
        for count in range(many, 0, -1):
            expect(struck).to_have_count(count)
            page.keyboard.press("Control+z")
        expect(struck).to_have_count(0)
        expect(card).to_have_attribute("data-tone", "warn")
        page.keyboard.press("Control+Shift+z")
        expect(struck).to_have_count(1)
        struck.get_by_role("button", name="Reopen").click()
        expect(struck).to_have_count(0)
        screen.saved()
