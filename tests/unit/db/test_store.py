from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pysqlite3.dbapi2 as sqlite
import pytest
from sqlalchemy import text
from structlog.testing import capture_logs

from app.config import Settings
from app.db.dialects.dialect import get_dialect
from app.db.dialects.sqlite import AGAIN_S, PRAGMAS
from app.db.log import NewLogEntry, append_entries, read_log
from app.db.migrate import migrate_database
from app.db.store import Store
from app.errors import BusyError, DamagedError, InputError, StorageError
from tests.databases import said_for_sqlite
from tests.locks import LockWatcher
from tests.unit.db.homes import INSERT, add, names

ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="layout of its locks")


class TestOpen:
    @pytest.mark.usefixtures("every_migration")
    def test_an_empty_home_is_migrated_and_private(self, settings: Settings) -> None:
        own_store = Store.open(settings)
        assert names(own_store) == []
        assert settings.home.stat().st_mode & 0o777 == 0o700
        own_store.close()

    @ON_LINUX
    @pytest.mark.file_of_sqlite("locks of a file")
    def test_a_second_one_in_this_process_leaves_the_locks_of_the_first(
        self, own_store: Store, settings: Settings, lock_watcher: LockWatcher
    ) -> None:
        """Closing any descriptor of a file ends the locks that its process has on it."""
        with own_store.read() as session:
            session.execute(text("SELECT count(*) FROM sqlite_schema"))
            assert lock_watcher.sees_open(settings.database_file)
            Store.open(settings).close()
            migrate_database(settings)
            assert lock_watcher.sees_open(settings.database_file)
        own_store.close()
        assert not lock_watcher.sees_open(settings.database_file)

    @ON_LINUX
    @pytest.mark.file_of_sqlite("locks of a file")
    def test_reading_the_file_in_this_process_is_seen_to_end_its_locks(
        self, own_store: Store, settings: Settings, lock_watcher: LockWatcher
    ) -> None:
        """What the fixture ``store`` refuses of every test."""
        with own_store.read() as session:
            session.execute(text("SELECT count(*) FROM sqlite_schema"))
            settings.database_file.with_name("touchline.db-shm").read_bytes()
            assert not lock_watcher.sees_open(settings.database_file)
        own_store.close()

    @pytest.mark.parametrize("name", PRAGMAS)
    @pytest.mark.file_of_sqlite("PRAGMAs of a connection")
    def test_every_connection_has_the_durability_settings(
        self, own_store: Store, name: str
    ) -> None:
        with own_store.read() as one, own_store.read() as two, own_store.write() as three:
            for session in (one, two, three):
                answer = session.execute(text(f"PRAGMA {name}")).scalar()
                assert answer == PRAGMAS[name][1]

    @pytest.mark.file_of_sqlite("PRAGMAs of a connection")
    def test_what_need_not_last_waits_for_no_disk_and_leaves_others_as_they_are(
        self, own_store: Store
    ) -> None:
        def promise(session) -> int:
            return session.execute(text("PRAGMA synchronous")).scalar()

        with own_store.write(lasting=False) as session:
            assert promise(session) == 1
            session.execute(text(INSERT.format("passing")))
        with own_store.write() as session:
            assert promise(session) == 2
        assert names(own_store) == ["passing"]

    def test_what_the_log_says_must_be_on_the_disk(self, own_store: Store) -> None:
        with (
            pytest.raises(RuntimeError, match="must be durable"),
            own_store.write(lasting=False) as session,
        ):
            append_entries(session, [NewLogEntry("work", "ada", "2026-11-23T10:00:00+00:00", {})])
        with own_store.read() as session:
            assert list(read_log(session)) == []

    @pytest.mark.file_of_sqlite("PRAGMAs of a connection")
    def test_a_database_with_weaker_durability_is_refused(
        self, settings: Settings, monkeypatch
    ) -> None:
        # The planted fault: what is set is weaker than what must be answered.
        monkeypatch.setitem(PRAGMAS, "synchronous", ("NORMAL", 2))
        with pytest.raises(StorageError, match="synchronous"):
            Store.open(settings)

    def test_a_newer_schema_is_refused(self, own_store: Store) -> None:
        with own_store.write() as session:
            session.execute(text("UPDATE alembic_version SET version_num = '9999'"))
        for attempt in (Store.open, migrate_database):
            with pytest.raises(StorageError, match="newer version"):
                attempt(own_store.settings)

    def test_an_older_schema_asks_for_a_migration(self, own_store: Store, monkeypatch) -> None:
        monkeypatch.setattr("app.db.store.SCHEMA_REVISION", "0999")
        with pytest.raises(StorageError, match="older version") as caught:
            Store.open(own_store.settings)
        assert caught.value.hint == "Run touchline migrate."

    @pytest.mark.file_of_sqlite("what is in the file")
    def test_a_file_that_is_no_database_is_named(self, settings: Settings) -> None:
        settings.home.mkdir()
        (settings.home / "touchline.db").write_bytes(b"certainly not a database\n" * 100)
        with pytest.raises(StorageError, match=r"touchline\.db is damaged"):
            Store.open(settings)

    def test_other_databases_are_refused(self, settings: Settings) -> None:
        other = settings.model_copy(update={"database_url": "mysql://ann:secret@localhost/x"})
        with pytest.raises(
            InputError, match=r"^only SQLite and PostgreSQL databases are supported$"
        ):
            Store.open(other)


