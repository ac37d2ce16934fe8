"""What a change costs the server beside windows that hear of it: its processor time."""

from __future__ import annotations

import itertools
import selectors
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import httpx
import numpy as np

from app.http.event_stream import PAUSE
from tests.bench.requests import Group, Served, sample_served
from tests.bench.table import print_table

WINDOWS = 50
ROUNDS = 5
EVENTS = "/api/v1/events"


def bench_listeners() -> None:
    """Measure and print verdicts, one after the other, with and without windows that listen."""
    with sample_served() as served:
        print_table(
            "Changes that are heard, processor time of the server a change",
            ("windows", "ms", "times nobody"),
            _measured(served),
        )


def _measured(served: Served) -> list[tuple[int, float, float]]:
    group = Group(served.client)

    def judge() -> httpx.Response:
        # Each is told by itself.
        time.sleep(2 * PAUSE)
        return group.judge()

    spent: dict[int, list[float]] = {0: [], WINDOWS: []}
    for number, windows in itertools.product(range(ROUNDS + 1), spent):
        with _listening(served.address, windows):
            milliseconds = served.cost(judge)
        # The first round compiles statements and fills caches.
        if number:
            spent[windows].append(milliseconds)
    medians = {windows: float(np.median(values)) for windows, values in spent.items()}
    return [(windows, median, median / medians[0]) for windows, median in medians.items()]


@contextmanager
def _listening(address: str, windows: int) -> Iterator[None]:
    """So many streams, whose events are read and thrown away."""
    ended = threading.Event()
    with ExitStack() as opened, selectors.DefaultSelector() as selector:
        for _ in range(windows):
            client = opened.enter_context(httpx.Client(base_url=address, timeout=60))
            answer = opened.enter_context(client.stream("GET", EVENTS))
            answer.raise_for_status()
            selector.register(answer.extensions["network_stream"].get_extra_info("socket"), 1)

        def read() -> None:
            while not ended.is_set():
                for key, _ in selector.select(0.1):
                    key.fileobj.recv(65536)  # type: ignore[union-attr]

        reader = threading.Thread(target=read)
        reader.start()
        try:
            yield
        finally:
            ended.set()
            reader.join()


if __name__ == "__main__":
    bench_listeners()
