from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.errors import InputError
from app.formats.cameras import read_cameras
from app.formats.export_record import ExportRecord
from app.formats.issia_3d import open_issia_3d, write_issia_3d
from app.formats.issia_reader import IssiaOptions
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.soccer.frames import ImagePoint
from app.soccer.group import Group

HEAD = ",frame,x_cam1,y_cam1,x_cam3,y_cam3,num_cameras,ball_3D,cam_list\n"


@pytest.fixture
def folder(tmp_path: Path, camera_json: dict[str, Any]) -> Path:
    calibration = json.dumps(json.dumps({"cam3": camera_json}))
    (tmp_path / "issia_calibration.json").write_text(calibration)
    rows = '0,358,100.5,50,300,60.25,2,"[1.0, 2.0, -0.1]","[1, 3]"\n1,12.0,,,7,8,1,nan,[3]\n'
    (tmp_path / "ISSIA-3D.csv").write_text("\ufeff" + HEAD + rows)
    return tmp_path


class TestOpenIssia3d:
    def test_each_camera_with_both_coordinates_annotates_the_ball(
        self, folder: Path, report: ReaderReport
    ) -> None:
        first, second = open_issia_3d(folder, IssiaOptions(), report).groups()
        assert (first.key, second.key) == ("12", "358")
        assert [view.key for view in second.views] == ["cam1", "cam3"]
        assert second.views[0].balls[0].point == ImagePoint(100.5, 50.0)
        assert (first.split, second.split) == ("train", "")
        assert report.problems == []
        assert (report.read, report.imported) == (2, 2)

    def test_a_camera_is_one_station_with_what_was_given(
        self, folder: Path, report: ReaderReport
    ) -> None:
        first, second = open_issia_3d(folder, IssiaOptions(), report).groups()
        station = second.views[1].station
        assert first.views[0].station is station
        assert station.given is not None
        assert second.views[0].station.given is None

    def test_half_a_point_a_second_row_and_no_frame_are_reported(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        rows = "0,5,1,,2,3,1,,\n1,5,4,5,,,1,,\n2,x,4,5,,,1,,\n"
        (tmp_path / "ISSIA-3D.csv").write_text(HEAD + rows)
        (group,) = open_issia_3d(tmp_path, IssiaOptions(), report).groups()
        assert [view.key for view in group.views] == ["cam3"]
        assert [(item.record, item.field) for item in report.problems] == [
            ("line 2", "cam1"), ("line 3", "frame"), ("line 4", "frame"),
        ]  # fmt: skip

    def test_a_folder_without_the_table_says_so(self, tmp_path: Path, report: ReaderReport) -> None:
        assert list(open_issia_3d(tmp_path, IssiaOptions(), report).groups()) == []
        assert "contains no ISSIA-3D.csv" in report.problems[0].problem


Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]


def _rows(root: Path) -> list[dict[str, str]]:
    with (root / "ISSIA-3D.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


class TestWriteIssia3d:
    def test_the_columns_are_the_released_ones(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        write_issia_3d(tmp_path, [solved(issia_group())])
        assert (tmp_path / "ISSIA-3D.csv").read_text().splitlines()[0] == (
            ",frame,x_cam1,y_cam1,x_cam2,y_cam2,x_cam3,y_cam3,x_cam4,y_cam4,x_cam5,y_cam5,"
            "x_cam6,y_cam6,num_cameras,ball_3D,err_cam1,err_cam2,err_cam3,err_cam4,err_cam5,"
            "err_cam6,cam_list,opt_d_cam1,opt_d_cam2,opt_d_cam3,opt_d_cam4,opt_d_cam5,opt_d_cam6,"
            "opt_e_cam1,opt_e_cam2,opt_e_cam3,opt_e_cam4,opt_e_cam5,opt_e_cam6"
        )

    def test_a_row_has_the_values_of_its_frame(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        counts = write_issia_3d(tmp_path, [solved(issia_group())])
        (row,) = _rows(tmp_path)
        assert {name: value for name, value in row.items() if value} == {
            "": "0", "frame": "358", "x_cam3": "300.0", "y_cam3": "50.5", "x_cam4": "400.0",
            "y_cam4": "50.5", "num_cameras": "2", "ball_3D": "[1.5, -2.25, -0.113]",
            "err_cam3": "0.75", "err_cam4": "0.75", "cam_list": "[3, 4]", "opt_d_cam3": "10.5",
            "opt_d_cam4": "10.5", "opt_e_cam3": "0.125", "opt_e_cam4": "0.125",
        }  # fmt: skip
        assert counts == {"groups": 1, "points": 1, "balls": 2}

    def test_every_annotating_camera_has_values_once_there_is_a_point(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        write_issia_3d(tmp_path, [solved(issia_group(cameras=(1, 2, 3)))])
        (row,) = _rows(tmp_path)
        assert row["err_cam3"] == "0.75"

    def test_without_a_point_there_are_no_values(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        counts = write_issia_3d(tmp_path, [solved(issia_group(cameras=(5,)), ball=False)])
        (row,) = _rows(tmp_path)
        assert (row["num_cameras"], row["cam_list"], row["ball_3D"]) == ("1", "[5]", "")
        assert not any(row[f"{name}_cam5"] for name in ("err", "opt_d", "opt_e"))
        assert counts == {"groups": 1, "points": 0, "balls": 0}

    def test_rows_come_by_number_of_the_frame(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        write_issia_3d(tmp_path, [solved(issia_group(frame)) for frame in (1000, 99, 358)])
        assert [(row[""], row["frame"]) for row in _rows(tmp_path)] == [
            ("0", "99"), ("1", "358"), ("2", "1000"),
        ]  # fmt: skip

    def test_a_frame_whose_balls_were_removed_has_no_row(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        group = issia_group()
        views = tuple(replace(view, balls=()) for view in group.views)
        assert write_issia_3d(tmp_path, [solved(replace(group, views=views))])["groups"] == 0

    def test_everything_adds_the_verdict_as_last_column(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        write_issia_3d(tmp_path, [solved(issia_group(), verdict="unreviewed")], everything=True)
        (row,) = _rows(tmp_path)
        assert list(row.items())[-1] == ("verdict", "unreviewed")

    def test_the_cameras_come_back(
        self,
        tmp_path: Path,
        solved: Solved,
        issia_group: Make,
        camera: Camera,
        report: ReaderReport,
    ) -> None:
        write_issia_3d(tmp_path, [solved(issia_group())])
        cameras = read_cameras(tmp_path / "issia_calibration.json", report)
        assert cameras == {"cam3": camera, "cam4": camera}

    def test_groups_of_other_datasets_are_refused(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        with pytest.raises(InputError, match="cannot be from ISSIA"):
            write_issia_3d(tmp_path, [solved(soccer_group())])
