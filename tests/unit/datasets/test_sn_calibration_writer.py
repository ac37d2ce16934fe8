from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.datasets.cameras_reader import read_cameras
from app.datasets.export_record import ExportRecord
from app.datasets.report import Report
from app.datasets.sn_calibration import DEFAULT_SIZE, LineFile, spelling
from app.datasets.sn_calibration_reader import lines_from_json, read_line_files
from app.datasets.sn_calibration_writer import lines_to_json, write_line_files, write_sn_calibration
from app.errors import UnsafePathError
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group
from app.soccer.pitch import MARKINGS

UNIT = st.floats(-0.5, 1.5)
LINE_FILES = st.dictionaries(
    st.sampled_from([spelling(marking) for marking in MARKINGS] + ["Line unknown"]),
    st.lists(st.fixed_dictionaries({"x": UNIT, "y": UNIT}), min_size=1, max_size=6),
)


Solved = Callable[..., ExportRecord]


Make = Callable[..., Group]


class TestWriteSnCalibration:
    def test_lines_and_cameras_lie_beside_each_other_and_come_back(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: Report
    ) -> None:
        group = soccer_group()
        counts = write_sn_calibration(tmp_path, [solved(group)])
        assert counts == {"groups": 1, "frames": 2, "cameras": 2}
        files = list(read_line_files(tmp_path, ImageSize(1280, 720), report))
        assert [file.stem for file in files] == ["7", "7_1"]
        assert [file.lines for file in files] == [view.station.lines for view in group.views]
        assert len(read_cameras(tmp_path, report)) == 2


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
