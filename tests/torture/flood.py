"""A flood: clients that ask for too much, and quiet parties who must not feel them.

Each attack keeps one kind of pressure up for a while: half-sent bodies, sockets that say nothing,
windows that listen, uploads, lists of ranges, long queries, large edits. The server may refuse
(429 or 503 with Retry-After, 4xx); it may not fail, grow without end, or keep others waiting. All of it
comes from one person of a team, and the quiet parties are another one.
"""

from __future__ import annotations

import asyncio
import re
import resource
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np

from tests.e2e.service import ROOT
from tests.torture.attacks import CLOSED, FULL, PERSON, Attack, Scale, Target
from tests.torture.background import Busy
from tests.torture.counting import family
from tests.torture.kills import Server
from tests.torture.people import invite_all
from tests.torture.proxy import behind_proxy
from tests.torture.quiet import PARTIES, READY, Told
from tests.waiting import SECONDS

MOST_TIMES = 3.0
"""How much slower the p99 of a quiet party may become."""
LEAST_MS = 15.0
"""A p99 below this is quiet, whatever the machine does besides."""
UNBOUNDED = """
from app.http import request_limits
request_limits.MOST_WAITING = 100_000
request_limits.PATIENCE = 1000.0
"""
"""Plants limits under which any number may wait for any time."""
QUIET = "from tests.torture.quiet import main; main()"


@dataclass
class Seen:
    """What one attack came to; times in milliseconds, memory in MB."""

    name: str
    times: dict[str, list[float]]
    """Of the answers to each quiet party."""
    peak_mb: float
    statuses: Counter[int] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def percentiles(self, party: str) -> tuple[float, float]:
        """p50 and p99 of the answers to a quiet party."""
        found = np.percentile(self.times.get(party) or [np.nan], [50, 99])
        return float(found[0]), float(found[1])

    def line(self) -> str:
        """The figures for people, below ``HEAD``."""
        parties = "  ".join("{:5.0f} {:6.0f}".format(*self.percentiles(one)) for one in PARTIES)
        told = ", ".join(f"{count} x {code or 'closed'}" for code, count in self.statuses.items())
        return f"{self.name:12}  {parties}  {self.peak_mb:6.0f}  {told or 'no answers'}"


HEAD = (
    "p50, p99 ms   " + "  ".join(f"{one:>12}" for one in PARTIES) + "      MB  answers to the flood"
)


def flood(
    home: Path,
    scale: Scale = FULL,
    *,
    times: float | None = MOST_TIMES,
    only: tuple[str, ...] = (),
    busy: Busy | None = None,
    plant: str = "",
    tell: Callable[[str], None] = lambda _sentence: None,
) -> list[str]:
    """Flood the server of a team, behind a proxy; what was not in order, one sentence each.

    Args:
        home: A home that ``kills.prepare`` has made.
        scale: How much of each.
        times: How much slower a quiet party may become; None: that is not judged.
        only: Names of attacks; none: all.
        busy: A dataset of the home with long work on it; None: there is no such work.
        plant: Python that the server runs first, to plant a fault.
        tell: Called with each line of figures.
    """
    _allow_files(scale.sockets + 200)
    invite_all(home, [PERSON])
    server = Server(home, plant, environment={"TOUCHLINE_TEAM": "1"})
    server.start()
    try:
        server.wait()
        with behind_proxy(server.port, home) as proxy:
            target = Target(proxy, scale, home, busy)
            # The first drags, and the first large one, start the processes that solve them.
            asyncio.run(target.warm_up())
            with _quiet(target):
                threading.Event().wait(scale.warm_up)
            quiet = _watched(server, target, "nobody", lambda: None)
            tell(HEAD)
            tell(quiet.line())
            faults = list(quiet.faults)
            for attack in target.attacks():
                if only and attack.name not in only:
                    continue
                seen = _watched(server, target, attack.name, lambda a=attack: run(a, scale))
                faults += seen.faults + judged(seen, quiet, attack, times)
                tell(seen.line())
            return faults
    finally:
        server.kill()


