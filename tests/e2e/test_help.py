"""Help inside the product: found, true, readable by everybody; and a practice that answers."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from app.features.practice.lessons import LESSONS, LessonRecipe, make_practice_scenes
from app.sample.scene import Scene
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.solving.jaccard import project_markings
from tests.e2e.conftest import Console, OpenPage
from tests.e2e.screen import Screen, at_rest, holding, until
from tests.e2e.service import run_touchline, serving
from tests.e2e.test_access import serious, serious_in_both, soon

Json = dict[str, Any]
TOKENS = Path(__file__).resolve().parents[2] / "static" / "css" / "tokens.css"
STRUCTURE = frozenset({"canvas-halo", "canvas-chalk", "canvas-chalk-soft"})
"""Colours below and around marks, which mean nothing themselves."""


def open_help(page: Page) -> None:
    page.keyboard.press("?")
    expect(page.get_by_role("tab", name="Keys")).to_be_visible()


class TestFound:
    def test_a_question_mark_opens_it_over_the_review_and_nobody_loses_their_place(
        self, review: Callable[[int], Screen]
    ) -> None:
        screen = review(0)
        page, address = screen.page, screen.page.url
        open_help(page)
        page.get_by_role("tab", name="Keys").focus()
        for name, words in (
            ("Legend", "Visible line, not drawn"),
            ("Glossary", "Jaccard index"),
            ("Guide", "The loop"),
            ("Practice", "Eight made-up groups"),
        ):
            page.keyboard.press("ArrowRight")
            expect(page.get_by_role("tab", name=name)).to_be_focused()
            expect(page.get_by_role("tabpanel")).to_contain_text(words)
        page.keyboard.press("Escape")
        expect(page.locator("dialog[open]")).to_have_count(0)
        expect(page).to_have_url(address)
        # The keys of the review work again.
        page.keyboard.press("2")
        expect(page.locator('.image-panel[data-view="B"][data-focused="true"]')).to_be_visible()

    def test_the_palette_finds_every_part(self, open_page: OpenPage) -> None:
        page = open_page("/jobs")
        page.wait_for_selector(".page__main > :nth-child(2)")
        for typed in ("legend", "glossary", "guide", "practice"):
            page.keyboard.press("Control+k")
            expect(page.get_by_role("combobox")).to_be_focused()
            page.keyboard.type(typed)
            expect(page.get_by_role("combobox")).to_have_value(typed)
            page.keyboard.press("Enter")
            chosen = page.get_by_role("tab", name=re.compile(typed, re.I))
            expect(chosen).to_have_attribute("aria-selected", "true")
            page.keyboard.press("Escape")
            expect(page.locator("dialog[open]")).to_have_count(0)
        expect(page).to_have_url(re.compile("/jobs$"))

    def test_the_palette_finds_help_itself(self, open_page: OpenPage) -> None:
        page = open_page("/jobs")
        page.wait_for_selector(".page__main > :nth-child(2)")
        page.keyboard.press("Control+k")
        page.keyboard.type("help")
        found = page.locator(".palette__item")
        expect(found.filter(has_text="Help").first).to_be_visible()
        for part in ("Keys", "Legend", "Glossary", "Guide", "Practice"):
            expect(found.filter(has_text=part).first).to_be_visible()
        page.keyboard.press("Enter")
        expect(page.get_by_role("tablist")).to_be_visible()

    def test_enter_chooses_nothing_that_was_found_for_half_the_word(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/jobs")
        page.wait_for_selector(".page__main > :nth-child(2)")
        # The server never answers the first half of the word, and the whole of it late.
        half, whole = (re.compile(rf"/groups\?.*\bq={word}(&|$)") for word in ("he", "help"))
        held: list[Route] = []
        page.route(half, lambda _never: None)
        page.route(whole, lambda route: held.append(route))
        page.keyboard.press("Control+k")
        page.keyboard.type("h")
        expect(page.locator(".palette__item", has_text="Group 1").first).to_be_visible()
        with page.expect_request(half):
            page.keyboard.type("e")
        with page.expect_request(whole):
            page.keyboard.type("lp")
            page.keyboard.press("Enter")
        expect(page.locator(".palette__field")).to_have_value("help")
        until(page, lambda: held)
        held[0].continue_()
        expect(page.get_by_role("tablist")).to_be_visible()

    def test_each_part_has_an_address(self, open_page: OpenPage) -> None:
        page = open_page("/help/words")
        expect(page.get_by_role("tab", name="Glossary")).to_have_attribute("aria-selected", "true")
        page.get_by_label("Find a word").fill("revision chain")
        expect(page.locator(".help-words dt")).to_have_text(["revision chain"])
        page.get_by_role("tab", name="Legend").click()
        expect(page.locator(".legend__row").first).to_be_visible()
        expect(page).to_have_url(re.compile("/help/legend$"))
        page.goto("/help")
        expect(page.get_by_role("tabpanel")).to_contain_text("Accept and next")


class TestFirstStart:
    def test_somebody_new_is_offered_practice_and_guide_until_they_wave_it_away(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/groups?dataset=sample")
        card = page.get_by_role("region", name="First steps")
        expect(card.get_by_role("button", name="Practice with eight groups")).to_be_visible()
        card.get_by_role("button", name="Read the guide").click()
        expect(page.get_by_role("tabpanel")).to_contain_text("The loop")
        page.keyboard.press("Escape")
        card.get_by_role("button", name="No, thanks").click()
        expect(card).to_have_count(0)
        page.reload()
        page.wait_for_selector(".queue-row a")
        expect(card).to_have_count(0)


LEGEND_FAULTS = """() => [...document.querySelectorAll('.legend__row')].flatMap((row) => {
  const canvas = row.querySelector('canvas');
  const name = row.querySelector('.legend__name').textContent;
  if (!canvas) return row.querySelector('.legend__picture').children.length ? [] : [`${name}: no picture`];
  if (canvas.width === 0) return [`${name}: not drawn`];
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const colours = new Set();
  for (let i = 0; i < data.length; i += 4) colours.add(`${data[i]} ${data[i + 1]} ${data[i + 2]}`);
  return colours.size > 2 || name === 'View without a frame' ? [] : [`${name}: nothing but ground`];
})"""


class TestLegend:
    def test_it_has_every_colour_that_marks_are_drawn_with(self, open_page: OpenPage) -> None:
        page = open_page("/help/legend")
        page.wait_for_selector(".legend__row")
        rows = page.locator(".legend__row")
        until(page, lambda: rows.count() >= 40)
        named = page.eval_on_selector_all(
            ".legend__row", "rows => rows.map((row) => row.dataset.tokens).join(' ')"
        )
        drawn = set(
            re.findall(r"--((?:canvas|scene|view)-[\w-]+):", TOKENS.read_text(encoding="utf-8"))
        )
        assert drawn - STRUCTURE - set(named.split()) == set()

    def test_every_row_has_a_picture_that_shows_something(
        self, open_page: OpenPage, console: Console
    ) -> None:
        # They are looked at until all are drawn.
        console.expect("willReadFrequently")
        page = open_page("/help/legend")
        page.wait_for_selector(".legend__row canvas")
        assert soon(page, LEGEND_FAULTS) == []


class TestTerms:
    def test_a_gate_explains_itself_to_the_keyboard_and_nothing_moves(
        self, review: Callable[[int], Screen]
    ) -> None:
        page = review(0).page
        gate = page.locator('.gates [data-gate="jac"] .gates__name')
        page.get_by_role("button", name="margins").press("Tab")
        page.keyboard.press("Tab")
        tip = page.get_by_role("tooltip")
        expect(gate).to_be_focused()
        expect(tip).to_contain_text("Do the field lines fit?")
        expect(gate).to_have_attribute("aria-describedby", tip.get_attribute("id") or "none")
        explained = at_rest(gate)
        page.keyboard.press("Escape")
        expect(tip).to_be_hidden()
        expect(gate).to_be_focused()
        assert at_rest(gate) == explained

    def test_a_column_of_the_queue_explains_itself_to_the_pointer(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/groups?dataset=sample")
        page.wait_for_selector(".queue-row a")
        page.get_by_role("columnheader", name="σ m").get_by_role("button").hover()
        tip = page.get_by_role("tooltip")
        expect(tip).to_contain_text("How uncertain the 3D ball is")
        page.mouse.move(5, 5)
        expect(tip).to_be_hidden()


@pytest.fixture(scope="module")
def practice(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a server over a home of its own, with the practice groups."""
    home = tmp_path_factory.mktemp("practice-home")
    run_touchline(home, "migrate", "practice")
    with serving(home) as address:
        yield address


