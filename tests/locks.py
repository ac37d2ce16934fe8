"""Whether other processes see that a database of SQLite is open.

A process that closes any descriptor of a file ends all its locks on that file. A test that reads an open
database in its own process takes the locks of the store away, and the next process that opens the database
takes its write-ahead log away: tests that have nothing to do with it then fail. It is seen only from outside.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

_PROGRAM = """
import fcntl, struct, sys

def is_locked(file, first, count):
    with open(file, "rb+") as opened:
        asked = struct.pack("@hhqqi", fcntl.F_WRLCK, 0, first, count, 0)
        return struct.unpack("@hhqqi", fcntl.fcntl(opened, fcntl.F_GETLK, asked))[0] != fcntl.F_UNLCK

for line in sys.stdin:
    name = line.rstrip("\\n")
    try:
        found = is_locked(name, 0x40000002, 510), is_locked(name + "-shm", 128, 1)
    except FileNotFoundError:
        found = False, False
    print(*found, flush=True)
"""
"""Asks for the bytes that SQLite locks while it has a database open, and those of its shared memory."""


class LockWatcher:
    """Another process, which is asked whether a database is open."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-IS", "-c", _PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def sees_open(self, database: Path) -> bool:
        """Whether another process holds both its locks: that of the file and that of the shared memory."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(f"{database}\n")
        self._process.stdin.flush()
        return self._process.stdout.readline() == "True True\n"

    def close(self) -> None:
        """End the process."""
        self._process.communicate()
