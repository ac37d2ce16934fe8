from __future__ import annotations

import os
import stat
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.config import Settings
from app.errors import DatasetFormatError, ImageError
from app.formats.file_tree import ImportLimits, list_files_in_folder
from app.formats.guess_format import guess_format
from app.formats.report import ReaderReport
from app.formats.safe_path import is_hidden, read_regular_file
from app.formats.soccernet_v3 import MatchFrameFinder
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.formats.trees import FolderTree, ZipTree, open_tree, open_tree_context
from app.media.object_frames import ArchiveMemberReader

MakeZip = Callable[..., Path]


class TestLimits:
    def test_they_come_from_the_settings(self) -> None:
        limits = ImportLimits.of(Settings(max_members=3, max_file_bytes=5))
        assert (limits.members, limits.file_bytes) == (3, 5)


class TestOpenTree:
    def test_a_missing_path_is_one_problem(self, tmp_path: Path, report: ReaderReport) -> None:
        assert open_tree(tmp_path / "none", report) is None
        assert [problem.problem for problem in report.problems] == ["does not exist"]

    def test_one_file_is_a_tree_of_one(self, tmp_path: Path, report: ReaderReport) -> None:
        (tmp_path / "a.json").write_text("{}")
        (tmp_path / "b.json").write_text("{}")
        tree = open_tree(tmp_path / "a.json", report)
        assert tree is not None
        assert tree.names() == ["a.json"]
        assert tree.read_bytes("a.json") == b"{}"

    def test_a_zip_is_known_by_its_content_too(
        self, make_zip: MakeZip, report: ReaderReport
    ) -> None:
        path = make_zip({"a": "1"})
        tree = open_tree(path.rename(path.with_suffix(".data")), report)
        assert tree is not None
        assert tree.read_bytes("a") == b"1"

    def test_a_truncated_zip_is_one_clear_problem(
        self, make_zip: MakeZip, report: ReaderReport
    ) -> None:
        path = make_zip({f"{index}.json": os.urandom(500) for index in range(20)})
        path.write_bytes(path.read_bytes()[:4000])
        assert open_tree(path, report) is None
        assert len(report.problems) == 1
        assert "not a complete zip file" in str(report.problems[0])


class TestOpenedTree:
    def test_it_is_closed_after_its_last_reader_and_what_is_not_there_is_none(
        self, tmp_path: Path
    ) -> None:
        path = tmp_path / "a.zip"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("a.json", "{}")
        with open_tree_context(path, ReaderReport()) as tree:
            assert tree is not None and tree.read_bytes("a.json") == b"{}"
        with pytest.raises(ValueError, match="closed"):
            tree.open("a.json")
        with open_tree_context(tmp_path / "none", ReaderReport()) as tree:
            assert tree is None