class TestRequireWhole:
    def test_names_the_fault_and_no_change_is_taken_after_it(
        self, own_store: Store, monkeypatch
    ) -> None:
        own_store.require_intact_database()
        monkeypatch.setattr(
            type(get_dialect(own_store.settings)), "find_file_faults", lambda *_: ["Tree 5 is torn"]
        )
        with pytest.raises(DamagedError, match=r"touchline\.db is damaged$"):
            own_store.require_intact_database()
        with pytest.raises(DamagedError, match="nothing can be changed now"):
            add(own_store, "late")

    @pytest.mark.file_of_sqlite("what is in the file")
    def test_clients_read_the_files_name_and_the_log_its_place_and_fault(
        self, own_store: Store, settings: Settings
    ) -> None:
        add(own_store, "demo")
        with own_store.write() as session:
            session.execute(text("PRAGMA writable_schema = ON"))
            session.execute(
                text(
                    "UPDATE sqlite_master SET sql = replace(sql, 'created VARCHAR NOT NULL',"
                    " 'created VARCHAR NOT NULL CHECK (created)') WHERE name = 'dataset'"
                )
            )
        own_store.close()
        opened = Store.open(settings)
        with capture_logs() as logs, pytest.raises(DamagedError) as caught:
            opened.require_intact_database()
        opened.close()
        assert caught.value.message == "touchline.db is damaged"
        assert logs[-1]["file"] == str(settings.database_file)
        assert "dataset" in logs[-1]["fault"]


