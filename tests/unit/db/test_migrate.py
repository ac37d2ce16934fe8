from __future__ import annotations

import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import text

from app.config import Settings
from app.db.backup import verify_backup
from app.db.dialects.dialect import WRITE, make_engine
from app.db.home import make_home
from app.db.locks import DatabaseOpenLock
from app.db.migrate import (
    KNOWN_REVISIONS,
    find_migrations_folder,
    migrate_database,
    read_schema_revision,
)
from app.db.restore import restore_database
from app.db.store import Store
from app.errors import StorageError
from app.features.tables import Base
from tests.unit.db.homes import say

pytestmark = [
    pytest.mark.file_of_sqlite("homes of released versions, which had a file, and its backup"),
    pytest.mark.usefixtures("every_migration"),
]

RELEASED = KNOWN_REVISIONS[:-1]
DATASET = "INSERT INTO dataset (name, created, policy, policy_hash) VALUES ('old', '', '', '')"


def make_old(settings: Settings, revision: str) -> None:
    """A home as an earlier version left it: its schema, a dataset, and no anchor."""
    make_home(settings)
    config = Config()
    config.set_main_option("script_location", str(find_migrations_folder()))
    engine = make_engine(settings).execution_options(**WRITE)
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, revision)
        connection.execute(text(DATASET))
    engine.dispose()


def state(settings: Settings) -> tuple[str | None, str]:
    """Schema and dataset of a home."""
    engine = make_engine(settings)
    with engine.connect() as connection:
        name = connection.execute(text("SELECT name FROM dataset")).scalar_one()
    revision = read_schema_revision(engine)
    engine.dispose()
    return revision, name


class TestMigrate:
    def test_makes_the_tables_of_the_models(self, settings) -> None:
        assert migrate_database(settings).revision == KNOWN_REVISIONS[-1]
        with make_engine(settings).connect() as connection:
            context = MigrationContext.configure(connection)
            assert compare_metadata(context, Base.metadata) == []

    def test_again_it_changes_nothing(self, own_store, settings) -> None:
        with own_store.write() as session:
            session.execute(text("INSERT INTO calibration (key, body) VALUES ('k', 'b')"))
        migrate_database(settings)
        with own_store.read() as session:
            assert session.execute(text("SELECT count(*) FROM calibration")).scalar() == 1

    @pytest.mark.parametrize("mode", ["delete", "wal"])
    def test_the_database_of_another_program_gets_no_tables(
        self, settings: Settings, mode: str
    ) -> None:
        settings.home.mkdir(parents=True, exist_ok=True)
        with closing(sqlite3.connect(settings.database_file)) as other:
            other.execute(f"PRAGMA journal_mode = {mode}")
            other.execute("CREATE TABLE cookies (name TEXT)")
            other.commit()
        before = settings.database_file.read_bytes()
        with pytest.raises(StorageError, match=r"another program \(tables: cookies\)"):
            Store.open(settings)
        with pytest.raises(StorageError, match="another program"):
            migrate_database(settings)
        assert settings.database_file.read_bytes() == before
        # SQLite makes files beside a database of this mode, also for whoever only reads.
        assert list(settings.home.glob("touchline.db?*")) == []

    def test_knows_every_migration_there_is(self) -> None:
        scripts = ScriptDirectory(str(find_migrations_folder()))
        revisions = [script.revision for script in scripts.walk_revisions()]
        assert tuple(reversed(revisions)) == KNOWN_REVISIONS

    def test_broken_midway_it_has_not_happened(self, settings, monkeypatch) -> None:
        from alembic.operations import Operations

        execute = Operations.execute

        def broken(self, sql, **options):
            if "verdict_refuses_delete" in str(sql):
                raise KeyboardInterrupt
            return execute(self, sql, **options)

        monkeypatch.setattr(Operations, "execute", broken)
        with pytest.raises(KeyboardInterrupt):
            migrate_database(settings)
        engine = make_engine(settings)
        assert read_schema_revision(engine) is None
        with engine.connect() as connection:
            assert connection.execute(text("SELECT count(*) FROM sqlite_master")).scalar() == 0
        monkeypatch.undo()
        Store.open(settings).close()


