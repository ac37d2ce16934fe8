from __future__ import annotations

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import text

from app.store.engine import make_engine
from app.store.migrate import KNOWN_REVISIONS, migrate, migrations_folder, schema_revision
from app.store.session import Store
from app.store.tables import Base


class TestMigrate:
    def test_makes_the_tables_of_the_models(self, settings) -> None:
        assert migrate(settings).revision == KNOWN_REVISIONS[-1]
        with make_engine(settings).connect() as connection:
            context = MigrationContext.configure(connection)
            assert compare_metadata(context, Base.metadata) == []

    def test_again_it_changes_nothing(self, store, settings) -> None:
        with store.write() as session:
            session.execute(text("INSERT INTO calibration (key, body) VALUES ('k', 'b')"))
        migrate(settings)
        with store.read() as session:
            assert session.execute(text("SELECT count(*) FROM calibration")).scalar() == 1

    def test_knows_every_migration_there_is(self) -> None:
        scripts = ScriptDirectory(str(migrations_folder()))
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
            migrate(settings)
        engine = make_engine(settings)
        assert schema_revision(engine) is None
        with engine.connect() as connection:
            assert connection.execute(text("SELECT count(*) FROM sqlite_master")).scalar() == 0
        monkeypatch.undo()
        Store.open(settings).close()
