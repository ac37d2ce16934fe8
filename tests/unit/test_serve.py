"""Serving and migrating a home that is not in order: one sentence, exit code 1, nothing changed."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pysqlite3.dbapi2 as sqlite
import pytest

from app.config import Settings
from app.db.dialects.dialect import get_dialect
from app.db.locks import hold_server_lock
from app.db.store import Store
from tests.unit.db.homes import say

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A home with some entries, closed."""
    with closing(Store.open(Settings(home=tmp_path / "home"))) as store:
        say(store, 20)
    return tmp_path / "home"


@pytest.fixture
def run(touchline: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    # A home that is served all the same shall fail the test, and not hold it.
    monkeypatch.setattr(
        "app.http.server.serve_application", lambda app, _: app.state.services.close()
    )
    return touchline


def flip_a_page(home: Path) -> None:
    """The page of the log's index becomes noise: a start does not read it."""
    database = home / "touchline.db"
    with closing(sqlite.connect(str(database))) as connection:
        query = "SELECT rootpage FROM sqlite_master WHERE name = 'verdict_batch'"
        (page,) = connection.execute(query).fetchone()
    with database.open("r+b") as file:
        file.seek((page - 1) * 4096)
        file.write(b"\xee" * 4096)


def cut(home: Path) -> None:
    database = home / "touchline.db"
    database.write_bytes(database.read_bytes()[:8192])


def scribble(home: Path) -> None:
    (home / "touchline.db").write_bytes(b"Dear all, " * 900)


def empty(home: Path) -> None:
    (home / "touchline.db").write_bytes(b"")


def lose(home: Path) -> None:
    (home / "touchline.db").unlink()


class TestServe:
    @pytest.mark.file_of_sqlite("a file that is damaged")
    @pytest.mark.parametrize(
        ("fault", "mends"),
        [
            (flip_a_page, "touchline doctor"),
            (cut, "touchline restore BACKUP"),
            (scribble, "touchline restore BACKUP"),
            (empty, "touchline restore BACKUP"),
            (lose, "touchline restore BACKUP"),
        ],
    )
    def test_a_damaged_home_is_one_sentence_with_the_command_that_mends(
        self, run: Run, home: Path, fault: Callable[[Path], None], mends: str
    ) -> None:
        fault(home)
        code, out, err = run("serve", "--port", "0")
        assert (code, out) == (1, "")
        assert f"Run {mends}" in err
        assert str(home / "touchline.db") in err
        # Where the file is and what SQLite says about its pages is a line of the log before it.
        lines = 3 if fault is flip_a_page else 2
        assert ("Traceback" in err, len(err.strip().splitlines())) == (False, lines)

    @pytest.mark.file_of_sqlite("permissions of the file")
    def test_an_open_home_is_closed_with_one_line_in_the_log(self, run: Run, home: Path) -> None:
        home.chmod(0o755)
        (home / "touchline.db").chmod(0o644)
        scribble(home)
        err = run("serve", "--port", "0")[2]
        assert err.count("others could read the home") == 1
        assert home.stat().st_mode & 0o777 == 0o700
        assert (home / "touchline.db").stat().st_mode & 0o777 == 0o600

    @pytest.mark.file_of_sqlite("a file is what several processes cannot share")
    def test_several_processes_over_a_file_are_refused(
        self, run: Run, home: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.http.server.serve_with_processes", lambda *_arguments: None)
        code, out, err = run("serve", "--port", "0", "--workers", "2")
        assert (code, out) == (1, "")
        assert "need a PostgreSQL database" in err
        assert "TOUCHLINE_DATABASE_URL" in err


class TestMigrate:
    def test_is_refused_beside_a_server_which_it_names(self, run: Run, home: Path) -> None:
        with hold_server_lock(Settings(home=home)):
            code, _, err = run("migrate")
        assert code == 1
        assert f"already uses this home folder (process {os.getpid()})" in err


def without_power(command: list[str]) -> list[str]:
    """Root may write anywhere; take that from it."""
    if os.geteuid() != 0:
        return command
    powers = "-dac_override,-dac_read_search"
    return ["setpriv", f"--bounding-set={powers}", f"--inh-caps={powers}", *command]


ONE_AFTER_THE_OTHER = """
import json, sys
from app.cli import main
for words in json.loads(sys.argv[1]):
    sys.argv = ["touchline", *words]
    try:
        main()
    except SystemExit as ended:
        print("exit code", ended.code, file=sys.stderr)
"""
"""Runs commands in one process: each of its own would load everything anew."""


@pytest.mark.skipif(os.geteuid() == 0 and not shutil.which("setpriv"), reason="root, no setpriv")
class TestReadOnlyHome:
    def test_is_one_sentence(self, home: Path, tmp_path: Path) -> None:
        for path in [*home.iterdir(), home]:
            path.chmod(0o500 if path.is_dir() else 0o400)
        commands = [
            ["serve", "--port", "0"],
            ["findings", "--dataset", "x"],
        ]
        if get_dialect(Settings(home=home)).is_file:
            commands.append(["backup", str(tmp_path / "b.zip")])
        done = subprocess.run(
            without_power([sys.executable, "-c", ONE_AFTER_THE_OTHER, json.dumps(commands)]),
            env={**os.environ, "TOUCHLINE_HOME": str(home)},
            cwd=Path(__file__).parents[3],
            capture_output=True,
            text=True,
            check=False,
        )
        home.chmod(0o700)
        assert (done.returncode, done.stdout) == (0, "")
        told = done.stderr.split("exit code 1\n")
        assert (len(told), told.pop()) == (len(commands) + 1, "")
        for text in told:
            assert "cannot be written: Permission denied" in text
            assert len(text.strip().splitlines()) == 2
