from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.errors import DatasetFormatError
from app.formats.report import ReaderReport
from app.formats.sn_calibration import DEFAULT_SIZE, NO_FRAMES
from app.formats.sn_calibration_reader import lines_from_json, read_line_files, read_sn_calibration
from app.soccer.frames import ImageSize
from app.soccer.group import Media

LINE = [{"x": 0.25, "y": 0.5}, {"x": 1.0, "y": -0.125}]
NAMED_WITH_SPACE = json.dumps(
    {"Goal left post left ": [{"x": 0.5, "y": 0.5}, {"x": 0.5, "y": 1.125}]}
)


class TestLinesFromJson:
    def test_normalised_points_scale_by_size_less_one(self, report: ReaderReport) -> None:
        lines, _ = lines_from_json({"Middle line": LINE}, ImageSize(961, 541), "f", report)
        assert lines["Middle line"] == ((240.0, 270.0), (960.0, -67.5))

    def test_a_file_with_half_of_its_points_beyond_two_is_in_pixels(
        self, report: ReaderReport
    ) -> None:
        value = {"Middle line": [{"x": 1.5, "y": 0.5}, {"x": 640, "y": 2}]}
        lines, _ = lines_from_json(value, DEFAULT_SIZE, "f", report)
        assert lines["Middle line"] == ((1.5, 0.5), (640.0, 2.0))

    def test_a_trailing_space_does_not_matter(self, report: ReaderReport) -> None:
        lines, _ = lines_from_json({"Goal left post left ": LINE}, DEFAULT_SIZE, "f", report)
        assert list(lines) == ["Goal left post left"]

    def test_both_spellings_of_one_marking_are_joined(self, report: ReaderReport) -> None:
        value = {"Goal left post left ": LINE, "Goal left post left": LINE}
        lines, _ = lines_from_json(value, DEFAULT_SIZE, "f", report)
        assert len(lines["Goal left post left"]) == 4

    def test_a_line_without_geometry_is_kept_silently(self, report: ReaderReport) -> None:
        lines, others = lines_from_json({"Line unknown": LINE}, ImageSize(961, 541), "f", report)
        assert not lines
        assert others == ({"class": "Line unknown", "points": [240.0, 270.0, 960.0, -67.5]},)
        assert report.problems == []

    def test_an_unknown_marking_is_reported_and_kept_beside_the_rest(
        self, report: ReaderReport
    ) -> None:
        value = {"Corner flag": LINE, "Middle line": LINE}
        lines, others = lines_from_json(value, DEFAULT_SIZE, "a.json", report)
        assert list(lines) == ["Middle line"]
        assert others[0]["class"] == "Corner flag"
        assert (report.problems[0].path, report.problems[0].field) == ("a.json", "Corner flag")

    @pytest.mark.parametrize(
        "line", [5, [5], [{"x": 1}], [{"x": "a", "y": 1}], [{"x": None, "y": 1}], "text"]
    )
    def test_an_unreadable_line_is_reported_and_the_rest_kept(
        self, report: ReaderReport, line: Any
    ) -> None:
        value = {"Circle left": line, "Middle line": LINE}
        lines, _ = lines_from_json(value, DEFAULT_SIZE, "a.json", report)
        assert list(lines) == ["Middle line"]
        assert [problem.field for problem in report.problems] == ["Circle left"]

    def test_one_far_point_does_not_make_a_normalised_file_one_of_pixels(
        self, report: ReaderReport
    ) -> None:
        value = {"Middle line": [*LINE, {"x": 2.31, "y": 0.2}], "Circle left": LINE}
        lines, _ = lines_from_json(value, ImageSize(961, 541), "a.json", report)
        assert lines["Middle line"] == ((240.0, 270.0), (960.0, -67.5))
        (problem,) = report.problems
        assert (problem.path, problem.field) == ("a.json", "Middle line")
        assert "(2.31, 0.2) is far outside" in problem.problem
        assert "point 3 is left out" in problem.problem

    @pytest.mark.parametrize("far", [2.5, 900.0, -1e5])
    def test_points_near_the_corner_of_a_file_of_pixels_are_pixels(
        self, report: ReaderReport, far: float
    ) -> None:
        value = {"Middle line": [{"x": 0.5, "y": 1.5}, {"x": 300, "y": 2}, {"x": far, "y": 400}]}
        lines, _ = lines_from_json(value, DEFAULT_SIZE, "f", report)
        assert lines["Middle line"] == ((0.5, 1.5), (300.0, 2.0), (far, 400.0))
        assert report.problems == []

    @pytest.mark.parametrize("bad", [float("nan"), float("inf"), None, "a", 1e300])
    def test_a_bad_number_costs_its_own_point_alone(self, report: ReaderReport, bad: Any) -> None:
        value = {"Middle line": [LINE[0], {"x": bad, "y": 0.5}, LINE[1]]}
        lines, _ = lines_from_json(value, ImageSize(961, 541), "a.json", report)
        assert lines["Middle line"] == ((240.0, 270.0), (960.0, -67.5))
        (problem,) = report.problems
        assert problem.field == "Middle line"
        assert problem.problem.endswith("; point 2 is left out")

    @pytest.mark.parametrize(
        "name", ["Goal_left_post_left", "goal left post left", "Goal left post left "]
    )
    def test_capitals_and_underscores_do_not_matter(self, report: ReaderReport, name: str) -> None:
        lines, _ = lines_from_json({name: LINE}, DEFAULT_SIZE, "f", report)
        assert list(lines) == ["Goal left post left"]

    def test_pairs_are_points(self, report: ReaderReport) -> None:
        value = {"Middle line": [[0.25, 0.5], [1.0, -0.125]]}
        lines, _ = lines_from_json(value, ImageSize(961, 541), "f", report)
        assert lines["Middle line"] == ((240.0, 270.0), (960.0, -67.5))

    def test_a_list_is_no_line_file(self, report: ReaderReport) -> None:
        with pytest.raises(DatasetFormatError, match="not an object"):
            lines_from_json([], DEFAULT_SIZE, "f", report)


