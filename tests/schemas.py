"""The schema of an empty home, made by all migrations once in a process and copied from then on."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from typing import Any

import pysqlite3.dbapi2 as sqlite
import pytest
from sqlalchemy import Engine

from app.db import migrate
from app.db.dialects.dialect import Dialect

make_schema = migrate.apply_missing_migrations
"""What the product does: run every migration."""


@contextmanager
def copied_schemas() -> Iterator[None]:
    """A new file gets a copy of the schema, and a name of its own as an installation.

    What is older, or on a server, is migrated; so is the first new file, which is then copied.
    """
    with closing(sqlite.connect(":memory:", check_same_thread=False)) as made:

        def copy(engine: Engine, dialect: Dialect, *, new: bool) -> None:
            if not (new and dialect.is_file):
                make_schema(engine, dialect, new=new)
                return
            with closing(engine.raw_connection()) as connection:
                file: Any = connection.driver_connection
                if made.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,):
                    make_schema(engine, dialect, new=True)
                    file.backup(made)
                made.backup(file)
                _install(file)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(migrate, "apply_missing_migrations", copy)
            yield


def _install(file: Any) -> None:
    """As revision 0010 does: no two installations have one key."""
    key, created = secrets.token_hex(16), datetime.now(UTC).isoformat(timespec="microseconds")
    file.execute("BEGIN IMMEDIATE")
    file.execute("UPDATE installation SET key = ?, created = ?", (key, created))
    file.execute(f"PRAGMA application_id = {int(key[:7], 16)}")
    file.execute("COMMIT")
