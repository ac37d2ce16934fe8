"""The folder of exports made over REST."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.errors import NotFoundError
from app.review.exporting.export import ExportReport
from app.review.exporting.folder import ExportEntry, ExportFolder

REQUEST = {"dataset": "small", "format": "cameras"}


@pytest.fixture
def folder(tmp_path: Path) -> ExportFolder:
    folder = ExportFolder(tmp_path / "exports")
    folder.prepare()
    return folder


def keep(folder: ExportFolder, name: str) -> ExportEntry:
    """Stands for an export: the smallest zip there is."""
    path = folder.content(name)
    path.write_bytes(b"PK\x05\x06" + b"\0" * 18)
    report = ExportReport(path, "cameras", {"cameras": 2}, {"stale": 1}, ("7.png: gone",))
    return folder.keep(name, REQUEST, report)


class TestKeep:
    def test_a_finished_export_is_found_again(self, folder: ExportFolder) -> None:
        entry = keep(folder, "12")
        assert folder.get("12") == folder.find("12") == entry
        assert (entry.counts, entry.left_out, entry.bytes) == ({"cameras": 2}, {"stale": 1}, 22)
        assert entry.missing_images == ["7.png: gone"]

    def test_a_zip_without_its_record_is_not_found(self, folder: ExportFolder) -> None:
        folder.content("12").write_bytes(b"PK")
        assert folder.find("12") is None


class TestGet:
    @pytest.mark.parametrize(
        "name", ["", "x", "../../etc/passwd", "0" * 31, "0" * 32, "A" * 32, "0", "012", "1" * 20]
    )
    def test_an_unknown_export_is_not_found(self, folder: ExportFolder, name: str) -> None:
        with pytest.raises(NotFoundError):
            folder.get(name)

    def test_exports_from_before_there_were_jobs_are_still_there(
        self, folder: ExportFolder
    ) -> None:
        entry = keep(folder, "9b2f0c6e5d7a4c18a3f1e2d4b5c6a798")
        assert folder.get(entry.id) == entry

    def test_a_record_outside_of_the_folder_is_not_reached(self, folder: ExportFolder) -> None:
        keep(folder, "12")
        record = folder.folder / "12.json"
        record.rename(folder.folder.parent / "13.json")
        with pytest.raises(NotFoundError):
            folder.get("../13")


class TestForget:
    def test_deletes_the_zip_and_its_record_and_nothing_else(self, folder: ExportFolder) -> None:
        keep(folder, "12")
        kept = keep(folder, "13")
        for name in ("12", "../exports/13", "99"):
            folder.forget(name)
        assert folder.find("12") is None
        assert not folder.content("12").exists()
        assert folder.get("13") == kept


class TestPrepare:
    def test_clears_half_written_files_of_a_killed_server(self, folder: ExportFolder) -> None:
        keep(folder, "12")
        (folder.folder / ".13.zip.abc.partial").mkdir()
        (folder.folder / ".13.zip.abc.partial" / "x.csv").write_text("x")
        (folder.folder / ".13.json.partial").write_text("{")
        folder.prepare()
        assert sorted(path.name for path in folder.folder.iterdir()) == ["12.json", "12.zip"]
