"""Attacks: what somebody who means no good asks of a server, in far too many requests at once."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from app.features.groups.edit_codec import VIEW_POINTS
from app.http.request_limits import MOST_WAITING
from app.soccer.pitch import MARKINGS
from tests.torture.background import Background, Busy
from tests.torture.connection import API, Connection, read_answer, write_head
from tests.torture.people import LEAD, log_in
from tests.torture.proxy import Proxy
from tests.torture.quiet import Place
from tests.waiting import SECONDS

CLOSED = 0
"""Stands for the status of a connection that ended without an answer."""
PERSON = "person"
"""Who the quiet parties are."""


@dataclass(frozen=True)
class Scale:
    """How much of each; the defaults are those of ``make torture``."""

    seconds: float = 12.0
    warm_up: float = 8.0
    """Seconds of the quiet parties before anything is measured."""
    bodies: int = 200
    sockets: int = 1100
    streams: int = 200
    uploads: int = 500
    others: int = 50
    pause: float = 0.02
    """Seconds between two requests of each quiet party."""
    rest: float = 1.0
    """Seconds that an attacker rests between an answer and the next request."""


FULL = Scale()
SHORT = Scale(0.4, 0.0, bodies=40, sockets=100, streams=110, uploads=60, others=12)


@dataclass(frozen=True)
class Attack:
    """One request of an attack, made again and again.

    Args:
        name: What it is called.
        clients: How many are at it at once.
        once: One request of the client of that number.
        may: Statuses that are in order, besides 429 and 503 with Retry-After.
        must: One of these has to be among them, for else the attack does not do what it is there for;
            none: whatever comes.
        growth: MB that the server may take beyond what it took at rest.
    """

    name: str
    clients: int
    once: Callable[[int], Awaitable[tuple[int, dict[str, str]]]]
    may: frozenset[int]
    must: frozenset[int] = frozenset()
    growth: float = 300.0


async def nothing(_number: int) -> tuple[int, dict[str, str]]:
    """Somebody who asks for nothing."""
    return 200, {}


def _logged_in(server: Proxy, name: str) -> dict[str, str]:
    """What somebody's requests say of who they are."""
    own = {"Origin": server.address}
    with httpx.Client(base_url=server.address, headers=own, timeout=SECONDS) as http:
        log_in(http, name)
        cookies = [f"{cookie}={value}" for cookie, value in http.cookies.items()]
    return {**own, "Cookie": "; ".join(cookies)}


