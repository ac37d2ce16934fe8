"""What is missing is drawn, what is wrong is taken back, and what is small is looked at."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from playwright.sync_api import expect

from tests.e2e.screen import Document, Screen, interior_point, until

Review = Callable[..., Screen]


def first_view(screen: Screen) -> Document:
    """The main camera's view, as the server has it."""
    view: Document = screen.document()["views"][0]
    return view


def balls(screen: Screen) -> list[Document]:
    """The balls of all views, as the server has them."""
    return [view["balls"] for view in screen.document()["views"]]


def undo(screen: Screen, before: Document) -> None:
    """Take edits back until the view is what it was."""
    screen.saved()
    for _ in range(8):
        now = first_view(screen)
        if (now["lines"], now["balls"]) == (before["lines"], before["balls"]):
            return
        screen.press("Control+z")
        screen.saved()
    pytest.fail("undo did not lead back")


class TestDrawing:
    def test_a_missing_ball_is_drawn_at_the_pointer(self, review: Review) -> None:
        screen = review(1)
        before = first_view(screen)
        x, y, width, height = before["balls"][0]["box"]
        screen.press("i", "Delete")
        expect(screen.page.locator(".object-list")).not_to_contain_text("Ball")
        screen.press("Escape")
        screen.page.mouse.move(*screen.place(before, x + width / 2, y + height / 2))
        screen.press("n", "Enter")
        screen.saved()
        box = first_view(screen)["balls"][0]["box"]
        middle = (box[0] + box[2] / 2, box[1] + box[3] / 2)
        assert middle == pytest.approx((x + width / 2, y + height / 2), abs=2)
        assert box[2] == pytest.approx(width, rel=0.5)
        undo(screen, before)

    def test_a_ball_is_drawn_at_the_pointer_though_the_list_opens_over_it(
        self, review: Review
    ) -> None:
        screen = review(1)
        before = first_view(screen)
        box = screen.page.locator('.image-panel[data-view="A"] .image-panel__stage').bounding_box()
        assert box is not None
        screen.press("i", "Delete", "Escape")
        place = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        screen.page.mouse.move(*place)
        screen.press("n")
        chooser = screen.page.locator(".chooser")
        expect(chooser).to_be_visible()
        over = chooser.bounding_box()
        assert over is not None
        screen.page.mouse.move(over["x"] + 20, over["y"] + 20)
        screen.page.keyboard.type("ball")
        screen.press("Enter")
        screen.saved()
        until(screen.page, lambda: first_view(screen)["balls"])
        undo(screen, before)

    def test_a_new_marking_is_drawn_click_by_click(self, review: Review) -> None:
        screen = review(1)
        before = first_view(screen)
        marking = "Goal left crossbar"
        if marking in before["lines"]:
            marking = "Goal right crossbar"
        screen.press("n")
        screen.page.keyboard.type(marking.lower())
        screen.press("Enter")
        expect(screen.page.locator(".drawing-chip")).to_contain_text(marking)
        # Far enough apart that no click means the point before it.
        for x, y in ((40, 500), (200, 505), (120, 502)):
            screen.page.mouse.click(*screen.place(before, x, y))
        screen.press("Escape")
        expect(screen.page.locator(".drawing-chip")).to_have_count(0)
        screen.saved()
        drawn = first_view(screen)["lines"][marking]
        assert [point["x"] for point in drawn] == pytest.approx([40, 120, 200], abs=2)
        undo(screen, before)

    def test_a_marking_is_found_by_the_words_that_people_use(self, review: Review) -> None:
        screen = review(1)
        screen.press("n")
        screen.page.keyboard.type("arc right")
        choice = screen.page.locator(".chooser__choice")
        expect(choice).to_have_count(1)
        expect(choice).to_contain_text("Circle right")
        expect(choice).to_contain_text("arc of the right penalty area")
        screen.press("Escape")

    def test_a_marking_whose_name_has_the_words_comes_before_one_in_whose_description_they_are(
        self, review: Review
    ) -> None:
        screen = review(1)
        for words, marking in (("side top", "Side line top"), ("side left", "Side line left")):
            screen.press("n")
            screen.page.keyboard.type(words)
            expect(screen.page.locator(".chooser__choice").nth(1)).to_contain_text("Big rect.")
            screen.press("Enter")
            expect(screen.page.locator(".drawing-chip")).to_contain_text(marking)
            screen.press("Escape")

    def test_a_click_on_a_point_of_another_marking_adds_a_point_to_the_one_that_is_drawn(
        self, review: Review
    ) -> None:
        screen = review(1)
        before = first_view(screen)
        marking = "Goal left crossbar"
        if marking in before["lines"]:
            marking = "Goal right crossbar"
        other, _, corner = interior_point(before)
        screen.press("n")
        screen.page.keyboard.type(marking.lower())
        screen.press("Enter")
        expect(screen.page.locator(".drawing-chip")).to_contain_text(marking)
        at = screen.place(before, corner["x"], corner["y"])
        screen.page.mouse.click(*at)
        screen.saved()
        # Once the marking has a point there, that point is moved.
        screen.drag(at, 60, 0)
        screen.press("Escape")
        screen.saved()
        now = first_view(screen)["lines"]
        assert now[other] == before["lines"][other]
        (drawn,) = now[marking]
        assert drawn["x"] > corner["x"] + 20
        undo(screen, before)

    def test_a_point_is_put_on_a_line(self, review: Review) -> None:
        screen = review(1)
        before = first_view(screen)
        _, line = max(
            before["lines"].items(),
            key=lambda item: abs(item[1][0]["x"] - item[1][1]["x"]) if len(item[1]) > 1 else 0,
        )
        middle = [(line[0][axis] + line[1][axis]) / 2 for axis in ("x", "y")]
        screen.page.keyboard.down("Alt")
        screen.page.mouse.click(*screen.place(before, *middle))
        screen.page.keyboard.up("Alt")
        screen.saved()
        now = first_view(screen)["lines"]
        grown = [name for name in now if len(now[name]) > len(before["lines"][name])]
        assert len(grown) == 1
        undo(screen, before)


