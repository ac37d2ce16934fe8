"""The calibration editor: lines staged, previewed, saved as one edit, and taken back."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from app.soccer.pitch import MARKINGS
from tests.e2e.conftest import Console
from tests.e2e.screen import (
    at_rest,
    hears,
    holding,
    jobs_end,
    on_present,
    passing,
    rows,
    settled,
    submitted,
    until,
)
from tests.e2e.test_access import CUT_OFF, NESTED_SCROLLERS, SIZES, serious, serious_in_both, soon

OpenPage = Callable[..., Page]
Document = dict[str, Any]


class Editor:
    """The editor of one view of a passing group, with what the server has."""

    def __init__(self, page: Page, address: str, group: int, place: int):
        self.page, self.address, self.group = page, address, group
        self.key = self.document()["views"][place]["key"]
        page.goto(f"{address}/review/{group}/calibration?view={self.key}")
        page.wait_for_selector(".editor__panel canvas")
        expect(page.locator(".line-table tbody tr[data-marking]").first).to_be_visible()

    def document(self) -> Document:
        """The group as the server has it."""
        answer = self.page.request.get(f"{self.address}/api/v1/groups/{self.group}")
        assert answer.ok
        document: Document = answer.json()
        return document

    @property
    def view(self) -> Document:
        """The view as the server has it."""
        views: list[Document] = self.document()["views"]
        return next(view for view in views if view["key"] == self.key)

    @property
    def lines(self) -> Document:
        """Its lines as the server has them."""
        lines: Document = self.view["lines"]
        return lines

    def press(self, *keys: str) -> None:
        """Press keys one after the other."""
        for key in keys:
            self.page.keyboard.press(key)

    def choose(self, marking: str) -> None:
        """Choose a marking in the diagram, by keyboard as others do by pointer."""
        self.page.locator(f'.diagram__marking[data-marking="{marking}"]').focus()
        self.page.keyboard.press("Enter")
        expect(self.page.locator(".marking-card h2")).to_have_text(marking)

    def drawn(self) -> dict[str, int]:
        """Markings of the table and how many points each has."""
        rows = self.page.locator(".line-table tbody tr[data-marking]")
        found: dict[str, int] = rows.evaluate_all(
            "rows => Object.fromEntries(rows.map((row) => [row.dataset.marking,"
            " parseInt(row.cells[2].textContent, 10)]))"
        )
        return {marking: count for marking, count in found.items() if count}

    def staged(self, count: int) -> None:
        """Wait until that many markings are staged."""
        text = "Nothing is staged." if count == 0 else f"{count} marking"
        expect(self.page.locator(".commit__state")).to_contain_text(text)

    def previewed(self) -> None:
        """Wait until the numbers on screen belong to the lines on screen."""
        expect(self.page.locator('section[aria-label="Before and after"]')).to_have_attribute(
            "aria-busy", "false"
        )

    def compared(self, name: str) -> tuple[str, str, str]:
        """Before, after, and which of the two is better."""
        row = self.page.locator(f'[data-compared="{name}"]')
        before, after = row.locator("td").all_inner_texts()[:2]
        return before, after, row.get_attribute("data-change") or ""

    def save_a_moved_line(self) -> None:
        """Move a point of the longest line and save it; the answer is not waited for."""
        self.choose(longest(self.lines))
        self.press(".", "Shift+ArrowDown")
        self.staged(1)
        self.press("Control+s")

    def saved(self) -> None:
        """Wait until the last write was answered."""
        expect(self.page.locator('.save[data-unsaved="0"]')).to_contain_text("Saved")

    def to_screen(self, x: float, y: float) -> tuple[float, float]:
        """Where an image point stands in the window, while the image is shown whole."""
        box = at_rest(self.page.locator(".editor__panel .image-panel__stage"))
        view = self.view
        scale = min(box["width"] / view["width"], box["height"] / view["height"])
        left = box["x"] + (box["width"] - view["width"] * scale) / 2
        top = box["y"] + (box["height"] - view["height"] * scale) / 2
        return left + (x + 0.5) * scale, top + (y + 0.5) * scale


@pytest.fixture
def editor(open_page: OpenPage, server: str) -> Iterator[Editor]:
    """The editor of a broadcast view; its lines are put back afterwards."""
    page = open_page(None)
    opened = Editor(page, server, passing(page, 0), 0)
    before = opened.lines
    yield opened
    settled(page)
    now = opened.lines
    if now != before:
        gone: dict[str, Any] = dict.fromkeys(now.keys() - before.keys())
        on_present(
            page,
            opened.group,
            lambda headers: page.request.patch(
                f"{server}/api/v1/views/{opened.view['id']}/lines",
                data={"lines": {**before, **gone}},
                headers=headers,
            ),
        )


def longest(lines: Document) -> str:
    """The marking with the most points."""
    return max(sorted(lines), key=lambda marking: len(lines[marking]))


def absent_from(lines: Document) -> str:
    """A marking that is not drawn."""
    return next(marking for marking in MARKINGS if marking not in lines)


class TestStaging:
    def test_several_edits_are_previewed_and_saved_as_one(self, editor: Editor) -> None:
        before = editor.lines
        first, second = sorted(before)[:2]
        writes = submitted(editor.page)
        editor.choose(first)
        editor.press(".", "Shift+ArrowDown", "Shift+ArrowDown", "Shift+ArrowDown")
        editor.staged(1)
        editor.choose(second)
        editor.press("Delete")
        editor.staged(2)
        editor.previewed()
        old, new, change = editor.compared("worst")
        assert (old != new, change) == (True, "worse")
        assert editor.lines == before
        assert writes == []
        editor.press("Control+s")
        editor.saved()
        assert len(writes) == 1
        moved = editor.lines[first][0]
        assert moved["y"] == pytest.approx(before[first][0]["y"] + 15, abs=1e-9)
        assert second not in editor.lines
        editor.staged(0)
        editor.press("Control+z")
        expect(editor.page.locator(f'tr[data-marking="{second}"] td').nth(1)).to_have_text(
            str(len(before[second]))
        )
        editor.saved()
        assert editor.lines == before

    def test_steps_are_taken_back_one_by_one_and_survive_a_reload(self, editor: Editor) -> None:
        before = editor.lines
        marking = longest(before)
        editor.choose(marking)
        editor.press(".", "Delete", "Delete")
        until(editor.page, lambda: editor.drawn()[marking] == len(before[marking]) - 2)
        editor.press("Control+z")
        until(editor.page, lambda: editor.drawn()[marking] == len(before[marking]) - 1)
        editor.page.on("dialog", lambda dialog: dialog.accept())
        editor.page.reload()
        editor.staged(1)
        until(editor.page, lambda: editor.drawn().get(marking) == len(before[marking]) - 1)
        editor.press("Control+Delete")
        editor.staged(0)
        whole = {name: len(points) for name, points in before.items()}
        until(editor.page, lambda: editor.drawn() == whole)
        assert editor.lines == before

    def test_what_is_staged_is_told_in_the_review_and_asked_about_before_accepting(
        self, editor: Editor
    ) -> None:
        page = editor.page
        page.on("dialog", lambda dialog: dialog.accept())
        editor.choose(longest(editor.lines))
        editor.press(".", "Delete")
        editor.staged(1)
        editor.press("Escape", "Escape")
        page.wait_for_url(f"**/review/{editor.group}")
        link = page.get_by_role("link", name="1 marking staged, not saved")
        expect(link).to_be_visible()
        editor.press("a")
        asked = page.get_by_role("region", name="1 marking staged in the calibration editor")
        expect(asked).to_be_visible()
        expect(page).to_have_url(re.compile(f"/review/{editor.group}$"))
        with page.expect_event("dialog") as asks:
            page.reload()
        assert asks.value.type == "beforeunload"

    def test_undo_is_offered_once_there_is_something_to_undo(
        self, open_page: OpenPage, server: str
    ) -> None:
        page = open_page(None)
        groups = (page.request.get(f"/api/v1/groups/{row['id']}").json() for row in rows(page))
        group = next(one for one in groups if not one["can_undo"] and not one["can_redo"])
        editor = Editor(page, server, group["id"], 0)
        undo, redo, discard = (
            page.get_by_role("button", name=re.compile(f"^{name} "))
            for name in ("Undo", "Redo", "Discard")
        )
        for button, why in (
            (undo, "Nothing to undo"),
            (redo, "Nothing to redo"),
            (discard, "Nothing is staged"),
        ):
            expect(button).to_have_attribute("aria-disabled", "true")
            button.click(force=True)
            expect(page.locator(".explained")).to_have_text(f"{why}.")
        editor.choose(longest(editor.lines))
        editor.press(".", "Shift+ArrowDown")
        expect(undo).to_have_attribute("aria-disabled", "false")
        undo.click()
        expect(undo).to_have_attribute("aria-disabled", "true")
        expect(redo).to_have_attribute("aria-disabled", "false")

    def test_sides_are_swapped_before_anything_is_saved(self, editor: Editor) -> None:
        before = editor.drawn()
        editor.press("m")
        editor.previewed()
        swapped = editor.drawn()
        assert sum(swapped.values()) == sum(before.values())
        assert swapped.keys() != before.keys()
        # The fit is the same from the other side; the ball is not.
        assert editor.compared("jac 0.5")[2] == "same"
        assert editor.compared("ball")[2] == "worse"
        editor.press("m")
        editor.staged(0)
        until(editor.page, lambda: editor.drawn() == before)

    def test_a_marking_is_relabelled_in_the_diagram(self, editor: Editor) -> None:
        before = editor.drawn()
        marking = longest(editor.lines)
        other = absent_from(editor.lines)
        editor.choose(marking)
        editor.press("r")
        expect(editor.page.locator(".diagram")).to_have_attribute("data-mode", "relabel")
        editor.choose(other)
        until(editor.page, lambda: editor.drawn().get(other) == before[marking])
        assert marking not in editor.drawn()
        editor.press("Control+Delete")


class TestPointer:
    def test_a_point_is_dragged_with_live_numbers(self, editor: Editor) -> None:
        lines = editor.lines
        marking = longest(lines)
        editor.choose(marking)
        index = len(lines[marking]) // 2
        x, y = editor.to_screen(lines[marking][index]["x"], lines[marking][index]["y"])
        mouse = editor.page.mouse
        mouse.move(x, y)
        mouse.down()
        mouse.move(x + 8, y + 30, steps=4)
        editor.previewed()
        assert editor.compared("worst")[2] == "worse"
        mouse.up()
        editor.staged(1)
        assert editor.lines == lines
        editor.press("Control+z")
        editor.staged(0)

    def test_lines_that_cannot_be_previewed_say_so(self, editor: Editor, console: Any) -> None:
        console.expect("422")
        told = {"title": "Refused", "status": 422, "detail": "these lines meet nowhere"}
        editor.page.route("**/preview", lambda route: route.fulfill(status=422, json=told))
        editor.choose(longest(editor.lines))
        editor.press(".", "Shift+ArrowDown")
        card = editor.page.get_by_role("region", name="Before and after", exact=True)
        expect(card).to_contain_text("not known")
        expect(card).to_contain_text("these lines meet nowhere")
        editor.press("Control+Delete")
        expect(card).to_contain_text("nothing staged")
        expect(card).not_to_contain_text("these lines meet nowhere")

    def test_a_group_that_is_not_there_is_not_waited_for(
        self, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("404")
        page = open_page("/review/999999/calibration")
        expect(page.get_by_role("heading", name="Group 999999 cannot be shown")).to_be_visible()

    def test_a_new_marking_is_drawn_by_clicks(self, editor: Editor) -> None:
        view = editor.view
        absent = absent_from(view["lines"])
        editor.choose(absent)
        expect(editor.page.locator(".editor__hint")).to_contain_text(absent)
        for share in (0.3, 0.5, 0.7):
            x, y = editor.to_screen(view["width"] * share, view["height"] * 0.93)
            editor.page.mouse.click(x, y)
        expect(editor.page.locator(".points li")).to_have_count(3)
        until(editor.page, lambda: editor.drawn()[absent] == 3)
        editor.press("Escape", "Control+Delete")
        editor.staged(0)

    def test_a_picture_is_taken_as_stretched_or_cropped_and_as_it_is_again(
        self, editor: Editor
    ) -> None:
        button = editor.page.get_by_role("button", name="Stretched or cropped")
        wide = editor.page.locator('[data-number="wide"]')
        expect(wide).to_have_count(0)
        button.click()
        expect(button).to_have_attribute("aria-pressed", "true")
        until(editor.page, lambda: editor.view["station"]["picture"] is not None)
        expect(wide).to_be_visible()
        button.click()
        until(editor.page, lambda: editor.view["station"]["picture"] is None)
        expect(wide).to_have_count(0)

    def test_a_line_lights_up_on_both_sides(self, editor: Editor) -> None:
        marking = longest(editor.lines)
        row = editor.page.locator(f'tr[data-marking="{marking}"]')
        shape = editor.page.locator(f'.diagram__marking[data-marking="{marking}"]')
        row.hover()
        expect(shape).to_have_attribute("data-lit", "true")
        points = editor.lines[marking]
        editor.page.mouse.move(*editor.to_screen(points[0]["x"], points[0]["y"]))
        expect(editor.page.locator('[data-lit="true"]').first).to_be_visible()


class TestPaint:
    def test_all_points_move_onto_it_in_one_step_that_is_taken_back(self, editor: Editor) -> None:
        before = editor.lines
        editor.press("e")
        chip = editor.page.locator(".paint-chip")
        expect(chip).to_contain_text("Markings with paint")
        editor.press("k")
        expect(editor.page.locator(".commit__state")).to_contain_text("Points moved onto the paint")
        editor.previewed()
        expect(editor.page.locator(".comparison")).to_contain_text("Median error")
        had, has = (float(text.split()[0]) for text in editor.compared("median")[:2])
        assert has < had / 2
        assert serious_in_both(editor.page) == []
        editor.press("Control+z")
        editor.staged(0)
        editor.press("e")
        expect(chip).to_have_count(0)
        assert editor.lines == before

    def test_one_marking_moves_alone(self, editor: Editor) -> None:
        marking = longest(editor.lines)
        editor.choose(marking)
        editor.press("Shift+K")
        editor.staged(1)
        expect(editor.page.locator(".commit__state")).to_contain_text(
            f"{marking} moved onto the paint"
        )
        editor.press("Control+Delete")
        editor.staged(0)

    def test_lines_are_proposed_where_there_are_none(self, editor: Editor) -> None:
        drawn = editor.drawn()
        for marking in drawn:
            editor.choose(marking)
            editor.press("Shift+Delete")
        editor.staged(len(drawn))
        button = editor.page.get_by_role("button", name="Propose lines")
        button.click()
        expect(editor.page.locator(".commit__state")).to_contain_text("Lines proposed")
        editor.previewed()
        assert float(editor.compared("jac 1")[1]) > 0.75
        editor.press("Control+Delete")
        editor.staged(0)
        until(editor.page, lambda: editor.drawn() == drawn)


def other_point(editor: Editor, marking: str) -> None:
    """Save, from elsewhere, another last point of one marking."""
    points = [dict(point) for point in editor.lines[marking]]
    points[-1]["x"] += 2
    on_present(
        editor.page,
        editor.group,
        lambda headers: editor.page.request.patch(
            f"{editor.address}/api/v1/views/{editor.view['id']}/lines",
            data={"lines": {marking: points}},
            headers=headers,
        ),
    )


class TestChangesElsewhere:
    def test_what_does_not_overlap_is_merged_without_asking(self, editor: Editor) -> None:
        hears(editor.page)
        mine, theirs = sorted(editor.lines)[:2]
        editor.choose(mine)
        editor.press(".", "Shift+ArrowDown")
        editor.staged(1)
        seen = editor.page.expect_response(lambda answer: answer.url.endswith(f"/{editor.group}"))
        with seen:
            other_point(editor, theirs)
        editor.previewed()
        expected = {**editor.lines}
        editor.press("Control+s")
        editor.saved()
        expect(editor.page.get_by_role("alert", name="Conflict")).to_have_count(0)
        assert editor.lines[theirs] == expected[theirs]
        assert editor.lines[mine] != expected[mine]

    def test_a_staged_line_that_another_saved_is_a_conflict_that_shows_both(
        self, editor: Editor, console: Any
    ) -> None:
        console.expect("412")
        hears(editor.page)
        mine = sorted(editor.lines)[0]
        editor.choose(mine)
        editor.press(".", "Shift+ArrowDown")
        editor.staged(1)
        with editor.page.expect_response(lambda answer: answer.url.endswith(f"/{editor.group}")):
            other_point(editor, mine)
        theirs = editor.lines[mine]
        editor.press("Control+s")
        bar = editor.page.get_by_role("alert", name="Conflict")
        expect(bar).to_contain_text("both changed it")
        bar.get_by_role("button", name="Take theirs").click()
        expect(bar).to_have_count(0)
        assert editor.lines[mine] == theirs


def of_static_camera(open_page: OpenPage, film: str) -> tuple[Editor, list[int]]:
    """The editor of a static camera in the first group of the film, and the film's groups."""
    page = open_page(None)
    groups: list[int] = page.request.get(f"{film}/api/v1/datasets/film/timeline").json()["id"]
    return Editor(page, film, groups[0], 3), groups


