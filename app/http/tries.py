"""Tries: how often somebody may ask whether a password, or a token, is right."""

from __future__ import annotations

import math
import time

from limits import RateLimitItem, parse
from limits.storage import MemoryStorage
from limits.strategies import MovingWindowRateLimiter

from app.db.store import Store
from app.errors import TooManyTriesError
from app.features.people.devices import Attempts

OF_A_NAME = parse("10/minute")
"""From one address, or from one browser in which the person has logged in before."""
OF_A_NAME_BY_STRANGERS = parse("100/hour")
"""From all addresses together: a password is guessed no faster by many machines. Browsers in which the
person has logged in before are not counted, and not refused, so nobody can lock them out."""
OF_AN_ADDRESS = parse("60/minute")
"""Many people may come from one address in the morning; each name has a limit of its own."""
CODES_OF_A_NAME = parse("20/hour")
"""Codes of second factors: there are but a million, and three of them are right at a time."""
TOKENS_OF_AN_ADDRESS = parse("60/minute")
"""Tokens that are none. Apart from passwords: a forgotten script keeps nobody from logging in."""
CHALLENGES_OF_AN_ADDRESS = parse("120/minute")
"""Challenges for passkeys, which cost the server some bytes for five minutes."""


class Tries:
    """Counts tries in the memory of this process, or in the database where others take them, too."""

    def __init__(self, store: Store | None = None) -> None:
        shared = store is not None and store.sharing.is_shared
        self._shared = Attempts(store) if store is not None and shared else None
        self._windows = MovingWindowRateLimiter(MemoryStorage())

    def count(self, address: str, name: str | None = None, device: str | None = None) -> None:
        """Count a try; whether it would have been right makes no difference.

        Args:
            address: Where it comes from.
            name: Whose password it is.
            device: The browser that it comes from, if the person has logged in there before.

        Raises:
            TooManyTriesError: There were too many of this name, or from this address.
        """
        self._count_try(OF_AN_ADDRESS, "address", address)
        if name is None:
            return
        name = name.strip().lower()[:200]
        if device is not None:
            self._count_try(OF_A_NAME, "device", name, device)
            return
        self._count_try(OF_A_NAME, "name", name, address)
        self._count_try(OF_A_NAME_BY_STRANGERS, "name", name)

    def count_code(self, name: str) -> None:
        """Count a code of a second factor.

        Raises:
            TooManyTriesError: There were too many of this name.
        """
        self._count_try(CODES_OF_A_NAME, "code", name.strip().lower()[:200])

    def count_token(self, address: str) -> None:
        """Count a token that is not valid; those that are count nothing.

        Raises:
            TooManyTriesError: There were too many from this address.
        """
        self._count_try(TOKENS_OF_AN_ADDRESS, "token", address)

    def count_challenge(self, address: str) -> None:
        """Count a challenge for a passkey.

        Raises:
            TooManyTriesError: There were too many from this address.
        """
        self._count_try(CHALLENGES_OF_AN_ADDRESS, "challenge", address)

    def _count_try(self, limit: RateLimitItem, *key: str) -> None:
        if self._shared is not None:
            wait = self._shared.hit("/".join(key), limit.amount, limit.get_expiry())
            if wait is not None:
                raise TooManyTriesError(max(1, math.ceil(wait)))
        elif not self._windows.hit(limit, *key):
            ends = self._windows.get_window_stats(limit, *key).reset_time
            raise TooManyTriesError(max(1, math.ceil(ends - time.time())))
