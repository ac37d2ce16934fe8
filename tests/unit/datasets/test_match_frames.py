from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from app.datasets.archive import DEFAULT_LIMITS, open_tree
from app.datasets.match_frames import MatchFrames
from app.datasets.report import Report
from app.soccer.group import Media


def _frames(folder: Path, report: Report) -> MatchFrames:
    tree = open_tree(folder, report)
    assert tree is not None
    return MatchFrames(tree, "", tree.names(), report, DEFAULT_LIMITS)


class TestMatchFrames:
    @pytest.mark.parametrize("inside", ["", "v3_frames/", "Frames-v3/", "frames/"])
    def test_members_are_found_wherever_the_archive_has_them(
        self, tmp_path: Path, make_zip: Callable[..., Path], report: Report, inside: str
    ) -> None:
        path = make_zip({f"{inside}7.png": b"x"}, tmp_path / "Frames-v3.zip")
        frames = _frames(tmp_path, report)
        assert frames.find("7.png") == Media(str(path), f"{inside}7.png")
        assert frames.find("8.png") is None
        assert frames.some

    @pytest.mark.parametrize("inside", ["", "v3_frames/", "Frames-v3/", "frames/"])
    def test_loose_frames_are_found_alike(
        self, tmp_path: Path, report: Report, inside: str
    ) -> None:
        path = tmp_path / inside / "7.png"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"x")
        assert _frames(tmp_path, report).find("7.png") == Media(str(path))

    def test_a_truncated_archive_is_one_problem_and_loose_frames_still_serve(
        self, tmp_path: Path, make_zip: Callable[..., Path], report: Report
    ) -> None:
        path = make_zip({"7.png": b"x" * 100}, tmp_path / "Frames-v3.zip")
        path.write_bytes(path.read_bytes()[:-30])
        (tmp_path / "8.png").write_bytes(b"x")
        frames = _frames(tmp_path, report)
        assert frames.find("7.png") is None
        assert frames.find("8.png") == Media(str(tmp_path / "8.png"))
        (problem,) = report.problems
        assert problem.path == str(path)
        assert "not a complete zip file" in problem.problem

    def test_a_zip_of_a_whole_dataset_has_its_loose_frames(
        self, make_zip: Callable[..., Path], report: Report
    ) -> None:
        path = make_zip({"m/frames/7.png": b"x"})
        tree = open_tree(path, report)
        assert tree is not None
        frames = MatchFrames(tree, "m/", ["frames/7.png"], report, DEFAULT_LIMITS)
        assert frames.find("7.png") == Media(str(path), "m/frames/7.png")
