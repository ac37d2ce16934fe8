"""Serving and migrating a home that is not in order: one sentence, exit code 1, nothing changed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pysqlite3.dbapi2 as sqlite
import pytest

from app.cli import main
from app.config import Settings
from app.store.locks import server_lock
from app.store.session import Store
from tests.unit.store.homes import say

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A home with some entries, closed."""
    with closing(Store.open(Settings(home=tmp_path / "home"))) as store:
        say(store, 20)
    return tmp_path / "home"


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], home: Path) -> Run:
    for name in [name for name in os.environ if name.startswith("TOUCHLINE_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("TOUCHLINE_HOME", str(home))
    # A home that is served all the same shall fail the test, and not hold it.
    monkeypatch.setattr("app.api.server.run", lambda *_arguments: None)

    def command(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["touchline", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfd.readouterr()
        return int(ended.value.code or 0), out, err

    return command


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
    @pytest.mark.parametrize("fault", [flip_a_page, cut, scribble, empty, lose])
    def test_a_damaged_home_is_one_sentence_with_the_command_that_mends(
        self, run: Run, home: Path, fault: Callable[[Path], None]
    ) -> None:
        fault(home)
        code, out, err = run("serve", "--port", "0")
        assert (code, out) == (1, "")
        assert "touchline restore" in err or "touchline doctor" in err
        assert str(home / "touchline.db") in err
        # Where the file is and what SQLite says about its pages is a line of the log before it.
        lines = 3 if fault is flip_a_page else 2
        assert ("Traceback" in err, len(err.strip().splitlines())) == (False, lines)

    def test_an_open_home_is_closed_with_one_line_in_the_log(self, run: Run, home: Path) -> None:
        home.chmod(0o755)
        (home / "touchline.db").chmod(0o644)
        scribble(home)
        err = run("serve", "--port", "0")[2]
        assert err.count("others could read the home") == 1
        assert home.stat().st_mode & 0o777 == 0o700
        assert (home / "touchline.db").stat().st_mode & 0o777 == 0o600


class TestMigrate:
    def test_is_refused_beside_a_server_which_it_names(self, run: Run, home: Path) -> None:
        with server_lock(Settings(home=home)):
            code, _, err = run("migrate")
        assert code == 1
        assert f"already uses this home folder (process {os.getpid()})" in err


def without_power(command: list[str]) -> list[str]:
    """Root may write anywhere; take that from it."""
    if os.geteuid() != 0:
        return command
    powers = "-dac_override,-dac_read_search"
    return ["setpriv", f"--bounding-set={powers}", f"--inh-caps={powers}", *command]


@pytest.mark.skipif(os.geteuid() == 0 and not shutil.which("setpriv"), reason="root, no setpriv")
class TestReadOnlyHome:
    @pytest.mark.parametrize(
        "command", [("serve", "--port", "0"), ("findings", "--dataset", "x"), ("backup", "{out}")]
    )
    def test_is_one_sentence(self, home: Path, tmp_path: Path, command: tuple[str, ...]) -> None:
        for path in [*home.iterdir(), home]:
            path.chmod(0o500 if path.is_dir() else 0o400)
        arguments = [part.format(out=tmp_path / "b.zip") for part in command]
        done = subprocess.run(
            without_power([sys.executable, "-c", "from app.cli import main; main()", *arguments]),
            env={**os.environ, "TOUCHLINE_HOME": str(home)},
            cwd=Path(__file__).parents[3],
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stdout) == (1, "")
        assert "cannot be written: Permission denied" in done.stderr
        assert len(done.stderr.strip().splitlines()) == 2
        home.chmod(0o700)
