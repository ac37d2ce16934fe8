"""The pictures of the documents, taken from the product itself: ``python -m tests.e2e.pictures``.

A fresh home with a sample and the practice groups is made, served, and looked at by a browser. Run it
whenever the screens have changed; each picture stays below 300 kB.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, sync_playwright

from tests.e2e.install_chromium import find_chromium
from tests.e2e.screen import Screen, rows
from tests.e2e.service import ROOT, run_touchline, serving

OUT = ROOT / "docs" / "images"
GROUPS = 24
SIZE = {"width": 1440, "height": 900}
MOST_BYTES = 300_000
QUALITIES = (88, 80, 72, 64, 56, 48)


def save(page: Page, name: str) -> None:
    """Write a picture of the window, as good as its size allows."""
    page.wait_for_load_state("networkidle")
    # Tooltips, fades and frames come to rest.
    page.wait_for_timeout(900)
    for quality in QUALITIES:
        picture = page.screenshot(type="jpeg", quality=quality)
        if len(picture) < MOST_BYTES:
            (OUT / name).write_bytes(picture)
            return
    raise ValueError(f"{name} does not fit into {MOST_BYTES} bytes")


def review_of(page: Page, group: int) -> Screen:
    """The review screen of a group, its frames drawn."""
    page.goto(f"/review/{group}")
    screen = Screen(page)
    screen.ready("A")
    screen.ready("B")
    return screen


def choose(page: Page, fits: Callable[[dict[str, Any]], bool]) -> int:
    """The first group of the sample that fits."""
    return int(next(row["id"] for row in rows(page) if fits(row)))


def take(page: Page) -> None:
    """Every picture, one after the other."""
    page.goto("/groups?dataset=sample")
    page.wait_for_selector(".queue-row a")
    save(page, "queue.jpg")
    sound = choose(page, lambda row: row["passes"] and not row["findings"] and row["views"] == 3)
    screen = review_of(page, sound)
    save(page, "review.jpg")
    view = screen.document()["views"][0]
    x, y, width, height = view["balls"][0]["box"]
    page.mouse.move(*screen.place(view, x + width / 2, y + height / 2))
    page.keyboard.down("z")
    page.wait_for_selector(".loupe")
    save(page, "review-loupe.jpg")
    page.keyboard.up("z")
    review_of(page, choose(page, lambda row: not row["passes"] and bool(row["findings"])))
    save(page, "review-remedy.jpg")
    lessons = page.request.get("/api/v1/practice").json()["lessons"]
    review_of(page, lessons[1]["group"])
    page.wait_for_selector(".lesson__question")
    page.keyboard.press("x")
    page.keyboard.press("1")
    page.wait_for_selector('.lesson__feedback[data-state="wrong"]')
    Screen(page).ready("B")
    save(page, "practice.jpg")


def main() -> None:
    """Make a home, serve it, take the pictures."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder) / "home"
        run_touchline(home, "migrate", f"sample --dataset sample --groups {GROUPS}", "practice")
        with serving(home) as address, sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=find_chromium())
            context = browser.new_context(
                base_url=address,
                viewport=SIZE,  # type: ignore[arg-type]
                color_scheme="dark",
            )
            page = context.new_page()
            page.set_default_timeout(60_000)
            take(page)
            browser.close()


if __name__ == "__main__":
    main()
