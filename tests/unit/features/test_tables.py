"""The whole schema in one place."""

from __future__ import annotations

import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pysqlite3.dbapi2 as sqlite

from app.config import Settings
from app.db.store import Store

ROOT = Path(__file__).parents[3]
ASKED = "from app.features.tables import Base; print(*sorted(Base.metadata.tables))"


def test_who_imports_it_alone_knows_every_table_of_a_database(tmp_path: Path) -> None:
    """Else a transfer would leave out a table, and compare without it."""
    settings = Settings(home=tmp_path / "home")
    Store.open(settings).close()
    command = [sys.executable, "-c", ASKED]
    known = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    with closing(sqlite.connect(str(settings.database_file))) as database:
        rows = database.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
    there = {name for (name,) in rows if not name.startswith("sqlite_")}
    assert set(known.split()) == there - {"alembic_version"}
