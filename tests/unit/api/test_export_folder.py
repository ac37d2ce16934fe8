"""The folder of exports made over REST."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from app.api.errors import BusyError
from app.api.export_folder import ExportFolder
from app.errors import IdempotencyError, InputError, NotFoundError
from app.review.export import ExportReport

REQUEST = {"dataset": "small", "format": "cameras"}


def write(path: Path) -> ExportReport:
    """Stands for an export: the smallest zip there is."""
    path.write_bytes(b"PK\x05\x06" + b"\0" * 18)
    return ExportReport(path, "cameras", {"cameras": 2})


@pytest.fixture
def folder(tmp_path: Path) -> ExportFolder:
    return ExportFolder(tmp_path / "exports")


class TestMake:
    def test_what_was_made_can_be_found_again(self, folder: ExportFolder) -> None:
        entry = folder.make(REQUEST, None, write)
        assert folder.get(entry.id) == entry
        assert (entry.counts, entry.bytes) == ({"cameras": 2}, 22)
        assert folder.content(entry.id).is_file()

    def test_two_exports_have_two_ids(self, folder: ExportFolder) -> None:
        first, second = (folder.make(REQUEST, None, write) for _ in range(2))
        assert first.id != second.id

    def test_under_one_key_it_is_made_once(self, folder: ExportFolder) -> None:
        first = folder.make(REQUEST, "a", write)
        assert folder.make(REQUEST, "a", lambda path: pytest.fail("written again")) == first

    def test_a_key_belongs_to_its_request(self, folder: ExportFolder) -> None:
        folder.make(REQUEST, "a", write)
        with pytest.raises(IdempotencyError):
            folder.make({**REQUEST, "format": "issia-3d"}, "a", write)

    def test_an_export_that_failed_leaves_nothing_and_can_be_tried_again(
        self, folder: ExportFolder
    ) -> None:
        def fail(path: Path) -> ExportReport:
            raise InputError("nothing to export")

        with pytest.raises(InputError):
            folder.make(REQUEST, "a", fail)
        assert list(folder.folder.iterdir()) == []
        assert folder.make(REQUEST, "a", write).counts == {"cameras": 2}

    def test_a_second_one_at_the_same_time_is_told_to_wait(self, folder: ExportFolder) -> None:
        started, finish = threading.Event(), threading.Event()

        def slow(path: Path) -> ExportReport:
            started.set()
            assert finish.wait(10)
            return write(path)

        thread = threading.Thread(target=folder.make, args=(REQUEST, None, slow))
        thread.start()
        assert started.wait(10)
        with pytest.raises(BusyError):
            folder.make(REQUEST, None, write)
        finish.set()
        thread.join()
        assert folder.make(REQUEST, None, write)


class TestGet:
    @pytest.mark.parametrize("name", ["", "x", "../../etc/passwd", "0" * 31, "0" * 32, "A" * 32])
    def test_what_was_never_made_is_not_found(self, folder: ExportFolder, name: str) -> None:
        with pytest.raises(NotFoundError):
            folder.get(name)

    def test_a_record_outside_of_the_folder_is_not_reached(self, folder: ExportFolder) -> None:
        entry = folder.make(REQUEST, None, write)
        record = folder.folder / f"{entry.id}.json"
        record.rename(folder.folder.parent / "outside.json")
        with pytest.raises(NotFoundError):
            folder.get("../outside")
