"""Locks of a home: one server, and who has the database open. They end with their process."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from app.config import Settings
from app.db.home import (
    DATABASE_LOCK,
    OPENING_LOCK,
    PRACTICE_LOCK,
    SERVER_LOCK,
    make_file_access_error,
    make_home,
)
from app.errors import BusyError, StorageError

AGAIN_S = 0.005
"""Between two looks whether a lock is free."""
NOTICE_SECONDS = 0.1
"""Between two words that somebody still waits."""
OPENING_SECONDS = 60.0
"""So long who opens the database waits for another process that does, and may be migrating it."""


def try_to_lock(handle: int, seconds: float, kind: int = fcntl.LOCK_EX) -> bool:
    """Take the lock of an open file or folder; False where others had it all the while."""
    until = time.monotonic() + seconds
    while True:
        try:
            fcntl.flock(handle, kind | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            if time.monotonic() >= until:
                return False
            time.sleep(AGAIN_S)


def require_lock(handle: int, held: str, seconds: float) -> None:
    """Take the lock of an open file or folder; ``held`` says what whoever has it has been doing.

    Raises:
        BusyError: It was not free in time.
    """
    if not try_to_lock(handle, seconds):
        raise BusyError(
            f"another Touchline process {held} for {seconds:.0f} seconds",
            hint="Wait until that process is done. If it was suspended with Ctrl-Z, continue it"
            " with fg.",
        )


class DatabaseOpenLock:
    """Says that a process has the database open.

    ``database.lock`` is shared by all who have. Who opens it holds ``opening.lock`` meanwhile:
    a lock that is changed from exclusive to shared is nobody's for a moment.

    Attributes:
        alone: Whether nobody else has; others wait until ``share`` before they open it.

    Raises:
        BusyError: Another process has been opening it for too long.
    """

    def __init__(self, settings: Settings):
        home = make_home(settings)
        self._handle, self._opening = (
            _open_lock_file(home / DATABASE_LOCK),
            _open_lock_file(home / OPENING_LOCK),
        )
        try:
            require_lock(self._opening, "has been opening the database", OPENING_SECONDS)
        except BusyError:
            self.release()
            raise
        self.alone = try_to_lock(self._handle, 0.0)
        if not self.alone:
            self.share()

    def share(self) -> None:
        """Let others open it, too."""
        fcntl.flock(self._handle, fcntl.LOCK_SH)
        self.alone = False
        self._opening = _close_handle(self._opening)

    def release(self) -> None:
        """It is closed."""
        self._handle, self._opening = _close_handle(self._handle), _close_handle(self._opening)


@contextmanager
def hold_exclusive_database_lock(settings: Settings, why: str) -> Iterator[None]:
    """Hold the database while its file is replaced or its schema changed.

    Raises:
        StorageError: Somebody has it open; ``why`` says what cannot be done meanwhile.
    """
    lock = DatabaseOpenLock(settings)
    try:
        if not lock.alone:
            raise StorageError(
                f"another Touchline command has the database open: {why}",
                hint="Wait until it is done, or stop it; then run this command again.",
            )
        yield
    finally:
        lock.release()


@contextmanager
def hold_server_lock(
    settings: Settings, *, shared: bool = False
) -> Iterator[Callable[[str], None]]:
    """Hold the home for one server, or ``shared`` for several; the file tells a process id.

    The value is to be called with the address of the server once it is known (``read_server_address``); of
    several servers the file tells of the first.

    Raises:
        StorageError: Another server holds it.
    """
    handle = _open_lock_file(make_home(settings) / SERVER_LOCK)
    try:
        beside = shared and not try_to_lock(handle, 0.0)
        # A command that looks for the address holds it for a moment.
        if not try_to_lock(handle, NOTICE_SECONDS, fcntl.LOCK_SH if shared else fcntl.LOCK_EX):
            holder = _read_lock_lines(handle)[0]
            process = f" (process {holder})" if holder.isdigit() else ""
            raise StorageError(
                f"another Touchline server already uses this home folder{process}",
                hint="Stop it, or set TOUCHLINE_HOME to another folder.",
            )

        def tell_address(address: str) -> None:
            if beside:
                return
            os.ftruncate(handle, 0)
            os.pwrite(handle, f"{os.getpid()}\n{address}\n".encode(), 0)

        tell_address("")
        yield tell_address
    finally:
        os.close(handle)


def read_server_address(settings: Settings) -> str | None:
    """The address of the server that holds the home; None: there is none, or it is not known."""
    if not (settings.home / SERVER_LOCK).is_file():
        return None
    handle = _open_lock_file(settings.home / SERVER_LOCK)
    try:
        if try_to_lock(handle, 0.0):
            return None
        holder, address, *_ = [*_read_lock_lines(handle), ""]
        is_alive = holder.isdigit() and Path("/proc", holder).exists()
        return address if is_alive and address else None
    finally:
        os.close(handle)


def _read_lock_lines(handle: int) -> list[str]:
    return os.pread(handle, 1000, 0).decode(errors="replace").split("\n")


@contextmanager
def hold_practice_lock(settings: Settings, waiting: Callable[[], None]) -> Iterator[None]:
    """Hold the practice groups while they are made; ``waiting`` is called while others make them."""
    handle = _open_lock_file(make_home(settings) / PRACTICE_LOCK)
    try:
        while not try_to_lock(handle, NOTICE_SECONDS):
            waiting()
        yield
    finally:
        os.close(handle)


def _close_handle(handle: int) -> int:
    if handle >= 0:
        os.close(handle)
    return -1


def _open_lock_file(path: Path) -> int:
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise make_file_access_error(path, error) from error
