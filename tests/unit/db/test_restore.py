"""Restoring: the backup is in place, what was there is beside it, and a kill loses neither."""

from __future__ import annotations

import json
import shutil
import zipfile
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text

from app.config import Settings
from app.db.backup import FRAMES, back_up_home
from app.db.locks import hold_server_lock
from app.db.restore import restore_database
from app.db.store import Store
from app.errors import DamagedError, InputError, StorageError
from tests.unit.db.homes import killed, say

pytestmark = pytest.mark.file_of_sqlite("the file put back from a copy")


@pytest.fixture
def backup(own_store: Store, tmp_path: Path) -> Path:
    """A backup after three entries, with one upload; the home has five more by now."""
    upload = own_store.settings.uploads / "1"
    upload.mkdir(parents=True)
    (upload / "upload.json").write_bytes(b"{}")
    say(own_store, 3)
    back_up_home(own_store.settings, tmp_path / "b.zip", FRAMES)
    say(own_store, 5)
    own_store.close()
    return tmp_path / "b.zip"


def entries(home: Path) -> int:
    with closing(Store.open(Settings(home=home))) as own_store, own_store.read() as session:
        return session.execute(text("SELECT count(*) FROM log")).scalar_one()


class TestRestore:
    def test_the_home_is_as_it_was_then(self, own_store: Store, backup: Path) -> None:
        restored = restore_database(own_store.settings, backup)
        assert (restored.entries, restored.files) == (3, 1)
        assert entries(own_store.settings.home) == 3

    def test_what_was_there_is_moved_aside_and_is_whole(
        self, own_store: Store, backup: Path
    ) -> None:
        restored = restore_database(own_store.settings, backup)
        assert restored.aside is not None
        assert (restored.aside / "uploads" / "1" / "upload.json").exists()
        shutil.rmtree(restored.aside / "uploads")
        assert entries(restored.aside) == 8

    def test_exports_are_moved_aside_for_the_ids_of_their_jobs_are_given_again(
        self, own_store: Store, backup: Path
    ) -> None:
        exports = own_store.settings.exports
        exports.mkdir()
        (exports / "57.json").write_bytes(b"{}")
        restored = restore_database(own_store.settings, backup)
        assert restored.aside is not None
        assert (restored.aside / "exports" / "57.json").exists()
        assert not exports.exists()

    def test_another_home_becomes_the_same(self, backup: Path, tmp_path: Path) -> None:
        restored = restore_database(Settings(home=tmp_path / "new"), backup)
        assert restored.aside is None
        assert entries(tmp_path / "new") == 3
        assert (tmp_path / "new" / "uploads" / "1" / "upload.json").exists()

    def test_its_files_are_for_their_owner_alone(self, backup: Path, tmp_path: Path) -> None:
        home = tmp_path / "new"
        restore_database(Settings(home=home), backup)
        assert {path.stat().st_mode & 0o077 for path in home.rglob("*")} == {0}

    def test_a_home_that_is_in_use_is_left_alone(self, backup: Path, tmp_path: Path) -> None:
        settings = Settings(home=tmp_path / "used")
        with (
            closing(Store.open(settings)),
            pytest.raises(StorageError, match="has the database open"),
        ):
            restore_database(settings, backup)
        with (
            hold_server_lock(settings),
            pytest.raises(StorageError, match="another Touchline server"),
        ):
            restore_database(settings, backup)
        assert entries(settings.home) == 0

    def test_a_damaged_backup_changes_nothing(self, own_store: Store, backup: Path) -> None:
        content = bytearray(backup.read_bytes())
        content[len(content) // 2] ^= 1
        backup.write_bytes(content)
        with pytest.raises(InputError):
            restore_database(own_store.settings, backup)
        assert entries(own_store.settings.home) == 8

    @pytest.mark.parametrize("name", ["../evil", "/evil", "uploads/../../evil", "other/evil"])
    def test_files_outside_the_home_are_refused(
        self, own_store: Store, backup: Path, tmp_path: Path, name: str
    ) -> None:
        forged = tmp_path / "forged.zip"
        with zipfile.ZipFile(backup) as source, zipfile.ZipFile(forged, "w") as target:
            manifest = json.loads(source.read("manifest.json"))
            manifest["files"][name] = manifest["files"]["uploads/1/upload.json"]
            target.writestr("manifest.json", json.dumps(manifest))
            for member in ("touchline.db", "uploads/1/upload.json"):
                target.writestr(member, source.read(member))
            target.writestr(name, b"{}")
        with pytest.raises(InputError, match="not a file of a Touchline home"):
            restore_database(own_store.settings, forged)
        assert not (tmp_path / "evil").exists()

    def test_killed_before_the_database_is_in_place_no_new_home_begins(
        self, own_store: Store, backup: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def kill(*_arguments):
            raise KeyboardInterrupt

        monkeypatch.setattr("app.db.restore._move_into_home", kill)
        with pytest.raises(KeyboardInterrupt):
            restore_database(own_store.settings, backup)
        monkeypatch.undo()
        with pytest.raises(DamagedError, match="is missing, but this home has been used"):
            Store.open(own_store.settings)
        restore_database(own_store.settings, backup)
        assert entries(own_store.settings.home) == 3

    def test_a_database_beside_a_foreign_log_goes_on_without_it(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        say(own_store, 4)
        with own_store._engine.connect() as connection:
            connection.exec_driver_sql("ROLLBACK")
            connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
        early = killed(own_store, tmp_path / "left", "touchline.db")
        say(own_store, 2)
        with own_store._engine.connect() as connection:
            connection.exec_driver_sql("ROLLBACK")
            connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
        say(own_store, 30)
        killed(own_store, tmp_path / "left", "touchline.db-wal", "home.json")
        with pytest.raises(DamagedError, match="another database"):
            Store.open(early)
        restored = restore_database(early, early.database_file)
        assert (restored.entries, restored.foreign_log) == (4, True)
        assert entries(early.home) == 4

    def test_a_killed_home_is_taken_over_with_its_log(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        say(own_store, 12)
        left = killed(own_store, tmp_path / "left")
        assert restore_database(Settings(home=tmp_path / "new"), left.database_file).entries == 12

    def test_a_backup_of_a_newer_version_is_refused(self, own_store: Store, tmp_path: Path) -> None:
        with own_store.write() as session:
            session.execute(text("UPDATE alembic_version SET version_num = '9999'"))
        back_up_home(own_store.settings, tmp_path / "b.zip")
        with pytest.raises(StorageError, match="newer version"):
            restore_database(Settings(home=tmp_path / "new"), tmp_path / "b.zip")

    def test_any_other_file_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "letter.txt").write_text("Dear all" * 100)
        with pytest.raises(InputError, match="neither a backup"):
            restore_database(Settings(home=tmp_path / "new"), tmp_path / "letter.txt")
