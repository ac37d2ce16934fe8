from __future__ import annotations

import json
import os
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from app.config import Settings
from app.errors import InputError, NotFoundError, TooLargeError
from app.store.uploads import (
    Upload,
    UploadWriter,
    delete_upload,
    expire_uploads,
    get_upload,
    keep_upload,
    list_uploads,
    safe_name,
    upload_path,
)


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(home=tmp_path / "home", max_upload_bytes=100)


def send(settings: Settings, name: str = "a.zip", content: bytes = b"content") -> Upload:
    writer = UploadWriter(settings, name)
    for start in range(0, len(content), 3):
        writer.write(content[start : start + 3])
    return writer.finish()


def files(settings: Settings) -> list[str]:
    return sorted(str(p.relative_to(settings.uploads)) for p in settings.uploads.rglob("*.*"))


class TestUploadWriter:
    def test_an_upload_is_whole_under_its_own_name(self, settings: Settings) -> None:
        upload = send(settings)
        path = upload_path(settings, upload.id)
        assert (path.name, path.read_bytes()) == ("a.zip", b"content")
        assert get_upload(settings, upload.id) == upload
        assert (upload.bytes, upload.kept) == (7, False)

    def test_the_same_file_again_is_the_same_upload(self, settings: Settings) -> None:
        first, again = send(settings), send(settings)
        other = send(settings, "b.zip")
        assert again == first
        assert other.id != first.id
        assert len(list_uploads(settings)) == 2
        assert [name for name in files(settings) if name.endswith(".part")] == []

    def test_one_byte_too_many_is_refused_and_nothing_stays(self, settings: Settings) -> None:
        writer = UploadWriter(settings, "a.zip")
        writer.write(b"x" * 100)
        with pytest.raises(TooLargeError, match="at most 100 bytes"):
            writer.write(b"y")
        writer.abort()
        assert files(settings) == []

    def test_an_empty_file_is_refused(self, settings: Settings) -> None:
        with pytest.raises(InputError, match="empty"):
            send(settings, content=b"")

    def test_nobody_else_may_read_it(self, settings: Settings) -> None:
        upload = send(settings)
        for folder in (settings.uploads, settings.uploads / upload.id):
            assert folder.stat().st_mode & 0o077 == 0


class TestSafeName:
    @pytest.mark.parametrize(
        ("sent", "name"),
        [
            ("Frames v3.zip", "Frames v3.zip"),
            ("../../etc/passwd", "passwd"),
            ("C:\\data\\x.csv", "x.csv"),
            ("a\x00b\n.json", "a_b_.json"),
            (".hidden.json", "hidden.json"),
            ("ünï.zip", "_n_.zip"),
            ("a" * 300 + ".zip", "a" * 116 + ".zip"),
        ],
    )
    def test_an_unsafe_name_becomes_the_nearest_safe_one(self, sent: str, name: str) -> None:
        assert safe_name(sent) == name

    @pytest.mark.parametrize("sent", ["", "..", "/", "...", "\x00"])
    def test_a_name_without_a_single_safe_letter_is_refused(self, sent: str) -> None:
        with pytest.raises(InputError):
            safe_name(sent)


class TestUploadPath:
    @pytest.mark.parametrize("upload_id", ["", "..", "x" * 32, "a" * 32, "../" + "a" * 29])
    def test_an_impossible_id_finds_nothing(self, settings: Settings, upload_id: str) -> None:
        send(settings)
        with pytest.raises(NotFoundError):
            upload_path(settings, upload_id)


class TestExpireUploads:
    def test_old_ones_go_and_those_that_a_dataset_reads_stay(self, settings: Settings) -> None:
        old, kept, new = (send(settings, f"{name}.zip") for name in ("old", "kept", "new"))
        keep_upload(settings, kept.id)
        then = (datetime.now(UTC) - timedelta(days=8)).isoformat()
        for upload in (old, kept):
            path = settings.uploads / upload.id / "upload.json"
            path.write_text(json.dumps({**json.loads(path.read_text()), "created": then}))
        assert expire_uploads(settings) == 1
        assert {item.name for item in list_uploads(settings)} == {"kept.zip", "new.zip"}
        assert get_upload(settings, new.id).name == "new.zip"

    def test_a_half_sent_file_goes_after_a_day(self, settings: Settings) -> None:
        writer = UploadWriter(settings, "a.zip")
        writer.write(b"abc")
        assert expire_uploads(settings) == 0
        writer._file.close()  # Its process is gone.
        (part,) = settings.uploads.glob("*.part")
        os.utime(part, (0, 0))
        assert expire_uploads(settings) == 1
        assert list(settings.uploads.iterdir()) == []

    def test_without_uploads_nothing_expires(self, settings: Settings) -> None:
        assert expire_uploads(settings) == 0
        assert list_uploads(settings) == []


class TestDeleteUpload:
    def test_is_refused_while_frames_are_read_from_it(self, settings: Settings) -> None:
        upload = send(settings)
        keep_upload(settings, upload.id)
        with pytest.raises(InputError, match="reads its frames"):
            delete_upload(settings, upload.id)
        other = send(settings, "b.zip")
        delete_upload(settings, other.id)
        with pytest.raises(NotFoundError):
            delete_upload(settings, other.id)
