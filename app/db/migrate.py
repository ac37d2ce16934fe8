"""Migrations: bring the database to this version's schema, wholly or not at all."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import Connection, Engine, inspect, text

from app.config import Settings, find_packaged_folder
from app.db.backup import write_backup
from app.db.dialects.dialect import (
    WRITE,
    Dialect,
    get_dialect,
    make_engine,
    translate_storage_errors,
)
from app.db.home import create_private_file
from app.db.locks import DatabaseOpenLock
from app.db.recovery.anchor import renew_anchor, require_own_database
from app.db.recovery.preopen_check import require_consistent_home_files
from app.errors import StorageError

KNOWN_REVISIONS = tuple(
    sorted(
        script.name[:4]
        for script in (find_packaged_folder("migrations") / "versions").glob("[0-9]*.py")
    )
)
"""Every revision that this version can migrate, oldest first."""
SCHEMA_REVISION = KNOWN_REVISIONS[-1] if KNOWN_REVISIONS else ""
"""The revision that this version works with."""
COPY = "before-schema-{}.zip"
UNFINISHED = "transfer"
"""The revision of a database into which another one is being copied: nothing else opens it."""


@dataclass(frozen=True)
class MigrationResult:
    """What a migration came to.

    Attributes:
        revision: The schema's revision now.
        copy: The backup that was taken before; None where nothing had to be changed, and of a
            database on a server, whose backups are the server's (``pg_dump``).
    """

    revision: str
    copy: Path | None = None


def find_migrations_folder() -> Path:
    """Where the migration scripts lie.

    Raises:
        StorageError: They do not.
    """
    folder = find_packaged_folder("migrations")
    if not (folder / "env.py").is_file():
        raise StorageError("the migration scripts are missing from this installation")
    return folder


def migrate_database(settings: Settings) -> MigrationResult:
    """Run the migrations that are missing, after a backup of what is there.

    All of them are one transaction: killed midway nothing has happened.

    Raises:
        StorageError: The database is newer than this version, or somebody has it open.
        DamagedError: The database is not what was written, or not the one of its home.
    """
    lock = DatabaseOpenLock(settings)
    try:
        if lock.alone and get_dialect(settings).is_file:
            require_consistent_home_files(settings)
        return migrate_database_under_lock(settings, alone=lock.alone)
    finally:
        lock.release()


def migrate_database_under_lock(settings: Settings, *, alone: bool) -> MigrationResult:
    """The same for who holds the database's lock; ``alone``: and nobody else has it open."""
    dialect = get_dialect(settings)
    if dialect.is_file:
        create_private_file(settings.database_file)
    engine = make_engine(settings)
    copy = None
    try:
        with translate_storage_errors(settings):
            revision = read_schema_revision(engine)
            _refuse_newer_schema(revision, settings)
            require_own_database(engine, settings)
            if revision not in (None, SCHEMA_REVISION):
                if not alone:
                    raise StorageError(
                        "another Touchline process has the database open, so its schema cannot be changed"
                        " now",
                        hint="Stop that process, then run touchline migrate.",
                    )
                if dialect.is_file:
                    copy = _make_backup_folder(settings) / COPY.format(SCHEMA_REVISION)
                    write_backup(settings, copy, replace=True)
            if revision != SCHEMA_REVISION:
                apply_missing_migrations(engine, dialect, new=revision is None)
            renew_anchor(engine, settings, alone=alone)
    finally:
        engine.dispose()
    if copy is not None:
        _delete_older_backups(copy)
    return MigrationResult(SCHEMA_REVISION, copy)


def apply_missing_migrations(engine: Engine, dialect: Dialect, *, new: bool) -> None:
    """Run what is missing of the migrations, in one transaction; ``new``: of an empty database."""
    # Alembic is slow to import and seldom needed.
    from alembic import command
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(find_migrations_folder()).replace("%", "%%"))
    with (
        engine.execution_options(**WRITE).begin() as connection,
        dialect.migration_context(connection, new=new),
    ):
        config.attributes["connection"] = connection
        command.upgrade(config, "head")


def _make_backup_folder(settings: Settings) -> Path:
    folder = settings.home / "backups"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder


def _delete_older_backups(copy: Path) -> None:
    """Of an earlier migration, which this one has shown to be good."""
    for other in copy.parent.glob(COPY.format("*")):
        if other != copy:
            other.unlink()


def read_schema_revision(engine: Engine) -> str | None:
    """The revision that the database says it has; None for an empty one."""
    with engine.connect() as connection:
        return _read_revision(connection)


def _read_revision(connection: Connection) -> str | None:
    if not inspect(connection).has_table("alembic_version"):
        return None
    revision = connection.execute(text("SELECT version_num FROM alembic_version")).scalar()
    return None if revision is None else str(revision)


def _refuse_newer_schema(revision: str | None, settings: Settings) -> None:
    if revision is not None and revision not in KNOWN_REVISIONS:
        raise newer_schema_error(revision, settings)


def newer_schema_error(revision: str, settings: Settings) -> StorageError:
    """The refusal of a database that a newer version made, with the way back."""
    if revision == UNFINISHED:
        return StorageError(
            "a transfer into this database was interrupted",
            hint="Run touchline transfer again with the same arguments.",
        )
    copy = settings.home / "backups" / COPY.format(revision)
    back = f" To go back to the state before its migration, run touchline restore {copy}."
    return StorageError(
        f"the database was made by a newer version of Touchline (schema {revision})",
        hint="Update Touchline; an older version would damage the data."
        + (back if copy.exists() else ""),
    )