class TestReadLineFiles:
    @pytest.mark.parametrize("name", NO_FRAMES)
    def test_what_lies_beside_frames_is_none(
        self, tmp_path: Path, report: ReaderReport, name: str
    ) -> None:
        (tmp_path / "00001.json").write_text('{"Middle line": [{"x": 0.5, "y": 0.5}]}')
        (tmp_path / name).write_text("{}")
        assert [file.stem for file in read_line_files(tmp_path, DEFAULT_SIZE, report)] == ["00001"]
        assert (report.read, report.problems) == (1, [])

    def test_a_zip_is_read_by_name_without_cameras_and_match_infos(
        self, make_zip: Callable[..., Path], report: ReaderReport
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

    def test_a_folder_is_read_alike(self, tmp_path: Path, report: ReaderReport) -> None:
        (tmp_path / "test").mkdir()
        (tmp_path / "test" / "00002.json").write_text(json.dumps({"Middle line": LINE}))
        (tmp_path / "test" / "00002.png").write_bytes(b"x")
        (file,) = read_line_files(tmp_path, DEFAULT_SIZE, report)
        assert file.stem == "00002"
        assert file.media == Media(str(tmp_path / "test" / "00002.png"))

    def test_equal_stems_in_two_folders_keep_their_folder(
        self, make_zip: Callable[..., Path], report: ReaderReport
    ) -> None:
        path = make_zip({"test/1.json": "{}", "train/1.json": "{}"})
        stems = [file.stem for file in read_line_files(path, DEFAULT_SIZE, report)]
        assert stems == ["test/1", "train/1"]

    def test_a_broken_file_is_reported_and_the_rest_read(
        self, make_zip: Callable[..., Path], report: ReaderReport
    ) -> None:
        path = make_zip({"1.json": '{"Middle line": [', "2.json": "[]", "3.json": "{}"})
        assert [file.stem for file in read_line_files(path, DEFAULT_SIZE, report)] == ["3"]
        assert (report.read, report.imported, len(report.problems)) == (3, 1, 2)

    @pytest.mark.parametrize(
        "value",
        [
            {
                "00001.jpg": {"Middle line": LINE},
                "test/00002.png": {"lines": {"Middle line": LINE}},
            },
            [
                {"file_name": "00001.jpg", "lines": {"Middle line": LINE}},
                {"image": "00002.jpg", "annotations": [{"class": "Middle line", "points": LINE}]},
            ],
        ],
        ids=["object", "list"],
    )
    def test_a_file_may_hold_many_images(
        self, tmp_path: Path, report: ReaderReport, value: Any
    ) -> None:
        (tmp_path / "lines.json").write_text(json.dumps(value))
        (tmp_path / "00001.jpg").write_bytes(b"x")
        first, second = read_line_files(tmp_path, DEFAULT_SIZE, report)
        assert [first.stem, second.stem] == ["00001", "00002"]
        assert first.media == Media(str(tmp_path / "00001.jpg"))
        assert first.lines == second.lines
        assert (report.read, report.imported, report.problems) == (2, 2, [])

    def test_lines_inside_an_object_are_of_the_size_that_it_says(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        value = {"image": "00001.jpg", "width": 1281, "height": 721, "lines": {"Middle line": LINE}}
        (tmp_path / "00001.json").write_text(json.dumps(value))
        (own,) = read_line_files(tmp_path, DEFAULT_SIZE, report, by_folder=True)
        (usual,) = read_line_files(tmp_path, DEFAULT_SIZE, report)
        assert (own.size, own.lines["Middle line"][0]) == (ImageSize(1281, 721), (320.0, 360.0))
        assert usual.size == DEFAULT_SIZE
        assert usual.lines["Middle line"][0] == pytest.approx(DEFAULT_SIZE.unit_to_pixel(0.25, 0.5))

    def test_pixels_of_another_size_are_scaled_about_the_corner_of_the_first_pixel(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        line = [{"x": -0.5, "y": 539.5}, {"x": 100, "y": 100}]
        lines = {"Middle line": line, "Line unknown": line}
        value = {"image": "00001.jpg", "width": 960, "height": 540, "lines": lines}
        (tmp_path / "00001.json").write_text(json.dumps(value))
        (file,) = read_line_files(tmp_path, ImageSize(1920, 1080), report)
        assert file.size == ImageSize(1920, 1080)
        assert file.lines["Middle line"] == ((-0.5, 1079.5), (200.5, 200.5))
        assert file.others[0]["points"] == [-0.5, 1079.5, 200.5, 200.5]
        (same,) = read_line_files(tmp_path, ImageSize(960, 540), report)
        assert same.lines["Middle line"] == ((-0.5, 539.5), (100.0, 100.0))

    def test_a_bad_image_of_many_is_named_and_the_others_are_read(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        value = {"1.jpg": {"Middle line": LINE}, "2.jpg": None}
        (tmp_path / "all.json").write_text(json.dumps(value))
        assert [file.stem for file in read_line_files(tmp_path, DEFAULT_SIZE, report)] == ["1"]
        assert (report.read, report.problems[0].record) == (2, "2.jpg")

    @pytest.mark.parametrize(
        ("value", "what"),
        [
            ({"kp": {"3": {"x": 0.4, "y": 0.2, "p": 0.7}}, "lines": {}}, "keypoints"),
            ({"lines": {"1": {"x_1": 0.1}}}, 'an object with "lines"'),
            ({"pan_degrees": 1.0}, "holds a camera: import it as cameras"),
            ({"images": [], "annotations": []}, "COCO document"),
            ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], "homography"),
            ({"Corner flag": LINE}, 'an object with "Corner flag"'),
            ([], "is a list of 0 values"),
            ("text", "not an object"),
        ],
    )
    def test_a_file_that_holds_no_lines_says_what_it_is(
        self, tmp_path: Path, report: ReaderReport, value: Any, what: str
    ) -> None:
        (tmp_path / "00001.json").write_text(json.dumps(value))
        assert list(read_line_files(tmp_path, DEFAULT_SIZE, report)) == []
        (problem,) = report.problems
        assert what in problem.problem
        assert 'lines are {"Side line top"' in problem.problem
        assert report.read == 1


class TestReadSnCalibration:
    def test_each_frame_is_a_group_of_one_view(self, tmp_path: Path, report: ReaderReport) -> None:
        (tmp_path / "00002.json").write_text(
            json.dumps({"Middle line": LINE, "Line unknown": LINE})
        )
        (group,) = read_sn_calibration(tmp_path, DEFAULT_SIZE, report)
        (view,) = group.views
        assert (group.key, view.key, view.station.key) == ("00002", "00002", "00002")
        assert list(view.station.lines) == ["Middle line"]
        assert view.extras.lines[0]["class"] == "Line unknown"
        assert view.size == DEFAULT_SIZE

    def test_the_match_the_split_and_the_record_of_an_image(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        for split in ("train", "test"):
            (tmp_path / split).mkdir()
            (tmp_path / split / "00001.json").write_text(NAMED_WITH_SPACE)
            info = {"00001.jpg": {"league": "l", "season": "s", "match": split, "half": 1}}
            (tmp_path / split / "match_info.json").write_text(json.dumps(info))
        groups = {group.key: group for group in read_sn_calibration(tmp_path, DEFAULT_SIZE, report)}
        assert set(groups) == {"train/00001", "test/00001"}
        first = groups["train/00001"]
        assert (first.match, first.split, first.label) == (
            "l/s/train",
            "train",
            "train · frame 00001",
        )
        assert first.views[0].extras.metadata["match_info"]["half"] == 1
        assert report.problems == []

    def test_the_name_with_a_space_and_points_outside_are_kept(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        (tmp_path / "00001.json").write_text(NAMED_WITH_SPACE)
        (group,) = read_sn_calibration(tmp_path, DEFAULT_SIZE, report)
        (points,) = group.views[0].station.lines.values()
        assert list(group.views[0].station.lines) == ["Goal left post left"]
        assert points[1].y == 1.125 * 539
        assert (group.match, group.label) == ("", "Frame 00001")
