from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.errors import InputError, UnsafePathError
from app.formats.cameras_reader import read_cameras
from app.formats.cameras_writer import write_camera_files
from app.formats.export_record import ExportRecord
from app.formats.report import Report
from app.formats.sn_calibration_writer import write_sn_calibration
from app.geometry.arrays import row_by_row
from app.geometry.camera import Camera
from app.soccer.group import Group

Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]


class TestWriteCameraFiles:
    def test_one_file_a_calibrated_view_in_the_folder_of_its_match(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str, camera: Camera,
        report: Report,
    ) -> None:  # fmt: skip
        counts = write_camera_files(tmp_path, [solved(soccer_group(replays=3))])
        assert counts == {"groups": 1, "cameras": 3}
        assert (tmp_path / match / "camera_7_1.json").is_file()
        assert read_cameras(tmp_path, report) == {
            f"{match}/{stem}": camera for stem in ("7", "7_1", "7_2")
        }

    def test_what_is_known_of_a_computed_camera_stands_in_its_file(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str
    ) -> None:
        record = solved(soccer_group(replays=1))
        assert record.solution is not None
        first, second = record.solution.views
        spread = row_by_row(np.eye(8) * 1e-4)
        known = replace(first, calibration=replace(first.calibration, covariance=spread))
        record = replace(record, solution=replace(record.solution, views=(known, second)))
        (tmp_path / "lines").mkdir()
        write_camera_files(tmp_path / "cameras", [record])
        write_sn_calibration(tmp_path / "lines", [record])
        for root in ("cameras", "lines"):
            files = [*(tmp_path / root).rglob("camera_*.json")]
            told = [json.loads(path.read_text()).get("covariance") for path in files]
            (found,) = (value for value in told if value is not None)
            assert np.diag(found)[:3].tolist() == [1e-4] * 3
            assert len(told) == 2

    def test_a_static_camera_is_written_once(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        records = [solved(issia_group(frame)) for frame in (1, 2, 3)]
        assert write_camera_files(tmp_path, records) == {"groups": 3, "cameras": 2}
        names = sorted(path.name for path in (tmp_path / "issia").iterdir())
        assert names == ["camera_cam3.json", "camera_cam4.json"]

    def test_two_frames_of_one_name_are_refused_even_where_their_cameras_are_equal(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        view = soccer_group(replays=0).views[0]
        for keys in (("a/7.png", "a/7.jpg"), ("a/B", "a/b")):
            groups = [Group(key, (replace(view, key=key),)) for key in keys]
            with pytest.raises(InputError, match=f"two frames .*{keys[0]} and {keys[1]}"):
                write_camera_files(tmp_path, map(solved, groups))

    def test_a_match_that_leaves_the_folder_is_refused(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        group = replace(soccer_group(), match="../..")
        with pytest.raises(UnsafePathError):
            write_camera_files(tmp_path, [solved(group)])
