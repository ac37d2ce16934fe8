from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.datasets.camera_json import camera_to_json
from app.datasets.cameras_reader import read_cameras
from app.datasets.cameras_writer import camera_text, write_cameras
from app.datasets.report import Report
from app.geometry.camera import Camera


class TestReadCameras:
    def test_a_folder_of_camera_files_is_keyed_by_stem(
        self, tmp_path: Path, camera: Camera, report: Report
    ) -> None:
        write_cameras(tmp_path, {"00002": camera, "00005": camera})
        (tmp_path / "00002.json").write_text("{}")
        assert read_cameras(tmp_path, report) == {"00002": camera, "00005": camera}
        assert (report.read, report.imported, report.problems) == (2, 2, [])

    def test_files_in_match_folders_keep_their_match(
        self, tmp_path: Path, camera: Camera, report: Report, match: str
    ) -> None:
        write_cameras(tmp_path / "..", {f"{tmp_path.name}/{match}/7_1": camera})
        assert list(read_cameras(tmp_path, report)) == [f"{match}/7_1"]

    def test_equal_stems_in_two_folders_keep_their_folders(
        self, make_zip: Callable[..., Path], camera: Camera, report: Report
    ) -> None:
        text = camera_text(camera)
        path = make_zip({"a/camera_1.json": text, "b/camera_1.json": text})
        assert list(read_cameras(path, report)) == ["a/1", "b/1"]

    def test_a_bad_camera_is_reported_and_the_rest_imported(
        self, make_zip: Callable[..., Path], camera: Camera, report: Report
    ) -> None:
        bad = camera_text(camera).replace("2100.5", "NaN")
        path = make_zip({"camera_1.json": bad, "camera_2.json": camera_text(camera)})
        assert list(read_cameras(path, report)) == ["2"]
        assert (report.read, report.imported) == (2, 1)
        assert "camera_1.json: holds NaN" in str(report.problems[0])

    @pytest.mark.parametrize("wrapped", [False, True])
    @pytest.mark.parametrize("encoded", ["plain", "json", "python"])
    def test_several_cameras_in_one_file(
        self, tmp_path: Path, camera: Camera, report: Report, wrapped: bool, encoded: str
    ) -> None:
        value: Any = {"cam1": camera_to_json(camera), "cam2": camera_to_json(camera)}
        value = {"_note": "ours", "cameras": value} if wrapped else value
        inner = {"plain": lambda v: v, "json": json.dumps, "python": repr}[encoded](value)
        path = tmp_path / "issia_calibration.json"
        path.write_text(json.dumps(inner))
        assert read_cameras(path, report) == {"cam1": camera, "cam2": camera}
        assert report.problems == []

    def test_one_bad_camera_of_several_is_named(
        self, tmp_path: Path, camera: Camera, report: Report
    ) -> None:
        value = {"cam1": camera_to_json(camera), "cam2": 5, "_note": "x"}
        path = tmp_path / "issia_calibration.json"
        path.write_text(json.dumps(value))
        assert list(read_cameras(path, report)) == ["cam1"]
        assert report.problems[0].record == "cam2"
