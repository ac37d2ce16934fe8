"""Lost members: those that a damaged list hides are missed."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from app.datasets.lost_members import lost_members
from app.datasets.report import Report
from app.datasets.trees import open_tree


class TestDamagedListOfMembers:
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
        report = Report()
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
            assert lost_members(archive) == 0

    def test_counts_more_members_than_a_short_number_holds(self, tmp_path: Path) -> None:
        path = tmp_path / "many.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for number in range(65_536):
                archive.writestr(zipfile.ZipInfo(str(number)), b"")
        with zipfile.ZipFile(path) as archive:
            assert lost_members(archive) == 0
            archive.infolist().pop()
            assert lost_members(archive) == 1

    def test_goes_on_where_an_old_program_began_to_count_anew(self, path: Path) -> None:
        with zipfile.ZipFile(path) as archive:
            archive.infolist().extend([zipfile.ZipInfo("more")] * 65_536)
            assert lost_members(archive) == 0
