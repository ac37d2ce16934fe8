"""The log beside a database, read from its bytes, against logs that SQLite itself wrote."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pysqlite3.dbapi2 as sqlite
import pytest

from app.db.recovery.preopen_check import read_header, summarize_wal_file

COMMITS = 30


def database(path: Path, *, checkpointed: int = 0) -> Path:
    """A killed database: its first commits are in the file, all others only in the log."""
    live = path.with_name(f"live-{path.name}")
    with closing(sqlite.connect(str(live), isolation_level=None)) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("CREATE TABLE said (id INTEGER PRIMARY KEY, body)")
        count(connection, 1)
        for number in range(COMMITS):
            if number == checkpointed:
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            connection.execute("BEGIN")
            connection.execute("INSERT INTO said (body) VALUES (zeroblob(700))")
            count(connection, number + 2)
            connection.execute("COMMIT")
        path.write_bytes(live.read_bytes())
        log(path).write_bytes(log(live).read_bytes())
    return path


def count(connection: sqlite.Connection, number: int) -> None:
    connection.execute(f"PRAGMA user_version = {number}")


def log(path: Path) -> Path:
    return path.with_name(f"{path.name}-wal")


class TestReadLog:
    def test_knows_every_commit_and_what_it_counted(self, tmp_path: Path) -> None:
        found = summarize_wal_file(log(database(tmp_path / "a.db")))
        assert found.commits == COMMITS
        assert [header.count for header in found.headers] == list(range(2, COMMITS + 2))

    @pytest.mark.parametrize("lost", [1, 100, 4096, 40_000])
    def test_what_was_cut_off_or_torn_does_not_count(self, tmp_path: Path, lost: int) -> None:
        path = log(database(tmp_path / "a.db"))
        whole = path.read_bytes()
        path.write_bytes(whole[:-lost])
        cut = summarize_wal_file(path).commits
        torn = bytearray(whole)
        torn[-lost] ^= 1
        path.write_bytes(torn)
        assert summarize_wal_file(path).commits == cut < COMMITS

    def test_nothing_is_an_empty_log(self, tmp_path: Path) -> None:
        assert summarize_wal_file(tmp_path / "none").commits == 0
        for content in (b"", b"x" * 20, b"x" * 5000):
            (tmp_path / "log").write_bytes(content)
            assert summarize_wal_file(tmp_path / "log").commits == 0


class TestBelongsTo:
    @pytest.mark.parametrize("checkpointed", [0, 1, COMMITS - 1])
    def test_a_log_belongs_to_its_own_database(self, tmp_path: Path, checkpointed: int) -> None:
        path = database(tmp_path / "a.db", checkpointed=checkpointed)
        header = read_header(path)
        assert header is not None
        assert summarize_wal_file(log(path)).belongs_to(header)

    def test_and_still_does_when_some_of_it_was_taken_over(self, tmp_path: Path) -> None:
        path = database(tmp_path / "a.db")
        found = summarize_wal_file(log(path))
        content = path.read_bytes()
        path.write_bytes(found.headers[10].raw + content[100:])
        header = read_header(path)
        assert header is not None
        assert found.belongs_to(header)

    def test_an_earlier_state_of_the_same_database_is_another_one(self, tmp_path: Path) -> None:
        early = read_header(database(tmp_path / "early.db", checkpointed=5))
        late = summarize_wal_file(log(database(tmp_path / "late.db", checkpointed=7)))
        assert early is not None
        assert not late.belongs_to(early)

    def test_a_database_of_other_pages_is_another_one(self, tmp_path: Path) -> None:
        other = tmp_path / "other.db"
        with closing(sqlite.connect(str(other))) as connection:
            connection.execute("PRAGMA page_size = 1024")
            connection.execute("CREATE TABLE said (id)")
            connection.execute("PRAGMA user_version = 1")
        header = read_header(other)
        assert header is not None
        assert not summarize_wal_file(log(database(tmp_path / "a.db"))).belongs_to(header)
