"""The log: append-only, each row's hash covers the row before it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from sqlalchemy import (
    ColumnElement,
    Index,
    LargeBinary,
    Row,
    Table,
    bindparam,
    func,
    insert,
    select,
    text,
)
from sqlalchemy.orm import Mapped, mapped_column
from zlib_ng import zlib_ng

from app.db.dialects.dialect import get_session_dialect, select_from_number_list
from app.db.json_columns import Json, decompress, decompress_json
from app.db.session import Base, Session
from app.errors import DamagedError
from app.json_text import canonical_json_text


class LogModel(Base):
    """Everything that was ever said, in order; each row's hash covers the row before."""

    __tablename__ = "log"
    __table_args__ = (
        Index("log_group", "group_id", "id"),
        Index("log_station", "station_id"),
        Index(
            "log_policy",
            "dataset_id",
            "id",
            sqlite_where=text("kind IN ('dataset', 'policy')"),
            postgresql_where=text("kind IN ('dataset', 'policy')"),
        ),
        Index(
            "log_deleted",
            "dataset_id",
            sqlite_where=text("kind = 'dataset_deleted'"),
            postgresql_where=text("kind = 'dataset_deleted'"),
        ),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[str]
    actor: Mapped[str]
    kind: Mapped[str]
    dataset_id: Mapped[int | None]
    group_id: Mapped[int | None]
    station_id: Mapped[int | None]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    hash: Mapped[str]


GENESIS = "0" * 64
"""The hash before the first row."""

AUDIT_KINDS = ("person", "job", "deed")
"""Kinds of log entries that are audit events: they record who did something, and change no annotation."""
_BATCH = 500


@dataclass(frozen=True)
class NewLogEntry:
    """One thing that was said.

    ``kind`` is ``dataset``, ``dataset_deleted``, ``policy``, ``station``, ``import``, ``camera``,
    ``spare``, ``edit``, ``undo``, ``redo``, the same after ``station_``, ``pitch``, ``position``,
    ``noise``, ``paint``, ``verdict``, ``verdict_batch``, ``verdict_batch_undo``, ``dismissal``,
    ``take``, ``agreement``, ``gold``, ``guideline``, ``comment``, ``freeze``, ``work``, ``person``,
    ``job``, or ``deed``; ``body`` is JSON that suffices to do it again.
    """

    kind: str
    actor: str
    at: str
    body: Json
    dataset_id: int | None = None
    group_id: int | None = None
    station_id: int | None = None


@dataclass(frozen=True)
class LogEntry(NewLogEntry):
    """An entry as it stands in the log."""

    id: int = 0
    hash: str = ""


def append_entries(session: Session, entries: Sequence[NewLogEntry]) -> list[int]:
    """Write entries at the end of the log, inside the caller's write transaction.

    Returns:
        Their ids.
    """
    if not entries:
        return []
    last = session.execute(_LAST).one_or_none()
    number, previous = (0, GENESIS) if last is None else last
    if session.log_end is None:
        session.log_before = number
    rows: list[dict[str, Any]] = []
    for entry in entries:
        number += 1
        body = canonical_json_text(entry.body).encode()
        previous = compute_chain_hash(previous, number, entry, body)
        row = {name: getattr(entry, name) for name in _COLUMNS}
        rows.append({**row, "id": number, "hash": previous, "body": zlib_ng.compress(body)})
    session.execute(insert(_LOG), rows)
    session.log_end = (number, previous)
    return [row["id"] for row in rows]


_LOG = cast(Table, LogModel.__table__)
_LAST = select(_LOG.c.id, _LOG.c.hash).order_by(_LOG.c.id.desc()).limit(1)
_CHANGES = LogModel.kind.not_in(("verdict", "comment", "dismissal"))
"""Entries that change what a group is."""
_STEPS = (
    select(_LOG.c.group_id, _LOG.c.id, _LOG.c.kind)
    .where(
        _LOG.c.group_id.in_(bindparam("groups", expanding=True)),
        _LOG.c.kind.in_(bindparam("kinds", expanding=True)),
    )
    .order_by(_LOG.c.id)
)
_NEWEST_STEPS = (
    select(_LOG.c.id, _LOG.c.kind)
    .where(
        _LOG.c.group_id == bindparam("group"), _LOG.c.kind.in_(bindparam("kinds", expanding=True))
    )
    .order_by(_LOG.c.id.desc())
    .limit(bindparam("most"))
)


def list_group_entry_kinds(
    session: Session, group_ids: Sequence[int], kinds: Iterable[str]
) -> Sequence[Any]:
    """Rows (group_id, id, kind) of the entries of some kinds about groups, in order."""
    return session.execute(_STEPS, {"groups": list(group_ids), "kinds": list(kinds)}).all()


def list_newest_entry_kinds(
    session: Session, group_id: int, kinds: Iterable[str], most: int
) -> Sequence[Any]:
    """Rows (id, kind) of the newest entries of some kinds about a group, the newest first."""
    parameters = {"group": group_id, "kinds": list(kinds), "most": most}
    return session.execute(_NEWEST_STEPS, parameters).all()


def list_station_entry_kinds(
    session: Session, station_id: int, kinds: Iterable[str]
) -> Sequence[Any]:
    """Rows (id, kind) of the entries of some kinds about a station, in order."""
    statement = (
        select(LogModel.id, LogModel.kind)
        .where(LogModel.station_id == station_id, LogModel.kind.in_(kinds))
        .order_by(LogModel.id)
    )
    return session.execute(statement).all()


def find_newest_entry_id(session: Session) -> int:
    """Id of the last entry; 0 for an empty log."""
    return session.scalar(select(func.max(LogModel.id))) or 0


def read_entry_hash(session: Session, log_id: int) -> str | None:
    """Hash of an entry; None where there is no such entry."""
    found: str | None = session.scalar(select(LogModel.hash).where(LogModel.id == log_id))
    return found


def list_group_entries(session: Session, group_id: int, *, verdicts: bool = True) -> list[LogEntry]:
    """Everything that was said about a group, oldest first; without verdicts and comments, if need be."""
    where = [] if verdicts else [_CHANGES]
    return list(read_log(session, LogModel.group_id == group_id, *where))


def iterate_group_entries_of_kinds(
    session: Session, group_ids: Sequence[int], kinds: Iterable[str]
) -> Iterator[LogEntry]:
    """Entries of some kinds about groups, oldest first."""
    mine = LogModel.group_id.in_(select_from_number_list(group_ids))
    return read_log(session, mine, LogModel.kind.in_(list(kinds)))


def iterate_entries_of_kinds(session: Session, kinds: Iterable[str]) -> Iterator[LogEntry]:
    """All entries of some kinds, oldest first."""
    return read_log(session, LogModel.kind.in_(list(kinds)))


def list_station_entries(session: Session, station_id: int) -> list[LogEntry]:
    """Everything that was said about a static camera, oldest first."""
    where = (LogModel.station_id == station_id, LogModel.group_id.is_(None))
    return list(read_log(session, *where))


def filter_groups_with_history(session: Session, group_ids: Sequence[int]) -> set[int]:
    """The groups with log entries after their first import, other than verdicts and comments."""
    statement = (
        select(LogModel.group_id)
        .where(LogModel.group_id.in_(select_from_number_list(group_ids)), _CHANGES)
        .group_by(LogModel.group_id)
        .having(func.count() > 1)
    )
    return {number for number in session.scalars(statement) if number is not None}


def read_entry(session: Session, log_id: int) -> LogEntry:
    """The entry of an id that is there."""
    (entry,) = read_log(session, LogModel.id == log_id)
    return entry


def read_log(session: Session, *where: ColumnElement[bool], after: int = 0) -> Iterator[LogEntry]:
    """Entries in order, in batches, so that a long log fits into memory."""
    for row in _iterate_rows(session, *where, after=after):
        yield LogEntry(**{**row._mapping, "body": decompress_json(row.body)})


def _iterate_rows(
    session: Session, *where: ColumnElement[bool], after: int = 0
) -> Iterator[Row[Any]]:
    while True:
        rows = session.execute(
            select(*(getattr(LogModel, name) for name in (*_COLUMNS, "body", "id", "hash")))
            .where(LogModel.id > after, *where)
            .order_by(LogModel.id)
            .limit(_BATCH)
        ).all()
        yield from rows
        if len(rows) < _BATCH:
            return
        after = rows[-1].id


def read_entries(session: Session, ids: Sequence[int]) -> Iterator[LogEntry]:
    """The entries of some ids, however many, in order."""
    for start in range(0, len(ids), _BATCH):
        yield from read_log(session, LogModel.id.in_(ids[start : start + _BATCH]))


def count_entries_after(session: Session, at: str) -> tuple[int, str | None]:
    """How many entries were written after a time, by their own clock, and the latest of these times."""
    statement = select(func.count(), func.max(LogModel.at)).where(LogModel.at > at)
    count, latest = session.execute(statement).one()
    return count, latest


def find_last_entry_time(session: Session) -> str | None:
    """When the last entry was written; None for an empty log."""
    return session.scalar(select(LogModel.at).order_by(LogModel.id.desc()).limit(1))


def verify_chain(session: Session) -> int:
    """Check every hash of the log; returns the number of rows.

    Raises:
        DamagedError: A row was changed, removed or put in from outside.
    """
    count, previous = 0, GENESIS
    for row in _iterate_rows(session):
        count += 1
        # The bytes as they were written: the value that is read of them may be another.
        previous = compute_chain_hash(previous, count, row, decompress(row.body))
        if row.id != count or row.hash != previous:
            raise DamagedError(
                f"row {row.id} of the log was changed or is damaged: its hash does not continue"
                " the hash chain",
                hint=get_session_dialect(session).restoring,
            )
    return count


def compute_chain_hash(
    previous: str, number: int, entry: NewLogEntry | Row[Any], body: bytes
) -> str:
    """Hash of a row: SHA-256 over the hash before it, its columns and the hash of its body.

    Args:
        previous: Hash of the row before.
        number: Id of the row.
        entry: Its columns.
        body: Canonical JSON of its body.
    """
    values: dict[str, Json] = {name: getattr(entry, name) for name in _COLUMNS}
    values |= {"id": number, "body": hashlib.sha256(body).hexdigest()}
    return hashlib.sha256((previous + canonical_json_text(values)).encode()).hexdigest()


_COLUMNS = ("kind", "actor", "at", "dataset_id", "group_id", "station_id")


def iterate_single_edits(value: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """A logged edit, or those that it consists of where it is several."""
    if value.get("edit") != "several":
        yield value
        return
    for one in value["edits"]:
        yield from iterate_single_edits(one)
