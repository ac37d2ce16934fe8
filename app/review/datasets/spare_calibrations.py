"""Spare calibrations: those that no solution rests on any more are deleted, whoever left them."""

from __future__ import annotations

from collections.abc import Callable

from app.store.orphans import delete_calibrations, spare_calibrations
from app.store.store import Store

CHUNK = 2000
"""Calibrations a transaction: nobody who saves waits long for it."""


def delete_spare_calibrations(store: Store, wanted: Callable[[], bool] = lambda: True) -> int:
    """Delete them in short transactions; returns how many there were.

    While a group waits to be solved they stay: its solver may have read them already. The rest is
    left once it is no longer ``wanted``.
    """
    with store.read() as session:
        keys = spare_calibrations(session)
    gone = 0
    for start in range(0, len(keys), CHUNK):
        if not wanted():
            break
        with store.write() as session:
            gone += delete_calibrations(session, keys[start : start + CHUNK])
    return gone