def judged(seen: Seen, quiet: Seen, attack: Attack, times: float | None) -> list[str]:
    """What an attack did that it should not have done."""
    faults = []
    wrong = {code: n for code, n in seen.statuses.items() if code not in {429, 503, *attack.may}}
    if wrong:
        faults.append(f"{seen.name}: answers {wrong}")
    if attack.must and not attack.must & seen.statuses.keys():
        wanted = " or ".join(map(str, sorted(attack.must)))
        faults.append(f"{seen.name}: nobody was answered with {wanted}")
    if seen.peak_mb > quiet.peak_mb + attack.growth:
        faults.append(f"{seen.name}: the server took {seen.peak_mb:.0f} MB")
    for party in PARTIES if times is not None else ():
        before, waited = quiet.percentiles(party)[1], seen.percentiles(party)[1]
        if waited > max(times * before, LEAST_MS):
            faults.append(f"{seen.name}: the {party} waited {waited:.0f} ms, {before:.0f} before")
    return faults


def _watched(server: Server, target: Target, name: str, attack: Callable[[], Seen | None]) -> Seen:
    """Let the quiet parties work, and look at the server's memory, while an attack lasts."""
    with _quiet(target) as told, _memory(server.pid) as peak:
        found = attack()
        if found is None:
            threading.Event().wait(target.scale.seconds)
    met = told()
    seen = found or Seen(name, {}, 0)
    seen.times, seen.peak_mb = met.milliseconds, peak()
    seen.faults += [f"{name}: {count} x {fault}" for fault, count in Counter(met.faults).items()]
    return seen


@contextmanager
def _quiet(target: Target) -> Iterator[Callable[[], Told]]:
    """The quiet parties at work, until the block is left; then what they have met."""
    pipe, command = subprocess.PIPE, [sys.executable, "-c", QUIET]
    process = subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe)
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(msgspec.json.encode(target.quiet) + b"\n")
    process.stdin.flush()
    if process.stdout.readline() != READY.encode():
        raise AssertionError("the quiet parties did not come")
    found: list[Told] = []
    try:
        yield lambda: found[0]
    finally:
        said, _ = process.communicate(timeout=SECONDS)
        found.append(msgspec.json.decode(said, type=Told))


@contextmanager
def _memory(pid: int) -> Iterator[Callable[[], float]]:
    """The most that a process and all below it hold at a time, MB."""
    peak, ended = [0.0], threading.Event()

    def look() -> None:
        while True:
            peak[0] = max(peak[0], sum(map(_held, family(pid))))
            if ended.wait(0.1):
                return

    watcher = threading.Thread(target=look, daemon=True)
    watcher.start()
    try:
        yield lambda: peak[0]
    finally:
        ended.set()
        watcher.join()


def _held(pid: int) -> float:
    """What a process holds, MB; nothing once it has ended."""
    try:
        text = Path(f"/proc/{pid}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return sum(int(size) for size in re.findall(r"VmRSS:\s+(\d+)", text)) / 1024


def run(attack: Attack, scale: Scale) -> Seen:
    """Let all clients of an attack work for a while."""
    seen = Seen(attack.name, {}, 0)

    async def client(number: int) -> None:
        while True:
            try:
                status, headers = await attack.once(number)
            except (OSError, asyncio.IncompleteReadError):
                status, headers = CLOSED, {}
            seen.statuses[status] += 1
            if status in (429, 503) and "retry-after" not in headers:
                seen.faults.append(f"{attack.name}: {status} without Retry-After")
            await asyncio.sleep(max(scale.rest, float(headers.get("retry-after", 0))))

    async def all_of_them() -> None:
        team = [asyncio.ensure_future(client(number)) for number in range(attack.clients)]
        done, _ = await asyncio.wait(team, timeout=scale.seconds)
        for one in team:
            one.cancel()
        await asyncio.gather(*team, return_exceptions=True)
        for one in done:
            one.result()

    asyncio.run(all_of_them())
    seen.faults = list(dict.fromkeys(seen.faults))
    return seen


def _allow_files(count: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft < count:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(count, hard), hard))
