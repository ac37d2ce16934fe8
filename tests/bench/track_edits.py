"""An edit of one frame's ball, and the frames of its track around it, in a real browser.

``python -m tests.bench.track_edits [TURNS]``: over ISSIA's six cameras where it is, else over a ball in flight. Each turn
takes an edit back by key, or makes it again, and waits until the card of the track shows what comes of it.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from app.config import Settings
from app.db.store import Store
from app.features.tracks.service import list_tracks, make_tracks, read_track_detail
from tests.bench.table import print_table
from tests.e2e.install_chromium import find_chromium
from tests.e2e.service import free_port, killable, run_touchline
from tests.flights import add_flight

TURNS = 8
PLACES = (0.25, 0.4, 0.6, 0.75)
"""Frames that are edited, as shares of the stretch."""
LIMIT_MS = 100

WATCH = """() => {
  const shown = () => document.querySelector('.track-card [data-around]')?.textContent;
  let before = shown();
  let pressed = 0;
  window.turns = [];
  addEventListener('keydown', () => {
    pressed = performance.now();
    // The list of them is soon full.
    performance.clearResourceTimings();
  }, true);
  new MutationObserver(() => {
    const now = shown();
    if (now === undefined || now === before) return;
    before = now;
    requestAnimationFrame(() => {
      const { port1, port2 } = new MessageChannel();
      port1.onmessage = () => {
        const asked = performance.getEntriesByType('resource').filter(({ name }) => name.includes('/around')).at(-1);
        window.turns.push([asked.startTime - pressed, asked.responseEnd - pressed, performance.now() - pressed]);
      };
      port2.postMessage(0);
    });
  }).observe(document.querySelector('.track-card'), { subtree: true, childList: true, characterData: true });
}"""
"""When the frames around were asked for, answered and painted, in milliseconds since the key."""


def bench_track_edits(data: Path, turns: int = TURNS) -> None:
    """Measure and print; says so where there is no Chromium."""
    chromium = find_chromium()
    if not chromium:
        print("\nEdits of a track's frame: no Chromium, left out")
        return
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        home = Path(folder)
        what, groups = _make_home(home, data)
        port = free_port()
        with killable(home, port) as server:
            browser = playwright.chromium.launch(executable_path=chromium)
            address = f"http://127.0.0.1:{port}"
            page = browser.new_page(base_url=address, viewport={"width": 1440, "height": 900})
            page.set_default_timeout(60_000)
            rows = [
                [
                    f"frame {frame}",
                    *_figures(np.array(list(_turns(page, group, turns, server.pid)))),
                ]
                for frame, group in groups
            ]
            browser.close()
    load = os.getloadavg()[0]
    print_table(
        f"From the key of an edit to the frames of its track around it, {what}: median ms of {turns} "
        f"(limit {LIMIT_MS}), load of the machine {load:.1f}",
        ("", "asked", "answered", "painted", "the fastest", "processor of the server"),
        rows,
    )


def _make_home(home: Path, data: Path) -> tuple[str, list[tuple[int, int]]]:
    """What is tracked there, and frames with their groups."""
    real = data / "issia"
    if real.is_dir():
        run_touchline(
            home, "migrate", f"import issia {real} --dataset flight", "solve --dataset flight"
        )
    else:
        run_touchline(home, "migrate")
    with closing(Store.open(Settings(home=home))) as store:
        if real.is_dir():
            make_tracks(store, "flight", None, "local", lambda *_: None)
        else:
            add_flight(store, count=90)
        (track,) = list_tracks(store, "flight")
        groups = read_track_detail(store, track.id).groups
    frames = sorted(groups)
    chosen = [frames[int(share * len(frames))] for share in PLACES]
    what = "ISSIA's six cameras" if real.is_dir() else "four cameras"
    return what, [(frame, groups[frame].id) for frame in chosen]


def _turns(page: Page, group: int, turns: int, server: int) -> Iterator[list[float]]:
    """Milliseconds of each turn: asked, answered, painted, and of the server's processor."""
    found = page.request.get(f"/api/v1/groups/{group}").json()
    view = next(one for one in found["views"] if one["balls"])
    ball = view["balls"][0]
    kind = "box" if ball.get("box") else "point"
    x, *rest = ball[kind]
    answer = page.request.patch(
        f"/api/v1/views/{view['id']}/ball",
        data={kind: [x + 1, *rest]},
        headers={"If-Match": found["etag"]},
    )
    assert answer.ok, answer.text()
    page.goto(f"/review/{group}")
    page.wait_for_selector(".track-card [data-around]")
    page.wait_for_timeout(1500)
    page.evaluate(WATCH)
    for turn in range(turns + 1):
        before = _processor(server)
        page.keyboard.press("Control+Shift+z" if turn % 2 else "Control+z")
        # Functions to wait for are texts, which the pages forbid.
        while page.evaluate("window.turns.length") <= turn:
            page.wait_for_timeout(20)
        spent = 1000 * (_processor(server) - before)
        times: list[float] = page.evaluate("window.turns.at(-1)")
        # The first turn reads what the next ones have at hand.
        if turn:
            yield [*times, spent]
        page.wait_for_timeout(700)


def _figures(turns: np.ndarray) -> list[float]:
    asked, answered, painted, spent = np.median(turns, axis=0).tolist()
    return [asked, answered, painted, float(turns[:, 2].min()), spent]


def _processor(process: int) -> float:
    # The processor clock of another process, as clock_getcpuclockid(3) numbers it.
    return time.clock_gettime((~process << 3) | 2)


if __name__ == "__main__":
    from tests.bench.__main__ import REAL_DATA

    bench_track_edits(REAL_DATA, int(sys.argv[1]) if len(sys.argv) > 1 else TURNS)
