"""Backups: whole and verified or not there at all, and never in the place of another file."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import zipfile
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text

from app.config import Settings
from app.db import backup as backup_module
from app.db.backup import EXPORTS, FRAMES, back_up_home, verify_backup
from app.db.store import Store
from app.errors import DamagedError, InputError, StorageError
from tests.unit.db.homes import killed, say

pytestmark = pytest.mark.file_of_sqlite("copies of the file")


def place(own_store: Store, name: str) -> Path:
    path = own_store.settings.exports / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"x")
    return path


class TestBackUp:
    def test_holds_what_was_acknowledged_beside_a_running_server(
        self, filled: Store, tmp_path: Path
    ) -> None:
        say(filled, 30)
        manifest = back_up_home(filled.settings, tmp_path / "b.zip")
        say(filled, 5)
        assert (manifest.entries, manifest.rows["groups"], manifest.rows["view"]) == (30, 1, 3)
        assert verify_backup(tmp_path / "b.zip") == manifest
        assert manifest.frames_elsewhere == 2

    def test_writers_go_on_while_it_is_taken(
        self, own_store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        say(own_store, 3)
        examine = "app.db.backup.examine_database"
        from app.db.backup import examine_database

        def meanwhile(*arguments):
            say(own_store, 4)
            return examine_database(*arguments)

        monkeypatch.setattr(examine, meanwhile)
        assert back_up_home(own_store.settings, tmp_path / "b.zip").entries == 3
        with own_store.read() as session:
            assert session.execute(text("SELECT count(*) FROM log")).scalar() == 7

    def test_files_of_the_home_go_with_it_when_asked_for(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        upload = own_store.settings.uploads / "1"
        upload.mkdir(parents=True)
        (upload / "frames.zip").write_bytes(b"frames")
        (own_store.settings.uploads / "2.part").write_bytes(b"half")
        assert list(back_up_home(own_store.settings, tmp_path / "a.zip").files) == ["touchline.db"]
        back_up_home(own_store.settings, tmp_path / "b.zip", FRAMES)
        with zipfile.ZipFile(tmp_path / "b.zip") as backup:
            assert backup.testzip() is None
            assert backup.read("uploads/1/frames.zip") == b"frames"
            assert "uploads/2.part" not in backup.namelist()

    def test_a_file_that_goes_meanwhile_is_left_out_and_the_backup_is_good(
        self, own_store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        stays, goes = place(own_store, "b.zip"), place(own_store, "a.zip")
        make = zipfile.ZipInfo.from_file

        def meanwhile(path: Path, *arguments: str) -> zipfile.ZipInfo:
            if path == goes:
                goes.unlink()
            return make(path, *arguments)

        monkeypatch.setattr(zipfile.ZipInfo, "from_file", meanwhile)
        # Found while the folder was listed, and there when it was looked at.
        monkeypatch.setattr(Path, "is_file", lambda _path: True)
        manifest = back_up_home(own_store.settings, tmp_path / "b.zip", EXPORTS)
        assert list(manifest.files) == ["touchline.db", f"exports/{stays.name}"]
        assert verify_backup(tmp_path / "b.zip") == manifest

    def test_a_file_that_cannot_be_read_is_named_and_no_backup_is_written(
        self, own_store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        unread, opened = place(own_store, "a.zip"), Path.open

        def refuse(path: Path, *arguments: Any, **named: Any) -> Any:
            if path == unread:
                raise PermissionError(errno.EACCES, "Permission denied", str(path))
            return opened(path, *arguments, **named)

        monkeypatch.setattr(Path, "open", refuse)
        with pytest.raises(StorageError, match=r"a\.zip cannot be read: Permission denied"):
            back_up_home(own_store.settings, tmp_path / "b.zip", EXPORTS)
        assert not (tmp_path / "b.zip").exists()

    def test_a_folder_that_takes_no_backup_is_what_the_advice_is_about(
        self, own_store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """And not the home, which is as it should be."""
        backups, made = tmp_path / "backups", Path.mkdir

        def refuse(path: Path, *arguments: Any, **named: Any) -> Any:
            if path.parent == backups:
                raise PermissionError(errno.EACCES, "Permission denied", str(path))
            return made(path, *arguments, **named)

        backups.mkdir()
        monkeypatch.setattr(Path, "mkdir", refuse)
        with pytest.raises(StorageError, match="cannot be written") as refused:
            back_up_home(own_store.settings, backups / "x.zip")
        assert (refused.value.hint or "").startswith(f"Make {backups} writable")

    def test_what_began_to_be_written_after_the_backup_began_is_left_out(
        self, own_store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        place(own_store, "a.zip")
        sample = own_store.settings.home / "sample"
        sample.mkdir()
        (sample / "1.png").touch()
        add = backup_module._add_file

        def meanwhile(backup: zipfile.ZipFile, name: str, *arguments: Any) -> Any:
            if name.startswith("sample"):
                place(own_store, ".7.zip.x1.partial")
            return add(backup, name, *arguments)

        monkeypatch.setattr(backup_module, "_add_file", meanwhile)
        manifest = back_up_home(own_store.settings, tmp_path / "b.zip", ("sample", *EXPORTS))
        assert list(manifest.files) == ["touchline.db", "sample/1.png", "exports/a.zip"]

    def test_is_for_its_owner_alone(self, own_store: Store, tmp_path: Path) -> None:
        back_up_home(own_store.settings, tmp_path / "b.zip")
        assert (tmp_path / "b.zip").stat().st_mode & 0o777 == 0o600

    def test_never_replaces_a_file(self, own_store: Store, tmp_path: Path) -> None:
        (tmp_path / "b.zip").write_bytes(b"mine")
        with pytest.raises(InputError, match="already exists"):
            back_up_home(own_store.settings, tmp_path / "b.zip")
        assert (tmp_path / "b.zip").read_bytes() == b"mine"

    def test_never_replaces_one_that_somebody_wrote_meanwhile(
        self, own_store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        out = tmp_path / "b.zip"
        monkeypatch.setattr("app.db.backup.verify_backup", lambda _: out.write_bytes(b"mine"))
        with pytest.raises(InputError, match="already exists"):
            back_up_home(own_store.settings, out)
        assert out.read_bytes() == b"mine"

    @pytest.mark.parametrize("step", ["verify_backup", "sync_to_disk"])
    def test_leaves_nothing_when_it_fails(
        self, own_store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
    ) -> None:
        def full(*_arguments):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(f"app.db.backup.{step}", full)
        folder = tmp_path / "out"
        folder.mkdir()
        with pytest.raises(StorageError, match="disk is full"):
            back_up_home(own_store.settings, folder / "b.zip")
        left = [path.name for path in folder.iterdir()]
        # The one that is in its place was verified, and may be lost with the power alone.
        assert left == (["b.zip"] if step == "sync_to_disk" else [])

    def test_what_a_killed_one_left_goes_with_the_next(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        left = tmp_path / ".b.zip.partial"
        left.mkdir()
        (left / "touchline.db").write_bytes(b"half")
        back_up_home(own_store.settings, tmp_path / "b.zip")
        assert not left.exists()

    def test_what_killed_ones_of_other_names_left_goes_with_the_next(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        old, held, new = (tmp_path / f".{name}.zip.partial" for name in ("old", "held", "new"))
        for folder in (old, held, new):
            folder.mkdir()
            (folder / "touchline.db").write_bytes(b"half")
        for path in (old, old / "touchline.db", held, held / "touchline.db"):
            os.utime(path, (1, 1))
        handle = os.open(held, os.O_RDONLY)
        fcntl.flock(handle, fcntl.LOCK_EX)
        back_up_home(own_store.settings, tmp_path / "b.zip")
        os.close(handle)
        assert [folder.exists() for folder in (old, held, new)] == [False, True, True]

    def test_a_damaged_database_makes_no_backup(self, own_store: Store, tmp_path: Path) -> None:
        say(own_store, 40)
        own_store.close()
        settings = killed(own_store, tmp_path / "left", "touchline.db", "home.json")
        content = bytearray(settings.database_file.read_bytes())
        page = content.rindex(b"\x0d", 0, -4096) // 4096 * 4096
        content[page : page + 4096] = b"\xff" * 4096
        settings.database_file.write_bytes(content)
        with pytest.raises(DamagedError, match=r"left/touchline\.db"):
            back_up_home(settings, tmp_path / "b.zip")
        assert not (tmp_path / "b.zip").exists()

    def test_a_log_that_was_changed_makes_no_backup(self, own_store: Store, tmp_path: Path) -> None:
        say(own_store, 3)
        with own_store.write() as session:
            session.execute(text("DROP TRIGGER log_refuses_update"))
            session.execute(text("UPDATE log SET actor = 'eve' WHERE id = 2"))
        with pytest.raises(DamagedError, match="row 2 of the log"):
            back_up_home(own_store.settings, tmp_path / "b.zip")

    def test_a_home_whose_files_do_not_belong_together_is_not_touched(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        say(own_store, 5)
        settings = killed(own_store, tmp_path / "left", "touchline.db-wal")
        with pytest.raises(DamagedError, match="is missing"):
            back_up_home(settings, tmp_path / "b.zip")
        assert not settings.database_file.exists()

    def test_a_home_that_is_none_has_nothing_to_back_up(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="no database"):
            back_up_home(Settings(home=tmp_path / "none"), tmp_path / "b.zip")


class TestVerifyBackup:
    @pytest.fixture
    def backup(self, own_store: Store, tmp_path: Path) -> Path:
        say(own_store, 3)
        back_up_home(own_store.settings, tmp_path / "b.zip")
        return tmp_path / "b.zip"

    @pytest.mark.parametrize("place", [200, -200, 0.5])
    def test_a_flipped_byte_is_noticed(self, backup: Path, place: float) -> None:
        content = bytearray(backup.read_bytes())
        content[int(len(content) * place) if isinstance(place, float) else place] ^= 1
        backup.write_bytes(content)
        with pytest.raises(InputError):
            verify_backup(backup)

    def test_a_file_that_was_put_in_afterwards_is_noticed(
        self, backup: Path, tmp_path: Path
    ) -> None:
        other = tmp_path / "other.zip"
        with zipfile.ZipFile(backup) as source, zipfile.ZipFile(other, "w") as target:
            target.writestr("manifest.json", source.read("manifest.json"))
            target.writestr("touchline.db", source.read("touchline.db") + b"x")
        with pytest.raises(InputError, match=r"touchline\.db in the backup .* is damaged"):
            verify_backup(other)

    def test_a_cut_one_is_noticed(self, backup: Path) -> None:
        backup.write_bytes(backup.read_bytes()[:-100])
        with pytest.raises(InputError, match="damaged or is not a backup"):
            verify_backup(backup)

    def test_another_zip_is_no_backup(self, tmp_path: Path) -> None:
        with closing(zipfile.ZipFile(tmp_path / "z.zip", "w")) as other:
            other.writestr("manifest.json", json.dumps({"format": "soccernet-v3"}))
        with pytest.raises(InputError, match="not a backup of Touchline"):
            verify_backup(tmp_path / "z.zip")
