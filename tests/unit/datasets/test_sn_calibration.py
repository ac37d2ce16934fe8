from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.datasets.report import Report
from app.datasets.sn_calibration import (
    DEFAULT_SIZE,
    LineFile,
    lines_from_json,
    lines_to_json,
    read_line_files,
    spelling,
    write_line_files,
)
from app.datasets.sn_calibration_groups import read_sn_calibration
from app.errors import DatasetFormatError, UnsafePathError
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.soccer.group import Media
from app.soccer.pitch import MARKINGS

LINE = [{"x": 0.25, "y": 0.5}, {"x": 1.0, "y": -0.125}]

UNIT = st.floats(-0.5, 1.5)
LINE_FILES = st.dictionaries(
    st.sampled_from([spelling(marking) for marking in MARKINGS] + ["Line unknown"]),
    st.lists(st.fixed_dictionaries({"x": UNIT, "y": UNIT}), min_size=1, max_size=6),
)


class TestLinesFromJson:
    def test_normalised_points_scale_by_size_less_one(self, report: Report) -> None:
        lines, _ = lines_from_json({"Middle line": LINE}, ImageSize(961, 541), "f", report)
        assert lines["Middle line"] == ((240.0, 270.0), (960.0, -67.5))

    def test_a_file_with_any_coordinate_above_two_is_in_pixels(self, report: Report) -> None:
        value = {"Middle line": [{"x": 1.5, "y": 0.5}, {"x": 640, "y": 2}]}
        lines, _ = lines_from_json(value, DEFAULT_SIZE, "f", report)
        assert lines["Middle line"] == ((1.5, 0.5), (640.0, 2.0))

    def test_a_trailing_space_does_not_matter(self, report: Report) -> None:
        lines, _ = lines_from_json({"Goal left post left ": LINE}, DEFAULT_SIZE, "f", report)
        assert list(lines) == ["Goal left post left"]

    def test_both_spellings_of_one_marking_are_joined(self, report: Report) -> None:
        value = {"Goal left post left ": LINE, "Goal left post left": LINE}
        lines, _ = lines_from_json(value, DEFAULT_SIZE, "f", report)
        assert len(lines["Goal left post left"]) == 4

    def test_a_line_without_geometry_is_kept_silently(self, report: Report) -> None:
        lines, others = lines_from_json({"Line unknown": LINE}, ImageSize(961, 541), "f", report)
        assert not lines
        assert others == ({"class": "Line unknown", "points": [240.0, 270.0, 960.0, -67.5]},)
        assert report.problems == []

    def test_an_unknown_marking_is_reported_and_kept_beside_the_rest(self, report: Report) -> None:
        value = {"Corner flag": LINE, "Middle line": LINE}
        lines, others = lines_from_json(value, DEFAULT_SIZE, "a.json", report)
        assert list(lines) == ["Middle line"]
        assert others[0]["class"] == "Corner flag"
        assert (report.problems[0].path, report.problems[0].field) == ("a.json", "Corner flag")

    @pytest.mark.parametrize(
        "line", [5, [5], [{"x": 1}], [{"x": "a", "y": 1}], [{"x": None, "y": 1}], "text"]
    )
    def test_an_unreadable_line_is_reported_and_the_rest_kept(
        self, report: Report, line: Any
    ) -> None:
        value = {"Circle left": line, "Middle line": LINE}
        lines, _ = lines_from_json(value, DEFAULT_SIZE, "a.json", report)
        assert list(lines) == ["Middle line"]
        assert [problem.field for problem in report.problems] == ["Circle left"]

    def test_a_list_is_no_line_file(self, report: Report) -> None:
        with pytest.raises(DatasetFormatError, match="not an object"):
            lines_from_json([], DEFAULT_SIZE, "f", report)


class TestLinesToJson:
    def test_the_formats_own_spelling_is_written(self) -> None:
        lines = make_lines({"Goal left post left": [(1.0, 2.0)]})
        assert list(lines_to_json(lines, DEFAULT_SIZE)) == ["Goal left post left "]

    def test_points_far_outside_make_a_file_in_pixels(self, report: Report) -> None:
        lines = make_lines({"Middle line": [(5000.0, 1.0), (3.0, 4.0)]})
        value = lines_to_json(lines, DEFAULT_SIZE)
        assert value["Middle line"][0] == {"x": 5000.0, "y": 1.0}
        assert lines_from_json(value, DEFAULT_SIZE, "f", report)[0] == lines

    @given(LINE_FILES, st.sampled_from([DEFAULT_SIZE, ImageSize(1280, 720), ImageSize(854, 480)]))
    def test_import_export_import_gives_the_same_lines(
        self, value: dict[str, Any], size: ImageSize
    ) -> None:
        report = Report()
        first = lines_from_json(value, size, "f", report)
        text = json.dumps(lines_to_json(first[0], size, first[1]))
        assert lines_from_json(json.loads(text), size, "f", report) == first
        assert report.problems == []


class TestReadLineFiles:
    def test_a_zip_is_read_by_name_without_cameras_and_match_infos(
        self, make_zip: Callable[..., Path], report: Report
    ) -> None:
        text = json.dumps({"Middle line": LINE})
        path = make_zip(
            {"00005.json": text, "00002.json": text, "camera_00002.json": "{}",
             "match_info.json": "{}", "00002.jpg": b"x"}
        )  # fmt: skip
        files = list(read_line_files(path, DEFAULT_SIZE, report))
        assert [file.stem for file in files] == ["00002", "00005"]
        assert files[0].media == Media(str(path), "00002.jpg")
        assert files[1].media is None
        assert (report.read, report.imported) == (2, 2)

    def test_a_folder_is_read_alike(self, tmp_path: Path, report: Report) -> None:
        (tmp_path / "test").mkdir()
        (tmp_path / "test" / "00002.json").write_text(json.dumps({"Middle line": LINE}))
        (tmp_path / "test" / "00002.png").write_bytes(b"x")
        (file,) = read_line_files(tmp_path, DEFAULT_SIZE, report)
        assert file.stem == "00002"
        assert file.media == Media(str(tmp_path / "test" / "00002.png"))

    def test_equal_stems_in_two_folders_keep_their_folder(
        self, make_zip: Callable[..., Path], report: Report
    ) -> None:
        path = make_zip({"test/1.json": "{}", "train/1.json": "{}"})
        stems = [file.stem for file in read_line_files(path, DEFAULT_SIZE, report)]
        assert stems == ["test/1", "train/1"]

    def test_a_broken_file_is_reported_and_the_rest_read(
        self, make_zip: Callable[..., Path], report: Report
    ) -> None:
        path = make_zip({"1.json": '{"Middle line": [', "2.json": "[]", "3.json": "{}"})
        assert [file.stem for file in read_line_files(path, DEFAULT_SIZE, report)] == ["3"]
        assert (report.read, report.imported, len(report.problems)) == (3, 1, 2)


class TestReadSnCalibration:
    def test_each_frame_is_a_group_of_one_view(self, tmp_path: Path, report: Report) -> None:
        (tmp_path / "00002.json").write_text(
            json.dumps({"Middle line": LINE, "Line unknown": LINE})
        )
        (group,) = read_sn_calibration(tmp_path, DEFAULT_SIZE, report)
        (view,) = group.views
        assert (group.key, view.key, view.station.key) == ("00002", "00002", "00002")
        assert list(view.station.lines) == ["Middle line"]
        assert view.extras.lines[0]["class"] == "Line unknown"
        assert view.size == DEFAULT_SIZE


class TestWriteLineFiles:
    def test_what_is_written_is_read_the_same(self, tmp_path: Path, report: Report) -> None:
        lines = make_lines({"Middle line": [(0.0, 0.0), (959.0, 539.0)]})
        others = ({"class": "Line unknown", "points": [0.0, 539.0]},)
        files = [LineFile("a/00002", DEFAULT_SIZE, lines, others)]
        write_line_files(tmp_path, files)
        (again,) = read_line_files(tmp_path, DEFAULT_SIZE, report)
        assert (again.lines, again.others) == (lines, others)

    def test_a_stem_that_leaves_the_folder_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(UnsafePathError):
            write_line_files(tmp_path, [LineFile("../a", DEFAULT_SIZE, make_lines({}))])
