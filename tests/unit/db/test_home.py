from __future__ import annotations

import os
from pathlib import Path

import pytest

from app.config import Settings
from app.db.home import (
    delete_leftovers,
    find_file_system,
    find_last_write_time,
    find_leftovers,
    find_paths_open_to_others,
    is_half_written,
    make_home,
    make_home_private,
)
from app.db.store import Store
from app.errors import StorageError
from app.features.datasets.queries import delete_expired_cache_entries
from app.features.imports.upload_queries import UploadWriter, get_upload, mark_upload_permanent
from tests.unit.db.homes import say

MOUNTS = """\
/dev/vda / ext4 rw 0 0
server:/share /mnt/team nfs4 rw 0 0
//server/x /mnt/with\\040space cifs rw 0 0
/dev/vdb /mnt/team/local ext4 rw 0 0
"""

OF_ANOTHER_PROGRAM = b"SQLite format 3\0\x10\0\2\2" + bytes(4076)
"""A database that has nothing to do with us."""


class TestFileSystem:
    @pytest.mark.parametrize(
        ("folder", "kind"),
        [
            ("/home/ann", "ext4"),
            ("/mnt/team/data", "nfs4"),
            ("/mnt/team/local/data", "ext4"),
            ("/mnt/with space/a", "cifs"),
            ("/mnt/teammates", "ext4"),
        ],
    )
    def test_is_that_of_the_nearest_mount(self, tmp_path: Path, folder: str, kind: str) -> None:
        mounts = tmp_path / "mounts"
        mounts.write_text(MOUNTS)
        assert find_file_system(Path(folder), mounts) == kind

    def test_without_a_list_of_mounts_the_file_system_is_unknown(self, tmp_path: Path) -> None:
        assert find_file_system(tmp_path, tmp_path / "nothing") == ""


