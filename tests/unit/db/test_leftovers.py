from __future__ import annotations

import os
from pathlib import Path

import pytest

from app.config import Settings
from app.db.leftovers import delete_leftovers, is_half_written, last_written, leftovers
from app.features.datasets.orphan_queries import expire_cache
from app.features.imports.upload_queries import UploadWriter, get_upload, keep_upload


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
        monkeypatch.setattr("app.db.leftovers.iglob", lambda *_, **__: ["uploads/1.part"])
        assert list(leftovers(settings)) == []

    def test_a_file_that_is_gone_has_no_time_of_writing(self, tmp_path: Path) -> None:
        assert last_written(tmp_path / "gone") is None

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
                keep_upload(settings, upload.id)
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
            "app.features.datasets.orphan_queries.os.walk",
            lambda top: found if top == settings.cache else [],
        )
        assert expire_cache(settings) == 1
