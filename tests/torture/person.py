"""People of a crowd, in a process of their own, which takes little of the processor."""

from __future__ import annotations

import asyncio
import random
import sys
import time
from collections import Counter
from dataclasses import dataclass, field

import msgspec

from tests.torture.connection import API, Answer, Connection

READY = "ready\n"
"""What a process of people says before it waits to be told to go on."""


@dataclass(frozen=True)
class Shift:
    """What the people of one process are to do.

    Attributes:
        port: Of the server.
        groups: Those that each of them works on.
        seeds: Decide what each of them does.
        seconds: For how long.
        think: Mean of the seconds between two requests of a person; 0: none.
    """

    port: int
    groups: list[list[int]]
    seeds: list[int]
    seconds: float
    think: float


@dataclass
class Work:
    """What people have done and met.

    Attributes:
        milliseconds: How long answers took, by kind of request.
        statuses: How often each came.
        accepted: Group and new ETag of each change that was answered with 200.
        faults: Why somebody had to stop.
        processor: Seconds of the processor that they took.
    """

    milliseconds: dict[str, list[float]] = field(default_factory=dict)
    statuses: dict[int, int] = field(default_factory=dict)
    accepted: list[tuple[int, str]] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    processor: float = 0.0


class _View(msgspec.Struct):
    id: int


class _Verdict(msgspec.Struct):
    state: str


class _Group(msgspec.Struct):
    """What a person needs to know of a group; the rest of a document is passed over."""

    id: int
    views: list[_View]
    verdict: _Verdict


_READ = msgspec.json.Decoder(_Group)


class Person:
    """Somebody who opens a group, moves a ball, judges, thinks, and goes on to the next."""

    def __init__(self, port: int, groups: list[int], seed: int, think: float):
        self.milliseconds: dict[str, list[float]] = {"group": [], "ball": [], "verdict": []}
        self.statuses: Counter[int] = Counter()
        self.accepted: list[tuple[int, str]] = []
        self.fault: str | None = None
        self._line = Connection(port)
        self._groups, self._think = groups, think
        self._random = random.Random(seed)

    async def work(self, until: float) -> None:
        """Come in, not all at the same moment, and work until the time is over."""
        try:
            await self._pause()
            while time.monotonic() < until:
                await self._treat(self._random.choice(self._groups))
        except Exception as error:
            self.fault = f"{type(error).__name__}: {error}"
        finally:
            self._line.close()

    async def _treat(self, group_id: int) -> None:
        answer = await self._ask("group", "GET", f"/groups/{group_id}")
        await self._pause()
        view = self._random.choice(_READ.decode(answer.body).views)
        box = [round(self._random.uniform(50, 800), 2), round(self._random.uniform(50, 450), 2)]
        edit = {"box": [*box, 12.0, 12.5]}
        moved = await self._change(
            group_id, "ball", "PATCH", f"/views/{view.id}/ball", edit, answer
        )
        if moved is None:
            return
        await self._pause()
        given = _READ.decode(moved.body).verdict.state
        state = {"state": "unreviewed" if given == "deferred" else "deferred"}
        await self._change(group_id, "verdict", "PUT", f"/groups/{group_id}/verdict", state, moved)

    async def _change(
        self, group: int, kind: str, method: str, path: str, body: object, before: Answer
    ) -> Answer | None:
        answer = await self._ask(kind, method, path, body, before.headers["etag"])
        if answer.status != 200:
            return None
        self.accepted.append((group, answer.headers["etag"]))
        return answer

    async def _ask(
        self, kind: str, method: str, path: str, body: object = None, etag: str | None = None
    ) -> Answer:
        sent = None if body is None else msgspec.json.encode(body)
        start = time.perf_counter()
        answer = await self._line.ask(method, API + path, sent, etag)
        self.milliseconds[kind].append(1000 * (time.perf_counter() - start))
        self.statuses[answer.status] += 1
        return answer

    async def _pause(self) -> None:
        if self._think:
            await asyncio.sleep(self._random.expovariate(1 / self._think))


async def work(shift: Shift) -> Work:
    """Let the people of a shift work until their time is over."""
    team = [
        Person(shift.port, groups, seed, shift.think)
        for groups, seed in zip(shift.groups, shift.seeds, strict=True)
    ]
    begun, until = time.process_time(), time.monotonic() + shift.seconds
    await asyncio.gather(*(person.work(until) for person in team))
    done = Work(processor=time.process_time() - begun)
    statuses: Counter[int] = Counter()
    for person in team:
        statuses += person.statuses
        done.accepted += person.accepted
        done.faults += [person.fault] if person.fault else []
        for kind, times in person.milliseconds.items():
            done.milliseconds.setdefault(kind, []).extend(times)
    done.statuses = dict(statuses)
    return done


def main() -> None:
    """Read a shift, wait to be told to go on, and tell what was done."""
    shift = msgspec.json.decode(sys.stdin.readline(), type=Shift)
    sys.stdout.write(READY)
    sys.stdout.flush()
    sys.stdin.readline()
    sys.stdout.write(msgspec.json.encode(asyncio.run(work(shift))).decode())
