"""The ball of a view followed through the groups before and after: shown, looked at, accepted by a key, taken back by one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from tests.e2e.screen import Screen, judge, until
from tests.e2e.service import serving
from tests.e2e.test_access import serious_in_both
from tests.filmed_rigs import filmed_groups
from tests.flights import FIRST
from tests.homes import copy_home, once_for_all

OpenPage = Callable[..., Page]
COUNT, CLICKED, HIDDEN = 16, 6, 11
"""Groups; the one whose ball is annotated; the one that shows none."""
API = "/api/v1"


def build(folder: Path) -> None:
    """A rig of which one camera has one ball."""
    (folder / "home").mkdir()
    (folder / "home" / "film").mkdir()
    groups = filmed_groups(
        folder / "home" / "film", COUNT, "cam1", said=[FIRST + CLICKED], hidden=[FIRST + HIDDEN]
    )
    store = Store.open(Settings(home=folder / "home"))
    try:
        import_groups(store, "rolling", groups, source="test", actor="local")
        solve_dataset(store, "rolling")
    finally:
        store.close()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    home = once_for_all(tmp_path_factory, "rolling", build)
    with serving(copy_home(home, tmp_path_factory)) as address:
        yield address


def groups_of(page: Page) -> list[dict[str, Any]]:
    """The groups with their documents, in order."""
    rows = page.request.get(f"{API}/groups", params={"dataset": "rolling", "limit": 50}).json()
    return [page.request.get(f"{API}/groups/{row['id']}").json() for row in rows["items"]]


def sources(page: Page) -> list[str | None]:
    """Where the ball of the camera in each group comes from; "" where there is none."""
    found = []
    for group in groups_of(page):
        view = next(view for view in group["views"] if view["key"] == "cam1")
        found.append(view["balls"][0]["predicted_by"] if view["balls"] else "")
    return found


def test_a_ball_is_followed_looked_at_accepted_and_taken_back(
    server: str, open_page: OpenPage
) -> None:
    page = open_page(None, address=server)
    ids = [group["id"] for group in groups_of(page)]
    before = ["", None]
    assert sources(page) == [before[place == CLICKED] for place in range(COUNT)]
    page.goto(f"{server}/review/{ids[CLICKED]}")
    screen = Screen(page)
    screen.ready()
    page.keyboard.press("Shift+Q")
    card = page.locator(".follow")
    expect(card).to_have_attribute("aria-busy", "false", timeout=60_000)
    expect(card).to_contain_text("no more groups")
    expect(card).to_contain_text("1 uncertain view is left out")
    expect(card.locator('[data-state="followed"]')).to_have_count(COUNT - 2)
    assert sources(page) == [before[place == CLICKED] for place in range(COUNT)]
    assert serious_in_both(page) == []

    page.get_by_role("button", name="Look at the next").click()
    page.wait_for_url(f"**/review/{ids[HIDDEN]}*")
    screen.ready()
    expect(card.locator('[data-here="true"]')).to_have_attribute("data-state", "uncertain")
    page.keyboard.press("Shift+Q")
    notice = page.locator(".bars .bar")
    expect(notice).to_contain_text(f"{COUNT - 2} balls placed")
    said = f"followed from {FIRST + CLICKED}"
    wanted = [said] * COUNT
    wanted[CLICKED], wanted[HIDDEN] = None, ""
    assert sources(page) == wanted

    # A group that was judged since gives its ball back all the same.
    judge(page, ids[CLICKED + 1], "deferred")

    # The uncertain one is this person's to say.
    page.keyboard.press("y")
    expect(notice).to_contain_text("1 ball placed")
    expect(card).to_be_hidden()
    assert sources(page)[HIDDEN] == said
    page.keyboard.press("Control+z")
    expect(notice).to_contain_text("1 ball removed again")
    page.keyboard.press("Control+z")
    expect(notice).to_contain_text(f"{COUNT - 2} balls removed again")
    assert sources(page) == [before[place == CLICKED] for place in range(COUNT)]
    page.keyboard.press("Control+y")
    expect(notice).to_contain_text(f"{COUNT - 2} balls placed again")
    page.keyboard.press("Control+z")
    until(page, lambda: sources(page) == [before[place == CLICKED] for place in range(COUNT)])


def test_it_is_left_by_escape_and_said_why_where_it_cannot_be(
    server: str, open_page: OpenPage
) -> None:
    page = open_page(None, address=server)
    ids = [group["id"] for group in groups_of(page)]
    page.goto(f"{server}/review/{ids[0]}")
    screen = Screen(page)
    screen.ready()
    page.keyboard.press("Shift+Q")
    expect(page.locator(".bars .bar")).to_contain_text("View A has no ball to follow")
    page.goto(f"{server}/review/{ids[CLICKED]}")
    screen.ready()
    page.get_by_role("button", name="Follow the ball of view A").click()
    card = page.locator(".follow")
    expect(card).to_have_attribute("aria-busy", "false", timeout=60_000)
    page.keyboard.press("Escape")
    expect(card).to_be_hidden()
