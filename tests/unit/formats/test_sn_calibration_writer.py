from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import InputError, UnsafePathError
from app.formats.cameras import read_cameras
from app.formats.export_record import ExportRecord
from app.formats.report import ReaderReport
from app.formats.sn_calibration import DEFAULT_SIZE, LineFile, line_frame_path
from app.formats.sn_calibration_reader import lines_from_json, read_line_files, read_sn_calibration
from app.formats.sn_calibration_writer import lines_to_json, write_line_files, write_sn_calibration
from app.formats.soccernet_v3 import soccernet_marking_name
from app.geometry.camera import Camera
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station
from app.soccer.pitch import MARKINGS
from tests.cameras import write_cameras

MATCH = "l/s/m"
UNIT = st.floats(-0.5, 1.5)
LINE_FILES = st.dictionaries(
    st.sampled_from([soccernet_marking_name(marking) for marking in MARKINGS] + ["Line unknown"]),
    st.lists(st.fixed_dictionaries({"x": UNIT, "y": UNIT}), min_size=1, max_size=6),
)


Solved = Callable[..., ExportRecord]


Make = Callable[..., Group]


class TestWriteSnCalibration:
    def test_lines_and_cameras_lie_in_folders_of_their_own_and_come_back(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group(split="test")
        counts = write_sn_calibration(tmp_path, [solved(group)])
        assert counts == {"groups": 1, "frames": 2, "cameras": 2}
        again = list(read_sn_calibration(tmp_path, DEFAULT_SIZE, report))
        assert [item.key for item in again] == ["7", "7_1"]
        assert {(item.match, item.split) for item in again} == {(group.match, "test")}
        assert [item.views[0].station for item in again] == [
            Station(item.key, ImageSize(1280, 720), lines=view.station.lines)
            for item, view in zip(again, group.views, strict=True)
        ]
        assert set(read_cameras(tmp_path, report)) == {f"{group.match}/7", f"{group.match}/7_1"}
        assert report.problems == []

    def test_a_split_of_any_name_comes_back_with_the_size_of_its_images(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group(split="fold-3")
        write_sn_calibration(tmp_path, [solved(group)])
        again = list(read_sn_calibration(tmp_path, DEFAULT_SIZE, report))
        assert {(item.split, item.views[0].size) for item in again} == {
            ("fold-3", ImageSize(1280, 720))
        }
        assert [item.views[0].station.lines for item in again] == [
            view.station.lines for view in group.views
        ]
        for folder in (tmp_path, tmp_path / "lines", tmp_path / "lines/fold-3-1280x720"):
            files = read_line_files(folder, DEFAULT_SIZE, report, by_folder=True)
            assert [file.size for file in files] == [ImageSize(1280, 720)] * 2, folder
        assert report.problems == []
        assert len(report.remarks) == 1 and '"fold-3"' in report.remarks[0]

    def test_a_folder_of_other_people_says_neither_split_nor_size(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        folder = tmp_path / "lines/clips-1920x1080"
        folder.mkdir(parents=True)
        (folder / "1.json").write_text('{"Middle line": [{"x": 0.5, "y": 0.5}]}')
        (tmp_path / "match_info.json").write_text('{"lines/clips-1920x1080/1.jpg": "m"}')
        (group,) = read_sn_calibration(tmp_path, DEFAULT_SIZE, report)
        assert (group.split, group.views[0].size) == ("", DEFAULT_SIZE)
        (file,) = read_line_files(tmp_path / "lines", DEFAULT_SIZE, report, by_folder=True)
        assert file.size == DEFAULT_SIZE

    def test_a_folder_holds_nothing_but_frames_of_one_split_and_one_size(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        small = soccer_group("9.png", replays=0, split="test")
        station = replace(small.views[0].station, size=ImageSize(960, 540))
        small = replace(small, views=(replace(small.views[0], station=station),))
        groups = [soccer_group(split="test"), small, soccer_group("8.png", split="")]
        write_sn_calibration(tmp_path, map(solved, groups))
        folders = ["test-1280x720", "test-960x540", "unassigned-1280x720"]
        for part, prefix in (("lines", ""), ("cameras", "camera_")):
            assert sorted(path.name for path in (tmp_path / part).iterdir()) == folders
            files = [path.name for path in (tmp_path / part / folders[0]).iterdir()]
            assert len(files) == 2
            # The evaluator cuts a name at its first dot and takes no folders.
            assert all(re.fullmatch(prefix + r"[0-9a-f]{12}_7(_1)?\.json", name) for name in files)

    def test_what_came_from_sn_calibration_keeps_its_name(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        for split in ("train", "valid"):
            write_line_files(tmp_path / "in", [LineFile(f"{split}/00002", DEFAULT_SIZE, {})])
        first = list(read_sn_calibration(tmp_path / "in", DEFAULT_SIZE, report))
        (tmp_path / "out").mkdir()
        write_sn_calibration(tmp_path / "out", [solved(group) for group in first])
        names = sorted(
            str(path.relative_to(tmp_path / "out")) for path in tmp_path.glob("out/l*/*/*")
        )
        assert names == ["lines/train-960x540/00002.json", "lines/valid-960x540/00002.json"]
        assert list(read_sn_calibration(tmp_path / "out", ImageSize(9, 9), report)) == first
        assert sorted(read_cameras(tmp_path / "out", report)) == ["train/00002", "valid/00002"]

    def test_two_frames_of_one_name_are_refused(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        view = soccer_group(replays=0).views[0]
        keys = ("00002", "valid/00002")
        groups = [Group(key, (replace(view, key=key),), split="valid") for key in keys]
        with pytest.raises(InputError, match="would both be called valid-1280x720/00002"):
            write_sn_calibration(tmp_path, map(solved, groups))

    def test_two_frames_that_differ_in_their_ending_are_refused_and_none_is_dropped(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        view = soccer_group(replays=0).views[0]
        groups = [Group(key, (replace(view, key=key),)) for key in ("a/7.png", "a/7.jpg")]
        with pytest.raises(InputError, match=r"two frames .*a/7\.png and a/7\.jpg"):
            write_sn_calibration(tmp_path, map(solved, groups))

    def test_the_layout_of_before_is_read_all_the_same(
        self, tmp_path: Path, soccer_group: Make, camera: Camera, report: ReaderReport
    ) -> None:
        view = soccer_group(replays=0).views[0]
        write_line_files(tmp_path, [LineFile(f"{MATCH}/7", view.size, view.station.lines)])
        write_cameras(tmp_path, {f"{MATCH}/7": camera})
        (tmp_path / "match_info.json").write_text(json.dumps({f"{MATCH}/7.jpg": {"match": MATCH}}))
        (group,) = read_sn_calibration(tmp_path, view.size, report)
        assert (group.key, group.match, group.views[0].station.lines) == (
            "7",
            MATCH,
            view.station.lines,
        )
        assert list(read_cameras(tmp_path, report)) == [f"{MATCH}/7"]


class TestTheFramesOfAnExport:
    def test_they_lie_beside_their_lines_where_they_are_found(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group(replays=0)
        write_sn_calibration(tmp_path, [solved(group)])
        place = tmp_path / line_frame_path(group, group.views[0], "train", ".png")
        place.write_bytes(b"x")
        (again,) = read_sn_calibration(tmp_path, DEFAULT_SIZE, report)
        assert again.views[0].media == Media(str(place))

    def test_those_of_a_static_camera_lie_by_its_match(self, issia_group: Make) -> None:
        group = issia_group()
        assert line_frame_path(group, group.views[0], "", ".jpg") == "issia/Frames-v3/cam3/358.jpg"


class TestLinesToJson:
    def test_the_formats_own_spelling_is_written(self) -> None:
        lines = make_lines({"Goal left post left": [(1.0, 2.0)]})
        assert list(lines_to_json(lines, DEFAULT_SIZE)) == ["Goal left post left "]

    def test_points_far_outside_make_a_file_in_pixels(self, report: ReaderReport) -> None:
        lines = make_lines({"Middle line": [(5000.0, 1.0), (3.0, 4.0)]})
        value = lines_to_json(lines, DEFAULT_SIZE)
        assert value["Middle line"][0] == {"x": 5000.0, "y": 1.0}
        assert lines_from_json(value, DEFAULT_SIZE, "f", report)[0] == lines

    @given(LINE_FILES, st.sampled_from([DEFAULT_SIZE, ImageSize(1280, 720), ImageSize(854, 480)]))
    def test_import_export_import_gives_the_same_lines(
        self, value: dict[str, Any], size: ImageSize
    ) -> None:
        report = ReaderReport()
        first = lines_from_json(value, size, "f", report)
        text = json.dumps(lines_to_json(first[0], size, first[1]))
        assert lines_from_json(json.loads(text), size, "f", report) == first
        assert report.problems == []


class TestWriteLineFiles:
    def test_what_is_written_is_read_the_same(self, tmp_path: Path, report: ReaderReport) -> None:
        lines = make_lines({"Middle line": [(0.0, 0.0), (959.0, 539.0)]})
        others = ({"class": "Line unknown", "points": [0.0, 539.0]},)
        files = [LineFile("a/00002", DEFAULT_SIZE, lines, others)]
        write_line_files(tmp_path, files)
        (again,) = read_line_files(tmp_path, DEFAULT_SIZE, report)
        assert (again.lines, again.others) == (lines, others)

    def test_a_stem_that_leaves_the_folder_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(UnsafePathError):
            write_line_files(tmp_path, [LineFile("../a", DEFAULT_SIZE, make_lines({}))])
