"""The file that a store has open, and whether it still lies at its place.

SQLite goes on with the file that it has opened, wherever that is moved, and after it was deleted: what
it says is saved is then in no database that anybody opens later.
"""

from __future__ import annotations

from pathlib import Path

from app.db.recovery.preopen_check import log_file
from app.errors import DamagedError

MOVED = (
    "Stop the server and put the file that was moved back into its place: with the -wal that lies there"
    " it has the newest changes. Where it was deleted, restore the newest backup."
)
LOG_MOVED = "Stop the server before anything else opens the database: what was saved goes into its file then."


class OpenedFile:
    """The file of a database that is open from now on."""

    def __init__(self, database: Path):
        self._database, self._log = database, log_file(database)
        self._opened = _identity(database)

    def require_there(self) -> None:
        """Raise DamagedError where another file lies in the database's place, or none."""
        found = _identity(self._database)
        if found is None:
            raise DamagedError(
                f"{self._database.name} was moved or deleted while it was open", hint=MOVED
            )
        if found != self._opened:
            raise DamagedError(
                f"{self._database.name} was replaced by another file while it was open", hint=MOVED
            )

    def require_log(self) -> None:
        """Raise DamagedError where the write-ahead log is gone.

        For who is in a transaction: SQLite deletes it when nobody has the database open any more.
        """
        if not self._log.exists():
            raise DamagedError(
                f"{self._log.name} was moved or deleted while the database was open", hint=LOG_MOVED
            )


def _identity(file: Path) -> tuple[int, int] | None:
    """What tells a file from all others at its place; None where there is none to be seen."""
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino
