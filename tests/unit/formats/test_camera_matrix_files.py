from __future__ import annotations

import io
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.formats import cameras
from app.formats.camera_matrix import MOST_CAMERAS
from app.formats.cameras import read_cameras
from app.formats.report import ReaderReport
from app.geometry.camera import Camera

K = np.array([[1800.0, 0, 639.5], [0, 1800.0, 359.5], [0, 0, 1]])


@pytest.fixture
def arrays(camera: Camera) -> dict[str, np.ndarray]:
    t = -camera.rotation @ camera.position
    frames = {"K": K, "R": camera.rotation, "t": t, "k": np.zeros(5)}
    return {name: np.stack([value] * 3) for name, value in frames.items()}


class TestCamerasOfArrays:
    def test_frames_of_a_match_are_called_by_their_number(
        self, tmp_path: Path, arrays: dict[str, np.ndarray], camera: Camera, report: ReaderReport
    ) -> None:
        arrays["K"][1, 0, 0] = 2000.0
        np.savez(tmp_path / "ARG_CRO.npz", **arrays)
        found = read_cameras(tmp_path / "ARG_CRO.npz", report)
        assert list(found) == ["ARG_CRO/0", "ARG_CRO/1", "ARG_CRO/2"]
        assert found["ARG_CRO/1"].focal_length[0] == 2000.0
        assert np.allclose(found["ARG_CRO/0"].position, camera.position)

    def test_a_camera_that_never_moves_is_one_camera(
        self, tmp_path: Path, arrays: dict[str, np.ndarray], report: ReaderReport
    ) -> None:
        np.savez_compressed(tmp_path / "north.npz", **arrays)
        assert list(read_cameras(tmp_path, report)) == ["north"]

    @pytest.mark.parametrize("frames", [1, 3])
    @pytest.mark.parametrize("each", [False, True])
    def test_the_numbers_of_a_lens_may_stand_in_a_column(
        self,
        tmp_path: Path,
        arrays: dict[str, np.ndarray],
        report: ReaderReport,
        frames: int,
        each: bool,
    ) -> None:
        lens = np.array([0.1, -0.2, 0.001, 0.002, 0.05])
        cameras = {name: array[:frames].copy() for name, array in arrays.items()}
        cameras["K"][-1, 0, 0] = 2000.0
        if frames == 1:
            cameras = {name: array[0] for name, array in cameras.items()}
        cameras["k"] = np.stack([lens] * frames)[..., None] if each else lens[:, None]
        np.savez(tmp_path / "north.npz", **cameras)
        found = read_cameras(tmp_path, report)
        assert (len(found), report.problems) == (frames, [])
        assert all(np.allclose(camera.distortion[:5], lens) for camera in found.values())

    @pytest.mark.parametrize(
        ("changes", "problem"),
        [
            ({"R": np.zeros((2, 3, 3))}, "arrays of different lengths"),
            ({"t": np.zeros((3, 4))}, "t: has the shape"),
            ({"K": np.array([{"a": 1}], dtype=object)}, "values that are not numbers"),
            ({"K": np.array(3.0)}, "K: has the shape one number"),
            ({"R": np.array(3.0)}, "R: has the shape one number"),
            ({"t": np.array(3.0)}, "t: has the shape one number"),
            ({"t": np.zeros((2, 3, 3, 3))}, "t: has the shape"),
            ({"k": np.zeros(0)}, "k: is empty"),
            ({"k": np.zeros((3, 0))}, "k: is empty"),
        ],
    )
    def test_arrays_that_do_not_fit_are_refused(
        self,
        tmp_path: Path,
        arrays: dict[str, np.ndarray],
        report: ReaderReport,
        changes,
        problem: str,
    ) -> None:
        np.savez(tmp_path / "a.npz", **(arrays | changes))
        assert read_cameras(tmp_path, report) == {}
        assert problem in str(report.problems[0])

    @pytest.mark.parametrize(
        ("arrays", "problem"),
        [
            ({"t": np.zeros((MOST_CAMERAS + 1, 3), np.uint8)}, "t: holds 300,003 numbers"),
            ({"K": np.zeros((MOST_CAMERAS + 1, 3, 3), "u1")}, "K: holds 900,009 numbers"),
            ({"k": np.arange(2.0 * MOST_CAMERAS)[:, None]}, "k: has 200,000 rows"),
        ],
    )
    def test_more_cameras_than_a_file_may_hold_are_refused_before_they_are_made(
        self,
        tmp_path: Path,
        report: ReaderReport,
        camera: Camera,
        arrays: dict[str, np.ndarray],
        problem: str,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        one = {"K": K, "R": camera.rotation, "t": np.zeros(3)}
        np.savez_compressed(tmp_path / "a.npz", **(one | arrays))
        monkeypatch.setattr(
            cameras, "_parse_camera", lambda *_: pytest.fail("a camera was made of it")
        )
        assert read_cameras(tmp_path, report) == {}
        (said,) = map(str, report.problems)
        assert "a.npz" in said and problem in said
        assert "a file may hold 100,000 cameras: split it into several files" in said

    def test_what_says_nothing_of_cameras_is_not_unpacked(
        self, tmp_path: Path, report: ReaderReport, arrays: dict[str, np.ndarray]
    ) -> None:
        more = {"frames": np.array(["a.png", "b.png", "c.png"]), "depth": np.zeros((10**6, 9))}
        np.savez_compressed(tmp_path / "north.npz", **arrays, **more)
        assert list(read_cameras(tmp_path, report)) == ["north"], report.problems

    def test_a_header_that_lies_about_its_size_takes_no_memory(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        buffer = io.BytesIO()
        np.lib.format.write_array_header_1_0(
            buffer, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3, 3)}
        )
        with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
            archive.writestr("K.npy", buffer.getvalue())
        assert read_cameras(tmp_path, report) == {}
        assert "differs from the size that it declares" in str(report.problems[0])

    def test_an_empty_array_that_says_to_be_endless_is_refused(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        buffer = io.BytesIO()
        np.lib.format.write_array_header_1_0(
            buffer, {"descr": "<f8", "fortran_order": False, "shape": (0, 10**30)}
        )
        with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
            archive.writestr("K.npy", buffer.getvalue())
        assert read_cameras(tmp_path, report) == {}
        assert "not a NumPy .npz file" in str(report.problems[0])


class TestOpencvStorage:
    def test_matrices_of_a_yaml_file_are_a_camera(
        self, tmp_path: Path, camera: Camera, report: ReaderReport
    ) -> None:
        path = tmp_path / "north.yml"
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
        storage.write("camera_matrix", K)
        storage.write("rvec", cv2.Rodrigues(camera.rotation)[0])
        storage.write("tvec", -camera.rotation @ camera.position)
        storage.write("distortion_coefficients", np.zeros((1, 5)))
        storage.release()
        found = read_cameras(tmp_path, report)
        assert np.allclose(found["north"].position, camera.position), report.problems

    @pytest.mark.parametrize(
        "text",
        [
            "a: &a [1]\nb: *a\n",
            "a: !!python/object:os.system x",
            "a: [",
            "a: !!timestamp x",
            "a: !!bool x",
            "a: !!int ''",
            "? [a, b]\n: 1",
            "? !!binary é\n: 1\na: !!int [1]",
        ],
    )
    def test_anything_but_plain_matrices_is_refused(
        self, tmp_path: Path, report: ReaderReport, text: str
    ) -> None:
        (tmp_path / "x.yaml").write_text(text)
        assert read_cameras(tmp_path, report) == {}
        assert "not a YAML file of OpenCV" in str(report.problems[0])

    @pytest.mark.parametrize(
        ("text", "key"),
        [
            ("1: {K: 3}", '"1"'),
            ("2026-11-28: {K: 3}", '"2026-11-28"'),
            ("on: 3", '"on"'),
            ("null: 3", '"null"'),
            ("1.5: {2: {3: 4}}", '"1.5"'),
            ("1: !!opencv-matrix {rows: 3, 2: 3}", '"1"'),
        ],
    )
    def test_keys_that_are_no_text_are_named_as_they_are_written(
        self, tmp_path: Path, report: ReaderReport, text: str, key: str
    ) -> None:
        (tmp_path / "x.yml").write_text(text)
        assert read_cameras(tmp_path, report) == {}
        assert f"is an object with {key}" in str(report.problems[0])
