from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.errors import InputError, UnsafePathError
from app.formats.camera_json import camera_to_json
from app.formats.cameras import format_camera_file, read_cameras, write_camera_files
from app.formats.export_record import ExportRecord
from app.formats.report import ReaderReport
from app.formats.sn_calibration_writer import write_sn_calibration
from app.geometry.arrays import flatten_covariance
from app.geometry.camera import Camera
from app.soccer.frames import ImageSize
from app.soccer.group import Group
from tests.cameras import SIZE, looking, write_cameras


class TestReadCameras:
    def test_a_folder_of_camera_files_is_keyed_by_stem(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        write_cameras(tmp_path, {"00002": camera, "00005": camera})
        (tmp_path / "00002.json").write_text("{}")
        assert read_cameras(tmp_path, report) == {"00002": camera, "00005": camera}
        assert (report.read, report.imported, report.problems) == (2, 2, [])

    def test_files_that_are_not_read_beside_others_are_named(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        write_cameras(tmp_path, {"00002": camera})
        for name in ("north.json", "south.npz", "track.json", "manifest.json", "notes.txt"):
            (tmp_path / name).write_text("{}")
        assert list(read_cameras(tmp_path, report)) == ["00002"]
        (remark,) = report.remarks
        assert "2 files are not read" in remark and "north.json, south.npz" in remark

    def test_a_name_that_begins_with_a_line_is_a_camera_where_it_has_one(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        value = {
            "_DSC0001.jpg": camera_to_json(camera),
            "_north": camera_to_json(camera),
            "_DSC0002.jpg": {"pan": 3},
            "_comment": "made by hand",
            "_meta": {"software": "x"},
        }
        (tmp_path / "cameras.json").write_text(json.dumps(value))
        assert set(read_cameras(tmp_path, report)) == {"_DSC0001", "_north"}
        assert [problem.record for problem in report.problems] == ["_DSC0002.jpg"]
        (remark,) = report.remarks
        assert '"_comment", "_meta" holds no camera' in remark

    def test_files_in_match_folders_keep_their_match(
        self, tmp_path: Path, camera: Camera, report: ReaderReport, match: str
    ) -> None:
        write_cameras(tmp_path / "..", {f"{tmp_path.name}/{match}/7_1": camera})
        assert list(read_cameras(tmp_path, report)) == [f"{match}/7_1"]

    def test_a_camera_keeps_its_folders_whatever_lies_beside_it(
        self, make_zip: Callable[..., Path], camera: Camera, report: ReaderReport
    ) -> None:
        text = format_camera_file(camera)
        path = make_zip(
            {"a/camera_1.json": text, "b/camera_1.json": text, "b/c/camera_2.json": text}
        )
        assert list(read_cameras(path, report)) == ["a/1", "b/c/2", "b/1"]

    def test_a_bad_camera_is_reported_and_the_rest_imported(
        self, make_zip: Callable[..., Path], camera: Camera, report: ReaderReport
    ) -> None:
        bad = format_camera_file(camera).replace("2100.5", "NaN")
        path = make_zip({"camera_1.json": bad, "camera_2.json": format_camera_file(camera)})
        assert list(read_cameras(path, report)) == ["2"]
        assert (report.read, report.imported) == (2, 1)
        assert "camera_1.json, x_focal_length: is nan, not a finite number" in str(
            report.problems[0]
        )

    def test_how_well_a_camera_is_known_is_read_with_it(
        self, make_zip: Callable[..., Path], report: ReaderReport
    ) -> None:
        known = flatten_covariance(np.eye(8) * 1e-4)
        camera = looking((0.0, 60.0, -15.0), (0.0, 0.0, 0.0), 1500.0)
        text = format_camera_file(camera, known, SIZE)
        value = json.loads(text)
        broken = json.dumps({**value, "covariance": [[1.0]]})
        path = make_zip(
            {
                "camera_1.json": text,
                "camera_2.json": format_camera_file(camera),
                "camera_3.json": broken,
            }
        )
        covariances: dict[str, Any] = {}
        assert list(read_cameras(path, report, covariances=covariances)) == ["1", "2"]
        assert covariances == {"1": value["covariance"]}
        assert "camera_3.json, covariance: has 1 numbers" in str(report.problems[0])

    @pytest.mark.parametrize("wrapped", [False, True])
    @pytest.mark.parametrize("encoded", ["plain", "json", "python"])
    def test_several_cameras_in_one_file(
        self, tmp_path: Path, camera: Camera, report: ReaderReport, wrapped: bool, encoded: str
    ) -> None:
        value: Any = {"cam1": camera_to_json(camera), "cam2": camera_to_json(camera)}
        value = {"_note": "ours", "cameras": value} if wrapped else value
        inner = {"plain": lambda v: v, "json": json.dumps, "python": repr}[encoded](value)
        path = tmp_path / "issia_calibration.json"
        path.write_text(json.dumps(inner))
        assert read_cameras(path, report) == {"cam1": camera, "cam2": camera}
        assert report.problems == []

    def test_one_bad_camera_of_several_is_named(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        value = {"cam1": camera_to_json(camera), "cam2": 5, "_note": "x"}
        path = tmp_path / "issia_calibration.json"
        path.write_text(json.dumps(value))
        assert list(read_cameras(path, report)) == ["cam1"]
        assert report.problems[0].record == "cam2"

    @pytest.mark.parametrize("name", ["file_name", "image_ids", "image", "frame"])
    def test_objects_of_json_lines_and_lists_are_called_like_their_image(
        self, tmp_path: Path, camera: Camera, report: ReaderReport, name: str
    ) -> None:
        items = [camera_to_json(camera) | {name: f"{stem}.jpg"} for stem in ("north", "south")]
        lines, listed = tmp_path / "per_sample_output.json", tmp_path / "cameras.json"
        lines.write_text("\n".join(map(json.dumps, items)))
        listed.write_text(json.dumps(items))
        assert read_cameras(lines, report) == {"north": camera, "south": camera}
        assert read_cameras(listed, report) == {"north": camera, "south": camera}
        assert report.problems == []

    def test_a_line_that_cannot_be_read_is_named_and_the_others_are_read(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        good = json.dumps(camera_to_json(camera) | {"image": "a.jpg"})
        (tmp_path / "cameras.jsonl").write_text(f"{good}\n{good[:-20]}\n")
        assert list(read_cameras(tmp_path, report)) == ["a"]
        assert report.problems[0].record == "line 2"

    def test_names_of_images_are_keys(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        value = camera_to_json(camera)
        names = ["north.jpg", "images/south.png", "C:\\frames\\east.jpg", "/data/west.jpg"]
        (tmp_path / "predictions.json").write_text(json.dumps(dict.fromkeys(names, value)))
        assert list(read_cameras(tmp_path, report)) == [
            "north", "images/south", "/frames/east", "/data/west",
        ]  # fmt: skip

    def test_the_wrapper_of_pnlcalib_is_taken_off(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        value = {"cam_params": camera_to_json(camera), "rep_err": 0.5, "mode": "full"}
        (tmp_path / "camera_00002.json").write_text(json.dumps(value))
        (tmp_path / "all.json").write_text(json.dumps({"00003.jpg": value, "00004.jpg": None}))
        assert read_cameras(tmp_path / "camera_00002.json", report) == {"00002": camera}
        assert read_cameras(tmp_path / "all.json", report) == {"00003": camera}
        assert [problem.record for problem in report.problems] == ["00004.jpg"]

    def test_the_principal_point_of_tvcalib_is_measured_from_the_corner(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        value = camera_to_json(camera) | {"image_ids": "a.jpg", "aov_radian": 0.6}
        (tmp_path / "per_sample_output.json").write_text(json.dumps(value))
        x, y = read_cameras(tmp_path, report)["a"].principal_point
        assert (x + 0.5, y + 0.5) == camera.principal_point

    def test_one_number_that_is_none_costs_its_own_camera_alone(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        value = {"cam1": camera_to_json(camera), "cam2": camera_to_json(camera)}
        text = json.dumps(value).replace("2100.5", "Infinity", 1)
        (tmp_path / "issia_calibration.json").write_text(text)
        assert read_cameras(tmp_path, report) == {"cam2": camera}
        assert "cam1, x_focal_length: is inf, not a finite number" in str(report.problems[0])

    def test_a_folder_without_camera_files_says_what_it_holds(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        (tmp_path / "a.homographies").write_text("1 0 0\n")
        assert read_cameras(tmp_path, report) == {}
        assert "contains no camera files (.json, .jsonl, .npz, .yml), but .homographies" in str(
            report.problems[0]
        )

    @pytest.mark.parametrize(
        "stated",
        [
            {"width": 1280, "height": 720},
            {"image_width": 1280.0, "image_height": "720"},
            {"image_size": [1280, 720]},
        ],
    )
    def test_a_size_that_a_file_states_is_handed_on(
        self, tmp_path: Path, camera: Camera, report: ReaderReport, stated: dict[str, Any]
    ) -> None:
        (tmp_path / "camera_1.json").write_text(json.dumps(camera_to_json(camera) | stated))
        (tmp_path / "camera_2.json").write_text(json.dumps(camera_to_json(camera) | {"width": 5}))
        sizes: dict[str, ImageSize] = {}
        assert list(read_cameras(tmp_path, report, sizes=sizes)) == ["1", "2"]
        assert sizes == {"1": ImageSize(1280, 720)}

    def test_a_second_camera_of_a_name_is_named(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        items = [camera_to_json(camera) | {"image": "a.jpg"}] * 2
        (tmp_path / "cameras.json").write_text(json.dumps(items))
        assert list(read_cameras(tmp_path, report)) == ["a"]
        assert "is a second camera" in str(report.problems[0])

    @pytest.mark.parametrize(
        ("value", "what"),
        [
            ({"homography": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "homography"),
            ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], "homography"),
            ({"kp": {"1": {"x": 0.5}}, "lines": {}}, "keypoints"),
            ({"images": [], "annotations": []}, "COCO document"),
            ({"Side line top": [{"x": 0.1, "y": 0.2}]}, "field lines"),
            ([{"image_id": 1, "bbox": [1, 2, 3, 4]}], "COCO results"),
            ({"a": 1}, 'object with "a"; a camera is'),
        ],
    )
    def test_a_file_that_holds_no_camera_says_what_it_is(
        self, tmp_path: Path, report: ReaderReport, value: Any, what: str
    ) -> None:
        (tmp_path / "x.json").write_text(json.dumps(value))
        assert read_cameras(tmp_path, report) == {}
        assert len(report.problems) == 1
        assert what in str(report.problems[0])

    def test_opentrackio_is_named_in_one_sentence(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        sample = {
            "protocol": {"name": "OpenTrackIO", "version": [1, 0, 1]},
            "lens": {},
            "timing": {},
        }
        (tmp_path / "sample_0.json").write_text(json.dumps(sample))
        assert read_cameras(tmp_path, report) == {}
        (problem,) = report.problems
        assert problem.problem.startswith(
            "is OpenTrackIO, which Touchline writes and does not read"
        )


Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]


class TestWriteCameraFiles:
    def test_one_file_a_calibrated_view_in_the_folder_of_its_match(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str, camera: Camera,
        report: ReaderReport,
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
        spread = flatten_covariance(np.eye(8) * 1e-4)
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
