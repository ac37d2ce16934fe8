"""A page by Tab alone: every control is reached, seen while it has the focus, in order, and left again."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from playwright.sync_api import Page

FARTHEST = 200
"""Presses of Tab within which a page comes round."""

CONTROLS = """() => {
  const root = document.querySelector('dialog[open]') ?? document.body;
  const all = root.querySelectorAll('a[href], button, input, select, textarea, summary, [tabindex="0"]');
  // Of radio buttons of one question Tab leads to one, and arrows to the others.
  return [...all].filter((one) => !(one.type === 'radio' && !one.checked)).filter((one) => one.checkVisibility({ visibilityProperty: true }) && !one.disabled
    && one.tabIndex >= 0 && one.getBoundingClientRect().width > 0)
    .map((one, number) => { one.dataset.walked ??= `${number}`; return one.dataset.walked; });
}"""
"""Numbers every control that a mouse finds."""

FOCUSED = """() => {
  const one = document.activeElement;
  if (!one || one === document.body) return null;
  const style = getComputedStyle(one);
  const box = one.getBoundingClientRect();
  const broad = style.outlineStyle === 'none' ? 0 : parseFloat(style.outlineWidth);
  // A ring may lie inside of what it surrounds.
  const reach = Math.max(broad + parseFloat(style.outlineOffset), 0);
  const ring = { left: box.left - reach, right: box.right + reach, top: box.top - reach, bottom: box.bottom + reach };
  const name = (one.getAttribute('aria-label') || one.textContent || one.name || one.tagName).trim().slice(0, 40);
  const faults = [];
  if (broad < 2) faults.push('has no ring');
  for (let up = one.parentElement; up; up = up.parentElement) {
    const clips = getComputedStyle(up);
    if (clips.overflowX === 'visible' && clips.overflowY === 'visible') continue;
    const frame = up.getBoundingClientRect();
    const [left, top] = [frame.left + up.clientLeft, frame.top + up.clientTop];
    const cut = Math.max(left - ring.left, ring.right - left - up.clientWidth, top - ring.top, ring.bottom - top - up.clientHeight);
    // Of what is larger than its frame no scrolling shows all.
    const fits = ring.right - ring.left <= up.clientWidth && ring.bottom - ring.top <= up.clientHeight;
    if (fits && cut > 0.6) faults.push(`its ring is cut by ${cut.toFixed(1)} px of ${up.className || up.tagName}`);
  }
  const [x, y] = [box.left + Math.min(box.width / 2, 40), box.top + box.height / 2];
  const hit = document.elementFromPoint(x, y);
  if (!hit || !(one.contains(hit) || hit.contains(one))) faults.push(`lies under ${hit?.className || hit?.tagName}`);
  const card = one.closest('section, header, dialog');
  const origin = card ? card.getBoundingClientRect() : { top: 0, left: 0 };
  return { number: one.dataset.walked ?? null, name, faults, card: card?.getAttribute('aria-label') ?? card?.className ?? '', top: box.top - origin.top, bottom: box.bottom - origin.top };
}"""


def walk(page: Page) -> list[dict[str, Any]]:
    """What Tab leads to, until it comes round."""
    seen: list[dict[str, Any]] = []
    for _ in range(FARTHEST):
        page.keyboard.press("Tab")
        one = page.evaluate(FOCUSED)
        if one is None:
            continue
        if any(one["number"] == other["number"] for other in seen):
            return seen
        seen.append(one)
    raise AssertionError("Tab does not come round")


def faults_of(page: Page) -> list[str]:
    """What is wrong with the page for somebody who has no mouse."""
    controls = page.evaluate(CONTROLS)
    seen = walk(page)
    found = [f"{one['card']}: {one['name']} {fault}" for one in seen for fault in one["faults"]]
    reached = {one["number"] for one in seen}
    for number in controls:
        if number not in reached:
            text = page.locator(f'[data-walked="{number}"]').evaluate("(one) => one.outerHTML")
            found.append(f"never reached: {text[:120]}")
    for one, other in pairwise(seen):
        if one["card"] == other["card"] and other["bottom"] <= one["top"]:
            found.append(f"{one['card']}: {other['name']} comes after {one['name']}, above it")
    there = page.evaluate(FOCUSED)["number"]
    page.keyboard.press("Shift+Tab")
    back = page.evaluate(FOCUSED)
    if back is not None and back["number"] == there:
        found.append(f"Shift+Tab does not lead back from {back['name']}")
    return found
