"""Migrations: bring the database to this version's schema, wholly or not at all."""

from __future__ import annotations

from pathlib import Path

from sqlalchemy import Connection, Engine, inspect, text

from app.config import Settings
from app.errors import StorageError
from app.store.engine import WRITE, make_engine, reported
from app.store.home import make_home

KNOWN_REVISIONS = ("0001", "0002", "0003", "0004", "0005", "0006", "0007", "0008", "0009", "0012")
"""Every revision that this version can migrate, oldest first."""
SCHEMA_REVISION = KNOWN_REVISIONS[-1]
"""The revision that this version works with."""


def migrations_folder() -> Path:
    """Where the migration scripts lie: beside the package in a checkout, inside it when built."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package.parent / "migrations", package / "migrations"):
        if (folder / "env.py").is_file():
            return folder
    raise StorageError("the migration scripts are missing from this installation")


def migrate(settings: Settings) -> str:
    """Run the migrations that are missing; returns the revision reached.

    Each migration is one transaction: killed midway it has not happened.

    Raises:
        StorageError: The database is newer than this version.
    """
    # Alembic is slow to import and seldom needed.
    from alembic import command
    from alembic.config import Config

    make_home(settings)
    engine = make_engine(settings).execution_options(**WRITE)
    config = Config()
    config.set_main_option("script_location", str(migrations_folder()).replace("%", "%%"))
    with reported(settings), engine.begin() as connection:
        _refuse_newer(_revision(connection))
        config.attributes["connection"] = connection
        command.upgrade(config, "head")
    engine.dispose()
    return SCHEMA_REVISION


def schema_revision(engine: Engine) -> str | None:
    """The revision that the database says it has; None for an empty one."""
    with engine.connect() as connection:
        return _revision(connection)


def _revision(connection: Connection) -> str | None:
    if not inspect(connection).has_table("alembic_version"):
        return None
    revision = connection.execute(text("SELECT version_num FROM alembic_version")).scalar()
    return None if revision is None else str(revision)


def _refuse_newer(revision: str | None) -> None:
    if revision is not None and revision not in KNOWN_REVISIONS:
        raise StorageError(
            f"the database was made by a newer version of Touchline (schema {revision})",
            hint="Update Touchline; an older version would damage the data.",
        )