class TestObjects:
    def test_a_ball_is_occluded_out_of_view_and_back(self, review: Review) -> None:
        screen = review(1)
        before = first_view(screen)
        screen.press("q")
        screen.saved()
        assert first_view(screen)["balls"][0]["occluded"] is True
        screen.press("o")
        expect(screen.page.locator('[data-row="A"] [data-number="ratio"]')).to_have_text("–")
        screen.saved()
        assert first_view(screen)["balls"][0]["out_of_view"] is True
        undo(screen, before)

    def test_a_nudged_ball_is_given_back_what_it_was(self, review: Review) -> None:
        screen = review(1)
        before = first_view(screen)
        screen.press("i", "Shift+ArrowRight")
        screen.saved()
        assert first_view(screen)["balls"] != before["balls"]
        screen.press("u")
        expect(screen.page.locator(".save")).to_have_attribute("data-unsaved", "0")
        until(screen.page, lambda: first_view(screen)["balls"] == before["balls"])

    def test_undo_takes_back_a_nudge_that_is_not_sent_yet(self, review: Review) -> None:
        screen = review(1)
        before = first_view(screen)
        screen.press("q")
        screen.saved()
        occluded = first_view(screen)["balls"]
        screen.press("i", "Shift+ArrowRight", "Control+z")
        screen.saved()
        assert first_view(screen)["balls"] == occluded
        screen.press("Control+Shift+z")
        until(screen.page, lambda: first_view(screen)["balls"] != occluded)
        undo(screen, before)

    def test_a_nudge_is_saved_when_the_browser_goes_back_at_once(self, review: Review) -> None:
        screen = review(1)
        group, before = screen.group, balls(screen)
        expect(screen.page.locator(".header__place")).to_contain_text("of")
        screen.press("f")
        screen.page.wait_for_url(lambda url: f"/review/{group}" not in url)
        screen.ready()
        screen.press("d")
        screen.page.wait_for_url(f"**/review/{group}*")
        screen.ready()
        screen.press("i", "Shift+ArrowRight")
        screen.page.evaluate("() => history.back()")
        screen.page.wait_for_url(lambda url: f"/review/{group}" not in url)
        screen.saved()
        screen.page.go_back()
        screen.ready()
        assert balls(screen) != before
        screen.press("Control+z")
        until(screen.page, lambda: balls(screen) == before)

    def test_undo_goes_across_views_and_survives_a_reload(self, review: Review) -> None:
        screen = review(1)
        before = screen.document()["views"]
        screen.press("q")
        screen.saved()
        screen.press("Shift+2")
        screen.saved()
        screen.page.reload()
        screen.ready()
        screen.press("Control+z")
        screen.saved()
        assert screen.document()["views"][1]["included"] is True
        assert screen.document()["views"][0]["balls"][0]["occluded"] is True
        screen.press("Control+z")
        expect(screen.page.locator(".save")).to_have_attribute("data-unsaved", "0")
        undo(screen, before[0])
        assert screen.document()["views"][0]["balls"] == before[0]["balls"]

    def test_sides_are_swapped_and_swapped_back(self, review: Review) -> None:
        screen = review(1)
        before = first_view(screen)
        # A main camera is swapped only by who insists.
        screen.press("m", "m")
        screen.saved()
        assert set(first_view(screen)["lines"]) != set(before["lines"])
        screen.press("m")
        screen.saved()
        expect(screen.page.locator(".save")).to_have_attribute("data-unsaved", "0")
        assert first_view(screen)["lines"] == before["lines"]


