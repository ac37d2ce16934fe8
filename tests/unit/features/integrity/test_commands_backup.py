"""Backup and restore on the command line: words, JSON, exit codes."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path
from socket import socket

import pytest
from typer.testing import CliRunner

from app.command_line import app
from app.config import Settings
from app.db.store import Store
from app.errors import InputError, StorageError
from tests.unit.db.homes import say

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


class TestTransfer:
    @pytest.fixture
    def file(self, tmp_path: Path) -> Path:
        """A file of its owner alone."""
        file = tmp_path / "database_url"
        file.touch(mode=0o600)
        return file

    @pytest.mark.parametrize(
        "address",
        [
            "postgresql://ann:secret@localhost/touchline",
            "postgresql://ann:se/cret@localhost/touchline",
            "postgresql://ann@localhost/touchline?password=secret",
        ],
    )
    def test_a_password_is_not_taken_from_the_command_line(self, home: Path, address: str) -> None:
        for places in ([str(home), address], [address, str(home)]):
            done = CliRunner().invoke(app, ["transfer", *places])
            assert isinstance(done.exception, InputError)
            assert "read the password" in str(done.exception)
            assert "name that file" in (done.exception.hint or "")
            assert "secret" not in f"{done.output} {done.exception} {done.exception.hint}"

    def test_a_file_with_an_address_is_its_owners_alone(self, home: Path, file: Path) -> None:
        file.write_text("postgresql://ann:secret@localhost/touchline")
        file.chmod(0o640)
        done = CliRunner().invoke(app, ["transfer", str(home), str(file)])
        assert isinstance(done.exception, InputError)
        assert done.exception.hint == f"Run chmod 600 {file}."

    def test_a_file_without_an_address_is_no_place(self, home: Path, file: Path) -> None:
        done = CliRunner().invoke(app, ["transfer", str(home), str(file)])
        assert isinstance(done.exception, InputError)
        assert str(done.exception) == f"{file} contains no address of a database"

    @pytest.mark.parametrize("turned", [False, True])
    def test_a_server_that_does_not_answer_cannot_be_reached(
        self, home: Path, file: Path, tmp_path: Path, turned: bool
    ) -> None:
        with socket() as free:
            free.bind(("127.0.0.1", 0))
            file.write_text(f"postgresql://ann:x@127.0.0.1:{free.getsockname()[1]}/touchline")
            places = [str(file), str(tmp_path / "new")] if turned else [str(home), str(file)]
            done = CliRunner().invoke(app, ["transfer", *places])
        assert isinstance(done.exception, StorageError)
        assert str(done.exception) == "the database touchline cannot be reached"