class TestMakeHome:
    @pytest.mark.file_of_sqlite("where the file may lie")
    def test_a_network_file_system_is_refused(self, settings, monkeypatch) -> None:
        monkeypatch.setattr("app.db.home.find_file_system", lambda _folder: "nfs4")
        with pytest.raises(StorageError, match="network file system"):
            make_home(settings)

    def test_files_of_a_database_on_a_server_may_lie_there(self, settings, monkeypatch) -> None:
        monkeypatch.setattr("app.db.home.find_file_system", lambda _folder: "nfs4")
        other = settings.model_copy(update={"database_url": "postgresql://host/touchline"})
        assert make_home(other) == settings.home

    def test_a_home_that_cannot_be_made_is_said(self, settings, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        other = settings.model_copy(update={"home": tmp_path / "file" / "home"})
        with pytest.raises(StorageError, match="cannot be created"):
            make_home(other)


class TestMakePrivate:
    @pytest.mark.file_of_sqlite("permissions of the file")
    def test_a_home_is_its_owners_alone_whatever_the_umask(self, settings) -> None:
        store = Store.open(settings)
        say(store)
        files = [settings.home, *settings.home.iterdir()]
        assert {path.stat().st_mode & 0o077 for path in files} == {0}
        assert {"touchline.db", "touchline.db-wal", "home.json"} <= {path.name for path in files}
        store.close()

    def test_an_open_home_is_mended_and_nothing_of_others_is_touched(self, settings) -> None:
        upload = settings.uploads / "1"
        upload.mkdir(parents=True)
        (upload / "frames.zip").touch()
        settings.database_file.touch()
        (settings.home / "letter.txt").touch()
        (settings.uploads / "link").symlink_to(settings.home / "letter.txt")
        assert make_home_private(settings) == 5
        assert make_home_private(settings) == 0
        assert settings.home.stat().st_mode & 0o777 == 0o700
        assert (upload / "frames.zip").stat().st_mode & 0o777 == 0o600
        assert (settings.home / "letter.txt").stat().st_mode & 0o777 == 0o644

    @pytest.mark.parametrize("name", ["before-restore-20260101T000000", ".restore.partial"])
    def test_what_a_restore_moved_aside_or_works_on_is_its_owners_too(self, settings, name) -> None:
        make_home(settings)
        old = settings.home / name / "exports" / "1.zip"
        old.parent.mkdir(parents=True)
        old.touch()
        settings.home.chmod(0o755)
        assert old in find_paths_open_to_others(settings)
        make_home_private(settings)
        assert old.stat().st_mode & 0o777 == 0o600
        assert old.parent.stat().st_mode & 0o777 == 0o700

    @pytest.mark.file_of_sqlite("permissions of the file")
    def test_of_a_database_elsewhere_only_what_is_its_own_is_touched(
        self, settings, tmp_path: Path
    ) -> None:
        file = tmp_path / "elsewhere" / "team.db"
        other = settings.model_copy(update={"database_url": f"sqlite:///{file}"})
        file.parent.mkdir()
        Store.open(other).close()
        beside = [file.with_name(name) for name in ("team.db-wal", "team.db.txt", "team.db-old")]
        for path in beside:
            path.touch()
        for path in (file, *beside):
            path.chmod(0o644)
        make_home_private(other)
        modes = [path.stat().st_mode & 0o777 for path in (file, *beside)]
        assert modes == [0o600, 0o600, 0o644, 0o644]

    @pytest.mark.file_of_sqlite("permissions of the file")
    @pytest.mark.parametrize("content", [b"root:x:0:0\n" * 20, b"", OF_ANOTHER_PROGRAM])
    def test_a_file_elsewhere_that_is_none_of_ours_keeps_its_permissions(
        self, settings, tmp_path: Path, content: bytes
    ) -> None:
        make_home(settings)
        file = tmp_path / "accounts"
        files = [file, tmp_path / "accounts-", tmp_path / "home.json"]
        for path in files:
            path.write_bytes(content)
            path.chmod(0o644)
        inside = f"{settings.home}/../accounts"
        for place in (str(file), inside):
            other = settings.model_copy(update={"database_url": f"sqlite:///{place}"})
            make_home_private(other)
            assert not set(files) & set(find_paths_open_to_others(other))
        assert {path.stat().st_mode & 0o777 for path in files} == {0o644}

    def test_from_then_on_new_files_are_private(self, settings) -> None:
        make_home(settings)
        make_home_private(settings)
        (settings.home / "new").touch()
        assert (settings.home / "new").stat().st_mode & 0o777 == 0o600


def age(path: Path) -> None:
    os.utime(path, (0, 0))


class TestLeftovers:
    def test_an_upload_is_kept_while_its_file_grows_however_long_ago_it_began(
        self, settings: Settings
    ) -> None:
        writer = UploadWriter(settings, "a.zip")
        writer.write(b"abc")
        (part,) = settings.uploads.iterdir()
        age(part)
        age(part / "content")
        assert delete_leftovers(settings) == 0
        writer._file.close()  # Its process is gone.
        age(part / "content" / "a.zip")
        assert delete_leftovers(settings) == 1
        assert not list(settings.uploads.iterdir())

    def test_one_that_vanishes_while_it_is_looked_at_is_none(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        settings.uploads.mkdir(parents=True)
        monkeypatch.setattr("app.db.home.iglob", lambda *_, **__: ["uploads/1.part"])
        assert list(find_leftovers(settings)) == []

    def test_a_file_that_is_gone_has_no_time_of_writing(self, tmp_path: Path) -> None:
        assert find_last_write_time(tmp_path / "gone") is None

    def test_what_a_killed_writer_of_ours_leaves_goes_whatever_it_wrote(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        writer = UploadWriter(settings, "a.zip")
        writer.write(b"abc")
        upload = writer.finish()
        half = UploadWriter(settings, "b.zip")
        half._file.close()  # Its process is gone.

        def killed(*_: object, **__: object) -> None:
            raise KeyboardInterrupt

        with monkeypatch.context() as broken:
            broken.setattr(Path, "replace", killed)
            broken.setattr(Path, "unlink", killed)
            with pytest.raises(KeyboardInterrupt):
                mark_upload_permanent(settings, upload.id)
        before = [path for path in settings.home.rglob("*") if is_half_written(path, settings.home)]
        assert len(before) == 4, "a record, and a folder with a folder with a file"
        for path in before:
            age(path)
        assert delete_leftovers(settings) == 2
        assert not any(path.exists() for path in before)
        assert get_upload(settings, upload.id) == upload


class TestExpireCache:
    def test_a_file_that_vanishes_meanwhile_does_not_end_it(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        folder = settings.cache / "frames"
        folder.mkdir(parents=True)
        (folder / "b.jpg").touch()
        age(folder / "b.jpg")
        found = [(str(folder), [], ["a.jpg", "b.jpg"])]
        monkeypatch.setattr(
            "app.features.datasets.queries.os.walk",
            lambda top: found if top == settings.cache else [],
        )
        assert delete_expired_cache_entries(settings) == 1