class TestStation:
    def test_an_edit_reaches_all_views_of_the_camera(self, open_page: OpenPage, film: str) -> None:
        page = open_page(None)
        timeline = page.request.get(f"{film}/api/v1/datasets/film/timeline").json()
        editor = Editor(page, film, timeline["id"][0], 2)
        expect(page.locator(".station-card")).to_contain_text("all 37 groups")
        before = editor.lines
        marking = longest(before)
        page.get_by_role("button", name="From lines").click()
        expect(page.get_by_role("button", name="From lines")).to_have_attribute(
            "aria-pressed", "true"
        )
        editor.choose(marking)
        editor.press(".", "Shift+ArrowDown")
        editor.staged(1)
        editor.press("Control+s")
        editor.saved()
        expect(page.locator(".station-card__work")).to_be_visible()
        other = page.request.get(f"{film}/api/v1/groups/{timeline['id'][20]}").json()
        changed = next(view for view in other["views"] if view["key"] == editor.key)
        assert changed["lines"] == editor.lines != before
        editor.press("Control+z")
        editor.staged(0)
        until(page, lambda: editor.lines == before)
        editor.saved()
        given = page.get_by_role("button", name="Given camera")
        given.click()
        expect(given).to_have_attribute("aria-pressed", "true")
        editor.press("Control+z")
        expect(given).to_have_attribute("aria-pressed", "false")
        editor.saved()
        given.click()
        expect(given).to_have_attribute("aria-pressed", "true")
        jobs_end(page, film)

    def test_undo_returns_to_the_group_of_an_edit_also_after_the_page_was_loaded_anew(
        self, open_page: OpenPage, film: str
    ) -> None:
        editor, groups = of_static_camera(open_page, film)
        page, before = editor.page, editor.lines
        editor.save_a_moved_line()
        editor.saved()
        assert editor.lines != before
        page.goto(f"{film}/review/{groups[5]}")
        page.wait_for_selector(".strip__tabs")
        page.keyboard.press("Control+z")
        expect(page).to_have_url(re.compile(rf"/review/{groups[0]}\b"))
        until(page, lambda: editor.lines == before)
        jobs_end(page, film)

    def test_undo_takes_back_an_edit_whose_answer_is_still_on_its_way(
        self, open_page: OpenPage, film: str
    ) -> None:
        editor, _ = of_static_camera(open_page, film)
        page, before = editor.page, editor.lines
        with holding(page, "**/stations/*/lines*", answered=True) as held:
            editor.save_a_moved_line()
            held.arrive()
            assert editor.lines != before
            editor.press("Control+z")
        until(page, lambda: editor.lines == before)
        jobs_end(page, film)

    def test_undo_takes_back_an_edit_whose_answer_the_page_before_never_got(
        self, open_page: OpenPage, film: str
    ) -> None:
        editor, groups = of_static_camera(open_page, film)
        page, before = editor.page, editor.lines
        with holding(page, "**/stations/*/lines*", answered=True) as held:
            editor.save_a_moved_line()
            held.arrive()
            assert editor.lines != before
            page.goto(f"{film}/review/{groups[5]}")
        page.wait_for_selector(".strip__tabs")
        page.keyboard.press("Control+z")
        expect(page).to_have_url(re.compile(rf"/review/{groups[0]}\b"))
        until(page, lambda: editor.lines == before)
        jobs_end(page, film)

    def test_all_static_cameras_are_adjusted_and_that_is_taken_back(
        self, open_page: OpenPage, film: str, console: Console
    ) -> None:
        console.expect("a status of 409")
        page = open_page(None)
        timeline = page.request.get(f"{film}/api/v1/datasets/film/timeline").json()
        editor = Editor(page, film, timeline["id"][0], 2)
        dialog = page.get_by_role("dialog", name="Adjust static cameras together")

        page.get_by_role("button", name="Adjust all static cameras").click()
        dialog.get_by_role("button", name="Propose").click()
        row = dialog.locator(f'tr[data-camera="{editor.key}"]')
        expect(row).to_be_visible()
        expect(dialog).to_contain_text("Camera pair")
        assert serious(page) == []
        # Somebody leaves a view out: that proposal is not saved any more, and a new one can be had.
        other = f"{film}/api/v1/groups/{timeline['id'][1]}"
        document = page.request.get(other).json()
        left = page.request.patch(
            f"{film}/api/v1/views/{document['views'][0]['id']}",
            data={"included": False},
            headers={"If-Match": document["etag"]},
        )
        assert left.ok
        dialog.get_by_role("button", name="Save").click()
        expect(dialog).to_contain_text("have changed since that proposal")
        expect(row).to_be_hidden()
        dialog.get_by_role("button", name="Propose").click()
        expect(row).to_be_visible()
        dialog.get_by_role("button", name="Save").click()
        expect(dialog).to_be_hidden()
        station = f"{film}/api/v1/stations/{editor.view['station']['id']}"
        until(page, lambda: page.request.get(station).json()["can_undo"])

        page.get_by_role("button", name="Adjust all static cameras").click()
        restore = dialog.get_by_role("button", name="Restore the previous cameras")
        expect(restore).to_be_hidden()
        dialog.get_by_role("button", name="Propose").click()
        expect(dialog).to_contain_text("were adjusted already")
        restore.click()
        expect(dialog).to_be_hidden()
        expect(page.locator(".station-card__work")).to_be_visible()
        # While the groups are solved anew, their state changes.
        jobs_end(page, film)
        undo = {"If-Match": page.request.get(other).json()["etag"]}
        assert page.request.post(f"{other}/undo", headers=undo).ok


class TestAccess:
    def test_axe_finds_nothing_serious(self, open_page: OpenPage, server: str) -> None:
        page = open_page(None)
        editor = Editor(page, server, passing(page, 0), 0)
        editor.choose(longest(editor.lines))
        editor.press(".", "Shift+ArrowDown")
        editor.staged(1)
        editor.previewed()
        assert serious_in_both(page) == []

    @pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
    def test_nothing_is_cut_off(
        self, open_page: OpenPage, film: str, size: tuple[int, int]
    ) -> None:
        page = open_page(None, size={"width": size[0], "height": size[1]})
        timeline = page.request.get(f"{film}/api/v1/datasets/film/timeline").json()
        editor = Editor(page, film, timeline["id"][5], 2)
        editor.press("]", ".")
        parts = page.locator(".editor__rail > *, .points")
        overflows = "all => all.filter((one) => one.scrollHeight > one.clientHeight + 1).length"
        assert parts.evaluate_all(overflows) == 0
        scrolled = ".editor__scroll, .editor__rail"
        assert soon(page, CUT_OFF.replace(".rail__scroll,", f".rail__scroll, {scrolled},")) == []
        assert soon(page, NESTED_SCROLLERS) == []
