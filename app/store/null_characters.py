"""U+0000 in texts: PostgreSQL cannot keep it, so neither database takes it; older SQLite files may hold it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import LargeBinary, String, cast, func, literal, select

from app.store.dialect.dialect import dialect_in
from app.store.session import Session
from app.store.tables import Base

NULL_CHARACTER, REPLACEMENT = "\0", "\ufffd"


@dataclass(frozen=True)
class NullCharacter:
    """A text of the database that holds U+0000.

    Attributes:
        table: Name of the table.
        key: Primary key of the row, by column.
        column: Name of the column.
        text: What stands there.
    """

    table: str
    key: Mapping[str, Any]
    column: str
    text: str

    def __str__(self) -> str:
        key = " ".join(f"{name}={value}" for name, value in self.key.items())
        return f"{self.table} {key} column {self.column}"


def find_null_characters(session: Session) -> list[NullCharacter]:
    """Every text of the database that holds U+0000, by table and column; none on PostgreSQL."""
    if not dialect_in(session).is_file:
        return []
    found = []
    for table in Base.metadata.sorted_tables:
        keys = list(table.primary_key.columns)
        for column in table.columns:
            if not isinstance(column.type, String):
                continue
            # Functions of SQLite on text end at U+0000; those on bytes do not.
            has_it = func.instr(cast(column, LargeBinary), literal(b"\0", LargeBinary)) > 0
            for row in session.execute(select(*keys, column.label("text_")).where(has_it)):
                values = dict(row._mapping)
                text = values.pop("text_")
                key = {name: values.get(name, text) for name in (item.name for item in keys)}
                found.append(NullCharacter(table.name, key, column.name, str(text)))
    return found


def without_null_characters(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row whose texts have U+FFFD, the replacement character, where they had U+0000."""
    return {
        name: value.replace(NULL_CHARACTER, REPLACEMENT) if isinstance(value, str) else value
        for name, value in row.items()
    }


def named(found: Sequence[NullCharacter], most: int = 5) -> str:
    """Rows and columns as a sentence lists them."""
    return ", ".join(map(str, found[:most])) + (" and others" if len(found) > most else "")
