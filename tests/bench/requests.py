"""What a request costs the server: its processor time, and that as a multiple of a trivial route.

The multiple compares machines, and moments of one machine, with each other; milliseconds do not.
Requests of all kinds take turns, so that whatever else the machine does falls on each alike.
"""

from __future__ import annotations

import itertools
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from app.config import Settings
from app.db.store import Store
from tests.bench.table import print_table
from tests.e2e.service import run_touchline, serving
from tests.flights import FIRST, add_flight
from tests.starting import end_nursery

GROUPS = 12
FLIGHT = 90
"""Frames of a ball in flight before four cameras."""
ROUNDS = 5
TURNS = 10
API = "/api/v1"


def bench_requests() -> None:
    """Measure and print, on a group of four views of the sample, and one of a ball in flight."""
    with sample_served(flight=True) as served:
        print_table(
            "Requests, processor time of the server a request",
            ("what", "ms", "times healthz", "limit, ms on a quiet machine"),
            _measured(served),
        )


@dataclass(frozen=True)
class Served:
    """A server over a solved sample: its address, a client of it, and the number of its process."""

    address: str
    client: httpx.Client
    process: int

    def cost(self, ask: Callable[[], httpx.Response]) -> float:
        """Milliseconds of the server's processor time for one request, over many."""
        before = self._cpu_seconds()
        for _ in range(TURNS):
            ask().raise_for_status()
        return 1000 * (self._cpu_seconds() - before) / TURNS

    def _cpu_seconds(self) -> float:
        # The processor clock of another process, as clock_getcpuclockid(3) numbers it.
        return time.clock_gettime((~self.process << 3) | 2)


@contextmanager
def sample_served(*, flight: bool = False) -> Iterator[Served]:
    """A server over a solved sample, and a tracked ball in flight before four cameras where one is asked for."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        tree = home / "tree"
        run_touchline(
            home,
            "migrate",
            f"sample --groups {GROUPS} {tree}",
            f"import soccernet-v3 {tree} --dataset sample",
            "solve --dataset sample",
        )
        if flight:
            with closing(Store.open(Settings(home=home))) as store:
                add_flight(store, count=FLIGHT)
        # Pools of benchmarks before this one have left a process that watches what they shared.
        others = _children()
        with serving(home) as address, httpx.Client(base_url=address, timeout=60) as client:
            end_nursery()
            (server,) = _children() - others
            yield Served(address, client, server)


def _children() -> set[int]:
    """Numbers of the processes that this one has started (Linux tells them)."""
    listed = Path(f"/proc/self/task/{os.getpid()}/children").read_text()
    return {int(number) for number in listed.split()}


def _measured(served: Served) -> list[tuple[str, float, float, str]]:
    client = served.client
    group, flying = Group(client), Group(client, "flight", FLIGHT // 2)
    (track,) = client.get(f"{API}/datasets/flight/tracks").json()["items"]
    around = f"{API}/tracks/{track['id']}/around?frame={FIRST + FLIGHT // 2}"

    def edit() -> httpx.Response:
        flying.move_ball().raise_for_status()
        return client.get(around)

    kinds: list[tuple[str, Callable[[], httpx.Response], str]] = [
        ("GET /healthz, the reference", lambda: client.get("/healthz"), ""),
        ("GET of a group", lambda: client.get(group.path), "< 4"),
        ("PATCH of a ball", group.move_ball, "< 12"),
        ("PATCH of a line", group.move_line, ""),
        ("PUT of a verdict", group.judge, "< 5"),
        ("PATCH of a ball, GET of the 51 frames of its track around it", edit, "< 60"),
    ]
    spent: dict[str, list[float]] = {what: [] for what, _, _ in kinds}
    for number in range(ROUNDS + 1):
        for what, ask, _ in kinds:
            milliseconds = served.cost(ask)
            # The first round compiles statements and fills caches.
            if number:
                spent[what].append(milliseconds)
    medians = {what: float(np.median(values)) for what, values in spent.items()}
    reference = medians[kinds[0][0]]
    return [(what, medians[what], medians[what] / reference, limit) for what, _, limit in kinds]


class Group:
    """A group of four views, and changes of it that build on each other.

    Args:
        client: Of the server.
        dataset: Name of its dataset.
        place: How many of its groups of four views are before it.
    """

    def __init__(self, client: httpx.Client, dataset: str = "sample", place: int = 0):
        rows = client.get(f"{API}/groups", params={"dataset": dataset, "limit": 500}).json()
        found = [row["id"] for row in rows["items"] if row["views"] == 4][place]
        self._client, self._number, self.path = client, found, f"{API}/groups/{found}"
        document = client.get(self.path).json()
        self._etag: str = document["etag"]
        self._view: dict[str, Any] = document["views"][0]
        self._turn = itertools.count()

    def move_ball(self) -> httpx.Response:
        """The ball of the first view a little elsewhere."""
        (ball, *_), aside = self._view["balls"], 0.01 * (next(self._turn) % 300)
        kind = "box" if ball.get("box") else "point"
        x, *rest = ball[kind]
        body = {kind: [x + aside, *rest]}
        return self._change("PATCH", f"{API}/views/{self._view['id']}/ball", body)

    def move_line(self) -> httpx.Response:
        """One marking of the first view a little elsewhere: its camera is found again."""
        marking, points = next(iter(self._view["lines"].items()))
        aside = 0.01 * (next(self._turn) % 300)
        moved = [{"x": point["x"] + aside, "y": point["y"]} for point in points]
        body = {"lines": {marking: moved}}
        return self._change("PATCH", f"{API}/views/{self._view['id']}/lines", body)

    def judge(self) -> httpx.Response:
        """Defer the group, or take that back."""
        state = ("deferred", "unreviewed")[next(self._turn) % 2]
        return self._change("PUT", f"{self.path}/verdict", {"state": state})

    def _change(self, method: str, path: str, body: Any) -> httpx.Response:
        key = f"bench-{self._number}-{next(self._turn)}"
        headers = {"If-Match": self._etag, "Idempotency-Key": key}
        answer = self._client.request(method, path, json=body, headers=headers)
        self._etag = answer.headers.get("etag", self._etag)
        return answer


if __name__ == "__main__":
    bench_requests()
