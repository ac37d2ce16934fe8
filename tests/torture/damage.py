"""Damage to the database file of a home that no server has open."""

from __future__ import annotations

import os
from contextlib import closing
from pathlib import Path

import pysqlite3.dbapi2 as sqlite

DATABASE = "touchline.db"
INTERIOR = 5
"""How a page begins that leads to other pages of its table."""


def write_newer_schema(home: Path) -> None:
    """Say that a newer version of the product has been here."""
    with closing(_connected(home)) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")


def cut_short(home: Path) -> None:
    """Leave half of it."""
    settle(home)
    os.truncate(home / DATABASE, (home / DATABASE).stat().st_size // 2 // 4096 * 4096)


def take_away(home: Path) -> None:
    """Leave nothing of it."""
    settle(home)
    (home / DATABASE).unlink()


def spoil_first(home: Path) -> None:
    """Write over the first page, which has the schema."""
    settle(home)
    scribble(home, (40, 3040))


def spoil_inside(home: Path) -> None:
    """Write over a page in the middle, which leads to the rows of a table."""
    settle(home)
    scribble(home, interior_page(home))


def interior_page(home: Path) -> tuple[int, int]:
    """Where the first page of the views begins and ends, which leads to their others."""
    with closing(_connected(home)) as connection:
        found = "SELECT rootpage FROM sqlite_master WHERE type = 'table' AND name = 'view'"
        number = connection.execute(found).fetchone()[0]
        size = connection.execute("PRAGMA page_size").fetchone()[0]
    start = (number - 1) * size
    with (home / DATABASE).open("rb") as file:
        file.seek(start)
        if file.read(1)[0] != INTERIOR:
            raise AssertionError("the first page of the views leads to no other")
    return start, start + size


def scribble(home: Path, place: tuple[int, int]) -> None:
    """Write over all between two places; a server may run."""
    start, end = place
    with (home / DATABASE).open("r+b") as file:
        file.seek(start)
        file.write(b"\xff" * (end - start))


def settle(home: Path) -> None:
    """Bring the write-ahead log into the database, so that its file alone counts."""
    with closing(_connected(home)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def write_beside(home: Path) -> None:
    """Count one up, as each write of ours does: a server then believes none of the pages it keeps."""
    with closing(_connected(home)) as connection:
        (count,) = connection.execute("PRAGMA user_version").fetchone()
        connection.execute(f"PRAGMA user_version = {count + 1}")


def _connected(home: Path) -> sqlite.Connection:
    return sqlite.connect(str(home / DATABASE))
