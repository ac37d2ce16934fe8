from __future__ import annotations

import errno
import fcntl
import json
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.config import Settings
from app.errors import BusyError, InputError, NotFoundError, StorageError, TooLargeError
from app.features.imports import upload_queries as uploads
from app.features.imports.upload_queries import (
    Upload,
    UploadWriter,
    delete_upload,
    expire_uploads,
    find_complete_upload_path,
    get_upload,
    list_uploads,
    make_safe_file_name,
    mark_upload_permanent,
)

THEN = "2030-01-01T00:00:00+00:00"


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(home=tmp_path / "home", max_upload_bytes=100)


def send(
    settings: Settings, name: str = "a.zip", content: bytes = b"content", by: str | None = None
) -> Upload:
    writer = UploadWriter(settings, name, by=by)
    for start in range(0, len(content), 3):
        writer.write(content[start : start + 3])
    return writer.finish()


def files(settings: Settings) -> list[str]:
    return sorted(str(p.relative_to(settings.uploads)) for p in settings.uploads.rglob("*.*"))


def without_record(settings: Settings, upload: Upload, instead: str | None) -> Path:
    """Folder of an upload whose record is gone, or another one."""
    folder = settings.uploads / upload.id
    (folder / "upload.json").unlink()
    if instead is not None:
        (folder / "upload.json").write_text(instead)
    return folder


def make_old(folder: Path) -> None:
    then = (datetime.now(UTC) - timedelta(days=8)).timestamp()
    os.utime(folder, (then, then))


