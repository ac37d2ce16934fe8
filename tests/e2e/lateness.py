"""Tests that are late: between two of their steps the page may do all that it does by itself."""

from __future__ import annotations

import os
import random
import time
from typing import Any

from playwright._impl._sync_base import SyncBase

LATE_MS = int(os.environ.get("TOUCHLINE_LATE_TESTS", "0"))
"""Milliseconds by which a step of a test is late at most; 0: it is not."""
SHARE = 0.1
"""Of the steps that are late."""


def make_late() -> None:
    """Let some of what tests ask of browsers wait, as on a machine that has no time for tests."""
    if not LATE_MS:
        return
    ask = SyncBase._sync

    def ask_late(base: SyncBase, awaitable: Any) -> Any:
        if random.random() < SHARE:
            # Not as Playwright waits: the page goes on, and nobody hears of it.
            time.sleep(random.random() * LATE_MS / 1000)
        return ask(base, awaitable)

    SyncBase._sync = ask_late  # type: ignore[method-assign]
