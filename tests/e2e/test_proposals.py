"""Lines that are proposed from the paint: looked for, drawn unlike any other, accepted with a key."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.screen import Document, Screen, on_present, passing, settled, until
from tests.e2e.test_access import serious_in_both
from tests.e2e.test_predictions import COUNT_PREDICTED

OpenPage = Callable[..., Page]

API = "/api/v1"
PROPOSALS = f"{API}/datasets/sample/proposals"


@pytest.fixture
def bare(open_page: OpenPage) -> Iterator[tuple[Page, int]]:
    """A page and a group whose main view has no lines; they are put back afterwards."""
    page = open_page(None)
    number = passing(page, 1)

    def draw(lines: Document) -> None:
        view = page.request.get(f"{API}/groups/{number}").json()["views"][0]["id"]
        on_present(
            page,
            number,
            lambda headers: page.request.patch(
                f"{API}/views/{view}/lines", data={"lines": lines}, headers=headers
            ),
        )

    before = page.request.get(f"{API}/groups/{number}").json()["views"][0]["lines"]
    draw(dict.fromkeys(before))
    yield page, number
    settled(page)
    now = page.request.get(f"{API}/groups/{number}").json()["views"][0]["lines"]
    draw({**dict.fromkeys(now), **before})
    assert page.request.delete(PROPOSALS).ok


def test_they_are_looked_for_drawn_and_accepted_with_one_key(bare: tuple[Page, int]) -> None:
    page, number = bare
    page.goto("/datasets/sample/statistics")
    card = page.locator('section[aria-labelledby="proposals-title"]')
    button = card.get_by_role("button", name="Propose lines for ")
    button.focus()
    page.keyboard.press("Enter")
    expect(card.locator('[data-result="proposals"]')).to_contain_text("proposed")
    match = screen_document(page, number)["match"]
    link = card.locator(f'[data-match="{match}"] [data-number="proposed"] a')
    expect(link).to_have_text("1")
    assert serious_in_both(page) == []
    link.click()
    # The head of the table is a row, too.
    expect(page.locator(".queue-table")).to_have_attribute("aria-rowcount", "2")

    page.goto(f"/review/{number}")
    screen = Screen(page)
    screen.ready()
    row = page.locator('.proposals [data-proposal="A"]')
    expect(row).to_contain_text("supported")
    expect(row).to_have_attribute("data-outcome", "proposed")
    until(page, lambda: page.evaluate(COUNT_PREDICTED) > 100)
    assert screen.document()["views"][0]["lines"] == {}
    title = page.locator(".verdict-card h1")
    expect(title).to_contain_text("proposed for A")
    expect(page.locator(".verdict-card__text")).to_contain_text("of its markings have paint")
    assert serious_in_both(page) == []
    page.keyboard.press("Enter")
    screen.saved()
    view = screen.document()["views"][0]
    assert view["proposed"] == sorted(view["lines"]) != []
    expect(page.locator('[data-proposed="A"]')).to_contain_text("accepted as")
    expect(row).to_be_hidden()
    expect(title).not_to_contain_text("proposed")
    page.keyboard.press("Control+z")
    expect(title).to_contain_text("proposed for A")
    page.keyboard.press("Shift+P")
    screen.saved()
    assert screen.document()["views"][0]["proposed"] == view["proposed"]
    page.keyboard.press("Control+z")
    expect(row).to_be_visible()
    screen.saved()
    assert screen.document()["views"][0]["lines"] == {}

    page.goto(f"/review/{number}/calibration?view={view['key']}")
    note = page.locator(".proposal-chip")
    expect(note).to_contain_text("proposed")
    assert serious_in_both(page) == []
    page.keyboard.press("Shift+P")
    expect(page.locator(".commit__state")).to_contain_text("Lines proposed")
    page.keyboard.press("Control+s")
    expect(page.locator('.save[data-unsaved="0"]')).to_contain_text("Saved")
    until(page, lambda: screen_document(page, number)["views"][0]["proposed"] == view["proposed"])


def test_the_card_offers_to_look_at_the_picture_of_a_view_without_lines(
    bare: tuple[Page, int],
) -> None:
    page, number = bare
    page.goto(f"/review/{number}")
    screen = Screen(page)
    screen.ready()
    box = page.get_by_role("group", name="What to do")
    expect(box.get_by_role("button", name="Propose lines")).to_be_visible()
    expect(box).not_to_contain_text("here mends it")
    page.keyboard.press("Enter")
    title = page.locator(".verdict-card h1")
    expect(title).to_contain_text("proposed for A", timeout=60_000)
    expect(page.locator('.proposals [data-proposal="A"]')).to_contain_text("supported")
    assert screen.document()["views"][0]["lines"] == {}
    page.keyboard.press("Enter")
    screen.saved()
    view = screen.document()["views"][0]
    assert view["proposed"] == sorted(view["lines"]) != []
    expect(box.get_by_role("button", name="Propose lines")).to_be_hidden()


def test_they_join_the_lines_that_determine_no_camera(bare: tuple[Page, int]) -> None:
    page, number = bare
    before = screen_document(page, number)
    view, name = before["views"][0], "Side line bottom"
    points = [{"x": 200.0, "y": 80.0}, {"x": 1000.0, "y": 90.0}]
    answer = page.request.patch(
        f"{API}/views/{view['id']}/lines",
        data={"lines": {name: points}},
        headers={"If-Match": before["etag"]},
    )
    assert answer.ok, answer.text()
    asked = page.request.post(PROPOSALS, data={}).json()
    until(page, lambda: page.request.get(f"{API}/jobs/{asked['id']}").json()["state"] == "done")
    page.goto(f"/review/{number}")
    screen = Screen(page)
    screen.ready()
    expect(page.locator(".verdict-card__text")).to_contain_text(f"“{name}” is drawn")
    page.keyboard.press("Enter")
    screen.saved()
    lines = screen.document()["views"][0]["lines"]
    assert lines[name] == points and len(lines) > 4
    page.keyboard.press("Control+z")
    screen.saved()
    until(page, lambda: list(screen.document()["views"][0]["lines"]) == [name])

    page.goto(f"/review/{number}/calibration?view={view['key']}")
    expect(page.locator(".proposal-chip")).to_contain_text("proposed")
    page.keyboard.press("Shift+P")
    expect(page.locator(".commit__state")).to_contain_text("Lines proposed")
    page.keyboard.press("Control+s")
    expect(page.locator('.save[data-unsaved="0"]')).to_contain_text("Saved")
    until(page, lambda: name not in (now(page, number)["proposed"] or [name]))
    assert now(page, number)["lines"][name] == points


def now(page: Page, number: int) -> Document:
    """The group's first view as the server has it."""
    view: Document = screen_document(page, number)["views"][0]
    return view


def screen_document(page: Page, number: int) -> Document:
    """The group as the server has it."""
    document: Document = page.request.get(f"{API}/groups/{number}").json()
    return document