class TestUploadWriter:
    def test_an_upload_is_whole_under_its_own_name(self, settings: Settings) -> None:
        upload = send(settings)
        path = find_complete_upload_path(settings, upload.id)
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

    def test_a_file_named_like_the_record_is_a_file(self, settings: Settings) -> None:
        said = {"id": "a" * 32, "name": "/etc/passwd", "bytes": 1, "created": "2030-01-01"}
        upload = send(settings, "upload.json", json.dumps(said).encode()[:90])
        assert get_upload(settings, upload.id) == upload
        path = find_complete_upload_path(settings, upload.id)
        assert (path.name, path.read_bytes()) == ("upload.json", json.dumps(said).encode()[:90])

    def test_it_is_nowhere_before_it_is_complete(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        seen: list[list[str]] = []
        rename = Path.rename

        def watched(path: Path, target: Path) -> Path:
            seen.append([item.id for item in list_uploads(settings)])
            assert (path / "upload.json").is_file()
            assert (path / "content" / "a.zip").read_bytes() == b"content"
            return rename(path, target)

        monkeypatch.setattr(Path, "rename", watched)
        upload = send(settings)
        assert seen == [[]]
        assert [item.id for item in list_uploads(settings)] == [upload.id]

    def test_eight_equal_ones_at_once_are_one(self, settings: Settings) -> None:
        writers = [UploadWriter(settings, "a.zip") for _ in range(8)]
        for writer in writers:
            writer.write(b"content")
        ready = threading.Barrier(8)

        def guess(path: Path) -> str:
            ready.wait(10)
            return "coco"

        with ThreadPoolExecutor(8) as pool:
            uploads = set(pool.map(lambda writer: writer.finish(guess).id, writers))
        assert len(uploads) == 1
        assert [item.id for item in list_uploads(settings)] == list(uploads)
        assert len(list(settings.uploads.iterdir())) == 1

    def test_who_meets_another_process_that_does_not_go_on_is_told_so(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(uploads, "WRITING_SECONDS", 0.01)
        settings.uploads.mkdir(parents=True)
        other = os.open(settings.uploads, os.O_RDONLY)
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(BusyError, match="another Touchline process has been writing uploads"):
            send(settings)
        os.close(other)
        assert send(settings).name == "a.zip"

    def test_a_folder_without_record_makes_way(self, settings: Settings) -> None:
        upload = send(settings)
        (settings.uploads / upload.id / "upload.json").unlink()
        assert send(settings).id == upload.id
        assert list_uploads(settings) != []

    def test_its_name_is_on_disk_before_it_is_acknowledged(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        synced: list[tuple[str, bool]] = []
        monkeypatch.setattr(
            uploads,
            "sync_to_disk",
            lambda path: synced.append((path.name, bool(list_uploads(settings)))),
        )
        send(settings)
        assert synced == [("home", False), ("content", False), ("uploads", True)]

    def test_a_full_disk_is_a_sentence_and_leaves_nothing(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def full(_: int) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        writer = UploadWriter(settings, "a.zip")
        writer.write(b"content")
        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(StorageError, match="the disk is full") as caught:
            writer.finish()
        assert isinstance(caught.value.__cause__, OSError)
        writer.abort()
        assert list(settings.uploads.iterdir()) == []

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
            ("x." + "j" * 200, "x." + "j" * 118),
            ("a" * 118 + ". " + "j" * 30, "a" * 118),
        ],
    )
    def test_an_unsafe_name_becomes_the_nearest_safe_one(self, sent: str, name: str) -> None:
        assert make_safe_file_name(sent) == name

    @pytest.mark.parametrize("sent", ["", "..", "/", "...", "\x00", "\x00" * 130 + "a"])
    def test_a_name_without_a_single_safe_letter_is_refused(self, sent: str) -> None:
        with pytest.raises(InputError):
            make_safe_file_name(sent)

    @given(
        st.lists(st.sampled_from(["j", "j" * 19, "j" * 130, ".", " ", "_", "/", "ü"])).map("".join)
    )
    def test_a_safe_name_is_its_own(self, sent: str) -> None:
        try:
            name = make_safe_file_name(sent)
        except InputError:
            return
        assert make_safe_file_name(name) == name
        assert len(name) <= 120
        assert name == name.strip(" .")

    @pytest.mark.parametrize("sent", ["x." + "j" * 200, "." * 9 + "j" * 120, "x" * 200 + ". .zip"])
    def test_what_was_sent_under_any_name_is_there(self, settings: Settings, sent: str) -> None:
        upload = send(settings, sent)
        assert get_upload(settings, upload.id) == upload
        delete_upload(settings, upload.id)
        assert list(settings.uploads.iterdir()) == []


class TestUploadPath:
    @pytest.mark.parametrize("upload_id", ["", "..", "x" * 32, "a" * 32, "../" + "a" * 29])
    def test_an_impossible_id_finds_nothing(self, settings: Settings, upload_id: str) -> None:
        send(settings)
        with pytest.raises(NotFoundError):
            find_complete_upload_path(settings, upload_id)


class TestGetUpload:
    @pytest.mark.parametrize(
        ("field", "said"),
        [
            ("name", "../../secret"),
            ("name", "/etc/passwd"),
            ("name", 7),
            ("id", "b" * 32),
            ("created", "yesterday"),
            ("created", "2030-01-01"),
            ("more", 1),
        ],
    )
    def test_a_record_that_nobody_wrote_so_is_none(
        self, settings: Settings, field: str, said: object
    ) -> None:
        upload = send(settings)
        record = settings.uploads / upload.id / "upload.json"
        record.write_text(json.dumps({**json.loads(record.read_text()), field: said}))
        with pytest.raises(NotFoundError):
            find_complete_upload_path(settings, upload.id)
        assert list_uploads(settings) == []

    def test_one_of_an_earlier_version_has_its_file_beside_the_record(
        self, settings: Settings
    ) -> None:
        folder = settings.uploads / ("c" * 32)
        folder.mkdir(parents=True)
        (folder / "a.zip").write_bytes(b"content")
        said = {"id": "c" * 32, "name": "a.zip", "bytes": 7, "created": THEN, "kept": True}
        (folder / "upload.json").write_text(json.dumps(said))
        assert find_complete_upload_path(settings, "c" * 32).read_bytes() == b"content"
        assert [item.name for item in list_uploads(settings)] == ["a.zip"]


class TestKeepUpload:
    def test_stays_true_while_the_file_is_sent_again(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        upload, abort = send(settings, by="ann"), UploadWriter.abort

        def slow(writer: UploadWriter) -> None:
            mark_upload_permanent(settings, upload.id)
            abort(writer)

        monkeypatch.setattr(UploadWriter, "abort", slow)
        send(settings, by="ben")
        found = get_upload(settings, upload.id)
        assert (found.kept, found.by) == (True, ("ann", "ben"))


class TestExpireUploads:
    def test_old_ones_go_and_those_that_a_dataset_reads_stay(self, settings: Settings) -> None:
        old, kept, new = (send(settings, f"{name}.zip") for name in ("old", "kept", "new"))
        mark_upload_permanent(settings, kept.id)
        then = (datetime.now(UTC) - timedelta(days=8)).isoformat()
        for upload in (old, kept):
            path = settings.uploads / upload.id / "upload.json"
            path.write_text(json.dumps({**json.loads(path.read_text()), "created": then}))
        assert expire_uploads(settings) == 1
        assert {item.name for item in list_uploads(settings)} == {"kept.zip", "new.zip"}
        assert get_upload(settings, new.id).name == "new.zip"

    @pytest.mark.parametrize("record", [None, {"name": ".jjj", "kept": False}])
    def test_what_has_no_record_of_ours_goes_when_it_is_old(
        self, settings: Settings, record: dict[str, object] | None
    ) -> None:
        upload = send(settings)
        folder = without_record(settings, upload, json.dumps(record) if record else None)
        assert expire_uploads(settings) == 0
        make_old(folder)
        assert expire_uploads(settings) == 1
        assert list(settings.uploads.iterdir()) == []

    @pytest.mark.parametrize(
        "record", ['{"name": ".jjj", "kept": true}', '{"later": 1}', "[", "[]"]
    )
    def test_what_a_dataset_may_read_stays_whoever_wrote_its_record(
        self, settings: Settings, record: str
    ) -> None:
        folder = without_record(settings, send(settings), record)
        make_old(folder)
        assert expire_uploads(settings) == 0
        assert (folder / "content" / "a.zip").read_bytes() == b"content"

    def test_what_is_none_of_ours_stays_beside_the_uploads(self, settings: Settings) -> None:
        send(settings)
        other = settings.uploads / "lost+found"
        other.mkdir()
        make_old(other)
        assert expire_uploads(settings) == 0
        assert other.is_dir()

    def test_without_uploads_nothing_expires(self, settings: Settings) -> None:
        assert expire_uploads(settings) == 0
        assert list_uploads(settings) == []


class TestDeleteUpload:
    def test_is_refused_while_frames_are_read_from_it(self, settings: Settings) -> None:
        upload = send(settings)
        mark_upload_permanent(settings, upload.id)
        with pytest.raises(InputError, match="reads its frames"):
            delete_upload(settings, upload.id)
        other = send(settings, "b.zip")
        delete_upload(settings, other.id)
        with pytest.raises(NotFoundError):
            delete_upload(settings, other.id)

    def test_what_two_have_sent_goes_with_the_second(self, settings: Settings) -> None:
        ann, ben = send(settings, by="ann"), send(settings, by="ben")
        assert (ann.id, ben.by) == (ben.id, ("ann", "ben"))
        delete_upload(settings, ann.id, "ann".__eq__)
        assert get_upload(settings, ann.id).by == ("ben",)
        assert find_complete_upload_path(settings, ann.id).read_bytes() == b"content"
        delete_upload(settings, ann.id, "ben".__eq__)
        assert list_uploads(settings) == []

    def test_that_it_is_gone_is_on_disk_before_it_is_said(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        upload, synced = send(settings), list[tuple[str, bool]]()
        monkeypatch.setattr(
            uploads,
            "sync_to_disk",
            lambda path: synced.append((path.name, bool(list_uploads(settings)))),
        )
        delete_upload(settings, upload.id)
        assert synced == [("uploads", False)]

    def test_who_may_delete_it_for_all_does(self, settings: Settings) -> None:
        send(settings, by="ann")
        delete_upload(settings, send(settings, by="ben").id)
        assert list_uploads(settings) == []
