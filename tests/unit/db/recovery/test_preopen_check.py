"""Homes whose files do not belong together: never a new start, never served, nothing changed."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pysqlite3.dbapi2 as sqlite
import pytest
from sqlalchemy import text

from app.config import Settings
from app.db.migrate import migrate_database
from app.db.recovery.preopen_check import find_write_ahead_log_file
from app.db.store import Store
from app.errors import DamagedError, StorageError
from tests.unit.db.homes import killed, say

pytestmark = pytest.mark.file_of_sqlite("the file before it is opened")


def content(home: Path) -> dict[str, bytes]:
    """The files of a home but its locks, and the index of the log, which whoever reads makes anew."""
    files = (path for path in home.iterdir() if not path.name.endswith((".lock", "-shm")))
    return {path.name: path.read_bytes() for path in files}


def refused(settings: Settings, match: str) -> None:
    """Neither opened nor migrated, with a way out, and not one byte is changed."""
    before = content(settings.home)
    for attempt in (Store.open, migrate_database):
        with pytest.raises(DamagedError, match=match) as caught:
            attempt(settings)
        assert "touchline restore" in str(caught.value.hint)
    assert content(settings.home) == before


def entries(settings: Settings) -> int:
    with closing(Store.open(settings)) as own_store, own_store.read() as session:
        return session.execute(text("SELECT count(*) FROM log")).scalar_one()


def flip_a_bit(log: bytes) -> bytes:
    middle = len(log) // 2
    return log[:middle] + bytes([log[middle] ^ 1]) + log[middle + 1 :]


def empty_the_header(log: bytes) -> bytes:
    return bytes(32) + log[32:]


def cut(log: bytes) -> bytes:
    return log[: len(log) // 2]


class TestRequireSound:
    def test_what_a_killed_server_left_is_taken_up(self, own_store: Store, tmp_path: Path) -> None:
        say(own_store, 40)
        assert entries(killed(own_store, tmp_path / "left")) == 40

    @pytest.mark.parametrize("further", [1, 100])
    def test_a_backup_copied_beside_the_log_of_later_changes_is_refused(
        self, own_store: Store, tmp_path: Path, further: int
    ) -> None:
        say(own_store, 3)
        backup = tmp_path / "backup.db"
        with closing(sqlite.connect(str(backup))) as copy:
            own_store._engine.raw_connection().driver_connection.backup(copy)
        say(own_store, 2)
        checkpoint(own_store)
        say(own_store, further)
        settings = killed(own_store, tmp_path / "left")
        shutil.copy(backup, settings.database_file)
        refused(settings, "log of another database")

    def test_the_database_of_another_home_beside_a_log_is_refused(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        with closing(Store.open(Settings(home=tmp_path / "other"))) as other:
            say(other, 10)
        checkpoint(own_store)
        say(own_store, 40)
        settings = killed(own_store, tmp_path / "left")
        shutil.copy(tmp_path / "other" / "touchline.db", settings.database_file)
        refused(settings, "log of another database")

    @pytest.mark.parametrize("missing", [True, False])
    def test_a_log_without_its_database_is_no_new_home(
        self, own_store: Store, tmp_path: Path, missing: bool
    ) -> None:
        say(own_store, 40)
        settings = killed(own_store, tmp_path / "left", "touchline.db-wal")
        if not missing:
            settings.database_file.touch()
        refused(settings, "is missing" if missing else "is empty")

    @pytest.mark.parametrize(
        "sign",
        [
            "home.json",
            "uploads/1/upload.json",
            "exports/1.json",
            "backups/before-schema-0032.zip",
            "before-restore-2030-01-01/touchline.db",
            "sample/game/Labels-v3.json",
            "practice/truth.json",
            "second-factor.key",
            "webhooks.key",
            "begun.key",
        ],
    )
    def test_a_home_that_was_used_is_no_new_home(
        self, own_store: Store, tmp_path: Path, sign: str
    ) -> None:
        place = tmp_path / "left" / sign
        place.parent.mkdir(parents=True)
        shutil.copy(own_store.settings.home / "home.json", place)
        settings = Settings(home=tmp_path / "left")
        with pytest.raises(DamagedError, match="is missing, but this home has been used"):
            Store.open(settings)
        assert not settings.database_file.exists()

    def test_a_home_with_nothing_but_locks_and_cache_is_new(self, settings: Settings) -> None:
        (settings.home / "cache").mkdir(parents=True)
        (settings.home / "server.lock").touch()
        assert entries(settings) == 0

    @pytest.mark.parametrize("damage", [flip_a_bit, empty_the_header, cut])
    def test_a_damaged_log_is_refused_and_kept(
        self, own_store: Store, tmp_path: Path, damage: Callable[[bytes], bytes]
    ) -> None:
        say(own_store, 3)
        checkpoint(own_store)
        say(own_store, 40)
        settings = killed(own_store, tmp_path / "left")
        log = find_write_ahead_log_file(settings.database_file)
        whole = log.read_bytes()
        log.write_bytes(damage(whole))
        refused(settings, r"the log .* ends after \d+ entries, but this home recorded 43")
        log.write_bytes(whole)
        assert entries(settings) == 43

    def test_the_torn_end_of_what_nobody_was_told_is_no_damage(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        say(own_store, 5)
        settings = killed(own_store, tmp_path / "left")
        say(own_store)
        killed(own_store, tmp_path / "left", "touchline.db-wal")
        log = find_write_ahead_log_file(settings.database_file)
        log.write_bytes(log.read_bytes()[:-100])
        assert entries(settings) == 5

    def test_frames_of_an_earlier_log_behind_the_last_are_no_damage(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        say(own_store, 40)
        checkpoint(own_store, "RESTART")
        say(own_store, 2)
        assert entries(killed(own_store, tmp_path / "left")) == 42

    def test_a_damaged_log_in_a_folder_with_signs_in_its_name_is_kept(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        say(own_store, 40)
        settings = killed(own_store, tmp_path / "50% of #1")
        log = find_write_ahead_log_file(settings.database_file)
        log.write_bytes(cut(log.read_bytes()))
        refused(settings, "but this home recorded 40")

    def test_a_database_that_is_cut_short_is_refused(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        say(own_store, 20)
        own_store.close()
        settings = killed(own_store, tmp_path / "left", "touchline.db", "home.json")
        whole = settings.database_file.read_bytes()
        settings.database_file.write_bytes(whole[: len(whole) // 2])
        refused(settings, "is truncated")

    def test_a_file_that_is_no_database_is_named(self, settings: Settings) -> None:
        settings.home.mkdir()
        settings.database_file.write_bytes(b"certainly not a database\n" * 100)
        refused(settings, r"touchline\.db is damaged or not a database")

    @pytest.mark.parametrize("place", [16, 44])
    def test_a_header_that_was_scribbled_on_is_named(
        self, own_store: Store, tmp_path: Path, place: int
    ) -> None:
        say(own_store)
        own_store.close()
        settings = killed(own_store, tmp_path / "left", "touchline.db", "home.json")
        with settings.database_file.open("r+b") as file:
            file.seek(place)
            file.write(b"\xff" * 4)
        refused(settings, r"touchline\.db is damaged or not a database")


class TestAnchor:
    def test_follows_every_commit(self, own_store: Store) -> None:
        say(own_store, 7)
        known = json.loads((own_store.settings.home / "home.json").read_bytes())
        assert known["entries"] == 7

    def test_a_log_whose_end_is_missing_is_refused(self, own_store: Store, tmp_path: Path) -> None:
        say(own_store, 5)
        checkpoint(own_store)
        early = killed(own_store, tmp_path / "left", "touchline.db")
        say(own_store, 1)
        killed(own_store, tmp_path / "left", "home.json")
        refused(early, "ends after 5 entries, but this home recorded 6")

    def test_a_log_that_says_something_else_is_refused(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        checkpoint(own_store)
        other = killed(own_store, tmp_path / "left", "touchline.db")
        with closing(Store.open(other)) as twin:
            say(twin, 5)
        say(own_store, 4)
        killed(own_store, tmp_path / "left", "home.json")
        refused(other, "entry 4 of the log .* differs from the entry")

    def test_an_emptied_database_is_refused(self, own_store: Store, tmp_path: Path) -> None:
        say(own_store, 4)
        settings = killed(own_store, tmp_path / "left", "home.json")
        with closing(sqlite.connect(str(settings.database_file))) as empty:
            empty.execute("PRAGMA journal_mode = WAL")
            empty.execute("CREATE TABLE something (id)")
        refused(settings, "has no log table, but this home recorded 4 log entries")

    def test_the_database_of_another_installation_is_refused(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        with closing(Store.open(Settings(home=tmp_path / "other"))) as other:
            say(other, 10)
        settings = killed(own_store, tmp_path / "other", "home.json")
        refused(settings, "of another installation")

    def test_a_log_that_a_power_cut_left_longer_than_the_anchor_is_fine(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        say(own_store, 2)
        settings = killed(own_store, tmp_path / "left", "home.json")
        say(own_store, 3)
        killed(own_store, tmp_path / "left", "touchline.db", "touchline.db-wal")
        assert entries(settings) == 5

    def test_a_home_from_before_there_were_anchors_gets_one(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        say(own_store, 2)
        settings = killed(own_store, tmp_path / "left", "touchline.db", "touchline.db-wal")
        assert entries(settings) == 2
        known = json.loads((settings.home / "home.json").read_bytes())
        assert (known["entries"], len(known["installation"])) == (2, 32)

    def test_a_damaged_anchor_is_named(self, own_store: Store, tmp_path: Path) -> None:
        settings = killed(own_store, tmp_path / "left")
        (settings.home / "home.json").write_bytes(b'{"half')
        with pytest.raises(StorageError, match=r"home\.json is damaged"):
            Store.open(settings)


def checkpoint(own_store: Store, how: str = "TRUNCATE") -> None:
    """Everything goes into the database's own file, and the log begins anew."""
    with own_store._engine.connect() as connection:
        connection.exec_driver_sql("ROLLBACK")
        connection.exec_driver_sql(f"PRAGMA wal_checkpoint({how})")
