"""A reviewer at work: queue, edits, verdicts, export, in a real browser."""

from __future__ import annotations

import csv
import io
import json
import re
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from app.formats.camera_json import camera_from_json
from tests.e2e.screen import (
    Screen,
    at_rest,
    holding,
    interior_point,
    lie_ready,
    on_present,
    passing,
    rows,
    submitted,
    undo_edit,
    until,
    withdraw_verdict,
)
from tests.e2e.test_access import serious_in_both

OpenPage = Callable[..., Page]

GREEN_PIXELS = """canvas => {
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let found = 0;
  for (let i = 0; i < data.length; i += 4) found += data[i + 1] > 220 && data[i] < 160 && data[i + 2] > 160;
  return found;
}"""


def bury(page: Page, number: int) -> int:
    """Move the balls of a group to where its cameras see a place 3 m below the grass; how many."""
    document = page.request.get(f"/api/v1/groups/{number}").json()
    x, y, _ = document["solution"]["ball"]["point"]
    pairs = [*zip(document["views"], document["solution"]["views"], strict=True)]
    for view, solved in pairs:
        camera = camera_from_json(solved["calibration"]["camera"], "answer", view["key"])
        ((right, down),) = camera.project(np.array([[x, y, 3.0]])).tolist()
        address = f"/api/v1/views/{view['id']}/ball"
        patch = partial(page.request.patch, address, data={"point": [right, down]})
        on_present(page, number, lambda headers, patch=patch: patch(headers=headers))
    return len(pairs)


COUNT_PICTURES = """() => {
  const { prototype } = CanvasRenderingContext2D;
  const { drawImage } = prototype;
  window.pictures = new Map();
  prototype.drawImage = function (...what) {
    window.pictures.set(this.canvas, 1 + (window.pictures.get(this.canvas) ?? 0));
    drawImage.apply(this, what);
  };
}"""


