from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from app.datasets.cameras_reader import read_cameras
from app.datasets.cameras_writer import write_camera_files, write_cameras
from app.datasets.export_record import ExportRecord
from app.datasets.report import Report
from app.errors import InputError, UnsafePathError
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

    def test_a_static_camera_is_written_once(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        records = [solved(issia_group(frame)) for frame in (1, 2, 3)]
        assert write_camera_files(tmp_path, records) == {"groups": 3, "cameras": 2}
        names = sorted(path.name for path in (tmp_path / "issia").iterdir())
        assert names == ["camera_cam3.json", "camera_cam4.json"]

    def test_two_frames_that_differ_in_their_ending_are_refused_and_none_is_dropped(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        view = soccer_group(replays=0).views[0]
        groups = [Group(key, (replace(view, key=key),)) for key in ("a/7.png", "a/7.jpg")]
        first, same = map(solved, groups)
        assert write_camera_files(tmp_path, [first, same]) == {"groups": 2, "cameras": 1}
        found = same.solution.views[0].calibration
        moved = replace(found, camera=replace(found.camera, position=found.camera.position + 1.0))
        views = (replace(same.solution.views[0], calibration=moved),)
        other = replace(same, solution=replace(same.solution, views=views))
        with pytest.raises(InputError, match="two frames would both be called a/camera_7"):
            write_camera_files(tmp_path, [first, other])

    def test_a_match_that_leaves_the_folder_is_refused(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        group = replace(soccer_group(), match="../..")
        with pytest.raises(UnsafePathError):
            write_camera_files(tmp_path, [solved(group)])


class TestWriteCameras:
    def test_a_key_that_leaves_the_folder_is_refused(self, tmp_path: Path, camera: Camera) -> None:
        with pytest.raises(UnsafePathError):
            write_cameras(tmp_path, {"../x": camera})
