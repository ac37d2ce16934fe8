"""Homes of every released schema, solved by an earlier solver: the doctor finds no fault, and its advice helps."""

from __future__ import annotations

import shlex
from contextlib import closing
from pathlib import Path

import pysqlite3.dbapi2 as sqlite
import pytest
from sqlalchemy import text

from app.config import Settings
from app.db.check import CheckResult
from app.db.home import make_home
from app.db.migrate import KNOWN_REVISIONS, migrate_database
from app.db.store import Store
from app.features.integrity.checks import examine_everything
from app.soccer.solution import SOLVER_VERSION
from tests.torture.populated import carry_back, people_work
from tests.torture.upgrades import make_old

pytestmark = pytest.mark.file_of_sqlite("homes of SQLite, schema by schema")
VERSIONS = "0003"
"""The first schema with frozen versions."""
NUMBERS = "SELECT group_id, solved, passes, error_px, sigma_m, min_jac FROM queue ORDER BY group_id"


@pytest.fixture
def worked_in(store: Store, fill, make_group, revision: str, tmp_path: Path) -> Path:
    """A home in which groups were solved, edited, judged and, where its schema can, frozen."""
    fill(make_group(7), make_group(8))
    # A copy: the store itself serves other tests.
    copy = Settings(home=tmp_path / "copy")
    make_home(copy)
    with (
        closing(sqlite.connect(str(store.settings.database_file))) as one,
        closing(sqlite.connect(str(copy.database_file))) as two,
    ):
        one.backup(two)
    people_work(copy, freezes=revision >= VERSIONS)
    return copy.home


def of_earlier_solver(home: Path, revision: str, folder: Path) -> Settings:
    """The home in a schema of before, its solutions those of a solver of before."""
    old = Settings(home=folder)
    make_old(old, revision)
    carry_back(home, old)
    with closing(sqlite.connect(str(old.database_file))) as connection:
        found = "SELECT sql FROM sqlite_master WHERE name = 'solution_refuses_update'"
        (guard,) = connection.execute(found).fetchone()
        connection.execute("DROP TRIGGER solution_refuses_update")
        connection.execute("UPDATE solution SET solver_version = ?", (f"{SOLVER_VERSION}-before",))
        connection.execute(guard)
        connection.commit()
    return old


def numbers(settings: Settings) -> list[tuple[object, ...]]:
    with closing(Store.open(settings)) as store, store.read() as session:
        return [tuple(row) for row in session.execute(text(NUMBERS))]


def commands(checks: list[CheckResult]) -> list[list[str]]:
    """Commands of the product that the advice consists of."""
    advice = [
        check.advice for check in checks if check.advice and check.advice.startswith("touchline ")
    ]
    return [shlex.split(sentence)[1:] for sentence in advice]


@pytest.mark.parametrize("revision", KNOWN_REVISIONS)
def test_no_fault_is_found_and_what_is_advised_leaves_nothing_to_do(
    worked_in: Path, revision: str, tmp_path: Path, touchline, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = of_earlier_solver(worked_in, revision, tmp_path / "old")
    monkeypatch.setenv("TOUCHLINE_HOME", str(old.home))
    migrate_database(old)
    before = numbers(old)
    assert all(row[1] for row in before)
    checks = examine_everything(old)
    assert [check for check in checks if not check.ok] == []
    advised = commands(checks)
    assert [words[0] for words in advised] == ["solve"]
    # What nobody needs must not harm, either.
    code, _, _ = touchline("doctor", "--rebuild")
    assert code == 0
    assert numbers(old) == before
    for words in advised:
        code, _, _ = touchline(*words)
        assert code == 0
    after = examine_everything(old)
    assert ([check for check in after if not check.ok], commands(after)) == ([], [])
    assert numbers(old) == before
