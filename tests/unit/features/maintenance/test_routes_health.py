"""Health: alive, ready, and no longer ready once the database was seen to be damaged."""

from __future__ import annotations

import re
import resource
import zlib
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import pysqlite3.dbapi2 as sqlite
import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient
from structlog.testing import capture_logs

from app.config import Settings
from app.errors import StorageError
from app.http.deps import Services
from tests.openapi import openapi_of

API = "/api/v1"
SLOW = ("/events", "/suggestions", "/influence", "/yield")
"""What has no end, or solves."""
KEY = {"Idempotency-Key": "once"}


class TestHealth:
    def test_a_process_that_answers_is_alive_and_ready(self, api: TestClient) -> None:
        assert api.get("/healthz").json()["status"] == "ok"
        assert api.get("/readyz").json() == {"status": "ready"}

    @pytest.mark.file_of_sqlite("the file that is open")
    def test_a_process_whose_database_is_moved_away_is_not_ready(
        self, api: TestClient, tmp_path: Path
    ) -> None:
        file = tmp_path / "home" / "touchline.db"
        file.rename(tmp_path / "aside.db")
        with capture_logs():
            ready = api.get("/readyz")
        assert ready.status_code == 503
        assert ready.json()["detail"] == "touchline.db was moved or deleted while it was open"

    @pytest.mark.file_of_sqlite("a disk that takes no more of a file")
    def test_a_process_that_can_keep_no_change_is_not_ready_until_it_can(
        self, app: FastAPI, api: TestClient
    ) -> None:
        store = app.state.services.store
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        # No file grows any more, as on a full disk.
        resource.setrlimit(resource.RLIMIT_FSIZE, (1, hard))
        try:
            with pytest.raises(StorageError), store.write() as session:
                session.exec_driver_sql("UPDATE dataset SET name = name")
            with capture_logs():
                ready = api.get("/readyz")
            assert ready.status_code == 503
            assert ready.json()["detail"].startswith("changes are refused: the disk ")
            assert api.get("/healthz").status_code == 200
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert api.get("/readyz").json() == {"status": "ready"}


@pytest.fixture
def spoil(app: FastAPI, tmp_path: Path) -> Callable[[Callable[[Path], None]], None]:
    """Stops the application, changes its database behind its back, and starts it again."""

    def run(change: Callable[[Path], None]) -> None:
        app.state.services.close()
        change(tmp_path / "home" / "touchline.db")
        app.state.services = Services.open(Settings(home=tmp_path / "home"))

    return run


def overwrite_root(table: str) -> Callable[[Path], None]:
    """The first page of a table becomes noise."""

    def change(database: Path) -> None:
        with closing(sqlite.connect(str(database))) as connection:
            query = "SELECT rootpage FROM sqlite_master WHERE name = ?"
            (page,) = connection.execute(query, (table,)).fetchone()
            (size,) = connection.execute("PRAGMA page_size").fetchone()
        with database.open("r+b") as file:
            file.seek((page - 1) * size)
            file.write(b"\xee" * size)

    return change


def forge_solutions(database: Path) -> None:
    """Records whose pages are fine and whose bytes are not what was written."""
    with closing(sqlite.connect(str(database))) as connection:
        connection.execute("DROP TRIGGER solution_refuses_update")
        connection.execute("UPDATE solution SET body = ?", (zlib.compress(b"{")[:-2],))
        connection.commit()


@dataclass
class Kept:
    """Texts of a column before they were overwritten, by row."""

    table: str = ""
    column: str = ""
    rows: list[tuple[str, int]] = field(default_factory=list)


def json_columns(database: Path) -> list[tuple[str, str]]:
    """Every column of the database that holds JSON as text."""
    found = []
    with closing(sqlite.connect(str(database))) as connection:
        tables = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        for (table,) in tables.fetchall():
            for row in connection.execute(f"PRAGMA table_info('{table}')").fetchall():
                query = f"""SELECT 1 FROM "{table}" WHERE "{row[1]}" GLOB '[[{{]*'"""
                if row[2] in ("VARCHAR", "TEXT") and connection.execute(query).fetchone():
                    found.append((table, row[1]))
    return found


