"""Attempts: tries counted against a limit by all processes of a server together."""

from __future__ import annotations

import time
from collections.abc import Callable

from app.review.people.tokens import hash_of
from app.store.short_lived import note_attempt, oldest_attempt
from app.store.store import Store


class Attempts:
    """Tries in a moving window.

    Args:
        store: Where they are counted.
        clock: Says what time it is, in seconds since 1970.
    """

    def __init__(self, store: Store, clock: Callable[[], float] = time.time):
        self._store, self._clock = store, clock

    def hit(self, whose: str, most: int, seconds: float) -> float | None:
        """Count a try; None, or after how many seconds there may be another where there were too many.

        Who is refused writes nothing: a flood keeps nobody from writing.
        """
        at, name = self._clock(), hash_of(whose)
        with self._store.glance() as session:
            oldest = oldest_attempt(session, name, at - seconds, most)
        if oldest is None:
            with self._store.write(lasting=False) as session:
                oldest = oldest_attempt(session, name, at - seconds, most)
                if oldest is None:
                    note_attempt(session, name, at)
        return None if oldest is None else oldest + seconds - at
