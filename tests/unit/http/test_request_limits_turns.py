"""Turns: people have theirs one after the other, however many requests each of them sends."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from app.http.request_limits import FairLimiter
from tests.waiting import SECONDS


class Waiting:
    """Requests that wait for a place, and the order in which they had one."""

    def __init__(self, width: int = 1, queue: int = 10, each: int | None = None):
        self.turns = FairLimiter(width, queue, each)
        self.at_work: list[str] = []
        self.served: list[str] = []
        self.refused: list[str] = []
        self.tasks: list[asyncio.Task[None]] = []

    def ask(self, who: str, seconds: float = SECONDS) -> asyncio.Task[None]:
        async def run() -> None:
            if self.turns.take(who) or (
                self.turns.has_room(who) and await self.turns.wait(who, seconds)
            ):
                self.served.append(who)
                self.at_work.append(who)
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
            self.end()
            await self.settle()

    def end(self) -> None:
        """The request that has been at work longest has its answer."""
        self.turns.give(self.at_work.pop(0))


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
            it.end()
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
            it.end()
            assert it.turns.free == 1

        run(test)

    def test_who_goes_in_the_moment_of_the_turn_gives_it_to_the_next(self) -> None:
        async def test() -> None:
            it = Waiting()
            it.ask("ann")
            gone = it.ask("bob")
            it.ask("eve")
            await it.settle()
            it.end()
            gone.cancel()
            await it.settle()
            assert it.served == ["ann", "eve"]
            it.end()
            assert it.turns.free == 1

        run(test)

    def test_one_person_has_no_more_places_than_each_may_and_others_have_the_rest(self) -> None:
        async def test() -> None:
            it = Waiting(width=2, each=1)
            for who in ("ann", "ann", "ann"):
                it.ask(who)
            await it.settle()
            assert (it.served, it.turns.free) == (["ann"], 1)
            for who in ("bob", "eve"):
                it.ask(who)
            await it.settle()
            assert it.served == ["ann", "bob"]
            it.end()
            await it.settle()
            # Ann waited before eve.
            assert it.served == ["ann", "bob", "ann"]
            await it.serve_all()
            assert it.served == ["ann", "bob", "ann", "eve", "ann"]
            while it.at_work:
                it.end()
            assert (it.turns.free, it.turns.waiting) == (2, 0)

        run(test)

    def test_who_has_no_name_may_have_all(self) -> None:
        async def test() -> None:
            it = Waiting(width=2, each=1)
            for _ in range(3):
                it.ask("")
            await it.settle()
            assert (it.served, it.turns.free, it.turns.waiting) == (["", ""], 0, 1)
            await it.serve_all()
            while it.at_work:
                it.end()
            assert it.turns.free == 2

        run(test)
