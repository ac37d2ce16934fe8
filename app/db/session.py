"""Sessions: one transaction on the database each; and the time as the database writes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeVar, cast

from sqlalchemy import Connection, Engine, Executable
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

if TYPE_CHECKING:
    from app.db.idempotency import IdempotencyKey

Row = TypeVar("Row")


class KeyedResponse(Protocol):
    """The response to a request that is being carried out."""

    @property
    def key(self) -> IdempotencyKey | None:
        """Under which the request was sent; None: it has none, and its response is not stored."""

    def store(self, session: Session, outcome: object) -> None:
        """Store the response that an outcome makes, in the transaction of its work."""


pending_response: ContextVar[KeyedResponse | None] = ContextVar("pending_response", default=None)
"""The response to the request that this thread carries out; None in jobs and commands."""


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
        self._pending = pending_response.get()
        self._outcome: tuple[object] | None = None

    def __enter__(self) -> Self:
        return self

    @property
    def idempotency_key(self) -> IdempotencyKey | None:
        """Under which the request was sent whose work this is; None: there is none."""
        return None if self._pending is None else self._pending.key

    def rows(
        self, kind: type[Row], statement: Executable, values: Mapping[str, Any] | None = None
    ) -> Sequence[Row]:
        """What a statement finds that asks for all columns of a table, or for those of a named tuple.

        Args:
            kind: The table or named tuple; a row reads as that does, and follows no changes.
            statement: What is asked.
            values: Of its parameters.
        """
        return cast(Sequence[Row], self.execute(statement, values).all())

    def row(
        self, kind: type[Row], statement: Executable, values: Mapping[str, Any] | None = None
    ) -> Row | None:
        """The same of a statement that finds one row at most; None: it finds none."""
        return cast(Row | None, self.execute(statement, values).one_or_none())

    def respond(self, outcome: object) -> None:
        """Answer the request whose work this is with an outcome, once this is committed.

        The response is stored as the last statement of the transaction: it is in the database
        exactly when the work is. Jobs and commands have no request, and nothing is stored.

        Args:
            outcome: What the work came to, as the route makes a response of it.
        """
        self._outcome = (outcome,)

    def store_response(self) -> None:
        """Store the response with the work, where there is one; called before the commit."""
        if self._pending is not None and self._outcome is not None:
            self._pending.store(self, *self._outcome)

    def call_after_commit(self, tell: Callable[[], None]) -> None:
        """Call a function once this is committed, before the next write of its process begins.

        What was not kept is not told of. It must be quick, and not ask the database.
        """
        self._then.append(tell)

    def commit(self) -> None:
        """Keep what was written."""
        super().commit()
        pending, self._then = self._then, []
        for tell in pending:
            tell()


def now() -> str:
    """Now, as ``format_utc_time`` writes it."""
    return format_utc_time(datetime.now(UTC))


def format_utc_time(at: datetime) -> str:
    """A time with a zone in UTC, ISO 8601 with microseconds; the texts sort as the times do."""
    return at.astimezone(UTC).isoformat(timespec="microseconds")


class Base(DeclarativeBase):
    """Base of all tables."""


class InstallationModel(Base):
    """Its one row: a random key, and when the installation began."""

    __tablename__ = "installation"

    key: Mapped[str] = mapped_column(primary_key=True)
    created: Mapped[str]


COPIES_USED = "copy_dataset"
"""Under which name the ids of datasets of copies are remembered, which are counted by themselves."""


class UsedIdModel(Base):
    """The largest id of a table that a deleted dataset or row had; ids are given once and for all."""

    __tablename__ = "used_id"

    table: Mapped[str] = mapped_column(primary_key=True)
    id: Mapped[int]
