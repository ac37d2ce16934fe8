"""Uploads in parts: they go on where they stopped, and are whole or not used."""

from __future__ import annotations

import errno
import os
import resource
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from app.config import Settings
from app.db.home import delete_leftovers
from app.errors import ConflictError, InputError, NotFoundError, StorageError, TooLargeError
from app.features.imports.upload_queries import (
    Upload,
    delete_upload,
    expire_uploads,
    find_complete_upload_path,
    get_upload,
    list_uploads,
)
from app.features.imports.upload_quota import count_used_bytes
from app.features.imports.uploads import PartWriter, begin_upload_in_parts

FILM = bytes(range(256)) * 40


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(home=tmp_path / "home")


def begin(
    settings: Settings, mark: str = "monday", by: str = "ann", size: int = len(FILM)
) -> Upload:
    return begin_upload_in_parts(settings, "final.mp4", size, mark, by=by)


def send(settings: Settings, upload: Upload, first: int, last: int) -> Upload:
    writer = PartWriter(settings, upload.id, first)
    writer.write(FILM[first:last])
    return writer.finish()


class TestBeginInParts:
    def test_the_same_file_again_is_as_far_as_it_came(self, settings: Settings) -> None:
        upload = begin(settings)
        assert (upload.bytes, upload.whole_size, upload.by) == (0, len(FILM), ("ann",))
        send(settings, upload, 0, 4000)
        again = begin(settings)
        assert (again.id, again.bytes) == (upload.id, 4000)
        send(settings, upload, 4000, len(FILM))
        whole = begin(settings)
        assert (whole.id, whole.bytes) == (upload.id, len(FILM))
        assert find_complete_upload_path(settings, upload.id).read_bytes() == FILM

    def test_another_file_or_another_persons_is_another_upload(self, settings: Settings) -> None:
        ids = {
            begin(settings).id,
            begin(settings, mark="tuesday").id,
            begin(settings, by="ben").id,
            begin(settings, size=9).id,
        }
        assert len(ids) == 4

    def test_what_the_disk_has_no_room_for_is_refused_before_it_comes(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        upload = send(settings, begin(settings), 0, 4000)
        monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(9, 9, 6000))  # type: ignore[attr-defined]
        with pytest.raises(StorageError, match=r"final\.mp4 needs 6,240 bytes more.* has 6,000"):
            begin(settings)
        with pytest.raises(StorageError):
            begin(settings, mark="tuesday")
        assert [item.id for item in list_uploads(settings)] == [upload.id]

    def test_what_is_too_large_or_empty_or_beyond_the_quota_leaves_nothing(
        self, settings: Settings
    ) -> None:
        small = settings.model_copy(update={"max_upload_bytes": 1000})
        with pytest.raises(TooLargeError, match="at most 1,000 bytes"):
            begin(small)
        with pytest.raises(InputError, match=r"final\.mp4 is empty"):
            begin(settings, size=0)
        team = settings.model_copy(update={"team": True, "upload_quota_bytes": len(FILM) + 100})
        begin(team)
        assert count_used_bytes(team, "ann") == len(FILM)
        with pytest.raises(TooLargeError, match=r"10,240 are used, and this file needs 101"):
            begin(team, size=101)
        assert begin(team).bytes == 0
        assert len(list_uploads(settings)) == 1