@pytest.fixture
def lessons(open_page: OpenPage, practice: str) -> tuple[Page, list[Json]]:
    """A window and the lessons, all of them open again."""
    page = open_page(None, address=practice)
    found: list[Json] = page.request.get("/api/v1/practice").json()["lessons"]
    return page, found


class TestPractice:
    def test_a_wrong_and_a_right_answer_are_told_on_the_next_group(
        self, lessons: tuple[Page, list[Json]]
    ) -> None:
        page, found = lessons
        page.goto(f"/review/{found[0]['group']}")
        Screen(page).ready()
        card = page.get_by_role("region", name="Practice")
        expect(card).to_contain_text("Lesson 1 of 8")
        expect(card).to_contain_text("Would you let this group into the dataset?")
        page.keyboard.press("Shift+h")
        expect(card).to_contain_text("Hint:")
        # Rightly: the first group is sound.
        page.keyboard.press("a")
        expect(card).to_contain_text("Lesson 2 of 8")
        expect(card).to_contain_text("Right: nothing is wrong with this group")
        # Wrongly: the second one could be mended.
        page.keyboard.press("x")
        page.keyboard.press("1")
        expect(card).to_contain_text("Lesson 3 of 8")
        expect(card).to_contain_text("Look again: the group could have been fixed")
        expect(card).to_contain_text("Best:")
        # Mended by a key: told before the verdict, too.
        page.wait_for_selector('.image-panel[data-view="B"] .image-panel__stage[data-ready="true"]')
        page.keyboard.press("2")
        page.keyboard.press("m")
        expect(card).to_contain_text("Right: the fault is fixed.")
        page.keyboard.press("?")
        page.get_by_role("tab", name="Practice").click()
        expect(page.get_by_role("tabpanel")).to_contain_text("1 of 8 right")

    def test_an_answer_is_told_though_the_next_group_comes_late(
        self, lessons: tuple[Page, list[Json]]
    ) -> None:
        page, _ = lessons
        page.goto("/help/practice")
        page.get_by_role("button", name="Start again").click()
        card = page.get_by_role("region", name="Practice")
        expect(card).to_contain_text("Lesson 1 of 8")
        first, second = page.request.get("/api/v1/practice").json()["lessons"][:2]
        with holding(page, re.compile(rf"/api/v1/groups/{second['group']}$")) as groups:
            # Afresh: the page may have loaded the second group already.
            page.goto(f"/review/{first['group']}")
            expect(card).to_contain_text("Lesson 1 of 8")
            Screen(page).ready()
            page.keyboard.press("a")
            expect(page).to_have_url(re.compile(rf"/review/{second['group']}"))
            # The card goes with the first group, and comes with the second.
            expect(card).to_have_count(0)
            groups.arrive()
        expect(card).to_contain_text("Lesson 2 of 8")
        expect(card).to_contain_text("Right: nothing is wrong with this group")

    def test_starting_again_forgets_the_answers_and_opens_the_first_lesson(
        self, lessons: tuple[Page, list[Json]]
    ) -> None:
        page, found = lessons
        page.goto("/help/practice")
        page.get_by_role("button", name="Start again").click()
        card = page.get_by_role("region", name="Practice")
        expect(card).to_contain_text("Lesson 1 of 8")
        before = "|".join(str(lesson["group"]) for lesson in found)
        expect(page).to_have_url(re.compile(rf"/review/(?!({before})\b)\d+$"))
        states = {
            lesson["state"] for lesson in page.request.get("/api/v1/practice").json()["lessons"]
        }
        assert states == {"open"}
        assert serious_in_both(page) == []

    def test_the_practice_on_a_recording_is_offered_below(
        self, lessons: tuple[Page, list[Json]]
    ) -> None:
        page, _ = lessons
        page.goto("/help/practice")
        part = page.get_by_role("region", name="With a recording")
        expect(part).to_contain_text("four known faults")
        expect(part.get_by_role("button", name="Make the recording")).to_be_visible()


