"""Slot: a request's place among those that compute, given back by whoever begins to wait.

One interpreter computes one thing at a time, so that few requests are let in at once. One that waits
for a disk or for another process keeps nobody out.
"""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar

_LEAVE: ContextVar[Callable[[], None] | None] = ContextVar("slot", default=None)


def hold_slot(leave: Callable[[], None]) -> None:
    """Say how what is called from here on, in other threads too, gives its slot back."""
    _LEAVE.set(leave)


def leave_slot() -> None:
    """Give it back for good, where there is one; may be called again."""
    leave = _LEAVE.get()
    if leave is not None:
        leave()
