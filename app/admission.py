"""Admission: a request's permission to compute, released when it begins to wait.

One interpreter computes one thing at a time, so that few requests are admitted at once. A request that
waits for a disk or for another process makes room for the next one.
"""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar

_RELEASE: ContextVar[Callable[[], None] | None] = ContextVar("admission", default=None)


def hold_admission(release: Callable[[], None]) -> None:
    """Set how what is called from here on, in other threads too, releases its admission."""
    _RELEASE.set(release)


def release_admission() -> None:
    """Release the admission for good, where there is one; may be called again."""
    release = _RELEASE.get()
    if release is not None:
        release()