class TestOldHomes:
    @pytest.mark.parametrize("revision", RELEASED)
    def test_every_released_schema_is_migrated_after_a_backup(
        self, settings: Settings, revision: str
    ) -> None:
        make_old(settings, revision)
        migrated = migrate_database(settings)
        assert state(settings) == (KNOWN_REVISIONS[-1], "old")
        assert (
            migrated.copy == settings.home / "backups" / f"before-schema-{KNOWN_REVISIONS[-1]}.zip"
        )
        assert verify_backup(migrated.copy).schema == revision
        with closing(Store.open(settings)) as own_store:
            say(own_store)

    @pytest.mark.parametrize("revision", (RELEASED[0], RELEASED[-1]))
    def test_killed_midway_it_is_as_before_and_migrates_again(
        self, settings: Settings, revision: str
    ) -> None:
        make_old(settings, revision)
        script = (
            "import os, sys; from pathlib import Path\n"
            "from alembic.runtime.migration import HeadMaintainer\n"
            "from app.config import Settings; from app.db.migrate import KNOWN_REVISIONS, migrate_database\n"
            "note = HeadMaintainer.update_to_step\n"
            "def killed(self, step):\n"
            "    KNOWN_REVISIONS[-1] in step.to_revisions and os.kill(os.getpid(), 9)\n"
            "    note(self, step)\n"
            "HeadMaintainer.update_to_step = killed\n"
            "migrate_database(Settings(home=Path(sys.argv[1])))\n"
        )
        command = [sys.executable, "-c", script, str(settings.home)]
        done = subprocess.run(command, cwd=Path(__file__).parents[3], check=False)
        assert done.returncode == -9
        assert state(settings) == (revision, "old")
        assert migrate_database(settings).revision == KNOWN_REVISIONS[-1]
        assert state(settings)[1] == "old"

    def test_the_way_back_is_the_backup(self, settings: Settings) -> None:
        make_old(settings, "0009")
        copy = migrate_database(settings).copy
        assert copy is not None
        restore_database(settings, copy)
        assert state(settings) == ("0009", "old")

    def test_an_older_version_names_the_way_back(self, settings: Settings, monkeypatch) -> None:
        make_old(settings, "0009")
        copy = migrate_database(settings).copy
        monkeypatch.setattr("app.db.migrate.KNOWN_REVISIONS", RELEASED)
        with pytest.raises(
            StorageError, match=f"newer version .* .schema {KNOWN_REVISIONS[-1]}"
        ) as caught:
            migrate_database(settings)
        assert f"touchline restore {copy}" in str(caught.value.hint)

    def test_backups_of_earlier_migrations_go_with_the_next(self, settings: Settings) -> None:
        make_old(settings, "0009")
        earlier = settings.home / "backups" / "before-schema-0009.zip"
        earlier.parent.mkdir()
        earlier.write_bytes(b"")
        copy = migrate_database(settings).copy
        assert list(earlier.parent.iterdir()) == [copy]

    def test_without_a_backup_nothing_is_migrated(self, settings: Settings, monkeypatch) -> None:
        def full(*_arguments, **_options):
            raise StorageError("the disk is full")

        make_old(settings, "0009")
        monkeypatch.setattr("app.db.migrate.write_backup", full)
        with pytest.raises(StorageError, match="disk is full"):
            migrate_database(settings)
        assert state(settings) == ("0009", "old")

    def test_is_refused_while_somebody_has_the_database_open(self, settings: Settings) -> None:
        make_old(settings, "0009")
        lock = DatabaseOpenLock(settings)
        lock.share()
        with pytest.raises(StorageError, match="another Touchline process has the database open"):
            migrate_database(settings)
        assert state(settings) == ("0009", "old")
        lock.release()
        migrate_database(settings)
