"""A crowd: many people who annotate at once, half of them the same groups.

Every change that was answered with 200 must be in its group's history, and nobody may see an error
of the server. How long answers take is printed beside the same load of one person.
"""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import msgspec
import numpy as np

from tests.e2e.service import ROOT
from tests.torture.counting import processor
from tests.torture.kills import API, Server
from tests.torture.person import READY, Shift, Work
from tests.waiting import SECONDS

SHARED_GROUPS = 20
PROCESSES = 2
"""Of the people: with more of them, a server on two processors waits for its clients."""
PEOPLE = "from tests.torture.person import main; main()"


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
    clients: float = 0.0
    """Seconds of the processor that the people took themselves, where it was measured."""

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
        busy = f"  processor: {self.processor[0]:.1f} s of the server, "
        busy += f"{self.clients:.1f} s of the people"
        return [head, *rows, *([busy] if self.clients else [])]


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
            shifts = list(_shifts(server.port, ids, people, seconds, think, seed))
            watched = ((server.pid,), tuple(others))
            with _come(shifts) as processes:
                begun = [sum(map(processor, pids)) for pids in watched]
                works = list(_works(processes, seconds))
                ended = [sum(map(processor, pids)) for pids in watched]
            kept = {group: _history(http, group) - before[group] for group in ids}
            load = gathered(people, seconds, works, kept)
            load.processor = (ended[0] - begun[0], ended[1] - begun[1])
            return load
    finally:
        server.kill()


def _shifts(
    port: int, ids: list[int], people: int, seconds: float, think: float, seed: int
) -> Iterator[Shift]:
    """What each process of people is to do."""
    for place in range(PROCESSES):
        # Pairs of neighbours, of whom one works on the shared groups, stay together.
        numbers = [number for number in range(people) if number // 2 % PROCESSES == place]
        groups = [ids[:SHARED_GROUPS] if number % 2 == 0 else ids for number in numbers]
        seeds = [seed + number for number in numbers]
        yield Shift(port, groups, seeds, seconds, think)


@contextmanager
def _come(shifts: Sequence[Shift]) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes of people, each of whom waits to be told to go on."""
    pipe, command = subprocess.PIPE, [sys.executable, "-c", PEOPLE]
    processes = [subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe) for _ in shifts]
    try:
        for process, shift in zip(processes, shifts, strict=True):
            assert process.stdin is not None and process.stdout is not None
            process.stdin.write(msgspec.json.encode(shift) + b"\n")
            process.stdin.flush()
        for process in processes:
            assert process.stdout is not None
            if process.stdout.readline() != READY.encode():
                raise AssertionError("people did not come")
        yield processes
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def _works(processes: Sequence[subprocess.Popen[bytes]], seconds: float) -> Iterator[Work]:
    """Tell all to go on, and what each process has done."""
    for process in processes:
        assert process.stdin is not None
        process.stdin.write(b"go on\n")
        process.stdin.flush()
    for process in processes:
        said, _ = process.communicate(timeout=seconds + SECONDS)
        yield msgspec.json.decode(said, type=Work)


def gathered(people: int, seconds: float, works: Sequence[Work], kept: Mapping[int, int]) -> Load:
    """What all processes of people came to, with what got lost.

    Args:
        people: How many they were.
        seconds: For how long.
        works: What each process has done.
        kept: How many entries the history of each group has grown by.
    """
    load = Load(people, seconds)
    for work in works:
        load.faults += work.faults
        load.clients += work.processor
        load.statuses.update(work.statuses)
        for kind, times in work.milliseconds.items():
            load.milliseconds.setdefault(kind, []).extend(times)
    places = Counter(place for work in works for place in work.accepted)
    accepted = Counter(group for group, _ in places.elements())
    load.changes, load.stale = accepted.total(), load.statuses[412]
    wrong = {status: count for status, count in load.statuses.items() if status not in (200, 412)}
    if wrong:
        load.faults.append(f"answers that were neither 200 nor 412: {wrong}")
    load.faults += [
        f"group {place[0]}: two changes led to one state" for place in places if places[place] > 1
    ]
    load.faults += [
        f"group {group}: {accepted[group]} changes accepted, {number} in its history"
        for group, number in kept.items()
        if accepted[group] != number
    ]
    return load


def _history(http: httpx.Client, group: int) -> int:
    return len(http.get(f"{API}/groups/{group}/history").json()["items"])