def overwrite_text(database: Path, table: str, column: str, text: str, kept: Kept) -> None:
    """Every text of a column becomes another one; the column before has its own again."""
    change = 'UPDATE "{}" SET "{}" = ? WHERE rowid = ?'
    with closing(sqlite.connect(str(database))) as connection:
        query = "SELECT name FROM sqlite_master WHERE type = 'trigger' AND tbl_name = ?"
        for (name,) in connection.execute(query, (table,)).fetchall():
            connection.execute(f"DROP TRIGGER {name}")
        if kept.rows:
            connection.executemany(change.format(kept.table, kept.column), kept.rows)
        kept.table, kept.column = table, column
        kept.rows = connection.execute(f'SELECT "{column}", rowid FROM "{table}"').fetchall()
        rows = [(text, row) for _, row in kept.rows]
        connection.executemany(change.format(table, column), rows)
        connection.commit()


def readable(app: FastAPI) -> list[str]:
    """An address for each GET of the interface, the first of everything."""
    found = []
    for path, operations in openapi_of(app)["paths"].items():
        if "get" in operations and not path.endswith(SLOW):
            named = path.replace("{dataset}", "broadcast")
            query = "?dataset=broadcast" if "{" not in path else ""
            found.append(re.sub(r"{\w+}", "1", named) + query)
    return found


@pytest.mark.file_of_sqlite("a file that is changed behind the server's back")
class TestDamage:
    @pytest.mark.parametrize("change", [overwrite_root("view"), forge_solutions])
    def test_the_first_sign_of_it_ends_all_changes(
        self, spoil, api: TestClient, change: Callable[[Path], None]
    ) -> None:
        spoil(change)
        body = {"name": "mine", "q": "status:accepted"}
        with capture_logs():
            first = api.get(f"{API}/groups/1")
            refused = api.post(f"{API}/datasets/broadcast/saved-views", json=body)
            ready = api.get("/readyz")
        assert [answer.status_code for answer in (first, refused, ready)] == [503, 503, 503]
        for answer in (first, refused, ready):
            problem = answer.json()
            assert "touchline doctor" in problem["hint"]
            assert answer.headers["content-type"] == "application/problem+json"
        said = f"nothing can be changed now: {first.json()['detail']}"
        assert [answer.json()["detail"] for answer in (refused, ready)] == [said, said]
        assert api.get(f"{API}/pitch").status_code == 200

    def test_a_text_that_is_not_what_was_written_is_damage_wherever_it_stands(
        self, app: FastAPI, spoil, api: TestClient, tmp_path: Path
    ) -> None:
        bulk = {"q": "", "state": "deferred"}
        assert api.post(f"{API}/datasets/broadcast/verdicts", json=bulk, headers=KEY).is_success
        asked = [path for path in readable(app) if api.get(path).status_code == 200]
        refused, kept = set[str](), Kept()
        for table, column in json_columns(tmp_path / "home" / "touchline.db"):
            # Whoever reads a column finds that this is no JSON; they alone can mind what it says.
            readers = asked
            for text in ("{", "[5]"):
                spoil(partial(overwrite_text, table=table, column=column, text=text, kept=kept))
                with capture_logs():
                    answers = {path: api.get(path) for path in readers}
                    ready = api.get("/readyz").status_code
                statuses = {path: answer.status_code for path, answer in answers.items()}
                assert 500 not in statuses.values(), (table, column, statuses)
                readers = [path for path, status in statuses.items() if status == 503]
                for path in readers:
                    assert "touchline doctor" in answers[path].json()["hint"]
                    assert ready == 503
                    refused.add(f"{table}.{column} {text}")
        known = ("dataset.policy", "station.lines", "view.balls", "solution.calibrations")
        assert {f"{name} {text}" for name in known for text in ("{", "[5]")} <= refused
