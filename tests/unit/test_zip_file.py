"""Zip files: what the end says, the first names, and members that a damaged list hides."""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path

import pytest

from app import zip_file as module
from app.formats.report import ReaderReport
from app.formats.trees import open_tree
from app.zip_file import count_unlisted_members, list_first_member_names


def entry(name: str, comment: bytes = b"") -> bytes:
    """A member as the list of a zip has it."""
    said = name.encode()
    lengths = struct.pack("<3H", len(said), 0, len(comment))
    return b"PK\x01\x02" + bytes(24) + lengths + bytes(12) + said + comment


def wide_zip(path: Path, records: bytes, count: int, *, said: int | None = None) -> Path:
    """A ZIP64 file of a list alone, whose older record says that it is empty."""
    size = len(records) if said is None else said
    wide = b"PK\x06\x06" + struct.pack("<Q2H2L4Q", 44, 45, 45, 0, 0, count, count, size, 0)
    locator = b"PK\x06\x07" + struct.pack("<LQL", 0, len(records), 1)
    old = b"PK\x05\x06" + struct.pack("<4H2LH", 0, 0, 0, 0, 0, 0, 0)
    path.write_bytes(records + wide + locator + old)
    return path


class TestFirstNames:
    def test_are_those_that_the_library_finds_first(self, tmp_path: Path) -> None:
        path = tmp_path / "a.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for number in range(9):
                archive.writestr(zipfile.ZipInfo(f"träume/{number}.json"), "x" * number)
            archive.comment = b"of some length"
        assert list_first_member_names(path, 100) == zipfile.ZipFile(path).namelist()
        assert list_first_member_names(path, 3) == [f"träume/{number}.json" for number in range(3)]

    def test_of_a_wide_zip_are_where_its_own_record_says(self, tmp_path: Path) -> None:
        records = b"".join(entry(f"{number}.json") for number in range(50))
        path = wide_zip(tmp_path / "a.zip", records, 50)
        assert list_first_member_names(path, 100) == [f"{number}.json" for number in range(50)]
        assert zipfile.ZipFile(path).namelist() == list_first_member_names(path, 100)

    def test_a_name_that_is_no_text_is_one_all_the_same(self, tmp_path: Path) -> None:
        spoiled = entry("abc.json").replace(b"abc", b"a\xffc")
        path = wide_zip(tmp_path / "a.zip", spoiled + entry("b.json"), 2)
        assert list_first_member_names(path, 100) == ["a\ufffdc.json", "b.json"]

    def test_no_more_of_the_list_is_read_than_its_limit(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        records = b"".join(entry(f"{number}.json", b"c" * 1000) for number in range(9))
        path = wide_zip(tmp_path / "a.zip", records, 9)
        monkeypatch.setattr(module, "MAX_LIST", 2500)
        assert list_first_member_names(path, 100) == ["0.json", "1.json", "2.json"]

    @pytest.mark.parametrize("said", [2**40, 1, 0])
    def test_a_list_that_is_not_where_it_is_said_to_be_has_none(
        self, tmp_path: Path, said: int
    ) -> None:
        path = wide_zip(tmp_path / "a.zip", entry("a.json"), 1, said=said)
        assert list_first_member_names(path, 100) == []

    def test_a_locator_that_points_at_nothing_is_not_passed_over(self, tmp_path: Path) -> None:
        path = wide_zip(tmp_path / "a.zip", entry("a.json"), 1)
        path.write_bytes(path.read_bytes().replace(b"PK\x06\x06", b"PK\x00\x00"))
        assert list_first_member_names(path, 100) == []

    @pytest.mark.parametrize("content", [b"", b"PK\x05\x06", b"PK\x03\x04" + bytes(40)])
    def test_a_file_that_is_no_zip_has_none(self, tmp_path: Path, content: bytes) -> None:
        path = tmp_path / "a.zip"
        path.write_bytes(content)
        assert list_first_member_names(path, 100) == []


class TestCountTruncated:
    """One byte there, and ``zipfile`` reads over a member without a word."""

    @pytest.fixture
    def path(self, tmp_path: Path) -> Path:
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            archive.writestr("a.json", "[1]")
            archive.writestr("b.json", "[2]")
        return tmp_path / "a.zip"

    def test_tells_how_many_members_are_lost(self, path: Path) -> None:
        content = bytearray(path.read_bytes())
        content[content.index(b"PK\1\2") + 32] = 60  # The length of the first one's comment.
        path.write_bytes(content)
        report = ReaderReport()
        tree = open_tree(path, report)
        assert tree is not None and tree.names() == ["a.json"]
        (problem,) = report.problems
        assert str(problem) == (
            f"{path}: has a damaged list of members: it should have 2 and has 1; copy it again, or"
            " read the folder that it was made of"
        )
        tree.close()

    @pytest.mark.parametrize("comment", [b"", b"made on Monday"])
    def test_has_nothing_to_tell_of_a_whole_one(self, path: Path, comment: bytes) -> None:
        with zipfile.ZipFile(path, "a") as archive:
            archive.comment = comment
        with zipfile.ZipFile(path) as archive:
            assert count_unlisted_members(archive) == 0

    def test_counts_more_members_than_a_short_number_holds(self, tmp_path: Path) -> None:
        path = tmp_path / "many.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for number in range(65_536):
                archive.writestr(zipfile.ZipInfo(str(number)), b"")
        with zipfile.ZipFile(path) as archive:
            assert count_unlisted_members(archive) == 0
            archive.infolist().pop()
            assert count_unlisted_members(archive) == 1

    def test_goes_on_where_an_old_program_began_to_count_anew(self, path: Path) -> None:
        with zipfile.ZipFile(path) as archive:
            archive.infolist().extend([zipfile.ZipInfo("more")] * 65_536)
            assert count_unlisted_members(archive) == 0