class TestPartWriter:
    def test_bytes_that_are_here_are_passed_over_and_a_gap_is_refused(
        self, settings: Settings
    ) -> None:
        upload = begin(settings)
        assert send(settings, upload, 0, 5000).bytes == 5000
        assert send(settings, upload, 0, 5000).bytes == 5000
        assert send(settings, upload, 3000, 7000).bytes == 7000
        with pytest.raises(ConflictError, match=r"begins at byte 7,001, and only 7,000 bytes"):
            send(settings, upload, 7001, 8000)
        assert send(settings, upload, 7000, len(FILM)).bytes == len(FILM)
        assert find_complete_upload_path(settings, upload.id).read_bytes() == FILM

    def test_two_windows_at_once_make_one_file(self, settings: Settings) -> None:
        upload = begin(settings)
        one, other = (PartWriter(settings, upload.id, 0) for _ in range(2))
        for first in range(0, len(FILM), 1000):
            one.write(FILM[first : first + 1000])
            other.write(FILM[first : first + 1000])
        assert other.finish().bytes == len(FILM)
        assert find_complete_upload_path(settings, upload.id).read_bytes() == FILM

    def test_more_than_was_said_is_refused_and_what_is_here_stays(self, settings: Settings) -> None:
        upload = send(settings, begin(settings, size=4000), 0, 3000)
        with pytest.raises(InputError, match="longer than the 4,000 bytes"):
            send(settings, upload, 3000, 4001)
        assert get_upload(settings, upload.id).bytes == 3000

    def test_what_was_never_acknowledged_is_written_over(self, settings: Settings) -> None:
        upload = send(settings, begin(settings), 0, 4000)
        with (settings.uploads / upload.id / "content" / "final.mp4").open("ab") as file:
            file.write(b"half of a part, when the server was killed")
        assert begin(settings).bytes == 4000
        send(settings, upload, 4000, len(FILM))
        assert find_complete_upload_path(settings, upload.id).read_bytes() == FILM

    def test_a_copy_of_a_home_may_have_less_than_its_record_says(self, settings: Settings) -> None:
        upload = send(settings, begin(settings), 0, 4000)
        os.truncate(settings.uploads / upload.id / "content" / "final.mp4", 2500)
        assert begin(settings).bytes == 2500
        send(settings, upload, 2500, len(FILM))
        assert find_complete_upload_path(settings, upload.id).read_bytes() == FILM

    def test_every_byte_is_on_the_disk_before_it_is_acknowledged(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        upload, synced, plain = begin(settings), list[tuple[int, int]](), os.fsync

        def watched(handle: int) -> None:
            plain(handle)
            synced.append((os.fstat(handle).st_size, get_upload(settings, upload.id).bytes))

        monkeypatch.setattr(os, "fsync", watched)
        send(settings, upload, 0, 4000)
        assert synced[0] == (4000, 0)

    def test_a_full_disk_is_a_sentence_and_the_upload_goes_on_afterwards(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        upload = send(settings, begin(settings), 0, 4000)

        def full(_: int) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        with monkeypatch.context() as patched:
            patched.setattr(os, "fsync", full)
            with pytest.raises(StorageError, match="is full: 4,000 of 10,240 bytes of final"):
                send(settings, upload, 4000, 8000)
        path = settings.uploads / upload.id / "content" / "final.mp4"
        assert (path.stat().st_size, begin(settings).bytes) == (4000, 4000)
        send(settings, upload, 4000, len(FILM))
        assert find_complete_upload_path(settings, upload.id).read_bytes() == FILM

    def test_a_part_that_the_disk_takes_half_of_is_taken_back(self, settings: Settings) -> None:
        upload = send(settings, begin(settings), 0, 4000)
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (6000, before[1]))
            with pytest.raises(StorageError, match="4,000 of 10,240 bytes of final"):
                send(settings, upload, 4000, 8000)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        path = settings.uploads / upload.id / "content" / "final.mp4"
        assert (path.stat().st_size, begin(settings).bytes) == (4000, 4000)

    def test_one_that_is_deleted_meanwhile_is_not_there(self, settings: Settings) -> None:
        upload = begin(settings)
        writer = PartWriter(settings, upload.id, 0)
        delete_upload(settings, upload.id)
        with pytest.raises(NotFoundError):
            writer.write(FILM)
        assert list(settings.uploads.iterdir()) == []

    def test_nothing_uses_what_is_not_whole(self, settings: Settings) -> None:
        upload = send(settings, begin(settings), 0, 4000)
        with pytest.raises(ConflictError, match=r"only 4,000 of 10,240 bytes of final\.mp4"):
            find_complete_upload_path(settings, upload.id)


class TestUpkeep:
    def test_one_of_which_no_part_came_for_days_is_deleted(self, settings: Settings) -> None:
        upload = send(settings, begin(settings), 0, 4000)
        folder = settings.uploads / upload.id
        long_ago = (datetime.now(UTC) - timedelta(days=settings.upload_days, hours=1)).timestamp()
        os.utime(folder / "content", (long_ago, long_ago))
        assert (delete_leftovers(settings), expire_uploads(settings)) == (0, 0)
        os.utime(folder, (long_ago, long_ago))
        # Begun long ago, but a part has just come.
        send(settings, upload, 4000, 5000)
        assert expire_uploads(settings) == 0
        os.utime(folder, (long_ago, long_ago))
        assert (delete_leftovers(settings), expire_uploads(settings)) == (0, 1)
        assert not folder.exists()
