"""Everybody can use it: axe finds nothing serious, nothing is cut off, at any size and scheme."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Error, Page, expect

from tests.e2e.screen import TWO_FRAMES

OpenPage = Callable[..., Page]

AXE = Path(__file__).resolve().parents[2] / "static" / "node_modules" / "axe-core" / "axe.min.js"
SIZES = [(1440, 900), (1100, 700), (1920, 1080)]
OF_COLOURS = ("color-contrast", "link-in-text-block")
"""The rules that ask for colours, which is all that the scheme changes."""
PAGES = {"queue": "/groups", "review": "/review/1"}


def serious(page: Page, rules: tuple[str, ...] = ()) -> list[str]:
    """What axe calls serious or critical, with the first place of each; by default of all rules."""
    if not page.evaluate("() => 'axe' in window"):
        page.evaluate(AXE.read_text(encoding="utf-8"))
    options = {"resultTypes": ["violations"], **({"runOnly": list(rules)} if rules else {})}
    found: list[dict[str, Any]] = page.evaluate(
        "async (options) => (await axe.run(options)).violations", options
    )
    return [
        f"{violation['id']}: {violation['nodes'][0]['html'][:160]} {violation['nodes'][0]['failureSummary'][:200]}"
        for violation in found
        if violation["impact"] in ("serious", "critical")
    ]


def serious_in_both(page: Page) -> list[str]:
    """What axe calls serious on the page as it stands, in the dark and in the light."""
    # Colours must not be on their way when they are measured.
    page.emulate_media(color_scheme="light", reduced_motion="reduce")
    found = [f"light: {fault}" for fault in serious(page)]
    page.emulate_media(color_scheme="dark", reduced_motion="reduce")
    return found + [f"dark: {fault}" for fault in serious(page, OF_COLOURS)]


def soon(page: Page, faults: str) -> list[str]:
    """What a script finds once the page has come to rest; the last of it, where it never does."""
    with suppress(Error):
        page.wait_for_function(f"() => ({faults})().length === 0")
        return []
    found: list[str] = page.evaluate(faults)
    return found


def resize(page: Page, width: int, height: int) -> None:
    """Give the page another size, and time to hear of it: what stood before must not be judged."""
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_function(f"() => innerWidth === {width} && innerHeight === {height}")
    page.evaluate(TWO_FRAMES)


def shown(open_page: OpenPage, name: str) -> Page:
    """A page with everything on it."""
    page = open_page(PAGES[name])
    waited = ".image-panel__stage[data-ready=true]" if name == "review" else ".queue-row a"
    page.wait_for_selector(waited)
    expect(page.locator('[aria-busy="true"]')).to_have_count(0)
    return page


CUT_OFF = """() => [...document.querySelectorAll('h1, h2, th, td, dd, dt, .button, .gates__value,'
    + ' .line-row__value, .crop__caption, .caption__state, .pill, .verdict-card__text')]
  .filter((element) => {
    const box = element.getBoundingClientRect();
    if (box.width === 0 || element.closest('.hidden-text') || element.closest('dialog')) return false;
    const scroller = element.closest('.rail__scroll, .queue-table__rows');
    const outside = box.right > innerWidth + 1 || box.left < -1
      || (!scroller && box.bottom > innerHeight + 1);
    return outside || element.scrollWidth > element.clientWidth + 1
      && getComputedStyle(element).display !== 'inline';
  })
  .map((element) => `${element.className || element.tagName}: ${element.textContent.trim()}`)"""

BEYOND_ITS_FRAME = """() => [...document.querySelectorAll('main, dialog[open], [popover]:popover-open')]
  .flatMap((root) => [...root.querySelectorAll('h2, h3, th, td, dt, dd, label, legend, .button, .pill, .note')])
  .filter((element) => {
    const box = element.getBoundingClientRect();
    if (box.width === 0 || element.closest('.hidden-text, .code')) return false;
    const frame = element.closest('.table__scroll, dialog, [popover], main').getBoundingClientRect();
    return box.right > frame.right + 1 || box.left < frame.left - 1;
  })
  .map((element) => `${element.className || element.tagName}: ${element.textContent.trim().slice(0, 60)}`)"""

NESTED_SCROLLERS = """() => {
  const scrolls = (element) => /auto|scroll/.test(getComputedStyle(element).overflowY)
    && element.scrollHeight > element.clientHeight + 1;
  return [...document.querySelectorAll('*')].filter(scrolls).filter((element) => {
    for (let up = element.parentElement; up; up = up.parentElement) if (scrolls(up)) return true;
    return false;
  }).map((element) => element.className);
}"""


TOO_WIDE = "() => (document.documentElement.scrollWidth > innerWidth ? ['the page'] : [])"


def fits(page: Page) -> None:
    """Everybody can use the screen as it stands, in both schemes and at every size."""
    found: dict[str, Any] = {"axe": serious_in_both(page)}
    for width, height in SIZES:
        resize(page, width, height)
        found[f"cut off at {width}"] = soon(page, CUT_OFF)
        found[f"scrolls twice at {width}"] = soon(page, NESTED_SCROLLERS)
        found[f"wider than {width}"] = soon(page, TOO_WIDE)
    assert {name: what for name, what in found.items() if what} == {}


@pytest.mark.parametrize("name", list(PAGES))
class TestScreens:
    def test_everybody_can_use_it_at_every_size(self, open_page: OpenPage, name: str) -> None:
        fits(shown(open_page, name))

    def test_everybody_can_use_its_dialogs(self, open_page: OpenPage, name: str) -> None:
        page = shown(open_page, name)
        if name == "queue":
            page.get_by_role("button", name="Export").first.click()
        else:
            page.keyboard.press("i")
            page.keyboard.press("x")
        page.wait_for_selector("dialog[open], .reasons")
        assert serious_in_both(page) == []
