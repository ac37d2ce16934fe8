"""How far cameras agree with their paint, where people meet it: views, queue, yield."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.screen import Screen
from tests.e2e.service import run_touchline, serving
from tests.homes import copy_home

MATCH = "meridia_premier-division/2025-2026/2025-08-16 - 20-45 Marlowick 2 - 0 Port Selwin"


@pytest.fixture(scope="module")
def painted(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a server over the sample with cameras from the paint of one match's pictures."""
    home = copy_home(sample, tmp_path_factory)
    run_touchline(
        home,
        "policy set touchline --dataset sample",
        f'paint sample --match "{MATCH}"',
        "solve --dataset sample --workers 1",
    )
    with serving(home) as address:
        yield address


def test_agreement_is_told_of_views_and_finds_groups_and_may_be_asked_for(
    painted: str, open_page: Callable[..., Page]
) -> None:
    page = open_page("/groups?q=sort:agreement+agreement>0", address=painted)
    cells = page.locator('[data-number="agreement"]')
    expect(cells.first).to_have_text(re.compile(r"0\.\d\d"))
    shown = [float(text) for text in cells.all_inner_texts()]
    assert shown == sorted(shown) and len(shown) > 1
    expect(page.get_by_role("columnheader", name="paint")).to_have_attribute(
        "aria-sort", "ascending"
    )
    expect(page.locator('.histogram[aria-label="agreement with paint"] svg')).to_be_visible()

    page.keyboard.press("Enter")
    screen = Screen(page)
    screen.ready()
    fit = screen.document()["solution"]["views"][0]["calibration"]["paint"]
    line = page.locator('[data-paint="A"]')
    expect(line).to_contain_text(f"supported {100 * fit['supported']:.0f} %")
    expect(line).to_contain_text(f"explained {100 * fit['explained']:.0f} %")
    line.get_by_text("explained").hover()
    expect(page.get_by_role("tooltip")).to_contain_text("line-like paint")

    page.goto("/datasets/sample/yield")
    step = page.locator(".funnel").get_by_role("row", name="Agreement with the paint ≥ 1")
    expect(page.locator(".yield__difference")).to_be_visible()
    expect(step).to_have_count(0)
    page.get_by_label("Smallest agreement with the paint is asked").check()
    # Asked for as it is first offered: another number goes in once that is answered.
    first = page.locator(".funnel").get_by_role("row", name="Agreement with the paint ≥")
    expect(first).to_contain_text(re.compile(r"\d"))
    asked = page.get_by_label("Smallest agreement with the paint", exact=True)
    asked.fill("1")
    asked.press("Enter")
    expect(step).to_contain_text(re.compile("−[1-9]"))
