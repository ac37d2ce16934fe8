"""A flood: clients that ask for too much, and a quiet reader who must not feel them.

Each attack keeps one kind of pressure up for a while: half-sent bodies, sockets that say nothing,
windows that listen, uploads, lists of ranges, long queries, large edits. The server may refuse
(429 or 503 with Retry-After, 4xx); it may not fail, grow without end, or keep others waiting.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import re
import resource
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from tests.torture.kills import API, Server

MOST_GROWTH_MB = 300.0
"""What the server may take beyond what it took at rest."""
MOST_TIMES = 3.0
"""How much slower the reader's p99 may become."""
LEAST_MS = 50.0
"""A p99 below this is quiet, whatever the machine does besides."""
CLOSED = 0
"""Stands for the status of a connection that ended without an answer."""
READER = """
import http.client, json, sys, threading, time
port, paths, pause = int(sys.argv[1]), sys.argv[2].split(","), float(sys.argv[3])
ended = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
line = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
times, faults, turn = [], [], 0
while not ended.wait(pause):
    start = time.perf_counter()
    try:
        line.request("GET", paths[turn % len(paths)])
        answer = line.getresponse()
        answer.read()
        if answer.status != 200:
            faults.append(f"{paths[turn % len(paths)]}: {answer.status}")
    except (OSError, http.client.HTTPException) as error:
        faults.append(f"{paths[turn % len(paths)]}: {type(error).__name__}")
        line.close()
    times.append(1000 * (time.perf_counter() - start))
    turn += 1
json.dump([times, faults], sys.stdout)
"""
"""Somebody who looks at groups, in a process of their own: the attackers are at work in this one."""


@dataclass(frozen=True)
class Scale:
    """How much of each; the defaults are those of ``make torture``."""

    seconds: float = 12.0
    bodies: int = 200
    sockets: int = 1100
    streams: int = 200
    uploads: int = 500
    others: int = 50
    pause: float = 0.02
    """Seconds between two looks of the reader."""
    rest: float = 1.0
    """Seconds that an attacker rests between an answer and the next request."""


SHORT = Scale(0.4, bodies=40, sockets=100, streams=110, uploads=60, others=12)


@dataclass
class Seen:
    """What one attack came to; times in milliseconds, memory in MB."""

    name: str
    reads: list[float]
    peak_mb: float
    statuses: Counter[int] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    @property
    def p99(self) -> float:
        """Of the reader's requests."""
        return float(np.percentile(self.reads or [np.nan], 99))

    def line(self) -> str:
        """The figures for people."""
        p50 = float(np.percentile(self.reads or [np.nan], 50))
        told = ", ".join(f"{count} x {code or 'closed'}" for code, count in self.statuses.items())
        return (
            f"  {self.name:12} reader p50 {p50:5.0f}  p99 {self.p99:5.0f} ms of "
            f"{len(self.reads):4}; server {self.peak_mb:4.0f} MB; {told or 'no answers'}"
        )


@dataclass(frozen=True)
class Attack:
    """One request of an attack, made again and again.

    Args:
        name: What it is called.
        clients: How many are at it at once.
        once: One request of the client of that number.
        may: Statuses that are in order, besides 429 and 503 with Retry-After.
    """

    name: str
    clients: int
    once: Callable[[int], Awaitable[tuple[int, dict[str, str]]]]
    may: frozenset[int]


def flood(
    home: Path,
    scale: Scale = Scale(),
    *,
    times: float | None = MOST_TIMES,
    only: tuple[str, ...] = (),
    plant: str = "",
    tell: Callable[[str], None] = lambda _sentence: None,
) -> list[str]:
    """Flood a server over a home; what was not in order, one sentence each.

    Args:
        home: A home that ``kills.prepare`` has made.
        scale: How much of each.
        times: How much slower the reader may become; None: that is not judged.
        only: Names of attacks; none: all.
        plant: Python that the server runs first, to plant a fault.
        tell: Called with each line of figures.
    """
    _allow_files(scale.sockets + 200)
    server = Server(home, plant)
    server.start()
    try:
        server.wait()
        target = _Target(server.port, scale)
        quiet = _watched(server, target, "nobody", lambda: None)
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
    if seen.peak_mb > quiet.peak_mb + MOST_GROWTH_MB:
        faults.append(f"{seen.name}: the server took {seen.peak_mb:.0f} MB")
    most = np.inf if times is None else max(times * quiet.p99, LEAST_MS)
    if seen.p99 > most:
        faults.append(f"{seen.name}: the reader waited {seen.p99:.0f} ms, {quiet.p99:.0f} before")
    return faults