MOST_KEYS = 5
"""From the cause that is seen to the verdict."""


class TestFiveKeys:
    def test_every_fault_is_mended_or_rejected_by_what_the_card_offers(
        self, lessons: tuple[Page, list[Json]]
    ) -> None:
        page, _ = lessons
        page.goto("/help/practice")
        page.get_by_role("button", name="Start again").click()
        expect(page.get_by_role("region", name="Practice")).to_contain_text("Lesson 1 of 8")
        for number, (lesson, scene) in enumerate(
            zip(LESSONS, make_practice_scenes(), strict=True), 1
        ):
            screen = Screen(page)
            expect(page.get_by_role("region", name="Practice")).to_contain_text(f"Lesson {number} ")
            screen.ready()
            used = self.answer(screen, lesson, scene)
            assert used <= MOST_KEYS, lesson.kind
        screen.saved()
        left = page.request.get("/api/v1/practice").json()["lessons"]
        assert [(one["number"], one["feedback"]) for one in left if one["state"] != "right"] == []

    def answer(self, screen: Screen, lesson: LessonRecipe, scene: Scene) -> int:
        """Do what the card offers; how many keys and clicks the first fault took."""
        card = screen.page.locator(".verdict-card")
        if lesson.kind in ("not_synchronous", "tiny_baseline"):
            screen.press("x", "Enter")
            return 2
        used = 0
        # Two lines are missing; the card goes on after the first, which is enough for the gate.
        offered = card.get_by_role("button", name="Draw it")
        while card.get_attribute("data-tone") == "bad" or offered.count():
            used = self.mend(screen, lesson, scene) + 1
        screen.press("a")
        return max(used, 1)

    @staticmethod
    def mend(screen: Screen, lesson: LessonRecipe, scene: Scene) -> int:
        page = screen.page
        before = screen.document()["etag"]
        expect(page.locator(".suggestion .button--fix")).to_be_visible()
        screen.press("Enter")
        # It may lead to a place, which it shows with the next frame.
        screen.drawn()
        keys = 1
        chip = page.locator(".drawing-chip")
        if lesson.kind == "missing_ball":
            expect(chip).to_be_visible()
            screen.press("0")
            screen.drawn()
            view = screen.document()["views"][lesson.view]
            box = scene.truth.views[lesson.view].ball_box
            page.mouse.click(*screen.place(view, *box.center))
            keys += 2
        if lesson.kind == "undrawn_line":
            expect(chip).to_be_visible()
            # Two clicks on the paint.
            view = screen.document()["views"][lesson.view]
            size = ImageSize(view["width"], view["height"])
            seen = project_markings(scene.truth.views[lesson.view].camera, Pitch(), size)
            line = seen[chip.locator("strong").inner_text()]
            screen.press("0")
            screen.drawn()
            for share in (0.2, 0.8):
                page.mouse.click(*screen.place(view, *line[int(share * len(line))]))
            screen.press("Escape")
            expect(chip).to_have_count(0)
            keys += 3
        until(page, lambda: screen.document()["etag"] != before)
        screen.saved()
        return keys