class TestFolderTree:
    def test_hidden_files_are_left_out(self, tmp_path: Path, report: ReaderReport) -> None:
        for name in ("b/1.json", "a.json", ".git/x", "b/.DS_Store", "__MACOSX/a.json"):
            path = tmp_path / name
            path.parent.mkdir(exist_ok=True)
            path.write_text("{}")
        tree = open_tree(tmp_path, report)
        assert tree is not None
        assert tree.names() == ["a.json", "b/1.json"]

    def test_a_file_behind_a_link_out_of_the_folder_is_refused(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        (tmp_path / "root").mkdir()
        (tmp_path / "secret").write_text("x")
        (tmp_path / "root" / "a").symlink_to(tmp_path / "secret")
        (tmp_path / "root" / "b").symlink_to(tmp_path)
        (tmp_path / "root" / "c").write_text("x")
        (tmp_path / "root" / "d").symlink_to(tmp_path / "root" / "c")
        tree = open_tree(tmp_path / "root", report)
        assert tree is not None
        assert tree.names() == ["c", "d"]
        assert len(report.problems) == 2
        with pytest.raises(DatasetFormatError, match="leads out"):
            tree.read_bytes("a")

    def test_a_pipe_is_refused_without_waiting(self, tmp_path: Path, report: ReaderReport) -> None:
        os.mkfifo(tmp_path / "a")
        tree = open_tree(tmp_path, report)
        assert tree is not None
        with pytest.raises(DatasetFormatError, match="not a regular file"):
            tree.read_bytes("a")

    def test_a_file_beyond_the_limit_is_refused(self, tmp_path: Path, report: ReaderReport) -> None:
        (tmp_path / "a").write_bytes(b"x" * 11)
        tree = open_tree(tmp_path, report, ImportLimits(file_bytes=10))
        assert tree is not None
        with pytest.raises(DatasetFormatError, match="longer than 10 bytes"):
            tree.read_bytes("a")


class TestFilesInside:
    def test_every_name_below_a_folder_is_among_them(self) -> None:
        names = sorted(["a/x", "a/Ünsal.png", "a/日本.png", "a~", "b/x"])
        assert list_files_in_folder(names, "a/") == {"x", "Ünsal.png", "日本.png"}


class TestReadPlain:
    def test_a_file_beyond_the_limit_is_refused_and_never_cut(self, tmp_path: Path) -> None:
        path = tmp_path / "a"
        path.write_bytes(b"12345")
        assert read_regular_file(path, 5) == b"12345"
        for limit in (4, 3):
            with pytest.raises(DatasetFormatError, match=f"longer than {limit} bytes"):
                read_regular_file(path, limit)


class TestZipTree:
    def test_members_are_read_in_place(self, make_zip: MakeZip, report: ReaderReport) -> None:
        tree = ZipTree(make_zip({"b/2": "two", "a": "one", "b/": ""}), report, ImportLimits())
        assert tree.names() == ["a", "b/2"]
        assert tree.read_bytes("b/2") == b"two"
        assert report.problems == []

    @pytest.mark.parametrize("name", ["../a", "/a", "a/../../b", "c:/a", "%2e%2e/a", "a\\..\\b"])
    def test_an_unsafe_member_is_left_out_and_the_rest_is_read(
        self, make_zip: MakeZip, report: ReaderReport, name: str
    ) -> None:
        tree = ZipTree(make_zip({name: "evil", "good": "1"}), report, ImportLimits())
        assert tree.names() == ["good"]
        assert len(report.problems) == 1

    @pytest.mark.parametrize(
        ("written", "marked", "name"),
        [
            (b"set\\images\\1.jpg", 0, "set/images/1.jpg"),
            ("bälle/1.jpg".encode(), 0, "bälle/1.jpg"),
            ("bälle/1.jpg".encode(), 0x800, "bälle/1.jpg"),
            ("bälle/1.jpg".encode("cp437"), 0, "bälle/1.jpg"),
            ("мяч\\1.jpg".encode(), 0, "мяч/1.jpg"),
        ],
    )
    def test_names_of_other_programs_are_read_as_they_were_meant_and_opened_as_they_are(
        self, make_zip: MakeZip, report: ReaderReport, written: bytes, marked: int, name: str
    ) -> None:
        stand_in = "x" * len(written)
        path = make_zip({stand_in: "one", "folder\\": ""})
        content = bytearray(path.read_bytes().replace(stand_in.encode(), written))
        for signature, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
            at = content.index(signature) + flags
            content[at : at + 2] = marked.to_bytes(2, "little")
        path.write_bytes(content)
        tree = ZipTree(path, report, ImportLimits())
        assert (tree.names(), tree.read_bytes(name)) == ([name], b"one")
        media = tree.media(name)
        assert media.member is not None
        assert ArchiveMemberReader().read(Path(media.path), media.member, 10) == b"one"
        assert report.problems == []

    def test_a_name_with_nul_is_left_out(self, make_zip: MakeZip, report: ReaderReport) -> None:
        path = make_zip({"aXb.json": "evil", "good": "1"})
        path.write_bytes(path.read_bytes().replace(b"aXb.json", b"a\x00b.json"))
        assert ZipTree(path, report, ImportLimits()).names() == ["good"]

    def test_a_link_is_left_out(self, tmp_path: Path, report: ReaderReport) -> None:
        path = tmp_path / "a.zip"
        with zipfile.ZipFile(path, "w") as archive:
            entry = zipfile.ZipInfo("link")
            entry.external_attr = (stat.S_IFLNK | 0o777) << 16
            archive.writestr(entry, "/etc/passwd")
        assert ZipTree(path, report, ImportLimits()).names() == []
        assert "link or device" in str(report.problems[0])

    @pytest.mark.filterwarnings("ignore:Duplicate name")
    def test_names_that_collide_are_all_left_out(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        path = tmp_path / "a.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for name in ("a.json", "a.json", "B.json", "b.json", "c.json"):
                archive.writestr(name, name)
        assert ZipTree(path, report, ImportLimits()).names() == ["c.json"]
        assert len(report.problems) == 4

    def test_too_many_members_are_refused(self, make_zip: MakeZip, report: ReaderReport) -> None:
        with pytest.raises(DatasetFormatError, match="has 3 members"):
            ZipTree(make_zip({"a": "", "b": "", "c": ""}), report, ImportLimits(members=2))

    def test_too_large_a_total_is_refused(self, make_zip: MakeZip, report: ReaderReport) -> None:
        with pytest.raises(DatasetFormatError, match="unpacks to 12 bytes"):
            ZipTree(make_zip({"a": "123456", "b": "123456"}), report, ImportLimits(total_bytes=11))

    def test_a_bomb_is_left_out(self, make_zip: MakeZip, report: ReaderReport) -> None:
        path = make_zip({"bomb": b"0" * 8_000_000, "good": "1"})
        assert ZipTree(path, report, ImportLimits()).names() == ["good"]
        assert "grows more than 200 times" in str(report.problems[0])

    def test_a_member_beyond_the_limit_is_refused(
        self, make_zip: MakeZip, report: ReaderReport
    ) -> None:
        tree = ZipTree(make_zip({"a": os.urandom(100)}), report, ImportLimits(file_bytes=99))
        with pytest.raises(DatasetFormatError, match="longer than 99 bytes"):
            tree.read_bytes("a")

    def test_a_damaged_member_says_so(self, make_zip: MakeZip, report: ReaderReport) -> None:
        path = make_zip({"a": os.urandom(1000)})
        content = bytearray(path.read_bytes())
        content[200:210] = bytes(10)
        path.write_bytes(content)
        with pytest.raises(DatasetFormatError, match=r"archive.zip/a: is damaged"):
            ZipTree(path, report, ImportLimits()).read_bytes("a")

    def test_a_member_that_lies_about_its_size_is_refused(
        self, make_zip: MakeZip, report: ReaderReport
    ) -> None:
        path = make_zip({"a": b"0" * 100_000})
        size = (100_000).to_bytes(4, "little")
        path.write_bytes(path.read_bytes().replace(size, (10).to_bytes(4, "little")))
        with pytest.raises(DatasetFormatError, match="damaged"):
            ZipTree(path, report, ImportLimits()).read_bytes("a")

    @given(data=st.data())
    def test_of_a_damaged_zip_every_member_is_whole_or_named_in_a_problem(
        self, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
    ) -> None:
        path = tmp_path_factory.mktemp("zip") / "a.zip"
        members = {"a.json": b'{"a": 1}' * 20, "b/c.json": b"[]"}
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, member in members.items():
                archive.writestr(name, member)
        content = bytearray(path.read_bytes())
        for _ in range(data.draw(st.integers(1, 4))):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
        if data.draw(st.integers(0, 3)) == 0:
            del content[data.draw(st.integers(1, len(content) - 1)) :]
        path.write_bytes(content)
        report, read = ReaderReport(), []
        tree = open_tree(path, report)
        for name in tree.names() if tree else ():
            try:
                read.append(tree.read_bytes(name))
            except DatasetFormatError as error:
                assert str(path) in str(error)
                report.add_problem(error)
        if tree:
            tree.close()
        assert set(read) <= set(members.values())
        assert report.problems or len(read) == len(members) or _leaves_out(path)


def _leaves_out(path: Path) -> bool:
    """Whether a name became, by its damage, that of a folder or of a hidden file."""
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    return any(name.endswith("/") or any(map(is_hidden, name.split("/"))) for name in names)


class TestNamesThatAreNoText:
    """Some packers mark names as UTF-8 that are not."""

    @pytest.fixture
    def marked(self, make_zip: MakeZip) -> Path:
        path = make_zip({"b/1.json": "one", "caf\u00e9.json": "two", "d.json": "three"})
        content = path.read_bytes()
        assert content.count("\u00e9".encode()) == 2
        path.write_bytes(content.replace("\u00e9".encode(), b"\xe9\xff"))
        return path

    def test_one_of_them_condemns_no_other_member(self, marked: Path, report: ReaderReport) -> None:
        tree = open_tree(marked, report)
        assert tree is not None
        with closing(tree):
            assert tree.names() == ["b/1.json", "d.json"]
            assert tree.read_bytes("b/1.json") == b"one"
        (problem,) = report.problems
        assert problem.record == b"caf\xe9\xff.json".decode("cp437")
        assert problem.problem == "has a name that is not text, so it cannot be read"
        assert guess_format(marked) == "sn-calibration"

    def test_one_of_them_inside_a_nested_zip_condemns_no_other_member(
        self, marked: Path, make_zip: MakeZip, report: ReaderReport
    ) -> None:
        path = make_zip({"inner.zip": marked.read_bytes()}, marked.with_name("outer.zip"))
        outer = ZipTree(path, report, ImportLimits())
        with closing(outer), closing(outer.open_nested_zip("inner.zip", report)) as inner:
            assert inner.read_bytes("d.json") == b"three"

    @pytest.mark.parametrize(
        ("limits", "said"),
        [
            (ImportLimits(members=5), "has 2 members, and the limit is 1: split it"),
            (
                ImportLimits(total_bytes=3_000),
                "unpacks to 2,000 bytes, and the limit is 1,000: split it",
            ),
        ],
    )
    def test_what_nested_zips_hold_counts_toward_the_limits_of_the_one_around_them(
        self,
        tmp_path: Path,
        make_zip: MakeZip,
        report: ReaderReport,
        limits: ImportLimits,
        said: str,
    ) -> None:
        inner = make_zip({"a": "x" * 1_000, "b": "y" * 1_000}, tmp_path / "inner.zip").read_bytes()
        path = make_zip({"one.zip": inner, "two.zip": inner}, tmp_path / "outer.zip")
        outer = ZipTree(path, report, limits)
        with closing(outer), pytest.raises(DatasetFormatError, match=said):
            for name in ("one.zip", "two.zip"):
                with closing(outer.open_nested_zip(name, report)) as tree:
                    for member in ("a", "b"):
                        tree.read_bytes(member)

    def test_a_picture_of_such_a_zip_is_read(self, marked: Path) -> None:
        with closing(ArchiveMemberReader()) as archives:
            assert archives.read(marked, "b/1.json", 100) == b"one"
            with pytest.raises(ImageError, match="cannot be read"):
                archives.read(marked, b"caf\xe9\xff.json".decode("cp437"), 100)


class TestPipesAndDevices:
    """Opening a pipe waits for who writes into it; a device may have no end."""

    @pytest.mark.parametrize("name", ["a", "a.zip", "a.json"])
    def test_a_pipe_that_is_named_is_refused_at_once(
        self, tmp_path: Path, report: ReaderReport, name: str
    ) -> None:
        os.mkfifo(tmp_path / name)
        assert open_tree(tmp_path / name, report) is None
        assert report.problems[0].problem == "is not a regular file"
        guess_format(tmp_path / name)

    def test_a_device_is_refused_at_once(self, report: ReaderReport) -> None:
        assert open_tree(Path("/dev/zero"), report) is None
        assert report.problems[0].problem == "is not a regular file"

    def test_a_pipe_in_a_folder_is_left_out(self, tmp_path: Path, report: ReaderReport) -> None:
        os.mkfifo(tmp_path / "Labels-v3.json")
        assert [*read_soccernet_v3(tmp_path, report)] == []
        assert "is not a regular file" in report.problems[0].problem

    def test_a_pipe_in_the_place_of_the_frames_costs_the_frames(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        os.mkfifo(tmp_path / "Frames-v3.zip")
        frames = MatchFrameFinder(
            FolderTree(tmp_path, report, ImportLimits()), "", ["Frames-v3.zip"], report
        )
        assert not frames.has_frames
        assert "Frames-v3.zip" in report.problems[0].path