def _watched(server: Server, target: _Target, name: str, attack: Callable[[], Seen | None]) -> Seen:
    """Let somebody read, and look at the server's memory, while an attack lasts."""
    with _reading(target) as read, _memory(server.pid) as peak:
        found = attack()
        if found is None:
            threading.Event().wait(target.scale.seconds)
    times, faults = read()
    seen = found or Seen(name, [], 0)
    seen.reads, seen.peak_mb = times, peak()
    seen.faults += [f"{name}: the reader met {fault}" for fault in dict.fromkeys(faults)]
    return seen


@contextmanager
def _reading(target: _Target) -> Iterator[Callable[[], tuple[list[float], list[str]]]]:
    command = [sys.executable, "-c", READER, str(target.port), ",".join(target.read)]
    process = subprocess.Popen(
        [*command, str(target.scale.pause)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    found: list[Any] = []
    try:
        yield lambda: (found[0], found[1])
    finally:
        found += json.loads(process.communicate(timeout=120)[0])


@contextmanager
def _memory(pid: int) -> Iterator[Callable[[], float]]:
    """The most that a process holds at a time, MB."""
    peak, ended = [0.0], threading.Event()

    def look() -> None:
        while True:
            text = Path(f"/proc/{pid}/status").read_text()
            peak[0] = max(peak[0], int(re.findall(r"VmRSS:\s+(\d+)", text)[0]) / 1024)
            if ended.wait(0.05):
                return

    watcher = threading.Thread(target=look, daemon=True)
    watcher.start()
    try:
        yield lambda: peak[0]
    finally:
        ended.set()
        watcher.join()


def run(attack: Attack, scale: Scale) -> Seen:
    """Let all clients of an attack work for a while."""
    seen = Seen(attack.name, [], 0)

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


async def nothing(_number: int) -> tuple[int, dict[str, str]]:
    """Somebody who asks for nothing."""
    return 200, {}


class _Target:
    """A server and what there is to ask of it."""

    def __init__(self, port: int, scale: Scale):
        self.port, self.scale = port, scale
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60) as http:
            ids = http.get(f"{API}/groups/ids", params={"dataset": "client0"}).json()["ids"]
            self.read = [f"{API}/groups/{group}" for group in ids[:4]]
            group = http.get(self.read[0]).json()
        self._etag, self._group = group["etag"], group["id"]
        self._view = group["views"][0]["id"]
        self._key, self._lines = group["views"][0]["key"], group["views"][0]["lines"]
        self._turn = itertools.count()
        # More than is read, and as much as a person sends; made once, for making them takes long.
        self._edits = [_lines_body(self._lines, points) for points in (15_000, 30)]

    def attacks(self) -> list[Attack]:
        """All of them."""
        scale, read = self.scale, frozenset({200})
        # A connection more than there is room for ends without an answer.
        mute = frozenset({CLOSED, 408})
        return [
            Attack("slow bodies", scale.bodies, self._slow_body, mute),
            Attack("idle sockets", scale.sockets, self._idle, mute),
            Attack("streams", scale.streams, self._listen, frozenset({200})),
            Attack("uploads", scale.uploads, self._upload, frozenset({201})),
            Attack("ranges", scale.others, self._ranges, read | {206}),
            Attack("queries", scale.others, self._query, read | {400, 414, 422, 431}),
            Attack("edits", scale.others, self._edit, frozenset({400, 412, 413, 422})),
            Attack("previews", scale.others, self._preview, frozenset({200, 400, 422})),
        ]

    async def _slow_body(self, _number: int) -> tuple[int, dict[str, str]]:
        head = self._head("PATCH", f"{API}/views/{self._view}/ball", b" " * 4000)
        async with self._connected() as (reader, writer):
            writer.write(head)
            answer = asyncio.ensure_future(_answer(reader))
            try:
                while not answer.done():
                    writer.write(b" ")
                    await asyncio.wait({answer}, timeout=0.5)
                return await answer
            finally:
                answer.cancel()

    async def _idle(self, _number: int) -> tuple[int, dict[str, str]]:
        async with self._connected() as (reader, _):
            return await _answer(reader)

    async def _listen(self, _number: int) -> tuple[int, dict[str, str]]:
        async with self._connected() as (reader, writer):
            writer.write(self._head("GET", f"{API}/events"))
            answer = await _answer(reader, whole=False)
            if answer[0] == 200:
                await asyncio.sleep(self.scale.seconds / 2)
            return answer

    async def _upload(self, number: int) -> tuple[int, dict[str, str]]:
        body = f"{number} {next(self._turn)} ".encode() * 10_000
        path = f"{API}/uploads?name=flood{number}.json"
        return await self._ask("POST", path, body, "application/octet-stream")

    async def _ranges(self, _number: int) -> tuple[int, dict[str, str]]:
        ranges = "bytes=" + ",".join(f"{place}-{place}" for place in range(5000))
        return await self._ask("GET", "/", extra={"Range": ranges})

    async def _query(self, number: int) -> tuple[int, dict[str, str]]:
        terms = ("jac%3C0.95", "sigma%3E0.5", "finding:low_parallax", "status:unreviewed")
        words = "+".join(itertools.islice(itertools.cycle(terms), 28 if number % 2 else 3000))
        return await self._ask("GET", f"{API}/groups?dataset=client0&limit=500&q={words}")

    async def _edit(self, number: int) -> tuple[int, dict[str, str]]:
        body = self._edits[number % 2]
        extra = {"If-Match": '"not-the-present-one"'}
        return await self._ask("PATCH", f"{API}/views/{self._view}/lines", body, extra=extra)

    async def _preview(self, _number: int) -> tuple[int, dict[str, str]]:
        # As many points as one marking may have: a camera is sought for each request.
        aside = 0.001 * next(self._turn)
        lines = {
            name: [
                {"x": points[n % len(points)]["x"] + aside, "y": points[n % len(points)]["y"]}
                for n in range(20)
            ]
            for name, points in self._lines.items()
        }
        body = json.dumps({"views": {self._key: {"lines": lines}}}).encode()
        return await self._ask("POST", f"{API}/groups/{self._group}/preview", body)

    async def _ask(
        self,
        method: str,
        path: str,
        body: bytes = b"",
        kind: str = "application/json",
        extra: dict[str, str] | None = None,
    ) -> tuple[int, dict[str, str]]:
        async with self._connected() as (reader, writer):
            writer.write(self._head(method, path, body, kind, extra) + body)
            return await _answer(reader)

    def _head(
        self,
        method: str,
        path: str,
        body: bytes = b"",
        kind: str = "application/json",
        extra: dict[str, str] | None = None,
    ) -> bytes:
        headers = {"Host": f"127.0.0.1:{self.port}", **(extra or {})}
        if method != "GET":
            headers |= {"Content-Type": kind, "Content-Length": str(len(body))}
        lines = [f"{method} {path} HTTP/1.1", *(f"{k}: {v}" for k, v in headers.items()), "", ""]
        return "\r\n".join(lines).encode()

    @asynccontextmanager
    async def _connected(
        self,
    ) -> AsyncIterator[tuple[asyncio.StreamReader, asyncio.StreamWriter]]:
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        try:
            yield reader, writer
        finally:
            writer.close()


async def _answer(reader: asyncio.StreamReader, whole: bool = True) -> tuple[int, dict[str, str]]:
    """Status and headers of an answer; its body is read and thrown away."""
    head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
    headers = {k.lower(): v.strip() for k, _, v in (line.partition(":") for line in head[1:])}
    if whole and headers.get("content-length", "").isdigit():
        await reader.readexactly(int(headers["content-length"]))
    return int(head[0].split(" ")[1]), headers


def _lines_body(lines: Any, points: int) -> bytes:
    point = {"x": 1.5, "y": 2.5}
    return json.dumps(
        {"lines": {name: [point] * (points // len(lines)) for name in lines}}
    ).encode()


def _allow_files(count: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft < count:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(count, hard), hard))
