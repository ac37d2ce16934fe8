from __future__ import annotations

import errno
import json
import os
import stat
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.errors import InputError, ReviewError
from app.features.file_tools.camera_export import export_cameras, key_by_frame_number
from app.formats import camera_matrix
from app.formats.camera_matrix import MOST_CAMERAS, MOST_ROWS
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.media.video import MAX_FRAMES
from app.soccer.frames import ImageSize
from tests.cameras import EVERY_COEFFICIENT, SIZE, looking, wide, write_cameras

POINTS = np.array([(0.0, 0.0, 0.0), (-4.0, 20.0, -2.0), (9.0, 10.0, -0.11), (3.0, -30.0, -8.0)])
CAMERAS = {
    frame: looking((0.0, 62.0, -16.0), (frame - 5.0, 0.0, 0.0), 1500.0 + 10 * frame, bend=0.01)
    for frame in (2, 3, 5)
}


def folder_of(folder: Path, cameras: dict[int, Camera] = CAMERAS) -> Path:
    folder.mkdir()
    write_cameras(folder, {f"{frame:05d}": camera for frame, camera in cameras.items()})
    return folder


class TestNpz:
    def test_opencv_sees_the_same_pixels(self, tmp_path: Path) -> None:
        """As FIFA's kit projects: ``cv2.projectPoints`` of points whose z is up."""
        out = tmp_path / "made" / "clip.npz"
        result = export_cameras(folder_of(tmp_path / "cameras"), out, "npz")
        assert result == {"cameras": 3, "first": 2, "last": 5, "missing": 1, "problems": []}
        with np.load(out, allow_pickle=False) as arrays:
            shapes = {name: arrays[name].shape for name in arrays.files}
            assert shapes == {"K": (6, 3, 3), "k": (6, 5), "R": (6, 3, 3), "t": (6, 3)}
            for frame, camera in CAMERAS.items():
                K, k, R, t = (arrays[name][frame] for name in "KkRt")
                assert np.linalg.det(R) == pytest.approx(1.0)
                assert (-R.T @ t)[2] == pytest.approx(16.0)
                seen, _ = cv2.projectPoints(POINTS * (1.0, -1.0, -1.0), R, t, K, k)
                # k holds less than the lens has.
                assert np.allclose(seen[:, 0], camera.project(POINTS), atol=1e-6)
            for frame in (0, 1, 4):
                assert all(np.isnan(arrays[name][frame]).all() for name in "KkRt")

    def test_longer_lenses_keep_all_their_numbers(self, tmp_path: Path) -> None:
        out = tmp_path / "clip.npz"
        export_cameras(folder_of(tmp_path / "cameras", {0: EVERY_COEFFICIENT}), out, "npz")
        with np.load(out) as arrays:
            assert arrays["k"][0].tolist() == EVERY_COEFFICIENT.distortion.tolist()

    def test_a_lens_that_opencv_has_not_is_refused(self, tmp_path: Path) -> None:
        cameras = {4: wide((0.0, 60.0, -20.0), (0.0, 0.0, 0.0))}
        with pytest.raises(ReviewError, match=r"frame 4.*fisheye"):
            export_cameras(folder_of(tmp_path / "cameras", cameras), tmp_path / "a.npz", "npz")

    def test_a_number_that_is_no_frame_s_is_refused_without_the_place_of_the_files(
        self, tmp_path: Path
    ) -> None:
        cameras = {3_000_000_000: CAMERAS[2]}
        with pytest.raises(
            ReviewError, match=r"^cameras, frame 3000000000, K: .*3,000,000,001 rows"
        ):
            export_cameras(folder_of(tmp_path / "cameras", cameras), tmp_path / "a.npz", "npz")

    def test_cameras_late_in_a_match_are_written(self, tmp_path: Path) -> None:
        late, out = MOST_CAMERAS + 20_000, tmp_path / "clip.npz"
        cameras = {late: CAMERAS[2]}
        result = export_cameras(folder_of(tmp_path / "cameras", cameras), out, "npz")
        assert (result["first"], result["last"]) == (late, late)
        with np.load(out) as arrays:
            assert arrays["K"].shape == (late + 1, 3, 3) and arrays["k"].shape == (late + 1, 5)
            assert np.allclose(arrays["K"][late], CAMERAS[2].K)
            assert all(np.isnan(arrays[name][:late]).all() for name in "KkRt")

    def test_more_cameras_than_a_file_may_hold_are_refused(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(camera_matrix, "MOST_CAMERAS", 2)
        with pytest.raises(ReviewError, match="would have 3 cameras; a file may hold 2 cameras"):
            export_cameras(folder_of(tmp_path / "cameras"), tmp_path / "a.npz", "npz")

    def test_a_recording_has_no_frame_beyond_what_is_written(self) -> None:
        assert MOST_ROWS == MAX_FRAMES


class TestOut:
    @pytest.mark.parametrize("form", ["npz", "opentrackio"])
    def test_the_umask_decides_who_may_read_it(self, tmp_path: Path, form: str) -> None:
        out = tmp_path / "out"
        before = os.umask(0o022)
        try:
            export_cameras(folder_of(tmp_path / "cameras"), out, form, SIZE)
        finally:
            os.umask(before)
        files = [out] if form == "npz" else list(out.iterdir())
        assert {stat.S_IMODE(file.stat().st_mode) for file in files} == {0o644}

    @pytest.mark.parametrize("form", ["npz", "opentrackio"])
    def test_what_is_in_the_way_is_named_before_anything_is_read(
        self, tmp_path: Path, form: str
    ) -> None:
        (tmp_path / "file").write_text("")
        for out in (tmp_path / "file" / "below", tmp_path if form == "npz" else tmp_path / "file"):
            with pytest.raises(InputError, match=r"is a (file|folder); name a (file|folder)"):
                export_cameras(tmp_path / "nothing", out, form, SIZE)

    def test_a_refused_write_names_the_file(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(*_arguments: object, **_options: object) -> None:
            raise PermissionError(errno.EACCES, "Permission denied", "/out/.a.npz.1234.partial")

        monkeypatch.setattr("app.features.file_tools.output_folder.replace_file", refuse)
        with pytest.raises(InputError, match=r"a\.npz cannot be written \(Permission denied\)"):
            export_cameras(folder_of(tmp_path / "cameras"), tmp_path / "a.npz", "npz")


class TestOpenTrackIO:
    def test_a_sample_a_frame_with_what_track_says(self, tmp_path: Path) -> None:
        source, out = folder_of(tmp_path / "cameras"), tmp_path / "out"
        rows = [
            {"frame": frame, "time": frame / 25, "outcome": "lost" if frame == 4 else "tracked"}
            for frame in range(6)
        ]
        (source / "track.json").write_text(json.dumps({"frames": rows}))
        export_cameras(source, out, "opentrackio", SIZE)
        assert sorted(path.name for path in out.iterdir()) == [
            f"sample_{frame}.json" for frame in CAMERAS
        ]
        sample = json.loads((out / "sample_3.json").read_text())
        assert sample["timing"]["sampleTimestamp"] == {"seconds": 0, "nanoseconds": 120_000_000}
        assert sample["timing"]["sampleRate"] == {"num": 25, "denom": 1}
        assert sample["tracker"] == {"status": "tracked"}
        assert sample["transforms"][0]["translation"] == {"x": 0.0, "y": -62.0, "z": 16.0}

    def test_the_size_has_to_be_known(self, tmp_path: Path) -> None:
        source = folder_of(tmp_path / "cameras")
        with pytest.raises(ReviewError, match="--size"):
            export_cameras(source, tmp_path / "out", "opentrackio")
        assert not (tmp_path / "out").exists()

    def test_a_camera_may_say_it(self, tmp_path: Path) -> None:
        source = folder_of(tmp_path / "cameras")
        for path in source.iterdir():
            value = {**json.loads(path.read_text()), "width": 1920, "height": 1080}
            path.write_text(json.dumps(value))
        export_cameras(source, tmp_path / "out", "opentrackio", ImageSize(640, 360))
        sample = json.loads((tmp_path / "out" / "sample_2.json").read_text())
        assert sample["static"]["camera"]["activeSensorResolution"] == {
            "height": 1080,
            "width": 1920,
        }

    def test_a_damaged_track_is_named(self, tmp_path: Path) -> None:
        source = folder_of(tmp_path / "cameras")
        (source / "track.json").write_text('{"rows": []}')
        with pytest.raises(ReviewError, match=r"track\.json"):
            export_cameras(source, tmp_path / "out", "opentrackio", SIZE)

    def test_what_it_cannot_say_is_refused(self, tmp_path: Path) -> None:
        source = folder_of(tmp_path / "cameras", {8: EVERY_COEFFICIENT})
        with pytest.raises(ReviewError, match=r"frame 8.*tangential"):
            export_cameras(source, tmp_path / "out", "opentrackio", SIZE)


class TestByFrame:
    def test_numbers_count_and_other_names_do_not(self) -> None:
        report = ReaderReport()
        cameras = {"00012": "a", "clip/7": "b", "north": "c", "²": "d"}
        assert key_by_frame_number(cameras, Path("clip"), report) == {12: "a", 7: "b"}
        assert [item.record for item in report.problems] == ['camera "north"', 'camera "²"']

    def test_two_cameras_of_one_frame_are_refused(self, tmp_path: Path) -> None:
        (tmp_path / "clips").mkdir()
        for name in ("a", "b"):
            folder_of(tmp_path / "clips" / name)
        with pytest.raises(InputError, match='two cameras of frame 2, "a/00002" and "b/00002"'):
            export_cameras(tmp_path / "clips", tmp_path / "out.npz", "npz")
        assert not (tmp_path / "out.npz").exists()

    def test_cameras_without_a_number_are_named(self, tmp_path: Path) -> None:
        source = folder_of(tmp_path / "cameras")
        write_cameras(source, {"north": CAMERAS[2]})
        found = export_cameras(source, tmp_path / "out.npz", "npz")
        assert found["cameras"] == 3
        assert len(found["problems"]) == 1 and 'camera "north"' in found["problems"][0]


class TestCommand:
    def test_an_empty_folder(
        self, tmp_path: Path, touchline: Callable[..., tuple[int, str, str]]
    ) -> None:
        code, _, err = touchline("cameras", tmp_path, tmp_path / "a.npz", "--format", "npz")
        assert code == 1
        assert "camera" in err

    def test_both_formats(
        self, tmp_path: Path, touchline: Callable[..., tuple[int, str, str]]
    ) -> None:
        source = folder_of(tmp_path / "cameras")
        code, out, _ = touchline("cameras", source, tmp_path / "a.npz", "--format", "npz", "--json")
        assert code == 0
        assert json.loads(out)["cameras"] == 3
        code, out, _ = touchline(
            "cameras", source, tmp_path / "o", "--format", "opentrackio", "--size", "1280x720"
        )
        assert code == 0
        assert "missing" in out
        assert len(list((tmp_path / "o").iterdir())) == 3