OUTSIDE = """() => {
  const card = document.querySelector('.help-page');
  const { bottom } = card.getBoundingClientRect();
  return [...card.querySelectorAll('*')]
    .filter((one) => one.getBoundingClientRect().bottom > bottom).map((one) => one.textContent);
}"""


class TestEverybody:
    def test_every_part_stands_inside_its_card(self, open_page: OpenPage) -> None:
        page = open_page(None, size={"width": 1100, "height": 700})
        for part in ("keys", "legend", "words", "guide", "practice"):
            page.goto(f"/help/{part}")
            expect(page.get_by_role("tabpanel").locator("p, dt").first).to_be_visible()
            assert page.evaluate(OUTSIDE) == [], part

    @pytest.mark.parametrize("part", ["keys", "legend", "practice"])
    def test_axe_finds_nothing_serious_in_both_schemes(
        self, open_page: OpenPage, part: str
    ) -> None:
        page = open_page(f"/help/{part}")
        expect(page.get_by_role("tabpanel").locator("p, dt").first).to_be_visible()
        assert serious_in_both(page) == []

    def test_axe_finds_nothing_serious_in_long_texts(self, open_page: OpenPage) -> None:
        # They have the colours of the other parts, so one scheme each is enough.
        page = open_page("/help/guide", scheme="light")
        expect(page.locator(".guide")).to_contain_text("The loop")
        assert serious(page) == []
        page.get_by_role("tab", name="Glossary").click()
        page.get_by_label("Find a word").fill("gate")
        page.emulate_media(color_scheme="dark", reduced_motion="reduce")
        assert serious(page) == []
