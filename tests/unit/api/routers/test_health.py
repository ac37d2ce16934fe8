"""Health: alive, ready, and no longer ready once the database was seen to be damaged."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pysqlite3.dbapi2 as sqlite
import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient
from structlog.testing import capture_logs

from app.api.deps import Services
from app.config import Settings

API = "/api/v1"


class TestHealth:
    def test_a_process_that_answers_is_alive_and_ready(self, api: TestClient) -> None:
        assert api.get("/healthz").json()["status"] == "ok"
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
        said = f"no change is taken: {first.json()['detail']}"
        assert [answer.json()["detail"] for answer in (refused, ready)] == [said, said]
        assert api.get(f"{API}/pitch").status_code == 200
