"""A crowd: many people who annotate at once, half of them the same groups.

Every change that was answered with 200 must be in its group's history, and nobody may see an error
of the server. How long answers take is printed beside the same load of one person.
"""

from __future__ import annotations

import random
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from tests.torture.counting import processor
from tests.torture.kills import API, Server

SHARED_GROUPS = 20


@dataclass
class Load:
    """What a crowd came to; times in milliseconds."""

    people: int
    seconds: float
    changes: int = 0
    stale: int = 0
    statuses: Counter[int] = field(default_factory=Counter)
    milliseconds: dict[str, list[float]] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    costs: dict[str, np.ndarray] = field(default_factory=dict)
    """What each kind of request costs by itself (``counting``), where it was measured."""
    processor: tuple[float, float] = (0.0, 0.0)
    """Seconds of the processor that the server took meanwhile, and others that were named."""

    def percentiles(self, kind: str) -> tuple[float, float, float]:
        """p50, p95 and p99 of one kind of request."""
        found = np.percentile(self.milliseconds.get(kind) or [np.nan], [50, 95, 99])
        return float(found[0]), float(found[1]), float(found[2])

    def lines(self) -> list[str]:
        """The figures for people."""
        head = f"{self.people} people, {self.seconds:.0f} s: {self.changes} changes accepted "
        head += f"({self.changes / self.seconds:.1f}/s), {self.stale} were stale"
        rows = [
            f"  {kind:8} p50 {p50:6.0f}  p95 {p95:6.0f}  p99 {p99:6.0f} ms"
            for kind in sorted(self.milliseconds)
            for p50, p95, p99 in [self.percentiles(kind)]
        ]
        return [head, *rows]


class Person(threading.Thread):
    """Somebody who opens a group, moves a ball, judges, thinks, and goes on to the next."""

    def __init__(self, address: str, groups: list[int], seed: int, until: float, think: float):
        super().__init__(daemon=True)
        self.milliseconds: dict[str, list[float]] = {"group": [], "ball": [], "verdict": []}
        self.statuses: Counter[int] = Counter()
        self.accepted: list[tuple[int, str]] = []
        """Group and new ETag of each change that was answered with 200."""
        self.fault: str | None = None
        self._http = httpx.Client(base_url=address, timeout=60)
        self._groups, self._until, self._think = groups, until, think
        self._random = random.Random(seed)

    def run(self) -> None:
        """Come in, not all at the same moment, and work until the time is over."""
        try:
            self._pause()
            while time.monotonic() < self._until:
                self._work(self._random.choice(self._groups))
        except Exception as error:
            self.fault = f"{type(error).__name__}: {error}"
        finally:
            self._http.close()

    def _work(self, group_id: int) -> None:
        group = self._ask("group", "GET", f"/groups/{group_id}").json()
        self._pause()
        view = self._random.choice(group["views"])
        box = [round(self._random.uniform(50, 800), 2), round(self._random.uniform(50, 450), 2)]
        edit = {"box": [*box, 12.0, 12.5]}
        after = self._change("ball", "PATCH", f"/views/{view['id']}/ball", edit, group)
        if after is None:
            return
        self._pause()
        state = "deferred" if after["verdict"]["state"] != "deferred" else "unreviewed"
        self._change("verdict", "PUT", f"/groups/{group_id}/verdict", {"state": state}, after)

    def _change(
        self, kind: str, method: str, path: str, body: Any, group: dict[str, Any]
    ) -> dict[str, Any] | None:
        answer = self._ask(kind, method, path, body, group["etag"])
        if answer.status_code != 200:
            return None
        after: dict[str, Any] = answer.json()
        self.accepted.append((group["id"], after["etag"]))
        return after

    def _ask(
        self, kind: str, method: str, path: str, body: Any = None, etag: str | None = None
    ) -> httpx.Response:
        quoted = None if etag is None else etag if etag.startswith('"') else f'"{etag}"'
        headers = {} if quoted is None else {"If-Match": quoted}
        start = time.perf_counter()
        answer = self._http.request(method, API + path, json=body, headers=headers)
        self.milliseconds[kind].append(1000 * (time.perf_counter() - start))
        self.statuses[answer.status_code] += 1
        return answer

    def _pause(self) -> None:
        if self._think:
            time.sleep(self._random.expovariate(1 / self._think))


def crowd(
    home: Path,
    *,
    people: int,
    seconds: float,
    think: float,
    seed: int,
    server: Server | None = None,
    others: Sequence[int] = (),
) -> Load:
    """Let a crowd work on the dataset ``client0`` of a home.

    Args:
        home: A home that ``kills.prepare`` has made.
        people: How many; the even ones work on the same ``SHARED_GROUPS`` groups.
        seconds: For how long.
        think: Mean of the seconds between two requests of a person; 0: none.
        seed: Decides what they do.
        server: Of the home, not started yet; None: one with the usual settings.
        others: Processes that work for the server, whose time is told, too.
    """
    server = Server(home) if server is None else server
    server.start()
    try:
        server.wait()
        with httpx.Client(base_url=server.address, timeout=60) as http:
            ids = http.get(f"{API}/groups/ids", params={"dataset": "client0"}).json()["ids"]
            before = {group: _history(http, group) for group in ids}
            until = time.monotonic() + seconds
            team = [
                Person(
                    server.address,
                    ids[:SHARED_GROUPS] if number % 2 == 0 else ids,
                    seed + number,
                    until,
                    think,
                )
                for number in range(people)
            ]
            watched = ((server.pid,), tuple(others))
            begun = [sum(map(processor, pids)) for pids in watched]
            for person in team:
                person.start()
            for person in team:
                person.join()
            ended = [sum(map(processor, pids)) for pids in watched]
            load = _load(
                team, seconds, {group: _history(http, group) - before[group] for group in ids}
            )
            load.processor = (ended[0] - begun[0], ended[1] - begun[1])
            return load
    finally:
        server.kill()


def _load(team: list[Person], seconds: float, kept: dict[int, int]) -> Load:
    load = Load(len(team), seconds)
    load.faults = [person.fault for person in team if person.fault]
    for person in team:
        load.statuses += person.statuses
        for kind, times in person.milliseconds.items():
            load.milliseconds.setdefault(kind, []).extend(times)
    accepted = Counter(group for person in team for group, _ in person.accepted)
    load.changes, load.stale = accepted.total(), load.statuses[412]
    wrong = {status: count for status, count in load.statuses.items() if status not in (200, 412)}
    if wrong:
        load.faults.append(f"answers that were neither 200 nor 412: {wrong}")
    etags = Counter(place for person in team for place in person.accepted)
    load.faults += [
        f"group {place[0]}: two changes led to one state" for place in etags if etags[place] > 1
    ]
    load.faults += [
        f"group {group}: {accepted[group]} changes accepted, {number} in its history"
        for group, number in kept.items()
        if accepted[group] != number
    ]
    return load


def _history(http: httpx.Client, group: int) -> int:
    return len(http.get(f"{API}/groups/{group}/history").json()["items"])
