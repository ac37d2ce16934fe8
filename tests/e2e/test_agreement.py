"""Paint of a dataset, where people meet it: agreement in views, queue and yield; reading it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.e2e.screen import Screen
from tests.e2e.service import run_touchline, serving
from tests.e2e.test_access import serious
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
    expect(page.locator('.histogram[aria-label="paint agrees"] svg')).to_be_visible()

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
    page.get_by_label("Use the threshold “Smallest agreement with the paint”").check()
    # Asked for as it is first offered: another number goes in once that is answered.
    first = page.locator(".funnel").get_by_role("row", name="Agreement with the paint ≥")
    expect(first).to_contain_text(re.compile(r"\d"))
    asked = page.get_by_label("Smallest agreement with the paint", exact=True)
    asked.fill("1")
    asked.press("Enter")
    expect(step).to_contain_text(re.compile("−[1-9]"))


def test_the_pictures_of_a_match_are_read_and_taken_back_by_keyboard(
    painted: str, open_page: Callable[..., Page]
) -> None:
    page = open_page("/datasets/sample/statistics", address=painted)
    card = page.get_by_role("region", name="Paint of the pictures")
    unread = card.locator("tbody tr").filter(has_text="the paint of none").first
    name = unread.get_by_role("rowheader").inner_text().split("\n")[0]
    row = card.locator("tbody tr").filter(has_text=name)
    row.get_by_role("button", name=f"Read {name}").press("Enter")
    expect(row).to_contain_text("by their paint")
    expect(row.get_by_role("button")).to_have_count(0)
    expect(card.get_by_role("heading")).to_be_focused()
    assert serious(page) == []
    back = card.get_by_role("button", name="Undo the last reading")
    expect(back).to_have_attribute("aria-disabled", "false")
    back.press("Enter")
    expect(row).to_contain_text("The paint of none")


def test_what_was_read_for_other_thresholds_is_counted_and_read_again_from_its_finding(
    painted: str, open_page: Callable[..., Page]
) -> None:
    path = f"{painted}/api/v1/datasets/sample/policy"
    etag = httpx.get(path).headers["etag"]
    body = {"values": {"calibration.robust_scale_px": 2.5}}
    assert httpx.put(path, json=body, headers={"If-Match": etag}).is_success
    page = open_page("/datasets/sample/statistics", address=painted)
    row = page.get_by_role("region", name="Paint of the pictures").locator("tbody tr")
    expect(row.filter(has_text="to be read again")).to_have_count(1)

    page.goto("/groups?q=finding:no_paint")
    expect(page.locator("[data-number=agreement]").first).to_be_visible()
    page.keyboard.press("Enter")
    Screen(page).ready()
    again = page.get_by_role("button", name="Read its paint")
    again.first.press("Enter")
    expect(again).to_have_count(0)
    solved = Screen(page).document()["solution"]["views"]
    assert "paint" in {view["calibration"]["source"] for view in solved}
