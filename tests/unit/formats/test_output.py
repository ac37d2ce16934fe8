from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path

import pytest

from app.errors import InputError, JobCancelled, StorageError
from app.formats.manifest import Manifest, write_manifest
from app.formats.output import open_output_folder, write_files_to_zip, write_zip

MANIFEST = Manifest("d", "cameras", "2030-01-02", {})


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def _export(out: Path, text: str = "1") -> None:
    with open_output_folder(out) as root:
        (root / "b").mkdir()
        (root / "b" / "x.txt").write_text(text)
        (root / "a.txt").write_text(text)
        write_manifest(root, MANIFEST)


class TestOutputTree:
    def test_a_folder_appears_when_all_is_written(self, tmp_path: Path) -> None:
        out = tmp_path / "new" / "out"
        with open_output_folder(out) as root:
            (root / "a.txt").write_text("1")
            assert not out.exists()
        assert (out / "a.txt").read_text() == "1"
        assert _names(out.parent) == ["out"]

    def test_a_zip_by_its_ending_has_sorted_entries_of_1980(self, tmp_path: Path) -> None:
        _export(tmp_path / "out.zip")
        with zipfile.ZipFile(tmp_path / "out.zip") as archive:
            assert archive.namelist() == ["a.txt", "b/x.txt", "manifest.json"]
            assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
            assert archive.read("b/x.txt") == b"1"
        assert _names(tmp_path) == ["out.zip"]

    def test_the_same_content_makes_the_same_zip(self, tmp_path: Path) -> None:
        for name in ("a.zip", "b.zip"):
            _export(tmp_path / name)
        assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()

    def test_who_is_told_how_much_is_packed_may_end_it_there(self, tmp_path: Path) -> None:
        out, told = tmp_path / "out.zip", []
        _export(out, "before")
        before = out.read_bytes()

        def progress(done: int, total: int | None = None, sentence: str = "") -> None:
            told.append((done, total, sentence))
            if done == 1:
                raise JobCancelled

        with pytest.raises(JobCancelled), open_output_folder(out, progress=progress) as root:
            (root / "a.txt").write_text("1")
            (root / "b.txt").write_text("1")
        assert told == [(0, 2, "Packing the files."), (1, 2, "Packing the files.")]
        assert out.read_bytes() == before
        assert _names(tmp_path) == ["out.zip"]

    @pytest.mark.parametrize("name", ["out", "out.zip"])
    def test_what_is_half_written_is_called_after_whoever_writes_it(
        self, tmp_path: Path, name: str
    ) -> None:
        half: set[str] = set()

        def progress(*_: object) -> None:
            half.update(_names(tmp_path))

        with open_output_folder(tmp_path / name, tmp_path / "12.zip.ab", progress) as root:
            (root / "a.txt").write_text("1")
            half.update(_names(tmp_path))
        assert half and all(item.startswith(".12.zip.ab.") for item in half)
        assert _names(tmp_path) == [name]

    @pytest.mark.parametrize("name", ["out", "out.zip"])
    def test_its_content_is_on_disk_before_its_name_and_then_its_name(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        out, synced = tmp_path / name, set()

        def watched(handle: int) -> None:
            synced.add((os.fstat(handle).st_ino, out.exists()))

        monkeypatch.setattr(os, "fsync", watched)
        _export(out)
        content = {(path.stat().st_ino, False) for path in (out, *out.rglob("*"))}
        assert synced == {*content, (tmp_path.stat().st_ino, True)}

    @pytest.mark.parametrize("name", ["out", "out.zip"])
    def test_an_error_leaves_nothing_behind(self, tmp_path: Path, name: str) -> None:
        with pytest.raises(InputError), open_output_folder(tmp_path / name) as root:
            (root / "a.txt").write_text("1")
            raise InputError("nothing to export")
        assert _names(tmp_path) == []

    @pytest.mark.parametrize("name", ["out", "out.zip"])
    def test_an_error_keeps_an_earlier_export(self, tmp_path: Path, name: str) -> None:
        _export(tmp_path / name)
        before = sorted(tmp_path.rglob("*"))
        with pytest.raises(KeyError), open_output_folder(tmp_path / name) as root:
            (root / "c.txt").write_text("1")
            raise KeyError
        assert sorted(tmp_path.rglob("*")) == before

    @pytest.mark.parametrize("name", ["out", "out.zip"])
    def test_an_earlier_export_is_replaced(self, tmp_path: Path, name: str) -> None:
        _export(tmp_path / name, "old")
        with open_output_folder(tmp_path / name) as root:
            (root / "a.txt").write_text("new")
        assert _names(tmp_path) == [name]
        if name == "out":
            assert _names(tmp_path / name) == ["a.txt"]

    def test_a_folder_with_other_files_is_never_touched(self, tmp_path: Path) -> None:
        _export(tmp_path / "out")
        (tmp_path / "out" / "thesis.txt").write_text("mine")
        with (
            pytest.raises(InputError, match="is not an earlier export"),
            open_output_folder(tmp_path / "out"),
        ):
            raise AssertionError("not reached")
        assert (tmp_path / "out" / "thesis.txt").read_text() == "mine"

    @pytest.mark.parametrize(
        "text", ["{}", "[]", "not json", '{"software": {"name": "touchline"}}']
    )
    def test_a_foreign_manifest_does_not_make_an_export(self, tmp_path: Path, text: str) -> None:
        (tmp_path / "manifest.json").write_text(text)
        with (
            pytest.raises(InputError, match="is not an earlier export"),
            open_output_folder(tmp_path),
        ):
            raise AssertionError("not reached")

    @pytest.mark.parametrize("name", ["out", "out.zip"])
    def test_an_export_of_another_program_with_such_a_manifest_is_never_replaced(
        self, tmp_path: Path, name: str
    ) -> None:
        foreign = {"software": {"name": "another"}, "files": [{"path": "a.txt"}]}
        content = {"manifest.json": json.dumps(foreign), "a.txt": "theirs"}
        out = tmp_path / name
        if name == "out":
            out.mkdir()
            for file, text in content.items():
                (out / file).write_text(text)
        else:
            with zipfile.ZipFile(out, "w") as archive:
                for file, text in content.items():
                    archive.writestr(file, text)
        with pytest.raises(InputError, match="is not an earlier export"), open_output_folder(out):
            raise AssertionError("not reached")

    def test_others_may_read_what_was_published(self, tmp_path: Path) -> None:
        _export(tmp_path / "out")
        _export(tmp_path / "out.zip")
        assert (tmp_path / "out").stat().st_mode & 0o777 == 0o755
        assert (tmp_path / "out.zip").stat().st_mode & 0o777 == 0o644

    @pytest.mark.parametrize("kind", ["text", "zip", "mixed", "link"])
    def test_a_foreign_file_that_ends_in_zip_is_never_replaced(
        self, tmp_path: Path, kind: str
    ) -> None:
        out = tmp_path / "out.zip"
        if kind == "text":
            out.write_text("my thesis")
        elif kind == "link":
            _export(tmp_path / "real.zip")
            out.symlink_to(tmp_path / "real.zip")
        else:
            if kind == "mixed":
                _export(out)
            with zipfile.ZipFile(out, "a") as archive:
                archive.writestr("thesis.txt", "mine")
        before = out.read_bytes()
        with pytest.raises(InputError, match="is not an earlier export"), open_output_folder(out):
            raise AssertionError("not reached")
        assert out.read_bytes() == before

    def test_an_empty_folder_is_used(self, tmp_path: Path) -> None:
        (tmp_path / "out").mkdir()
        _export(tmp_path / "out")
        assert (tmp_path / "out" / "a.txt").is_file()

    def test_a_file_in_the_way_is_said(self, tmp_path: Path) -> None:
        (tmp_path / "out").write_text("x")
        with pytest.raises(InputError, match="is a file"), open_output_folder(tmp_path / "out"):
            raise AssertionError("not reached")
        with pytest.raises(StorageError), open_output_folder(tmp_path / "out" / "deeper"):
            raise AssertionError("not reached")


class TestWriteZip:
    def test_a_file_of_more_than_two_gigabytes_gets_in(self, tmp_path, monkeypatch) -> None:
        """The limits stand for those of the format: what goes in in pieces is larger than both."""
        monkeypatch.setattr("app.formats.output.WHOLE", 100)
        monkeypatch.setattr("zipfile.ZIP64_LIMIT", 1000)
        root = tmp_path / "root"
        root.mkdir()
        content = os.urandom(5000)
        (root / "large.json").write_bytes(content)
        write_zip(root, tmp_path / "out.zip")
        with zipfile.ZipFile(tmp_path / "out.zip") as archive:
            assert archive.read("large.json") == content

    def test_what_is_compressed_already_is_stored(self, tmp_path) -> None:
        root = tmp_path / "root"
        root.mkdir()
        for name in ("7.JPG", "a.json"):
            (root / name).write_bytes(b"a" * 1000)
        files = [(path.name, path) for path in sorted(root.iterdir())]
        write_files_to_zip(files, tmp_path / "out.zip", stored=(".jpg",))
        with zipfile.ZipFile(tmp_path / "out.zip") as archive:
            assert [item.compress_type for item in archive.infolist()] == [
                zipfile.ZIP_STORED,
                zipfile.ZIP_DEFLATED,
            ]
