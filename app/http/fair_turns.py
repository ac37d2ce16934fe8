"""Turns: the places of a lane, given to those who wait person by person.

Whoever sends a hundred requests at once waits for them himself; others wait for one of them each.
"""

from __future__ import annotations

import asyncio
from collections import Counter, deque


class Turns:
    """Places on one event loop.

    Args:
        width: How many there are.
        queue: How many requests may wait for one.
        each: How many one person may have at a time; None: all. Who has no name, as on a server that
            somebody runs alone, may have all.
    """

    def __init__(self, width: int, queue: int, each: int | None = None):
        self.width, self.free, self.waiting = width, width, 0
        self._queue, self._each = queue, width if each is None else each
        self._at_work = Counter[str]()
        self._of: dict[str, deque[asyncio.Future[bool]]] = {}
        """Those who wait, with their requests: whose turn is next comes first."""

    def take(self, who: str) -> bool:
        """Take a place where one is free for somebody."""
        if not self._may(who):
            return False
        self.free -= 1
        self._at_work[who] += 1
        return True

    def has_room(self, who: str) -> bool:
        """Whether somebody may wait. Where all may not, somebody with few requests displaces the
        newest of whoever waits with the most."""
        if self.waiting < self._queue:
            return True
        most = max(self._of.values(), key=len, default=deque[asyncio.Future[bool]]())
        if len(most) <= len(self._of.get(who, ())) + 1:
            return False
        most.pop().set_result(False)
        self.waiting -= 1
        return True

    async def wait(self, who: str, seconds: float) -> bool:
        """Whether a place was given in time; without, the request was displaced or waited too long."""
        mine = asyncio.get_running_loop().create_future()
        self._of.setdefault(who, deque()).append(mine)
        self.waiting += 1
        try:
            await asyncio.wait((mine,), timeout=seconds)
        except asyncio.CancelledError:
            if mine.done() and mine.result():
                self.give(who)
            raise
        finally:
            if not mine.done():
                self._forget(who, mine)
        return mine.done() and mine.result()

    def give(self, who: str) -> None:
        """Give somebody's place back, to whose turn it is."""
        self.free += 1
        self._at_work[who] -= 1
        if not self._at_work[who]:
            del self._at_work[who]
        following = next(filter(self._may, self._of), None)
        if following is None:
            return
        waiting = self._of.pop(following)
        self.take(following)
        waiting.popleft().set_result(True)
        self.waiting -= 1
        if waiting:
            self._of[following] = waiting

    def _may(self, who: str) -> bool:
        return self.free > 0 and (not who or self._at_work[who] < self._each)

    def _forget(self, who: str, mine: asyncio.Future[bool]) -> None:
        self._of[who].remove(mine)
        self.waiting -= 1
        if not self._of[who]:
            del self._of[who]
