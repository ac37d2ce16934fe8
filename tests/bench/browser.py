"""The browser as a reviewer meets it: real Chromium before a real server, in milliseconds.

Two datasets: the sample, with frames, for the review screen, and one of 12,764 groups for the
queue. Every figure is a percentile over many turns; the limits are printed beside them.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from playwright.sync_api import Browser, Page, sync_playwright

from tests.bench.table import print_table
from tests.e2e.install_chromium import find_chromium
from tests.e2e.service import run_touchline, serving

ROOT = Path(__file__).resolve().parents[2]
SAMPLE_GROUPS = 40
LARGE_GROUPS = int(os.environ.get("TOUCHLINE_BENCH_GROUPS", "12764"))
LARGE_SECONDS = 3600
TURNS = 25
DRAG_STEPS = 90
MEMORY_GROUPS = 500
READY = '.image-panel[data-view="A"] .image-panel__stage[data-ready="true"]'
Row = tuple[str, float, float, str]


def bench_browser() -> None:
    """Measure and print; says so where there is no Chromium."""
    chromium = find_chromium()
    if not chromium:
        print("\nBrowser: no Chromium, left out")
        return
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        home = Path(folder)
        _make_home(home)
        browser = playwright.chromium.launch(
            executable_path=chromium,
            args=["--enable-precise-memory-info", "--js-flags=--expose-gc"],
        )
        with serving(home) as address:
            rows += _review(browser, address)
            rows += _queue(browser, address)
        browser.close()
    print_table(
        "Browser, 1440 x 900, headless Chromium",
        ("what", "median", "p95", "limit"),
        rows,
    )


def _make_home(home: Path) -> None:
    """The sample, and the large dataset: the sample's groups again and again without frames."""
    tree, many = home / "tree", home / "many"
    run_touchline(
        home,
        "migrate",
        f"sample --groups {SAMPLE_GROUPS} {tree}",
        f"import soccernet-v3 {tree} --dataset sample",
        "solve --dataset sample",
    )
    _multiply(tree, many)
    run_touchline(
        home,
        f"import soccernet-v3 {many} --dataset large",
        "solve --dataset large",
        seconds=LARGE_SECONDS,
    )


def _multiply(tree: Path, many: Path) -> None:
    """Copies of every match, until there are groups enough."""
    labels = sorted(tree.rglob("Labels-v3.json"))
    copies = -(-LARGE_GROUPS // SAMPLE_GROUPS)
    for copy in range(copies):
        for path in labels:
            match = path.parent
            target = many / match.parent.relative_to(tree) / f"{match.name} {copy:03d}"
            target.mkdir(parents=True)
            shutil.copy(path, target / path.name)


def _open(browser: Browser, address: str) -> Page:
    context = browser.new_context(base_url=address, viewport={"width": 1440, "height": 900})
    page = context.new_page()
    page.set_default_timeout(60_000)
    return page


def _row(what: str, values: list[float], limit: str) -> Row:
    return (
        what,
        round(float(np.median(values)), 1),
        round(float(np.percentile(values, 95)), 1),
        limit,
    )


PAINTED = """(key) => new Promise((resolve) => {
  const start = performance.now();
  const shown = () => document.querySelector('.image-panel__stage')?.dataset.frame;
  const before = shown();
  const look = () => {
    if (shown() && shown() !== before) requestAnimationFrame(() => resolve(performance.now() - start));
    else requestAnimationFrame(look);
  };
  dispatchEvent(new KeyboardEvent('keydown', { key, code: 'Key' + key.toUpperCase() }));
  look();
})"""
"""Press a key and wait until another group's frame has been painted."""

USABLE = """(frame) => new Promise((resolve) => {
  const look = () => {
    if (!document.querySelector(frame) || !document.querySelector('.gates li')) requestAnimationFrame(look);
    else requestAnimationFrame((now) => resolve(now));
  };
  look();
})"""
"""When frames and numbers stand on the screen, in milliseconds since the address was opened."""

FRAMES = """(count) => new Promise((resolve) => {
  const times = [];
  let last = performance.now();
  const tick = (now) => {
    times.push(now - last);
    last = now;
    if (times.length < count) requestAnimationFrame(tick);
    else resolve(times.slice(2));
  };
  requestAnimationFrame(tick);
})"""


def _review(browser: Browser, address: str) -> Iterator[Row]:
    first = [_first_screen(browser, address) for _ in range(5)]
    yield _row("first usable review screen, ms", first, "< 1000")
    page = _open(browser, address)
    page.goto("/review/1")
    page.wait_for_selector(READY)
    _warm(page)
    turns = [_next_group(page, "f") for _ in range(TURNS)]
    yield _row("next group painted, warm, ms", turns, "< 100")
    yield _row("frame of a ball drag with preview, ms", _drag(page), "<= 17")
    yield _row("edit to authoritative numbers, ms", _edits(page), "< 100")
    growth = round(_memory(page), 1)
    yield (f"memory over {MEMORY_GROUPS} groups, MB", growth, growth, "< 20")
    page.context.close()


def _first_screen(browser: Browser, address: str) -> float:
    """From the address to frames, numbers and keys, in a window that knows nothing."""
    page = _open(browser, address)
    page.add_init_script(f"window.__first = ({USABLE})({READY!r})")
    page.goto("/review/1", wait_until="commit")
    page.wait_for_selector(READY)
    spent = float(page.evaluate("() => window.__first"))
    page.context.close()
    return spent


def _warm(page: Page) -> None:
    """Wait until what comes next has been loaded."""
    page.wait_for_timeout(1500)


def _next_group(page: Page, key: str) -> float:
    spent = float(page.evaluate(PAINTED, key))
    # A person looks at a group; the next ones are loaded meanwhile.
    page.wait_for_timeout(600)
    return spent


def _drag(page: Page) -> list[float]:
    """Times between frames while the ball of the main camera is dragged in circles."""
    page.goto("/review/3")
    page.wait_for_selector(READY)
    x, y = _ball_place(page)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 6, y)
    page.evaluate(f"() => {{ window.__frames = ({FRAMES})({DRAG_STEPS}); }}")
    for step in range(DRAG_STEPS):
        angle = step / 7
        page.mouse.move(x + 6 + 5 * float(np.cos(angle)), y + 5 * float(np.sin(angle)))
    times: list[float] = page.evaluate("() => window.__frames")
    page.keyboard.press("Escape")
    page.mouse.up()
    return times


