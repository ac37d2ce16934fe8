"""Counting: what the requests to a server cost, where times would say how busy the machine is.

A server is told to count (``plant``); ``Meter`` reads what it has counted while it runs.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from sqlalchemy import Connection, Engine, event

FILE = "torture-counts"
STATEMENTS, TRANSACTIONS, COMMITS = range(3)
_SHAPE = (3,)


def plant(home: Path) -> str:
    """Python that lets a server count into a file of its home."""
    return f"from tests.torture import counting; counting.count({str(home / FILE)!r})"


def count(file: str) -> None:
    """Count every statement, transaction and commit of this process from now on."""
    counts = np.memmap(file, dtype=np.uint64, mode="w+", shape=_SHAPE)

    def one(place: int) -> Callable[..., None]:
        def add(*_: object) -> None:
            counts[place] += np.uint64(1)

        return add

    def written(connection: Connection) -> None:
        if connection.get_execution_options().get("touchline_write"):
            counts[COMMITS] += np.uint64(1)

    event.listen(Engine, "before_cursor_execute", one(STATEMENTS))
    event.listen(Engine, "begin", one(TRANSACTIONS))
    event.listen(Engine, "commit", written)


def processor(pid: int) -> float:
    """Seconds of the processor that a process and all below it have taken, ended ones too."""
    ticks = 0
    for one in family(pid):
        with suppress(FileNotFoundError, ProcessLookupError):
            ticks += sum(map(int, _fields(Path(f"/proc/{one}/stat"))[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


def family(pid: int) -> list[int]:
    """A process and all below it."""
    parents: dict[int, int] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(FileNotFoundError, ProcessLookupError):
            parents[int(stat.parent.name)] = int(_fields(stat)[1])
    found = [pid]
    for one in found:
        found += [child for child, parent in parents.items() if parent == one]
    return found


def _fields(stat: Path) -> list[str]:
    # The name, in brackets, may hold anything.
    return stat.read_text().rpartition(")")[2].split()


class Meter:
    """What a server and its processes have used since it was looked at last; statements are those of
    the server itself.

    Args:
        home: Of the server.
        pid: Of its process.
    """

    def __init__(self, home: Path, pid: int):
        self._counts = np.memmap(home / FILE, dtype=np.uint64, mode="r", shape=_SHAPE)
        self._pid = pid
        self._before = self._read()

    def lap(self) -> np.ndarray:
        """Statements, transactions, commits and milliseconds of processor since the last lap."""
        now = self._read()
        used, self._before = now - self._before, now
        return used

    def _read(self) -> np.ndarray:
        tasks = [task for one in family(self._pid) for task in Path(f"/proc/{one}/task").iterdir()]
        busy = sum(int((task / "schedstat").read_text().split()[0]) for task in tasks)
        return np.array([*self._counts.astype(float), busy / 1e6])
