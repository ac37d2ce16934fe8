"""Session: what is asked of a database, and said to it, in one transaction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

from sqlalchemy import Connection, Engine


class Session(Connection):
    """A connection of its own whose first statement begins a transaction; what is not committed when it
    ends is taken back.

    No row is ever an object that follows its changes: an ORM session would look after every
    statement, which takes longer than most of them.

    Args:
        engine: The database, with what holds for all statements.

    Attributes:
        log_end: Id and hash of the last entry that was written into the log; None: none was.
        log_before: Id of the log's last entry before those that were written; 0: it had none.
    """

    def __init__(self, engine: Engine):
        super().__init__(engine)
        self.log_end: tuple[int, str] | None = None
        self.log_before = 0
        self._then: list[Callable[[], None]] = []

    def __enter__(self) -> Self:
        return self

    def once_kept(self, tell: Callable[[], None]) -> None:
        """Call a function once this is committed, before the next write of its process begins.

        What was not kept is not told of. It must be quick, and not ask the database.
        """
        self._then.append(tell)

    def commit(self) -> None:
        """Keep what was written."""
        super().commit()
        told, self._then = self._then, []
        for tell in told:
            tell()
