"""The folder of exports made over REST."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from app.errors import NotFoundError
from app.features.exports.jobs import ExportEntry, ExportFolder
from app.features.exports.service import ExportReport

REQUEST = {"dataset": "small", "format": "cameras"}


@pytest.fixture
def folder(tmp_path: Path) -> ExportFolder:
    folder = ExportFolder(tmp_path / "exports")
    folder.folder.mkdir()
    return folder


def keep(folder: ExportFolder, name: str) -> ExportEntry:
    """Stands for an export: the smallest zip there is."""
    path = folder.get_zip_path(name)
    path.write_bytes(b"PK\x05\x06" + b"\0" * 18)
    report = ExportReport(path, "cameras", 2, {"cameras": 2}, {"stale": 1}, ("7.png: gone",))
    return folder.save_entry(name, REQUEST, report)


def age(folder: ExportFolder, entry: ExportEntry, days: int) -> None:
    """Let an export have been finished so many days ago."""
    created = (datetime.now(UTC) - timedelta(days=days)).isoformat()
    record = folder.folder / f"{entry.id}.json"
    record.write_text(json.dumps({**asdict(entry), "created": created}))


class TestKeep:
    def test_a_finished_export_is_found_again(self, folder: ExportFolder) -> None:
        entry = keep(folder, "12")
        assert folder.get_entry("12") == folder.find_entry("12") == entry
        assert (entry.counts, entry.left_out, entry.bytes) == ({"cameras": 2}, {"stale": 1}, 22)
        assert entry.missing_images == ["7.png: gone"]

    def test_a_zip_without_its_record_is_not_found(self, folder: ExportFolder) -> None:
        folder.get_zip_path("12").write_bytes(b"PK")
        assert folder.find_entry("12") is None


class TestExpire:
    def test_zips_of_so_many_days_ago_go_and_their_records_say_so(
        self, folder: ExportFolder
    ) -> None:
        for name, days in (("12", 31), ("13", 29)):
            age(folder, keep(folder, name), days)
        assert folder.delete_expired_zips(30) == 1
        old, young = folder.get_entry("12"), folder.get_entry("13")
        assert (old.expired, young.expired) == (True, False)
        assert (old.counts, old.bytes) == ({"cameras": 2}, 22)
        assert [folder.get_zip_path(name).exists() for name in ("12", "13")] == [False, True]
        assert folder.delete_expired_zips(30) == 0

    def test_none_expires_where_exports_are_kept_for_good(self, folder: ExportFolder) -> None:
        age(folder, keep(folder, "12"), 4000)
        assert folder.delete_expired_zips(0) == 0
        assert folder.get_zip_path("12").exists()
        assert folder.get_entry("12").find_expiry_time(0) is None

    def test_a_zip_whose_deletion_was_interrupted_goes_the_next_time(
        self, folder: ExportFolder
    ) -> None:
        age(folder, replace(keep(folder, "12"), expired=True), 31)
        folder.delete_expired_zips(30)
        assert not folder.get_zip_path("12").exists()

    def test_what_was_delivered_to_an_object_store_never_expires(
        self, folder: ExportFolder
    ) -> None:
        age(folder, replace(keep(folder, "12"), stored="s3://exports/12.zip"), 31)
        assert folder.delete_expired_zips(30) == 0
        assert folder.get_entry("12").expired is False

    def test_a_record_that_cannot_be_read_keeps_no_other_from_expiring(
        self, folder: ExportFolder
    ) -> None:
        (folder.folder / "11.json").write_text("x")
        age(folder, keep(folder, "12"), 31)
        assert folder.delete_expired_zips(30) == 1

    def test_a_record_of_an_earlier_version_is_read(self, folder: ExportFolder) -> None:
        values = asdict(keep(folder, "12"))
        del values["expired"]
        (folder.folder / "12.json").write_text(json.dumps(values))
        assert folder.get_entry("12").expired is False


class TestGet:
    @pytest.mark.parametrize(
        "name", ["", "x", "../../etc/passwd", "0" * 31, "0" * 32, "A" * 32, "0", "012", "1" * 20]
    )
    def test_an_unknown_export_is_not_found(self, folder: ExportFolder, name: str) -> None:
        with pytest.raises(NotFoundError):
            folder.get_entry(name)

    def test_exports_from_before_there_were_jobs_are_still_there(
        self, folder: ExportFolder
    ) -> None:
        entry = keep(folder, "9b2f0c6e5d7a4c18a3f1e2d4b5c6a798")
        assert folder.get_entry(entry.id) == entry

    def test_a_record_outside_of_the_folder_is_not_reached(self, folder: ExportFolder) -> None:
        keep(folder, "12")
        record = folder.folder / "12.json"
        record.rename(folder.folder.parent / "13.json")
        with pytest.raises(NotFoundError):
            folder.get_entry("../13")


class TestForget:
    def test_deletes_the_zip_and_its_record_and_nothing_else(self, folder: ExportFolder) -> None:
        keep(folder, "12")
        kept = keep(folder, "13")
        for name in ("12", "../exports/13", "99"):
            folder.delete_export(name)
        assert folder.find_entry("12") is None
        assert not folder.get_zip_path("12").exists()
        assert folder.get_entry("13") == kept


class TestWriting:
    def test_what_was_left_half_written_of_it_goes_before_and_after(
        self, folder: ExportFolder
    ) -> None:
        keep(folder, "12")
        half = folder.folder / ".13.zip.abc.partial"
        half.mkdir()
        (half / "x.csv").write_text("x")
        with folder.reserve_partial_path("13") as beside:
            assert not half.exists()
            beside.with_name(f".{beside.name}.abc.partial").write_text("half of the zip")
        assert sorted(path.name for path in folder.folder.iterdir()) == ["12.json", "12.zip"]

    def test_what_others_are_writing_stays(self, folder: ExportFolder) -> None:
        others = folder.folder / ".12.zip.abc.partial"
        others.mkdir()
        with folder.reserve_partial_path("2"), folder.reserve_partial_path("13"):
            assert others.is_dir()
        assert others.is_dir()

    def test_another_server_that_has_begun_with_it_meanwhile_goes_on(
        self, folder: ExportFolder
    ) -> None:
        with ExitStack() as other:
            with folder.reserve_partial_path("13"):
                beside = other.enter_context(folder.reserve_partial_path("13"))
                half = beside.with_name(f".{beside.name}.abc.partial")
                half.mkdir()
            assert half.is_dir()

    def test_a_folder_that_is_missing_is_made_for_its_owner_alone(self, tmp_path: Path) -> None:
        folder = ExportFolder(tmp_path / "home" / "exports")
        with folder.reserve_partial_path("1"):
            assert folder.folder.stat().st_mode & 0o777 == 0o700