class Target:
    """A server, what there is to ask of it, and where the quiet parties are meanwhile.

    Args:
        server: Where it is reached.
        scale: How much is asked.
        home: What it serves.
        busy: What there is long work on; None: there is no such work.
    """

    def __init__(self, server: Proxy, scale: Scale, home: Path, busy: Busy | None = None):
        self.scale, self._headers = scale, _logged_in(server, LEAD)
        self.port = port = server.port
        line = Connection(port, self._headers)
        self._background = None if busy is None else Background(line, home, busy)
        with httpx.Client(base_url=server.address, headers=self._headers, timeout=60) as http:
            ids = http.get(f"{API}/groups/ids", params={"dataset": "client0"}).json()["ids"]
            *others, own = ids
            quiet = _logged_in(server, PERSON)
            self.quiet = Place(port, quiet, others[:4], own, others[-1], scale.pause)
            group = http.get(f"{API}/groups/{others[0]}").json()
            # What is read or dragged stays as large as it was.
            edited = [http.get(f"{API}/groups/{one}").json() for one in others[4:-1] or others]
        self._group, self._view = group["id"], group["views"][0]["id"]
        self._key, self._lines = group["views"][0]["key"], group["views"][0]["lines"]
        self._etags = {one["views"][0]["id"]: one["etag"] for one in edited}
        self._turn = itertools.count()
        # More than is read, and more points than a marking may have; made once, for making them
        # takes long.
        self._refused = [_lines_body(self._lines, points) for points in (15_000, 30)]

    def attacks(self) -> list[Attack]:
        """All of them."""
        scale, read = self.scale, frozenset({200})
        refused = frozenset({429, 503} if scale.uploads > MOST_WAITING else ())
        # The proxy ends connections that say nothing without an answer.
        mute = frozenset({CLOSED, 408})
        return [
            Attack("slow bodies", scale.bodies, self._slow_body, mute),
            Attack("idle sockets", scale.sockets, self._idle, mute),
            Attack("streams", scale.streams, self._listen, frozenset({200})),
            Attack("uploads", scale.uploads, self._upload, frozenset({201}), refused),
            Attack("ranges", scale.others, self._ranges, read | {206}),
            Attack("queries", scale.others, self._query, read | {400, 404, 422}),
            Attack("edits", scale.others, self._edit, read | {400, 412, 413, 422}, read),
            Attack("previews", scale.others, self._preview, frozenset({200, 400, 422})),
            *self._long_work(),
        ]

    def _long_work(self) -> list[Attack]:
        work, done = self._background, frozenset({200, 202})
        if work is None:
            return []
        return [
            # Each has a process of its own, which loads what a server does.
            Attack("exporting", 1, work.export, done, growth=600.0),
            Attack("freezing", 1, work.freeze, done, growth=600.0),
            # What is verified goes on when nobody waits for it.
            Attack("judging", 1, work.judge, done, growth=600.0),
            Attack("importing", 1, work.import_, done),
            # The last one, for it goes on when nobody waits; each of its processes has a solver of its own.
            Attack("solving", 1, work.solve, done, growth=1200.0),
        ]

    async def warm_up(self) -> None:
        """Have the process of large edits started, which then belongs to what there is at rest."""
        body = json.dumps({"views": {self._key: {"lines": _largest(0)}}}).encode()
        await self._ask("POST", f"{API}/groups/{self._group}/preview", body)

    async def _slow_body(self, _number: int) -> tuple[int, dict[str, str]]:
        path = f"{API}/views/{self._view}/ball"
        head = write_head("PATCH", path, b" " * 4000, self._own())
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
            writer.write(write_head("GET", f"{API}/events", None, self._own()))
            answer = await _answer(reader, whole=False)
            if answer[0] == 200:
                await asyncio.sleep(self.scale.seconds / 2)
            return answer

    async def _upload(self, number: int) -> tuple[int, dict[str, str]]:
        body = f"{number} {next(self._turn)} ".encode() * 10_000
        path = f"{API}/uploads?name=flood{number}.json"
        return await self._ask("POST", path, body, {"Content-Type": "application/octet-stream"})

    async def _ranges(self, _number: int) -> tuple[int, dict[str, str]]:
        ranges = "bytes=" + ",".join(f"{place}-{place}" for place in range(5000))
        return await self._ask("GET", "/", extra={"Range": ranges})

    async def _query(self, number: int) -> tuple[int, dict[str, str]]:
        terms = ("jac%3C0.95", "sigma%3E0.5", "finding:low_parallax", "status:unreviewed")
        words = "+".join(itertools.islice(itertools.cycle(terms), 28 if number % 2 else 3000))
        return await self._ask("GET", f"{API}/groups?dataset=client0&limit=500&q={words}")

    async def _edit(self, number: int) -> tuple[int, dict[str, str]]:
        """As large as is allowed, of those who have a group for themselves; too large of the others."""
        views = list(self._etags)
        if number >= len(views):
            path, stale = f"{API}/views/{self._view}/lines", {"If-Match": '"not-the-present-one"'}
            return await self._ask("PATCH", path, self._refused[number % 2], extra=stale)
        view = views[number]
        body = json.dumps({"lines": _largest(next(self._turn))}).encode()
        extra = {"If-Match": self._etags[view]}
        status, headers = await self._ask("PATCH", f"{API}/views/{view}/lines", body, extra=extra)
        self._etags[view] = headers.get("etag", self._etags[view])
        return status, headers

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
        self, method: str, path: str, body: bytes | None = None, extra: dict[str, str] | None = None
    ) -> tuple[int, dict[str, str]]:
        async with self._connected() as (reader, writer):
            writer.write(write_head(method, path, body, self._own(extra)) + (body or b""))
            return await _answer(reader)

    def _own(self, extra: dict[str, str] | None = None) -> dict[str, str]:
        return {"Host": f"127.0.0.1:{self.port}", **self._headers, **(extra or {})}

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
    found = await read_answer(reader, whole)
    return found.status, found.headers


def _lines_body(lines: Any, points: int) -> bytes:
    point = {"x": 1.5, "y": 2.5}
    return json.dumps(
        {"lines": {name: [point] * (points // len(lines)) for name in lines}}
    ).encode()


def _largest(turn: int) -> dict[str, list[dict[str, float]]]:
    """Every marking, with as many points in all as a view may have; each turn has others."""
    return {
        name: [
            {"x": 40.0 * number + 0.001 * turn, "y": 20.0 * place + number}
            for number in range(VIEW_POINTS // len(MARKINGS))
        ]
        for place, name in enumerate(MARKINGS)
    }