class TestQueue:
    def test_lists_every_group_and_opens_one_by_keyboard(self, open_page: OpenPage) -> None:
        page = open_page("/groups")
        expect(page.locator(".save")).to_contain_text("14 of 14 match")
        expect(page.locator(".queue-row[data-active=true]")).to_have_attribute("aria-rowindex", "2")
        page.keyboard.press("ArrowDown")
        page.keyboard.press("ArrowDown")
        page.keyboard.press("Enter")
        page.wait_for_url("**/review/3")
        expect(page.locator(".header__place")).to_contain_text("group 3 of 14")

    def test_the_query_is_in_the_address_and_filters(self, open_page: OpenPage) -> None:
        page = open_page("/groups")
        expect(page.locator(".save")).to_contain_text("14 of 14 match")
        page.keyboard.press("/")
        expect(page.locator(".field--query")).to_be_focused()
        page.keyboard.type("number<=5 sort:number-desc")
        expect(page.locator(".save")).to_contain_text("5 of 14 match")
        expect(page).to_have_url(re.compile("q=number"))
        first = page.locator(".queue-row:not(.queue-row--head)").first
        expect(first.locator("a")).to_have_text("5")

    def test_a_query_that_cannot_be_read_says_why_and_keeps_no_number_of_the_one_before(
        self, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("400")
        console.expect("422")
        page = open_page("/groups?q=number<=5")
        expect(page.locator(".facet__count").first).to_have_text(re.compile(r"\d"))
        page.locator(".field--query").fill("nonsense:1")
        expect(page.locator(".empty h2")).to_have_text("The query cannot be read")
        expect(page.locator(".facet__count").first).to_be_empty()
        expect(page.locator(".histogram rect")).to_have_count(0)
        expect(page.locator(".histogram").first).to_contain_text("Not counted: the query fails")
        page.get_by_text("Show all groups").click()
        expect(page.locator(".save")).to_contain_text("14 of 14 match")
        expect(page.locator(".histogram rect").first).to_be_visible()

    def test_an_angle_is_the_same_number_in_the_queue_and_in_the_group(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/groups")
        expect(page.locator(".queue-row a").first).to_have_text("1")
        row = rows(page)[0]
        shown = f"{row['parallax_degrees']:.1f}°"
        expect(page.locator(".queue-row [data-numeric]").get_by_text(shown)).to_be_visible()
        page.locator(".queue-row a").first.click()
        expect(page.locator(".mini-pitch [data-number=parallax]")).to_have_text(shown)

    def test_nothing_found_offers_a_way_back(self, open_page: OpenPage) -> None:
        page = open_page("/groups?q=number%3E9000")
        expect(page.locator(".empty h2")).to_have_text("No group matches this query")

    def test_a_histogram_brushes_the_query(self, open_page: OpenPage) -> None:
        page = open_page("/groups")
        box = at_rest(page.locator(".histogram:not([aria-busy]) svg").first)
        page.mouse.move(box["x"] + 0.82 * box["width"], box["y"] + 20)
        page.mouse.down()
        page.mouse.move(box["x"] + 0.99 * box["width"], box["y"] + 20, steps=4)
        page.mouse.up()
        expect(page.locator(".field--query")).to_have_value("jac>=0.8 jac<=1")


class TestSayingOneThing:
    def test_an_error_says_what_it_is_measured_from_before_and_after_a_view_is_left_out(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/review/12")
        screen = Screen(page)
        screen.ready()
        told = page.locator('[data-unused="D"]')
        expect(told).to_have_text(
            re.compile(
                r"not used: \S+ px in its best pair.*; \S+ px from the 3D ball of the others"
            )
        )
        far = (told.inner_text().split("; ")[-1]).removesuffix(" of the others")
        box = page.get_by_label("Include view D")
        box.uncheck()
        screen.saved()
        expect(told).to_have_text(f"ball of D, not used: {far} of the others")
        expect(page.locator('[data-view="D"] .caption [data-number="error"]')).to_have_text(
            re.compile(r"ball \S+ px \(from others\)")
        )
        undo_edit(page, 12)

    def test_a_camera_that_its_lines_do_not_determine_looks_uncertain_and_says_why(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/review/4")
        Screen(page).ready()
        state = page.locator('[data-view="B"] .caption__state').first
        expect(state).to_have_attribute("data-grade", "warn")
        expect(state).to_contain_text("uncertain")
        gate = page.locator('[data-gate="calibratable"]')
        expect(gate).to_have_attribute("data-state", "doubt")
        expect(gate).to_contain_text("in 4 of 4 views, B uncertain")
        uncertain = page.locator('.mini-pitch__camera[data-uncertain="true"]')
        expect(uncertain).to_have_attribute("data-letter", "B")
        expect(page.locator('[data-remark="B"]')).to_contain_text(
            "uncertain camera: its lines do not determine the position"
        )

    def test_a_line_that_does_not_fit_leads_to_its_view_and_its_worst_point(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/review/11")
        screen = Screen(page)
        screen.ready()
        page.keyboard.press("Shift+s")
        link = page.get_by_role("button", name="“Side line bottom” of B")
        link.click()
        expect(page.locator('[data-row="B"]')).to_have_attribute("data-focused", "true")
        lines = page.get_by_role("region", name="Lines of view B")
        expect(lines).to_be_in_viewport()
        fits = screen.document()["solution"]["views"][1]["calibration"]["markings"]
        far = next(fit["distances_px"] for fit in fits if fit["marking"] == "Side line bottom")
        page.keyboard.press("i")
        chosen = page.locator(".object-list [aria-pressed=true]")
        expect(chosen).to_contain_text(f"Side line bottompoint {far.index(max(far)) + 1}")
        page.keyboard.press("Escape")
        screen.saved()
        page.keyboard.press("Control+z")
        expect(link).to_have_count(0)
        screen.saved()


class TestExplanations:
    def test_a_key_that_does_nothing_says_why_for_a_moment_and_moves_nothing(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/review/1")
        Screen(page).ready()
        before = at_rest(page.locator(".image-grid"))
        explained = page.locator(".explained span")
        for key, why in (
            ("6", "There is no view 6."),
            ("Shift+6", "There is no view 6."),
            ("d", "This is the first group of the queue."),
            ("e", "No group with a finding comes before this one."),
            ("Delete", "Select a point or a ball first."),
            (".", "This dataset has no frames before or after this one."),
        ):
            page.keyboard.press(key)
            expect(explained).to_have_text(why)
            expect(explained).to_be_visible()
        box = at_rest(explained)
        assert box["y"] + box["height"] <= at_rest(page.locator(".header"))["height"]
        assert at_rest(page.locator(".image-grid")) == before
        page.evaluate("document.getAnimations().forEach((one) => one.finish())")
        expect(explained).to_be_hidden()
        page.keyboard.press("6")
        expect(explained).to_be_visible()
        # What the page shows anyway is only read out.
        page.keyboard.press("p")
        expect(explained).to_have_count(0)
        page.keyboard.press("p")


class TestPaint:
    def test_whiskers_lead_to_it_and_strips_show_it_once_it_is_asked_for(
        self, open_page: OpenPage, console: Any
    ) -> None:
        console.expect("willReadFrequently")
        page = open_page("/review/1")
        screen = Screen(page)
        screen.ready()
        strip = page.locator(".line-row__strip").first
        expect(strip).to_be_visible()
        read: list[str] = []
        page.on("response", lambda answer: read.append(answer.url))
        views = [view["id"] for view in screen.document()["views"]]
        screen.press("Shift+W")
        until(page, lambda: sum(url.endswith("/paint") for url in read) == len(views))
        # A green that no picture of grass has: the middle of the paint.
        until(page, lambda: strip.evaluate(GREEN_PIXELS) > 20)
        screen.press("Shift+W")
        until(page, lambda: strip.evaluate(GREEN_PIXELS) == 0)


class TestEditing:
    def test_a_dragged_line_point_changes_the_numbers_and_undo_brings_them_back(
        self, review: Callable[..., Screen]
    ) -> None:
        screen = review(0)
        before = screen.document()
        view = before["views"][0]
        marking, index, point = interior_point(view)
        jac = screen.number("A", "jac")
        screen.drag(screen.place(view, point["x"], point["y"]), 4, 22)
        screen.saved()
        expect(screen.page.locator('[data-row="A"] [data-number="jac"]')).not_to_have_text(jac)
        after = screen.document()
        moved = after["views"][0]["lines"][marking][index]
        assert abs(moved["x"] - point["x"]) > 1 and moved["y"] - point["y"] > 10
        assert after["solution"]["views"][0]["calibration"]["jac"]["0.5"] < float(jac)
        screen.press("Escape", "Control+z")
        expect(screen.page.locator('[data-row="A"] [data-number="jac"]')).to_have_text(jac)
        assert screen.document()["views"][0]["lines"] == view["lines"]
        screen.press("Control+Shift+z")
        expect(screen.page.locator('[data-row="A"] [data-number="jac"]')).not_to_have_text(jac)
        screen.press("Control+z")
        expect(screen.page.locator('[data-row="A"] [data-number="jac"]')).to_have_text(jac)

    def test_a_dragged_ball_is_previewed_before_the_server_knows(
        self, review: Callable[..., Screen]
    ) -> None:
        screen = review(1)
        writes = submitted(screen.page)
        view = screen.document()["views"][0]
        x, y, width, height = view["balls"][0]["box"]
        before = screen.pitch("x"), screen.pitch("y")
        screen.drag(screen.place(view, x + width / 2, y + height / 2), 7, 3, drop=False)
        expect(screen.page.locator('.mini-pitch [data-number="x"]')).not_to_have_text(before[0])
        assert writes == []
        shown = screen.pitch("x"), screen.pitch("y"), screen.number("A", "error")
        screen.page.mouse.up()
        screen.saved()
        assert (screen.pitch("x"), screen.pitch("y"), screen.number("A", "error")) == shown
        saved = screen.document()["solution"]["ball"]["point"]
        assert f"{saved[0]:.2f}".replace("-", "−") in shown[0]
        screen.press("Escape", "Control+z")
        expect(screen.page.locator('.mini-pitch [data-number="x"]')).to_have_text(before[0])

    def test_gates_follow_a_ball_that_is_still_held(self, review: Callable[..., Screen]) -> None:
        screen = review(3)
        writes = submitted(screen.page)
        view = screen.document()["views"][0]
        x, y, width, height = view["balls"][0]["box"]
        gate = screen.page.locator(".gates [data-gate=reprojection] .gates__value")
        expect(gate).not_to_contain_text("not used")
        before, sigma = gate.inner_text(), screen.pitch("sigma")
        screen.drag(screen.place(view, x + width / 2, y + height / 2), 60, 90, drop=False)
        expect(gate).to_contain_text("not used")
        expect(screen.page.locator('.mini-pitch [data-number="sigma"]')).not_to_have_text(sigma)
        screen.press("Escape")
        expect(gate).to_have_text(before)
        expect(screen.page.locator('.mini-pitch [data-number="sigma"]')).to_have_text(sigma)
        screen.page.mouse.up()
        assert writes == []

    def test_escape_gives_a_held_point_back(self, review: Callable[..., Screen]) -> None:
        screen = review(1)
        writes = submitted(screen.page)
        view = screen.document()["views"][0]
        _, _, point = interior_point(view)
        screen.drag(screen.place(view, point["x"], point["y"]), 5, 30, drop=False)
        screen.press("Escape")
        screen.page.mouse.up()
        screen.page.wait_for_timeout(300)
        assert writes == []
        assert screen.document()["views"][0]["lines"] == view["lines"]

    def test_objects_are_reached_and_nudged_by_keyboard(
        self, review: Callable[..., Screen]
    ) -> None:
        screen = review(1)
        view = screen.document()["views"][0]
        box = view["balls"][0]["box"]
        screen.press("i")
        expect(screen.page.locator(".object-list [aria-pressed=true]")).to_contain_text("Ball")
        screen.press("ArrowRight", "Shift+ArrowRight", "Alt+ArrowDown", "]")
        screen.saved()
        moved = screen.document()["views"][0]["balls"][0]["box"]
        assert moved == pytest.approx(
            [box[0] + 6 - 0.125, box[1] + 0.1 - 0.125, box[2] + 0.25, box[3] + 0.25]
        )
        screen.press("Escape")
        # How many steps the keys make depends on how fast they came.
        for _ in range(4):
            if screen.document()["views"][0]["balls"][0]["box"] != box:
                screen.press("Control+z")
                screen.saved()
        assert screen.document()["views"][0]["balls"][0]["box"] == box

    def test_a_view_is_left_out_for_a_reason(self, review: Callable[..., Screen]) -> None:
        screen = review(0)
        before = screen.document()["verdict"]
        screen.press("2", "Shift+x")
        expect(screen.page.locator(".ask__title")).to_contain_text("Leave this view out because")
        screen.press("6")
        panel = screen.page.locator('.image-panel[data-view="B"]')
        expect(panel).to_have_attribute("data-included", "false")
        screen.saved()
        document = screen.document()
        assert document["verdict"] == before
        assert document["views"][1]["left_out"] == {"reason": "duplicate_view", "note": None}
        screen.press("Shift+a")
        expect(panel).to_have_attribute("data-included", "true")
        screen.saved()

    def test_a_view_is_left_out_and_taken_back(self, review: Callable[..., Screen]) -> None:
        screen = review(0)
        screen.press("Shift+2")
        panel = screen.page.locator('.image-panel[data-view="B"]')
        expect(panel).to_have_attribute("data-included", "false")
        screen.saved()
        assert screen.document()["views"][1]["included"] is False
        screen.press("Shift+2")
        expect(panel).to_have_attribute("data-included", "true")
        screen.saved()


class TestLooking:
    def test_a_page_that_loads_draws_each_picture_a_few_times(self, open_page: OpenPage) -> None:
        page = open_page(None)
        page.add_init_script(f"({COUNT_PICTURES})()")
        page.goto(f"/review/{passing(page, 0)}")
        Screen(page).ready()
        strips = page.locator(".line-row__strip")
        expect(strips.first).to_be_visible()
        pictures = page.locator(".image-panel__stage, .crop__canvas").count() + strips.count()
        until(page, lambda: page.evaluate("window.pictures.size") >= pictures)
        assert page.evaluate("Math.max(...window.pictures.values())") <= 3

    def test_t_shows_the_other_3d_ball_and_says_which(self, review: Callable[..., Screen]) -> None:
        screen = review(0)
        solution = screen.document()["solution"]
        which = screen.page.locator(".mini-pitch button")
        expect(which).to_have_text("pair average")
        mean = screen.pitch("sigma"), screen.number("A", "error")
        screen.press("t")
        expect(which).to_have_text("most likely point")
        best = solution["best_ball"]
        shown = screen.pitch("x"), screen.pitch("y"), screen.pitch("sigma")
        expected = (
            f"{best['point'][0]:.2f} m",
            f"{best['point'][1]:.2f} m",
            f"{best['sigma_m']:.2f} m",
        )
        assert shown == tuple(text.replace("-", "−") for text in expected)
        # The gates stay with the mean, which is exported.
        assert screen.document()["solution"]["ball"] == solution["ball"]
        which.click()
        expect(which).to_have_text("pair average")
        assert (screen.pitch("sigma"), screen.number("A", "error")) == mean

    def test_g_tells_by_how_much_each_gate_is_met(self, review: Callable[..., Screen]) -> None:
        screen = review(0)
        gate = next(
            gate for gate in screen.document()["solution"]["gates"] if gate["name"] == "baseline"
        )
        margins = screen.page.locator(".gates__margin")
        expect(margins).to_have_count(0)
        screen.press("g")
        told = screen.page.locator('[data-gate="baseline"] .gates__margin')
        expect(told).to_have_text(
            "margin over 10×" if gate["margin"] > 10 else f"margin +{100 * gate['margin']:.0f} %"
        )
        screen.press("g")
        expect(margins).to_have_count(0)

    def test_keys_that_change_what_is_shown_say_so(self, review: Callable[..., Screen]) -> None:
        screen = review(0)
        for key, said in (
            ("l", "collapsed"),
            ("l", "Strip with ball, lines and pitch shown"),
            ("Shift+l", "equally large"),
            ("Shift+l", "The main camera is large"),
            ("z", "zoomed to the ball"),
            ("0", "All views are shown whole"),
        ):
            screen.press(key)
            expect(screen.page.locator("[aria-live]").filter(has_text=said)).to_have_count(1)


class TestVerdicts:
    def test_a_reviewer_accepts_rejects_and_exports(
        self, open_page: OpenPage, tmp_path: Path
    ) -> None:
        page = open_page(None)
        first = passing(page, 3)
        page.goto(f"/review/{first}")
        screen = Screen(page)
        screen.ready()
        key = screen.document()["key"]
        screen.press("a")
        page.wait_for_url(lambda url: f"/review/{first}" not in url)
        screen.saved()
        screen.ready()
        second = screen.group
        screen.press("x")
        expect(page.locator(".reasons")).to_be_visible()
        screen.press("1")
        page.wait_for_url(lambda url: f"/review/{second}" not in url)
        screen.saved()
        verdicts = {row["id"]: row["status"] for row in rows(page)}
        assert (verdicts[first], verdicts[second]) == ("accepted", "rejected")

        page.get_by_role("link", name="Queue").click()
        page.get_by_role("button", name="Export").first.click()
        page.get_by_text("Accepted groups").click()
        with page.expect_download() as download:
            page.locator("dialog").get_by_role("button", name="Export", exact=True).click()
        target = tmp_path / "export.zip"
        download.value.save_as(target)
        check_export(target, key)
        expect(page.locator(".export__result")).to_contain_text("Ready")
        for group in (first, second):
            withdraw_verdict(page, group)

    def test_keys_faster_than_the_network_lose_nothing(self, open_page: OpenPage) -> None:
        page = open_page(None)
        chain = [row["id"] for row in rows(page)][-4:]
        page.goto(f"/review/{chain[0]}")
        screen = Screen(page)
        screen.ready()
        expect(page.locator(".header__place")).to_contain_text("of 14")
        lie_ready(page, chain)
        with holding(page, "**/neighbours*") as neighbours:
            screen.press("s", "x", "1", "s")
            neighbours.arrive()
            page.wait_for_url(f"**/review/{chain[3]}")
        screen.saved()
        verdicts = {row["id"]: row["status"] for row in rows(page)}
        assert [verdicts[group] for group in chain[:3]] == ["deferred", "rejected", "deferred"]
        for group in chain[:3]:
            withdraw_verdict(page, group)

    def test_a_key_that_is_held_down_gives_one_verdict(self, open_page: OpenPage) -> None:
        page = open_page(None)
        chain = [row["id"] for row in rows(page)][-4:]
        page.goto(f"/review/{chain[0]}")
        screen = Screen(page)
        screen.ready()
        lie_ready(page, chain)
        for key in ("s", "x"):
            # A key that is down already repeats.
            for _ in range(4):
                page.keyboard.down(key)
            page.keyboard.up(key)
        expect(page.locator(".reasons")).to_be_visible()
        for _ in range(4):
            page.keyboard.down("1")
        page.keyboard.up("1")
        page.wait_for_url(f"**/review/{chain[2]}")
        page.get_by_role("button", name="Defer").focus()
        for _ in range(4):
            page.keyboard.down("Enter")
        page.keyboard.up("Enter")
        page.wait_for_url(f"**/review/{chain[3]}")
        screen.saved()
        verdicts = {row["id"]: row["status"] for row in rows(page)}
        said = [verdicts[group] for group in chain]
        assert said == ["deferred", "rejected", "deferred", "unreviewed"]
        for group in chain[:3]:
            withdraw_verdict(page, group)

    def test_a_note_that_is_begun_is_there_again(self, review: Callable[..., Screen]) -> None:
        screen = review(1)
        screen.press("x", "7")
        note = screen.page.get_by_label("What is wrong with this group?")
        note.fill("the ball is behind the post")
        screen.press("Escape")
        expect(note).to_have_count(0)
        screen.press("x", "7")
        expect(note).to_have_value("the ball is behind the post")

    def test_a_failing_group_is_accepted_only_with_a_reason(self, open_page: OpenPage) -> None:
        page = open_page(None)
        failing = next(row["id"] for row in rows(page) if not row["passes"])
        page.goto(f"/review/{failing}")
        screen = Screen(page)
        screen.ready()
        screen.press("a")
        note = page.get_by_label("Say why.")
        expect(note).to_be_focused()
        page.keyboard.type("seen on video")
        page.keyboard.press("Enter")
        screen.saved()
        row = next(row for row in rows(page) if row["id"] == failing)
        assert row["status"] == "accepted"
        document = page.request.get(f"/api/v1/groups/{failing}").json()
        assert document["verdict"]["note"] == "seen on video"
        withdraw_verdict(page, failing)

    def test_a_ball_that_cannot_be_used_is_said_first_and_accepted_only_with_a_reason(
        self, open_page: OpenPage
    ) -> None:
        page = open_page(None)
        number = passing(page, 2)
        edits = bury(page, number)
        page.goto(f"/review/{number}")
        screen = Screen(page)
        screen.ready()
        card = page.get_by_role("region", name="Result")
        expect(card).to_have_attribute("data-tone", "bad")
        expect(card).to_contain_text("Passes, but the ball cannot be used")
        expect(card.locator(".verdict-card__text")).to_contain_text("lies 3.00 m below the grass")
        assert serious_in_both(page) == []
        screen.press("a")
        note = page.get_by_label("Say why.")
        expect(note).to_be_focused()
        expect(page.locator(".ask__title")).to_contain_text("the ball cannot be used")
        page.keyboard.press("Escape")
        assert screen.document()["verdict"]["state"] == "unreviewed"
        for _ in range(edits):
            undo_edit(page, number)

    def test_a_line_that_the_picture_does_not_show_is_marked_and_taken_back(
        self, open_page: OpenPage
    ) -> None:
        page = open_page(None)
        listed = page.request.get(
            "/api/v1/groups", params={"dataset": "sample", "q": "finding:visible_not_annotated"}
        )
        page.goto(f"/review/{listed.json()['items'][0]['id']}")
        screen = Screen(page)
        screen.ready()
        before = screen.document()
        finding = next(
            item
            for item in before["solution"]["findings"]
            if item["kind"] == "visible_not_annotated"
        )
        place = [view["key"] for view in before["views"]].index(finding["view"])
        page.keyboard.press(str(place + 1))
        name = finding["marking"]
        page.get_by_role("button", name=f"{name} is not visible").click()
        back = page.get_by_role("button", name=f"{name} is visible")
        expect(back).to_be_visible()
        screen.saved()
        after = screen.document()
        assert after["views"][place]["not_visible"] == [name]
        jac = [
            item["solution"]["views"][place]["calibration"]["jac"]["0.5"]
            for item in (before, after)
        ]
        assert jac[0] < jac[1]
        kinds = [(item["kind"], item["marking"]) for item in after["solution"]["findings"]]
        assert ("visible_not_annotated", name) not in kinds
        assert serious_in_both(page) == []
        back.click()
        screen.saved()
        assert screen.document()["views"][place]["not_visible"] == []

    def test_a_verdict_that_is_refused_puts_the_group_back(
        self, review: Callable[..., Screen], console: Any
    ) -> None:
        console.expect("422")
        screen = review(4)
        group = screen.group
        before = screen.document()["verdict"]["state"]
        problem = {
            "type": "about:blank",
            "title": "Refused",
            "status": 422,
            "detail": "this is no verdict",
        }
        screen.page.route(
            "**/verdict",
            lambda route: route.fulfill(
                status=422, content_type="application/problem+json", body=json.dumps(problem)
            ),
        )
        screen.press("s")
        expect(screen.page.get_by_role("alert")).to_contain_text("this is no verdict")
        assert screen.group == group
        expect(screen.page.locator('.pill[data-status="deferred"]')).to_have_count(0)
        assert screen.document()["verdict"]["state"] == before

    def test_a_refusal_that_is_there_before_the_next_group_is_known_keeps_the_group(
        self, open_page: Callable[..., Page], console: Any
    ) -> None:
        console.expect("422")
        page = open_page(None)
        page.route("**/verdict", lambda route: route.fulfill(status=422, body="{}"))
        with holding(page, re.compile("/neighbours")) as neighbours:
            page.goto(f"/review/{passing(page, 4)}")
            screen = Screen(page)
            screen.ready()
            neighbours.arrive()
            group = screen.group
            screen.press("s")
            expect(page.get_by_role("alert")).to_contain_text("Not saved")
        expect(page.locator(".header__place")).to_contain_text("of 14")
        screen.drawn()
        expect(page.get_by_role("alert")).to_contain_text("Not saved")
        assert screen.group == group

    def test_the_help_lists_the_keys(self, review: Callable[..., Screen]) -> None:
        screen = review(0)
        screen.press("?")
        dialog = screen.page.get_by_role("dialog")
        expect(dialog).to_contain_text("Accept and next")
        screen.press("Escape")
        expect(dialog).to_have_count(0)


def check_export(path: Path, key: str) -> None:
    """The zip holds the accepted group and a manifest that names every file."""
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
        assert "SNv3D.csv" in names and "manifest.json" in names
        manifest = json.loads(archive.read("manifest.json"))
        lines = list(csv.DictReader(io.StringIO(archive.read("SNv3D.csv").decode("utf-8-sig"))))
    assert manifest["dataset"] == "sample"
    found = {f"{row['league']}/{row['season']}/{row['match']}" for row in lines}
    assert key.rsplit("/", 1)[0] in found
