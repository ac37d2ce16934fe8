"""The doctor on the command line: exit code, words and JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from sqlalchemy import text
from typer.testing import CliRunner

from app.command_line import app
from app.config import Settings
from app.db.dialects.dialect import get_dialect
from app.db.locks import hold_server_lock
from app.db.store import Store
from app.features.imports.ingest import ensure_dataset


@pytest.fixture
def settings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Settings:
    """A home with an empty dataset."""
    settings = Settings(home=tmp_path / "home")
    monkeypatch.setenv("TOUCHLINE_HOME", str(settings.home))
    store = Store.open(settings)
    ensure_dataset(store, "demo", "ann")
    store.close()
    return settings


class TestDoctor:
    def test_a_healthy_home_ends_with_0(self, settings: Settings) -> None:
        done = CliRunner().invoke(app, ["doctor"])
        assert (done.exit_code, "FAULT" in done.output) == (0, False)

    def test_a_fault_ends_with_1_and_its_mend(self, settings: Settings) -> None:
        store = Store.open(settings)
        with store.write() as session:
            session.execute(text("UPDATE dataset SET name = 'eve'"))
        store.close()
        done = CliRunner().invoke(app, ["doctor", "--json"])
        assert done.exit_code == 1
        (fault,) = (check for check in json.loads(done.stdout) if not check["ok"])
        mended_by = "touchline restore" if get_dialect(settings).is_file else "pg_restore"
        assert (fault["name"], mended_by in fault["advice"]) == ("datasets", True)

    @pytest.mark.file_of_sqlite("a home without one")
    def test_a_home_without_a_database_is_refused_and_not_made(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("TOUCHLINE_HOME", str(tmp_path / "hoem"))
        refused = CliRunner().invoke(app, ["doctor"])
        assert refused.exit_code == 1
        assert "there is no database in" in str(refused.exception)
        assert not (tmp_path / "hoem").exists()

    def test_rebuilding_waits_for_no_server(self, settings: Settings) -> None:
        assert CliRunner().invoke(app, ["doctor", "--rebuild"]).exit_code == 0
        with hold_server_lock(settings):
            refused = CliRunner().invoke(app, ["doctor", "--rebuild"])
        assert refused.exit_code == 1
        assert "another Touchline server" in str(refused.exception)

    @pytest.mark.file_of_sqlite("a file that is empty")
    def test_a_home_that_is_refused_is_explained(self, settings: Settings) -> None:
        settings.database_file.write_bytes(b"")
        done = CliRunner().invoke(app, ["doctor", "--json"])
        assert done.exit_code == 1
        (fault,) = (check for check in json.loads(done.stdout) if not check["ok"])
        assert (fault["name"], "touchline restore" in fault["advice"]) == ("database", True)
        assert settings.database_file.stat().st_size == 0
