from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from app.formats.issia_3d_reader import open_issia_3d
from app.formats.issia_reader import IssiaOptions
from app.formats.report import Report
from app.soccer.frames import ImagePoint

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
        self, folder: Path, report: Report
    ) -> None:
        first, second = open_issia_3d(folder, IssiaOptions(), report).groups()
        assert (first.key, second.key) == ("12", "358")
        assert [view.key for view in second.views] == ["cam1", "cam3"]
        assert second.views[0].balls[0].point == ImagePoint(100.5, 50.0)
        assert (first.split, second.split) == ("train", "")
        assert report.problems == []
        assert (report.read, report.imported) == (2, 2)

    def test_a_camera_is_one_station_with_what_was_given(
        self, folder: Path, report: Report
    ) -> None:
        first, second = open_issia_3d(folder, IssiaOptions(), report).groups()
        station = second.views[1].station
        assert first.views[0].station is station
        assert station.given is not None
        assert second.views[0].station.given is None

    def test_half_a_point_a_second_row_and_no_frame_are_reported(
        self, tmp_path: Path, report: Report
    ) -> None:
        rows = "0,5,1,,2,3,1,,\n1,5,4,5,,,1,,\n2,x,4,5,,,1,,\n"
        (tmp_path / "ISSIA-3D.csv").write_text(HEAD + rows)
        (group,) = open_issia_3d(tmp_path, IssiaOptions(), report).groups()
        assert [view.key for view in group.views] == ["cam3"]
        assert [(item.record, item.field) for item in report.problems] == [
            ("line 2", "cam1"), ("line 3", "frame"), ("line 4", "frame"),
        ]  # fmt: skip

    def test_a_folder_without_the_table_says_so(self, tmp_path: Path, report: Report) -> None:
        assert list(open_issia_3d(tmp_path, IssiaOptions(), report).groups()) == []
        assert "holds no ISSIA-3D.csv" in report.problems[0].problem
