"""The place in a queue stays true while groups leave it, and the header leads everywhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from urllib.parse import quote

import pytest
from playwright.sync_api import Page, expect

from tests.e2e.screen import Screen, judge, settled, until

OpenPage = Callable[..., Page]

QUERY = "status:unreviewed number>=4 number<=9"
"""Six groups, each of which leaves the queue once it is judged."""
KEPT = "() => JSON.parse(sessionStorage.getItem('touchline.walk')).ids"
SMALL = {"width": 1100, "height": 700}


def ids(page: Page) -> list[int]:
    """The groups of the queue, in order."""
    params = {"dataset": "sample", "q": QUERY}
    found: list[int] = page.request.get("/api/v1/groups/ids", params=params).json()["ids"]
    return found


def stands(page: Page, group: int, *texts: str) -> None:
    """Wait for a group, and for what the header says about its place."""
    page.wait_for_url(f"**/review/{group}?*")
    for text in texts:
        expect(page.locator(".header__place")).to_contain_text(text)


@pytest.fixture
def page(open_page: OpenPage) -> Iterator[Page]:
    """The first group of the queue on a small screen; verdicts are taken back in the end."""
    page: Page = open_page(None, size=SMALL)
    for group in range(4, 10):
        judge(page, group, "unreviewed")
    queue = ids(page)
    assert len(queue) == 6
    page.goto(f"/review/{queue[0]}?q={quote(QUERY)}")
    Screen(page).ready()
    yield page
    settled(page)
    for group in queue:
        judge(page, group, "unreviewed")


class TestWalk:
    def test_a_pass_counts_forward_from_the_queue_as_it_was(self, page: Page) -> None:
        queue, keys = ids(page), page.keyboard
        stands(page, queue[0], "group 1 of 6")
        expect(page.locator(".header__done")).to_have_count(0)
        keys.press("s")
        stands(page, queue[1], "group 2 of 6", "1 done, 5 left")
        # One is passed without a verdict: it is still to do.
        keys.press("f")
        stands(page, queue[2], "group 3 of 6", "1 done, 5 left")
        keys.press("s")
        stands(page, queue[3], "group 4 of 6", "2 done, 4 left")
        page.reload()
        stands(page, queue[3], "group 4 of 6", "2 done, 4 left")
        keys.press("d")
        stands(page, queue[1], "group 2 of 6", "2 done, 4 left")
        keys.press("Control+z")
        stands(page, queue[2], "group 3 of 6", "1 done, 5 left")

    def test_another_query_begins_anew(self, page: Page) -> None:
        queue = ids(page)
        stands(page, queue[0], "group 1 of 6")
        page.keyboard.press("s")
        stands(page, queue[1], "1 done, 5 left")
        # A verdict that the next page sends is one of its own pass.
        settled(page)
        page.goto(f"/review/{queue[1]}?q={quote(QUERY + ' sort:number-desc')}")
        stands(page, queue[1], "group 5 of 5")
        expect(page.locator(".header__done")).to_have_count(0)

    def test_what_others_judge_meanwhile_is_not_left(self, page: Page) -> None:
        queue = ids(page)
        stands(page, queue[0], "group 1 of 6")
        # The queue is kept as it was before somebody else judges.
        until(page, lambda: page.evaluate(KEPT) == queue)
        judge(page, queue[5], "deferred")
        page.keyboard.press("s")
        stands(page, queue[1], "group 2 of 6", "1 done, 4 left")

    def test_at_1100_the_header_keeps_yield_and_evaluation_and_nothing_collides(
        self, page: Page
    ) -> None:
        queue = ids(page)
        stands(page, queue[0], "group 1 of 6")
        page.keyboard.press("s")
        stands(page, queue[1], "group 2 of 6", "1 done, 5 left")
        for name in ("Review", "Queue", "Yield", "Evaluation"):
            link = page.get_by_role("navigation", name="Pages", exact=True).get_by_role(
                "link", name=name
            )
            expect(link).to_be_visible()
        until(page, lambda: collisions(page, ".header") == [])


COLLISIONS = """(selector) => {
  const leaves = [];
  for (const node of document.querySelectorAll(`${selector} *`)) {
    const own = [...node.childNodes].some((one) => one.nodeType === 3 && one.data.trim());
    const style = getComputedStyle(node);
    const hidden = node.closest('.hidden-text, [popover], script, title, option, select, kbd');
    if (!own || hidden || !node.checkVisibility() || style.visibility === 'hidden' || style.opacity === '0') continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const box of range.getClientRects()) {
      // What overflows a clipping parent is not seen.
      let clip = { left: 0, top: 0, right: innerWidth, bottom: innerHeight };
      for (let up = node; up && up !== document.body; up = up.parentElement) {
        if (getComputedStyle(up).overflowX === 'visible') continue;
        const { left, top, right, bottom } = up.getBoundingClientRect();
        clip = { left: Math.max(clip.left, left), top: Math.max(clip.top, top),
          right: Math.min(clip.right, right), bottom: Math.min(clip.bottom, bottom) };
      }
      const seen = { left: Math.max(box.left, clip.left), top: Math.max(box.top, clip.top),
        right: Math.min(box.right, clip.right), bottom: Math.min(box.bottom, clip.bottom) };
      if (seen.right - seen.left > 1 && seen.bottom - seen.top > 1) {
        leaves.push({ node, seen, text: node.textContent.trim().slice(0, 40) });
      }
    }
  }
  const found = [];
  for (const [at, a] of leaves.entries()) {
    for (const b of leaves.slice(at + 1)) {
      if (a.node.contains(b.node) || b.node.contains(a.node)) continue;
      const wide = Math.min(a.seen.right, b.seen.right) - Math.max(a.seen.left, b.seen.left);
      const high = Math.min(a.seen.bottom, b.seen.bottom) - Math.max(a.seen.top, b.seen.top);
      if (wide > 1 && high > 4) found.push(`${a.text} | ${b.text}`);
    }
  }
  return found;
}"""
"""Pairs of texts that lie upon each other."""


def collisions(page: Page, selector: str) -> list[str]:
    """Pairs of texts within a part of the page that lie upon each other."""
    found: list[str] = page.evaluate(COLLISIONS, selector)
    return found
