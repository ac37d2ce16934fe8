"""Keep: how the answer to a request gets into the transaction of the work that it asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from app.store.session import Session

T = TypeVar("T")

Kept = Callable[[Session], None]
"""Writes an answer into a transaction; called as the last in it."""
Keep = Callable[[T], Kept]
"""Makes the answer of what work came to, to be kept in the transaction of that work: then the
same request, sent again, gets it, wherever the server was stopped."""


def keep_nothing(_outcome: object) -> Kept:
    """For work that nobody asked for under a key."""
    return lambda _session: None
