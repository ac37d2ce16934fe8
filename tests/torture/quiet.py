"""Quiet parties beside a flood: one reads groups, one edits a group of their own, one drags a ball.

They are in a process of their own, for the attackers keep theirs busy.
"""

from __future__ import annotations

import asyncio
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count

import msgspec

from tests.torture.connection import API, Connection

PARTIES = ("reader", "editor", "previewer")
READY = "ready\n"
"""What the process says once all of them have come."""


@dataclass(frozen=True)
class Place:
    """Where the quiet parties work.

    Attributes:
        port: Of the server.
        headers: Say who they are.
        read: Groups that are read, in turns.
        edited: The group that is edited, by nobody else.
        dragged: The group of which previews are asked.
        pause: Seconds between two requests of each.
    """

    port: int
    headers: dict[str, str]
    read: list[int]
    edited: int
    dragged: int
    pause: float


@dataclass
class Told:
    """What the parties have met: milliseconds of each answer, and what was in the way."""

    milliseconds: dict[str, list[float]] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Request:
    method: str
    path: str
    body: bytes | None = None


class _View(msgspec.Struct):
    id: int
    key: str


class _Group(msgspec.Struct):
    views: list[_View]


class Party:
    """One of them, who asks one thing after the other and expects to be answered with 200."""

    def __init__(self, name: str, place: Place, told: Told):
        self._name, self._place, self._told = name, place, told
        self._own = place.edited if name == "editor" else place.dragged
        self._line = Connection(place.port, place.headers)
        self._etag: str | None = None

    async def come(self) -> None:
        """Open a group."""
        self._view = await self._look()

    async def work(self, ended: asyncio.Event) -> None:
        """Ask, at least once, and rest until it is over."""
        times = self._told.milliseconds.setdefault(self._name, [])
        for request in self._requests(self._view):
            if times and ended.is_set():
                break
            await asyncio.sleep(self._place.pause)
            start = time.perf_counter()
            fault = await self._ask(request)
            times.append(1000 * (time.perf_counter() - start))
            if fault:
                self._told.faults.append(f"{self._name}: {fault}")
                self._line.close()
                # A busy server may not say that either; the next request is told.
                with suppress(OSError, EOFError, KeyError, msgspec.MsgspecError):
                    await self._look()
        self._line.close()

    async def _look(self) -> _View:
        answer = await self._line.ask("GET", f"{API}/groups/{self._own}")
        self._etag = answer.headers["etag"]
        return msgspec.json.decode(answer.body, type=_Group).views[0]

    async def _ask(self, request: _Request) -> str:
        """Why the answer was none that was hoped for; empty: it was."""
        etag = self._etag if request.method == "PATCH" else None
        try:
            answer = await self._line.ask(request.method, request.path, request.body, etag)
        except (OSError, EOFError) as error:
            return type(error).__name__
        if answer.status == 200 and etag is not None:
            self._etag = answer.headers["etag"]
        return "" if answer.status == 200 else str(answer.status)

    def _requests(self, view: _View) -> Iterator[_Request]:
        for turn in count():
            ball = {"box": [100 + turn % 500, 200 + 0.01 * turn, 12, 12]}
            if self._name == "reader":
                group = self._place.read[turn % len(self._place.read)]
                yield _Request("GET", f"{API}/groups/{group}")
            elif self._name == "editor":
                yield _Request("PATCH", f"{API}/views/{view.id}/ball", msgspec.json.encode(ball))
            else:
                dragged = msgspec.json.encode({"views": {view.key: {"ball": ball}}})
                yield _Request("POST", f"{API}/groups/{self._own}/preview", dragged)


async def work(place: Place) -> Told:
    """Let all parties come, say so, and let them work until the standard input ends."""
    told, ended, loop = Told(), asyncio.Event(), asyncio.get_running_loop()

    def wait() -> None:
        sys.stdin.read()
        loop.call_soon_threadsafe(ended.set)

    threading.Thread(target=wait, daemon=True).start()
    team = [Party(name, place, told) for name in PARTIES]
    await asyncio.gather(*(party.come() for party in team))
    sys.stdout.write(READY)
    sys.stdout.flush()
    await asyncio.gather(*(party.work(ended) for party in team))
    return told


def main() -> None:
    """Read where to work, work, and tell what was met."""
    place = msgspec.json.decode(sys.stdin.readline(), type=Place)
    sys.stdout.write(msgspec.json.encode(asyncio.run(work(place))).decode())
