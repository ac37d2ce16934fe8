"""A folder as one file that can be sent, and back."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import pytest

from app.errors import UnsafePathError
from app.terminal.remote import unpack_zip, zip_if_folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "frames of May"
    (made / "b").mkdir(parents=True)
    (made / "empty").mkdir()
    (made / "b" / "2.JPG").write_bytes(b"j" * 1000)
    (made / "a.json").write_bytes(b"{}" * 1000)
    return made


def test_a_file_is_sent_as_it_is(folder: Path) -> None:
    with zip_if_folder(folder / "a.json") as file:
        assert file == folder / "a.json"


def test_a_folder_is_a_zip_of_its_name_that_is_gone_afterwards(folder: Path) -> None:
    with zip_if_folder(folder) as file:
        assert file.name == "frames of May.zip"
        with zipfile.ZipFile(file) as archive:
            packed = {one.filename: one.compress_type for one in archive.infolist()}
    assert packed == {"a.json": zipfile.ZIP_DEFLATED, "b/2.JPG": zipfile.ZIP_STORED}
    assert list(packed) == sorted(packed)
    assert not file.exists()


def test_the_same_files_make_the_same_zip_whenever_they_were_written(folder: Path) -> None:
    with zip_if_folder(folder) as file:
        first = file.read_bytes()
    os.utime(folder / "a.json", (1e9, 1e9))
    with zip_if_folder(folder) as file:
        assert file.read_bytes() == first


def test_what_was_packed_is_unpacked(folder: Path, tmp_path: Path) -> None:
    with zip_if_folder(folder) as file:
        unpack_zip(file, tmp_path / "again")
    again = tmp_path / "again"
    files = {path.relative_to(again).as_posix() for path in again.rglob("*") if path.is_file()}
    assert files == {"a.json", "b/2.JPG"}
    assert (again / "b" / "2.JPG").read_bytes() == b"j" * 1000


def test_a_zip_that_leads_out_of_the_folder_is_refused_and_writes_nothing_there(
    tmp_path: Path,
) -> None:
    with zipfile.ZipFile(tmp_path / "bad.zip", "w") as archive:
        archive.writestr("../out.txt", "x")
    with pytest.raises(UnsafePathError):
        unpack_zip(tmp_path / "bad.zip", tmp_path / "folder")
    assert not (tmp_path / "out.txt").exists()