class TestWrite:
    def test_is_kept_when_the_block_ends_and_not_otherwise(self, own_store: Store) -> None:
        add(own_store, "kept")
        with pytest.raises(KeyError), own_store.write() as session:
            session.execute(text(INSERT.format("lost")))
            raise KeyError
        assert names(own_store) == ["kept"]

    @pytest.mark.file_of_sqlite("BEGIN IMMEDIATE; the lock of PostgreSQL has a test of its own")
    def test_begins_immediately(self, own_store: Store, settings: Settings) -> None:
        other = sqlite.connect(str(settings.home / "touchline.db"), timeout=0)
        with own_store.write(), pytest.raises(sqlite.OperationalError, match="locked"):
            other.execute("BEGIN IMMEDIATE")
        other.execute("BEGIN IMMEDIATE")
        other.close()

    @pytest.mark.file_of_sqlite("BEGIN IMMEDIATE; PostgreSQL wakes who waits")
    def test_finds_a_short_gap_between_the_writes_of_another_process(
        self, own_store: Store, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """SQLite's own waiting would look again ever more seldom, and leave nobody to say so."""
        other = sqlite.connect(str(settings.home / "touchline.db"), isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        looks: list[float] = []

        def look_again(seconds: float) -> None:
            looks.append(seconds)
            if len(looks) == 40:
                other.execute("ROLLBACK")

        monkeypatch.setattr("app.db.dialects.sqlite.sleep", look_again)
        add(own_store, "in the gap")
        other.close()
        assert (names(own_store), set(looks), len(looks)) == (["in the gap"], {AGAIN_S}, 40)

    @pytest.mark.file_of_sqlite("BEGIN IMMEDIATE; the lock of PostgreSQL has a test of its own")
    def test_gives_up_where_another_process_writes_all_the_while(
        self, own_store: Store, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.db.dialects.sqlite.BUSY_SECONDS", 0.05)
        other = sqlite.connect(str(settings.home / "touchline.db"), isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StorageError, match="another process is writing"):
            add(own_store, "refused")
        other.execute("ROLLBACK")
        other.close()
        add(own_store, "afterwards")
        assert names(own_store) == ["afterwards"]
        with own_store.read() as session:
            assert session.execute(text("PRAGMA busy_timeout")).scalar() == 5000

    def test_reading_does_not_lock(self, own_store: Store) -> None:
        with own_store.read() as session:
            before = session.execute(text("SELECT count(*) FROM dataset")).scalar()
            add(own_store, "beside")
        with own_store.read() as session:
            after = session.execute(text("SELECT count(*) FROM dataset")).scalar()
        assert (before, after) == (0, 1)

    def test_a_reader_keeps_its_snapshot(self, own_store: Store) -> None:
        with own_store.read() as session:
            before = session.execute(text("SELECT count(*) FROM dataset")).scalar()
            add(own_store, "later")
            assert session.execute(text("SELECT count(*) FROM dataset")).scalar() == before

    def test_threads_take_turns(self, own_store: Store) -> None:
        def work(number: int) -> None:
            for step in range(5):
                add(own_store, f"{number}-{step}")

        threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(names(own_store)) == 20

    def test_a_turn_that_does_not_come_is_a_storage_error(
        self, own_store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.db.store.TURN_SECONDS", 0.01)
        refused = pytest.raises(StorageError, match="other changes are still being written")
        with own_store.write(), ThreadPoolExecutor(1) as other, refused:
            other.submit(add, own_store, "late").result()
        add(own_store, "after")
        assert names(own_store) == ["after"]

    @pytest.mark.file_of_sqlite("a file with a largest size")
    def test_a_full_disk_is_a_storage_error_and_reads_go_on(self, own_store: Store) -> None:
        add(own_store, "before")
        with own_store.read() as session:
            pages = session.execute(text("PRAGMA page_count")).scalar_one()
        with pytest.raises(StorageError, match="disk is full"), own_store.write() as session:
            session.execute(text(f"PRAGMA max_page_count = {pages}"))
            for number in range(5000):
                session.execute(text(INSERT.format(f"x{number}" * 20)))
        assert names(own_store) == ["before"]

    @pytest.mark.file_of_sqlite("locks of the file; those of PostgreSQL have a test of their own")
    def test_a_busy_database_is_a_storage_error(self, own_store: Store, settings: Settings) -> None:
        other = sqlite.connect(str(settings.home / "touchline.db"), isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        busy = pytest.raises(StorageError, match="another process is writing")
        with busy, own_store.read() as session:
            session.execute(text("PRAGMA busy_timeout = 1"))
            session.execute(text("DELETE FROM dataset"))
        other.execute("ROLLBACK")
        other.close()

    @pytest.mark.file_of_sqlite("the file that a process leaves")
    def test_an_acknowledged_write_survives_a_killed_process(self, own_store, settings) -> None:
        script = (
            "import os, sys; from pathlib import Path; from app.config import Settings;"
            "from app.db.store import Store; from sqlalchemy import text\n"
            "store = Store.open(Settings(home=Path(sys.argv[1])))\n"
            "with store.write() as session:\n"
            f"    session.execute(text({INSERT.format('acknowledged')!r}))\n"
            "print('saved', flush=True)\n"
            "held = store.write()\n"
            "writing = held.__enter__()\n"
            f"writing.execute(text({INSERT.format('lost')!r}))\n"
            "os.kill(os.getpid(), 9)\n"
        )
        root = Path(__file__).parents[3]
        done = subprocess.run(
            [sys.executable, "-c", script, str(settings.home)],
            capture_output=True,
            text=True,
            cwd=root,
            check=False,
        )
        assert (done.stdout, done.returncode) == ("saved\n", -9)
        assert names(own_store) == ["acknowledged"]


class TestPeek:
    @pytest.mark.file_of_sqlite("a server of databases is always waited for")
    def test_answers_at_once_while_others_write_and_all_connections_are_taken(
        self, own_store: Store
    ) -> None:
        add(own_store, "kept")
        with ExitStack() as held, own_store.write() as writing:
            writing.execute(text(INSERT.format("not yet")))
            for _ in range(20):
                held.enter_context(own_store.read())
            with own_store.read_without_waiting() as session:
                found = session.scalars(text("SELECT name FROM dataset")).all()
                promise = session.execute(text("PRAGMA busy_timeout")).scalar()
        assert (found, promise) == (["kept"], 0)

    @pytest.mark.file_of_sqlite("a server of databases is always waited for")
    def test_sees_what_was_written_since(self, own_store: Store) -> None:
        for name in ("one", "two"):
            add(own_store, name)
            with own_store.read_without_waiting() as session:
                found = session.scalars(text("SELECT name FROM dataset ORDER BY id")).all()
            assert found[-1] == name

    @pytest.mark.file_of_sqlite("a server of databases is always waited for")
    def test_who_would_wait_for_another_thread_is_told(self, own_store: Store) -> None:
        with (
            own_store.read_without_waiting(),
            pytest.raises(BusyError),
            own_store.read_without_waiting(),
        ):
            pytest.fail("it was answered")

    def test_where_every_statement_is_waited_for_it_is_refused(
        self, own_store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(own_store, "_peeker", None)
        with pytest.raises(BusyError), own_store.read_without_waiting():
            pytest.fail("it was answered")


class TestListen:
    def test_a_listener_that_fails_costs_neither_the_change_nor_the_others(
        self, own_store: Store
    ) -> None:
        told: list[int] = []
        own_store.listen(lambda: told.append(1 // 0))
        own_store.listen(lambda: told.append(1))
        with capture_logs() as logs:
            add(own_store, "kept")
        assert (names(own_store), told) == (["kept"], [1])
        assert [line["log_level"] for line in logs] == ["error"]


ROWS = (
    "INSERT INTO log (id, at, actor, kind, body, hash) VALUES (1, '', '', '', '', '')",
    "INSERT INTO calibration (key, body) VALUES ('k', '')",
)


class TestAppendOnly:
    @pytest.mark.parametrize(
        "statement",
        [
            "UPDATE log SET actor = 'eve'",
            "DELETE FROM log",
            "INSERT OR REPLACE INTO log (id, at, actor, kind, body, hash)"
            " VALUES (1, '', 'eve', '', '', '')",
            "UPDATE calibration SET body = 'x'",
        ],
    )
    def test_history_cannot_be_rewritten(self, own_store: Store, statement: str) -> None:
        with own_store.write() as session:
            for row in ROWS:
                session.execute(text(row))
        refused = pytest.raises(Exception, match="never changed")
        with own_store.write() as session:
            with said_for_sqlite(session), refused:
                session.execute(text(statement))
            # After a refusal PostgreSQL takes no further statement in the same transaction.
            session.rollback()
        with own_store.read() as session:
            assert session.execute(text("SELECT actor FROM log")).scalar() == ""

    @pytest.mark.file_of_sqlite("the list of triggers in sqlite_master")
    def test_every_table_that_must_not_change_has_its_triggers(self, own_store: Store) -> None:
        with own_store.read() as session:
            triggers = set(
                session.scalars(text("SELECT name FROM sqlite_master WHERE type = 'trigger'"))
            )
        assert triggers == {
            *(
                f"{name}_refuses_update"
                for name in ("solution", "calibration", "frozen", "paint_evidence")
            ),
            *(f"group_{name}_is_marked" for name in ("new", "change", "solved")),
            "frozen_refuses_delete",
            "frozen_keeps_what_it_has",
            "calibration_stays_in_versions",
            *(
                f"{name}_refuses_{verb}"
                for name in ("log", "verdict", "dismissal", "version", "version_group")
                for verb in ("update", "delete", "insert")
            ),
        }


class TestErrors:
    @pytest.mark.file_of_sqlite("what is in the file")
    def test_a_file_that_is_no_database_is_a_storage_error(
        self, own_store: Store, settings: Settings
    ) -> None:
        assert names(own_store) == []
        own_store.close()
        (settings.home / "touchline.db").write_bytes(b"x" * 4096)
        with pytest.raises(StorageError, match="not a database"):
            names(own_store)

    def test_what_was_to_be_written_is_not_in_the_error_that_is_logged(
        self, own_store: Store
    ) -> None:
        refused = text("INSERT INTO dataset (name) VALUES (:name)")
        with pytest.raises(StorageError) as caught, own_store.write() as session:
            session.execute(refused, {"name": "a secret"})
        assert "INSERT" in f"{caught.value.__cause__}"
        assert "a secret" not in f"{caught.value.__cause__}"

    def test_a_refused_statement_is_a_storage_error_that_shows_no_sql(
        self, own_store: Store
    ) -> None:
        add(own_store, "demo")
        with pytest.raises(StorageError, match="could not carry out") as caught:
            add(own_store, "demo")
        assert "INSERT" not in f"{caught.value} {caught.value.hint}"
        assert names(own_store) == ["demo"]
