"""What a page costs with its modules joined, and with each of them asked for: time and processor.

Both in turns of one run, before two servers over equal homes; the ratio is what counts. "Empty":
the browser has nothing of the server's; "kept": it has all files.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import perf_counter

import httpx
import numpy as np
from playwright.sync_api import Browser, Page, sync_playwright

from tests.bench.table import print_table
from tests.e2e import service
from tests.e2e.install_chromium import find_chromium
from tests.e2e.service import run_touchline, serving

TURNS = 12
JOINED = service.SERVE
MODULES = (
    "from app.http.pages import JoinedModules; JoinedModules.read = staticmethod(lambda folder: None); "
    + service.SERVE
)
PLACES = {
    "queue": ("/groups", ".queue-row a"),
    "review": ("/review/{group}", '.image-panel__stage[data-ready="true"]'),
    "jobs": ("/jobs", "h1"),
}
HERTZ = os.sysconf("SC_CLK_TCK")


def bench_page_loads() -> None:
    """Measure and print; says so where there is no Chromium."""
    chromium = find_chromium()
    if not chromium:
        print("\nPages: no Chromium, left out")
        return
    rows = []
    with ExitStack() as stack:
        servers = [stack.enter_context(_served(program)) for program in (JOINED, MODULES)]
        playwright = stack.enter_context(sync_playwright())
        browser = playwright.chromium.launch(executable_path=chromium)
        for name, (path, sign) in PLACES.items():
            for kept in (False, True):
                joined, apart = _in_turns(browser, servers, path, sign, kept)
                what = f"{name}, {'kept' if kept else 'empty'}"
                for unit, one, other in zip(("ms", "ms of processor"), joined, apart, strict=True):
                    rows.append((f"{what}, {unit}", one, other, one / other))
        browser.close()
    print_table("Pages, headless Chromium and server", ("what", "joined", "modules", "ratio"), rows)


@contextmanager
def _served(program: str) -> Iterator[tuple[str, int]]:
    """Address of a server, and a group that it has."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder) / "home"
        home.mkdir()
        tree = Path(folder) / "tree"
        run_touchline(
            home,
            f"sample --workers 1 --groups 3 {tree}",
            f"import soccernet-v3 {tree} --dataset bench",
            "solve --dataset bench --workers 1",
        )
        service.SERVE = program
        try:
            with serving(home) as address:
                api = f"{address}/api/v1"
                dataset = httpx.get(f"{api}/datasets").json()["items"][0]["id"]
                groups = httpx.get(f"{api}/groups", params={"dataset": dataset}).json()
                yield address, groups["items"][0]["id"]
        finally:
            service.SERVE = JOINED


def _in_turns(
    browser: Browser, servers: list[tuple[str, int]], path: str, sign: str, kept: bool
) -> list[tuple[float, float]]:
    """Milliseconds until a page is ready, and of the processor until it has settled, by server."""
    found: list[list[tuple[float, float]]] = [[] for _ in servers]
    for _ in range(TURNS):
        for (address, group), measured in zip(servers, found, strict=True):
            with browser.new_context(base_url=address) as context:
                page = context.new_page()
                if kept:
                    _open(page, path.format(group=group), sign)
                measured.append(_open(page, path.format(group=group), sign))
    return [tuple(np.median(measured, axis=0)) for measured in found]


def _open(page: Page, path: str, sign: str) -> tuple[float, float]:
    before, began = _processor(), perf_counter()
    page.goto(path)
    page.wait_for_selector(sign)
    ready = perf_counter() - began
    page.wait_for_timeout(500)
    return 1000 * ready, 1000 * (_processor() - before)


def _processor() -> float:
    """Seconds that browsers and servers have used so far; of those that are there."""
    used = 0
    for process in Path("/proc").glob("[0-9]*"):
        try:
            line = (process / "cmdline").read_bytes()
            if b"chrom" in line[:80] or b"wait_for_requests" in line:
                fields = (process / "stat").read_text().rpartition(")")[2].split()
                used += int(fields[11]) + int(fields[12])
        except OSError:
            continue
    return used / HERTZ


if __name__ == "__main__":
    bench_page_loads()
