"""Numbers that compare: margins as shares, logarithmic histograms, and JaC only where measured."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from shutil import rmtree

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.film import write_film
from tests.e2e.screen import Screen, at_rest, rows
from tests.e2e.service import run_touchline, serving
from tests.e2e.test_queue_walk import SMALL, collisions

OpenPage = Callable[..., Page]

PAGES = {
    "/groups?dataset=sample&q=sort:value": ".histogram .bin-axis span",
    "/datasets/sample/yield": ".funnel",
    "/datasets/sample/policy": ".policy__text",
    "/datasets/sample/statistics": ".spread",
    "/datasets/sample/evaluation": ".run-form",
    "/datasets/sample/versions": ".empty",
    "/datasets": ".dataset-card",
}


class TestMargins:
    def test_the_queue_says_shares_and_is_sorted_by_them(self, open_page: OpenPage) -> None:
        page = open_page("/groups?dataset=sample&q=sort:margin")
        first = page.locator(".queue-row:not(.queue-row--head)").first
        expect(first.locator('[data-short="true"]')).to_have_text(re.compile(r"^<?−\d+ %$"))
        listed = [row["margin"] for row in rows(page)]
        known = sorted(margin for margin in listed if margin is not None)
        answer = page.request.get("/api/v1/groups?dataset=sample&limit=100&q=sort:margin").json()
        shown = [row["margin"] for row in answer["items"]]
        assert [margin for margin in shown if margin is not None] == known
        gates = page.request.get(f"/api/v1/groups/{answer['items'][-1]['id']}").json()["solution"]
        for gate in gates["gates"]:
            if gate["margin"] is None:
                continue
            off = gate["value"] - gate["threshold"]
            less = gate["name"] in ("reprojection", "sigma")
            assert gate["margin"] == pytest.approx((-off if less else off) / gate["threshold"])

    def test_a_gate_that_fails_says_by_which_share_it_misses(self, open_page: OpenPage) -> None:
        page = open_page("/groups?dataset=sample&q=margin<-0.05")
        page.locator(".queue-row a").first.click()
        screen = Screen(page)
        screen.ready()
        failing = screen.document()["solution"]["first_failing"]["gate"]
        screen.press("g")
        told = page.locator(f'[data-gate="{failing}"] .gates__margin')
        expect(told).to_have_text(re.compile(r"^misses by (over )?[\d.]+ %$"))

    def test_the_value_of_review_explains_itself_where_it_is_chosen_and_on_the_column(
        self, open_page: OpenPage
    ) -> None:
        page = open_page("/groups?dataset=sample")
        expect(page.locator(".queue-tools__order")).to_have_count(0)
        page.get_by_label("Order").select_option("value")
        expect(page.locator(".queue-tools__order")).to_contain_text("closest to a gate’s threshold")
        expect(page.get_by_label("Order")).to_have_attribute(
            "title", re.compile("closest to a gate")
        )
        column = page.get_by_role("columnheader", name="margin")
        expect(column.locator("small")).to_have_text("by value")
        expect(column.locator("button")).to_have_attribute("data-term", "column:margin")


class TestLogarithmicHistograms:
    @pytest.mark.parametrize("name", ["ball error, %", "σ, m"])
    def test_a_brushed_bar_finds_exactly_the_groups_that_it_counts(
        self, open_page: OpenPage, name: str
    ) -> None:
        page = open_page("/groups?dataset=sample")
        card = page.get_by_label(name, exact=True)
        expect(card.locator(".bin-axis span").first).to_have_text("0.01")
        tall = [
            int(float(height))
            for height in card.locator("rect").evaluate_all(
                "bars => bars.map(b => b.getAttribute('height'))"
            )
        ]
        # Spread over several bars; on an even scale nearly all would stand in the first.
        assert sum(height > 1 for height in tall) >= 3
        bar = card.locator("rect").nth(tall.index(max(tall)))
        counted = int(re.search(r"(\d+) groups?$", bar.locator("title").text_content() or "")[1])
        box = at_rest(bar)
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        expect(page.locator(".field--query")).to_have_value(re.compile(r">=[\d.]+ \w+<[\d.]+$"))
        expect(page.locator(".save")).to_contain_text(f"{counted} of 14 match")

    def test_the_statistics_have_powers_of_ten_below_their_bars(self, open_page: OpenPage) -> None:
        page = open_page("/datasets/sample/statistics")
        for label in ("Uncertainty", "Reprojection error"):
            card = page.locator(".spread").filter(has_text=label)
            expect(card.locator(".bin-axis span").first).to_have_text("0.01")
            texts = card.locator(".bin-axis span").all_inner_texts()
            assert texts[:3] == ["0.01", "0.1", "1"]
            assert texts[-1].endswith("+")


class TestAt1100:
    def test_no_two_texts_lie_upon_each_other_and_yield_and_evaluation_are_there(
        self, open_page: OpenPage
    ) -> None:
        page = open_page(None, size=SMALL)
        found = {}
        for path, waited in PAGES.items():
            page.goto(path)
            page.wait_for_selector(waited)
            for name in ("Yield", "Evaluation"):
                pages = page.get_by_role("navigation", name="Pages", exact=True)
                expect(pages.get_by_role("link", name=name)).to_be_visible()
            found[path] = collisions(page, "body")
        assert {path: texts for path, texts in found.items() if texts} == {}


@pytest.fixture(scope="module")
def unmeasured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a server with a dataset whose cameras came with it, without any field line."""
    home = tmp_path_factory.mktemp("given-home")
    folder = write_film(tmp_path_factory.mktemp("given"))
    rmtree(folder / "lines")
    run_touchline(
        home,
        "migrate",
        f"import issia {folder} --dataset given",
        "solve --dataset given --workers 1",
    )
    with serving(home) as address:
        yield address


@pytest.fixture
def given(open_page: OpenPage, unmeasured: str) -> Page:
    """A page of that server."""
    return open_page(None, size=SMALL, address=unmeasured)


class TestUnmeasuredJac:
    def test_the_yield_draws_no_jac_that_nobody_measured(self, given: Page) -> None:
        given.goto("/datasets/given/yield")
        curves = given.get_by_role("region", name="Groups that qualify, by JaC threshold")
        expect(curves).to_contain_text("JaC was not measured here: the cameras were given.")
        expect(curves.locator("canvas")).to_have_count(0)
        expect(given.locator('.funnel [data-measured="false"]')).to_contain_text("not measured")
        # JaC and its tolerance were not measured, and no paint was read.
        expect(given.locator(".threshold__idle")).to_have_count(3)
        assert collisions(given, "body") == []

    def test_the_queue_says_why_it_has_no_bars(self, given: Page) -> None:
        given.goto("/groups?dataset=given")
        card = given.get_by_label("min JaC 0.5 %", exact=True)
        expect(card).to_contain_text("JaC needs drawn field lines and a camera")
        assert collisions(given, "body") == []
