"""Backup and restore on the command line: words, JSON, exit codes."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.commands.command_line import app
from app.config import Settings
from app.store.store import Store
from tests.unit.store.homes import say

pytestmark = pytest.mark.file_of_sqlite("copies of the file")


@pytest.fixture
def home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A home with four entries."""
    monkeypatch.setenv("TOUCHLINE_HOME", str(tmp_path / "home"))
    with closing(Store.open(Settings(home=tmp_path / "home"))) as store:
        say(store, 4)
    return tmp_path / "home"


class TestBackup:
    def test_says_what_is_in_it(self, home: Path, tmp_path: Path) -> None:
        done = CliRunner().invoke(app, ["backup", str(tmp_path / "b.zip")])
        assert done.exit_code == 0
        assert "is written and verified\n  4 entries of the log, 0 groups" in done.output

    def test_with_frames_and_exports_it_takes_their_folders(
        self, home: Path, tmp_path: Path
    ) -> None:
        for name in ("uploads", "exports"):
            (home / name).mkdir()
            (home / name / "file").write_bytes(b"x")
        options = ["--with-frames", "--with-exports", "--json"]
        done = CliRunner().invoke(app, ["backup", str(tmp_path / "b.zip"), *options])
        assert list(json.loads(done.stdout)["files"]) == [
            "touchline.db",
            "uploads/file",
            "exports/file",
        ]


class TestRestore:
    def test_says_where_things_are(self, home: Path, tmp_path: Path) -> None:
        CliRunner().invoke(app, ["backup", str(tmp_path / "b.zip")])
        done = CliRunner().invoke(app, ["restore", str(tmp_path / "b.zip"), "--json"])
        restored = json.loads(done.stdout)
        assert (done.exit_code, restored["entries"]) == (0, 4)
        assert Path(restored["aside"]).parent == home

    def test_goes_into_another_home(self, home: Path, tmp_path: Path) -> None:
        CliRunner().invoke(app, ["backup", str(tmp_path / "b.zip")])
        command = ["restore", str(tmp_path / "b.zip"), "--home", str(tmp_path / "new")]
        done = CliRunner().invoke(app, command)
        assert done.exit_code == 0
        assert f"{tmp_path / 'new'} is restored" in done.output
        assert (tmp_path / "new" / "touchline.db").exists()
