"""Tries: how often somebody may ask whether a password is right."""

from __future__ import annotations

import math
import time

from limits import RateLimitItem, parse
from limits.storage import MemoryStorage
from limits.strategies import MovingWindowRateLimiter

from app.errors import TooManyTriesError

OF_A_NAME = parse("10/minute")
OF_AN_ADDRESS = parse("60/minute")
"""Many people may come from one address in the morning; each name has a limit of its own."""


class Tries:
    """Counts tries in the memory of this process, which is the only one that takes them."""

    def __init__(self) -> None:
        self._windows = MovingWindowRateLimiter(MemoryStorage())

    def count(self, address: str, name: str | None = None) -> None:
        """Count a try; whether it would have been right makes no difference.

        Raises:
            TooManyTriesError: There were too many of this name, or from this address.
        """
        self._count(OF_AN_ADDRESS, "address", address)
        if name is not None:
            self._count(OF_A_NAME, "name", name.strip().lower()[:200])

    def _count(self, limit: RateLimitItem, *key: str) -> None:
        if not self._windows.hit(limit, *key):
            ends = self._windows.get_window_stats(limit, *key).reset_time
            raise TooManyTriesError(max(1, math.ceil(ends - time.time())))
