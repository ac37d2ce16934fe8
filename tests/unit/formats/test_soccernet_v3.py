from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.formats.file_tree import DEFAULT_LIMITS, ImportLimits
from app.formats.report import ReaderReport
from app.formats.soccernet_v3 import MatchFrameFinder, group_label, parse_image_numbers
from app.formats.trees import open_tree
from app.soccer.group import Media


class TestGroupLabel:
    @pytest.mark.parametrize(
        ("metadata", "time"),
        [
            ({"gameTime": "2 - 05:09"}, " · 05:09 · second half"),
            ({"gameTime": "05:09", "half": 1}, " · 05:09 · first half"),
            ({"gameTime": "05:09"}, " · 05:09"),
            ({}, " · 7"),
            ({"gameTime": [1]}, " · 7"),
        ],
    )
    def test_teams_and_time_of_play(self, match: str, metadata: dict[str, Any], time: str) -> None:
        expected = "Alder Town 3 – 1 Birch Rovers" + time
        assert group_label(match, "7.png", metadata) == expected

    def test_another_folder_name_is_shown_as_it_is(self) -> None:
        assert group_label("a/b/Final", "7.png", {}) == "Final · 7"


class TestImageNumbers:
    def test_actions_and_replays(self) -> None:
        assert parse_image_numbers("7.png") == (7, None)
        assert parse_image_numbers("12_0.png") == (12, 0)
        assert parse_image_numbers("cam3") is None


def _frames(folder: Path, report: ReaderReport) -> MatchFrameFinder:
    tree = open_tree(folder, report)
    assert tree is not None
    return MatchFrameFinder(tree, "", tree.names(), report)


class TestMatchFrames:
    @pytest.mark.parametrize("inside", ["", "v3_frames/", "Frames-v3/", "frames/"])
    def test_members_are_found_wherever_the_archive_has_them(
        self, tmp_path: Path, make_zip: Callable[..., Path], report: ReaderReport, inside: str
    ) -> None:
        path = make_zip({f"{inside}7.png": b"x"}, tmp_path / "Frames-v3.zip")
        frames = _frames(tmp_path, report)
        assert frames.find_frame("7.png") == Media(str(path), f"{inside}7.png")
        assert frames.find_frame("8.png") is None
        assert frames.has_frames

    def test_members_with_backslashes_keep_the_name_by_which_they_are_opened(
        self, tmp_path: Path, make_zip: Callable[..., Path], report: ReaderReport
    ) -> None:
        path = make_zip({"frames\\7.png": b"x"}, tmp_path / "Frames-v3.zip")
        assert _frames(tmp_path, report).find_frame("7.png") == Media(str(path), "frames\\7.png")

    @pytest.mark.parametrize("inside", ["", "v3_frames/", "Frames-v3/", "frames/"])
    def test_loose_frames_are_found_alike(
        self, tmp_path: Path, report: ReaderReport, inside: str
    ) -> None:
        path = tmp_path / inside / "7.png"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"x")
        assert _frames(tmp_path, report).find_frame("7.png") == Media(str(path))

    def test_a_truncated_archive_is_one_problem_and_loose_frames_still_serve(
        self, tmp_path: Path, make_zip: Callable[..., Path], report: ReaderReport
    ) -> None:
        path = make_zip({"7.png": b"x" * 100}, tmp_path / "Frames-v3.zip")
        path.write_bytes(path.read_bytes()[:-30])
        (tmp_path / "8.png").write_bytes(b"x")
        frames = _frames(tmp_path, report)
        assert frames.find_frame("7.png") is None
        assert frames.find_frame("8.png") == Media(str(tmp_path / "8.png"))
        (problem,) = report.problems
        assert problem.path == str(path)
        assert "not a complete zip file" in problem.problem

    def test_a_zip_of_a_whole_dataset_has_its_loose_frames(
        self, make_zip: Callable[..., Path], report: ReaderReport
    ) -> None:
        path = make_zip({"m/frames/7.png": b"x"})
        tree = open_tree(path, report)
        assert tree is not None
        frames = MatchFrameFinder(tree, "m/", ["frames/7.png"], report)
        assert frames.find_frame("7.png") == Media(str(path), "m/frames/7.png")