class TestLooking:
    def test_holding_z_magnifies_and_follows_a_nudge(self, review: Review) -> None:
        screen = review(1)
        before = first_view(screen)
        screen.press("i")
        screen.page.keyboard.down("z")
        caption = screen.page.locator(".loupe figcaption")
        expect(caption).to_contain_text("8×")
        said = caption.inner_text()
        screen.press("Shift+ArrowRight")
        expect(caption).not_to_have_text(said)
        screen.page.keyboard.up("z")
        expect(caption).to_have_count(0)
        undo(screen, before)

    def test_a_comment_stands_where_the_pointer_was_and_judges_nothing(
        self, review: Review
    ) -> None:
        screen = review(1)
        view = first_view(screen)
        _, _, point = interior_point(view)
        screen.page.mouse.move(*screen.place(view, point["x"], point["y"]))
        screen.press("Shift+n")
        before = screen.document()["verdict"]
        expect(screen.page.locator("#comment-new")).to_be_focused()
        screen.page.keyboard.type("look here")
        screen.press("Control+Enter")
        thread = screen.page.locator(".talk__threads > li", has_text="look here")
        expect(thread).to_be_visible()
        assert screen.document()["verdict"] == before
        thread.get_by_role("button", name="Delete").click()
        thread.get_by_role("button", name="Delete for good?").click()
        expect(thread).to_have_count(0)

    def test_a_comment_that_is_begun_outlives_escape_and_a_reload(self, review: Review) -> None:
        screen = review(1)
        screen.press("Shift+n")
        field = screen.page.locator("#comment-new")
        expect(field).to_be_focused()
        screen.page.keyboard.type("half a sent")
        screen.press("Escape")
        screen.page.reload()
        expect(field).to_have_value("half a sent")
        field.fill("")
        screen.page.reload()
        expect(field).to_have_value("")

    def test_single_letters_can_be_switched_off(self, review: Review) -> None:
        screen = review(1)
        screen.press("?")
        screen.page.get_by_label("Use single-letter keys").click()
        screen.press("Escape")
        expect(screen.page.locator("dialog[open]")).to_have_count(0)
        screen.press("x")
        expect(screen.page.locator(".reasons")).to_have_count(0)
        screen.press("?")
        screen.page.get_by_label("Use single-letter keys").click()
        screen.press("Escape")
        expect(screen.page.locator("dialog[open]")).to_have_count(0)
        screen.press("x")
        expect(screen.page.locator(".reasons")).to_be_visible()

    def test_another_key_is_chosen_for_a_verdict(self, review: Review) -> None:
        screen = review(1)
        screen.press("?")
        name = "X: choose another key for “Reject; then a digit for the reason”"
        screen.page.get_by_role("button", name=name, exact=True).click()
        screen.press("a")
        expect(screen.page.locator(".key-field")).to_contain_text("Accept and next")
        screen.press(";", "Escape")
        expect(screen.page.locator("dialog[open]")).to_have_count(0)
        screen.press("x")
        expect(screen.page.locator(".reasons")).to_have_count(0)
        screen.press(";")
        expect(screen.page.locator(".reasons")).to_be_visible()
