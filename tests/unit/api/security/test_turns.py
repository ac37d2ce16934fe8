"""Turns: people have theirs one after the other, however many requests each of them sends."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from app.api.security.turns import Turns
from tests.waiting import SECONDS


class Waiting:
    """Requests that wait for a place, and the order in which they had one."""

    def __init__(self, width: int = 1, queue: int = 10):
        self.turns = Turns(width, queue)
        self.served: list[str] = []
        self.refused: list[str] = []
        self.tasks: list[asyncio.Task[None]] = []

    def ask(self, who: str, seconds: float = SECONDS) -> asyncio.Task[None]:
        async def run() -> None:
            if self.turns.take() or (
                self.turns.has_room(who) and await self.turns.wait(who, seconds)
            ):
                self.served.append(who)
            else:
                self.refused.append(who)

        task = asyncio.create_task(run())
        self.tasks.append(task)
        return task

    async def settle(self) -> None:
        for _ in range(10):
            await asyncio.sleep(0)

    async def serve_all(self) -> None:
        await self.settle()
        while self.turns.waiting:
            self.turns.give()
            await self.settle()


def run(test: Callable[[], Awaitable[None]]) -> None:
    async def inside() -> None:
        await test()

    asyncio.run(inside())


class TestTurns:
    def test_people_have_theirs_one_after_the_other(self) -> None:
        async def test() -> None:
            it = Waiting()
            for who in ("ann", "ann", "ann", "ann", "bob", "eve", "bob"):
                it.ask(who)
            await it.serve_all()
            assert it.served == ["ann", "ann", "bob", "eve", "ann", "bob", "ann"]
            it.turns.give()
            assert (it.turns.free, it.turns.waiting) == (1, 0)

        run(test)

    def test_where_no_more_may_wait_who_asks_most_makes_room_for_others(self) -> None:
        async def test() -> None:
            it = Waiting(queue=4)
            for who in ("ann", "ann", "ann", "ann", "ann", "ann", "bob", "eve"):
                it.ask(who)
                await it.settle()
            # One of ann's had a place, four waited, the sixth was one too many, and two made room.
            assert it.refused == ["ann", "ann", "ann"]
            await it.serve_all()
            assert it.served == ["ann", "ann", "bob", "eve", "ann"]

        run(test)

    def test_nobody_is_displaced_by_somebody_who_asks_as_much(self) -> None:
        async def test() -> None:
            it = Waiting(queue=2)
            for who in ("ann", "ann", "bob", "bob", "ann", "eve"):
                it.ask(who)
                await it.settle()
            assert it.refused == ["bob", "ann", "eve"]
            await it.serve_all()
            assert it.served == ["ann", "ann", "bob"]

        run(test)

    def test_who_waited_too_long_or_went_leaves_no_place_lost(self) -> None:
        async def test() -> None:
            it = Waiting()
            it.ask("ann")
            await it.ask("bob", seconds=0.001)
            gone = it.ask("eve")
            await it.settle()
            gone.cancel()
            await it.settle()
            assert (it.refused, it.turns.waiting) == (["bob"], 0)
            it.turns.give()
            assert it.turns.free == 1

        run(test)

    def test_who_goes_in_the_moment_of_the_turn_gives_it_to_the_next(self) -> None:
        async def test() -> None:
            it = Waiting()
            it.ask("ann")
            gone = it.ask("bob")
            it.ask("eve")
            await it.settle()
            it.turns.give()
            gone.cancel()
            await it.settle()
            assert it.served == ["ann", "eve"]
            it.turns.give()
            assert it.turns.free == 1

        run(test)