class TestFramesOfAZippedTree:
    @pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
    def test_the_archive_inside_the_zip_is_read_in_place(
        self, tmp_path: Path, make_zip: Callable[..., Path], report: ReaderReport, compression: int
    ) -> None:
        path = _nested(tmp_path, make_zip, {"v3_frames/7.png": b"x"}, compression)
        frames = _zipped(path, report)
        place = "m/Frames-v3.zip/v3_frames/7.png"
        assert frames.find_frame("7.png") == Media(str(path), place)
        assert frames.find_frame("8.png") is None
        assert report.problems == []

    def test_a_damaged_archive_inside_is_one_problem(
        self, tmp_path: Path, make_zip: Callable[..., Path], report: ReaderReport
    ) -> None:
        path = make_zip({"m/Frames-v3.zip": b"PK nothing", "m/8.png": b"x"})
        frames = _zipped(path, report)
        assert frames.find_frame("8.png") == Media(str(path), "m/8.png")
        (problem,) = report.problems
        assert problem.path == f"{path}/m/Frames-v3.zip"
        assert "without these frames" in problem.problem

    @pytest.mark.parametrize(
        ("limits", "said"),
        [
            (ImportLimits(members=3), "members"),
            (ImportLimits(total_bytes=2_000_000), "unpacks to"),
            (ImportLimits(ratio=1), "grows more"),
        ],
    )
    def test_what_is_inside_counts_toward_the_limits_of_the_whole(
        self,
        tmp_path: Path,
        make_zip: Callable[..., Path],
        report: ReaderReport,
        limits: ImportLimits,
        said: str,
    ) -> None:
        inside = {f"{n}.png": bytes(1_500_000) for n in range(3)}
        path = _nested(tmp_path, make_zip, inside, zipfile.ZIP_STORED)
        frames = _zipped(path, report, limits)
        assert frames.find_frame("1.png") is None
        assert said in report.problems[0].problem

    def test_unsafe_members_inside_are_left_out(
        self, tmp_path: Path, make_zip: Callable[..., Path], report: ReaderReport
    ) -> None:
        path = _nested(tmp_path, make_zip, {"../7.png": b"x", "8.png": b"x"}, zipfile.ZIP_STORED)
        frames = _zipped(path, report)
        assert frames.find_frame("8.png") is not None
        assert [item.record for item in report.problems] == ["../7.png"]

    def test_an_archive_inside_the_archive_is_not_opened(
        self, tmp_path: Path, make_zip: Callable[..., Path], report: ReaderReport
    ) -> None:
        deep = make_zip({"7.png": b"x"}, tmp_path / "deep.zip").read_bytes()
        path = _nested(tmp_path, make_zip, {"Frames-v3.zip": deep}, zipfile.ZIP_STORED)
        assert not _zipped(path, report).has_frames


def _nested(
    tmp_path: Path, make_zip: Callable[..., Path], inside: dict[str, bytes], compression: int
) -> Path:
    """A zip of a tree whose match ``m`` has its frames in a zip of its own."""
    inner = make_zip(inside, tmp_path / "inner.zip")
    path = tmp_path / "upload.zip"
    with zipfile.ZipFile(path, "w", compression) as target:
        target.write(inner, "m/Frames-v3.zip")
    return path


def _zipped(
    path: Path, report: ReaderReport, limits: ImportLimits = DEFAULT_LIMITS
) -> MatchFrameFinder:
    tree = open_tree(path, report, limits)
    assert tree is not None
    inside = [name.removeprefix("m/") for name in tree.names()]
    return MatchFrameFinder(tree, "m/", inside, report)