def _ball_place(page: Page) -> tuple[float, float]:
    group = page.url.split("/review/")[1].split("?")[0]
    view: dict[str, Any] = page.request.get(f"/api/v1/groups/{group}").json()["views"][0]
    stage = page.locator(".image-panel[data-view=A] .image-panel__stage").bounding_box()
    assert stage is not None
    scale = min(stage["width"] / view["width"], stage["height"] / view["height"])
    x, y, width, height = view["balls"][0]["box"]
    left = stage["x"] + (stage["width"] - view["width"] * scale) / 2
    top = stage["y"] + (stage["height"] - view["height"] * scale) / 2
    return left + (x + width / 2 + 0.5) * scale, top + (y + height / 2 + 0.5) * scale


SAVED = """() => new Promise((resolve) => {
  const start = performance.now();
  const look = () => (document.querySelector('.save')?.dataset.unsaved === '0'
    ? resolve(performance.now() - start) : setTimeout(look, 1));
  window.dispatchEvent(new KeyboardEvent('keydown', { key: 'Q', code: 'KeyQ', bubbles: true }));
  setTimeout(look, 2);
})"""


def _edits(page: Page) -> list[float]:
    """From an edit of the ball to the server's answer on screen, three views."""
    page.wait_for_selector('.save[data-unsaved="0"]')
    page.evaluate(SAVED)
    return [float(page.evaluate(SAVED)) for _ in range(TURNS)]


def _memory(page: Page) -> float:
    """Megabytes of script memory that many groups leave behind, after a first round of them."""
    _walk(page, SAMPLE_GROUPS)
    before = _heap(page)
    _walk(page, MEMORY_GROUPS)
    return (_heap(page) - before) / 1e6


def _walk(page: Page, groups: int) -> None:
    """Through the sample, forth and back."""
    key = "f"
    for _ in range(groups):
        place = int(page.url.split("/review/")[1].split("?")[0])
        if place >= SAMPLE_GROUPS - 1 or place <= 2:
            key = "f" if place <= 2 else "d"
        page.evaluate(PAINTED, key)


def _heap(page: Page) -> float:
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.collectGarbage")
    used = float(session.send("Runtime.getHeapUsage")["usedSize"])
    session.detach()
    return used


def _queue(browser: Browser, address: str, dataset: str = "large") -> list[Row]:
    page = _open(browser, address)
    datasets = page.request.get("/api/v1/datasets").json()["items"]
    groups = next(one["groups"] for one in datasets if one["name"] == dataset)
    page.goto(f"/groups?dataset={dataset}")
    page.wait_for_selector(".queue-row a")
    queries = ["jac<0.95", "passes:yes", "views>2", "finding:none", "sigma<0.5"]
    sorts = ["sort:sigma", "sort:jac-desc", "sort:value", "sort:error-desc", "sort:number-desc"]
    # One after the other: the same query twice in a row asks nothing.
    filters = [_query(page, dataset, query) for query in [*queries, *sorts] * 2]
    page.goto(f"/groups?dataset={dataset}")
    page.wait_for_selector(".queue-row a")
    frames = _scroll(page)
    page.context.close()
    return [
        _row(f"filter or sort of {groups:,} groups, ms", filters, "< 150"),
        _row("frame of scrolling the queue, ms", frames, "<= 17"),
    ]


ANSWERED = """(address) => new Promise((resolve) => {
  const answers = () => performance.getEntriesByType('resource')
    .filter(({ name }) => name.includes('/api/v1/groups?')).length;
  const before = answers();
  const start = performance.now();
  history.pushState(null, '', address);
  dispatchEvent(new PopStateEvent('popstate'));
  const look = () => (answers() > before && document.querySelector('.queue-row a')
    ? requestAnimationFrame(() => resolve(performance.now() - start)) : requestAnimationFrame(look));
  requestAnimationFrame(look);
})"""
"""Ask another query and wait until its rows have been painted."""


def _query(page: Page, dataset: str, query: str) -> float:
    page.evaluate("() => performance.clearResourceTimings()")
    address = f"/groups?dataset={dataset}&q={quote(query)}"
    spent = float(page.evaluate(ANSWERED, address))
    page.wait_for_timeout(150)
    return spent


def _scroll(page: Page) -> list[float]:
    scroller = page.locator(".queue-table__rows").bounding_box()
    assert scroller is not None
    page.mouse.move(scroller["x"] + 200, scroller["y"] + 200)
    _repeat(page, lambda: page.mouse.wheel(0, 600), 5)
    page.evaluate(f"() => {{ window.__frames = ({FRAMES})({DRAG_STEPS}); }}")
    _repeat(page, lambda: page.mouse.wheel(0, 240), 40)
    times: list[float] = page.evaluate("() => window.__frames")
    return times


def _repeat(page: Page, work: Callable[[], None], count: int) -> None:
    for _ in range(count):
        work()
        page.wait_for_timeout(16)


if __name__ == "__main__":
    bench_browser()
