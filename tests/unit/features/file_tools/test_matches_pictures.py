from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from app.errors import DatasetFormatError
from app.features.file_tools.calibrate import calibrate_files
from app.features.file_tools.matches import (
    choose_picture_geometry,
    estimate_picture_geometry_of_files,
    read_picture_geometry,
)
from app.formats.cameras import read_cameras
from app.formats.report import ReaderReport
from app.formats.sn_calibration import LineFile
from app.formats.sn_calibration_writer import write_line_files
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEND, click

POSITION = (1.0, 62.0, -16.0)


def write(folder: Path, aspect: float = 1.06, count: int = 4) -> list[LineFile]:
    """Line files of one match whose pixels are that wide."""
    files = []
    for number in range(count):
        camera = looking(POSITION, (-30.0 + 20.0 * number, -4.0, 0.0), 1300.0, bend=BEND)
        shown = PictureGeometry(aspect).camera_of_annotated_picture(camera, SIZE)
        files.append(LineFile(f"{number}", SIZE, click(shown, 0.7, number, Pitch(goal="middle"))))
    write_line_files(folder, files)
    return files


def calibrate(folder: Path, out: Path, **options) -> dict:
    with ThreadPoolExecutor(1) as executor:
        return calibrate_files(folder, out, size=SIZE, executor=executor, **options)


class TestCalibrateFiles:
    @pytest.mark.parametrize("by_file", [True, False])
    def test_cameras_are_those_of_the_picture_as_it_is(self, tmp_path: Path, by_file: bool) -> None:
        lines, file = tmp_path / "lines", tmp_path / "picture.json"
        write(lines)
        file.write_text(json.dumps(estimate_picture_geometry_of_files(lines, size=SIZE)))
        options = {"picture": file} if by_file else {"guess_picture": True}
        summary = calibrate(lines, tmp_path / "out", **options)
        assert summary["picture"]["aspect"] == pytest.approx(1.06, abs=0.015)
        cameras = read_cameras(tmp_path / "out", ReaderReport()).values()
        assert len(cameras) == 4
        for camera in cameras:
            assert camera.focal_length[0] / camera.focal_length[1] == pytest.approx(
                summary["picture"]["aspect"]
            )
            assert np.linalg.norm(camera.position - POSITION) < 2.5

    def test_pictures_that_are_not_stretched_get_the_same_cameras_as_without_a_guess(
        self, tmp_path: Path
    ) -> None:
        write(tmp_path / "lines", aspect=1.0)
        calibrate(tmp_path / "lines", tmp_path / "plain")
        calibrate(tmp_path / "lines", tmp_path / "asked", guess_picture=True)
        cameras = sorted((tmp_path / "plain").glob("camera_*.json"))
        assert len(cameras) == 4
        for file in cameras:
            assert (tmp_path / "asked" / file.name).read_bytes() == file.read_bytes()


class TestPictureFor:
    def test_too_few_frames_are_told_and_nothing_is_done(self, tmp_path: Path) -> None:
        picture, told = choose_picture_geometry(write(tmp_path, count=2), SIZE, None)
        assert picture is None
        assert "needs 3" in told["problem"]


class TestReadPicture:
    def test_numbers_that_are_absent_are_nothing(self, tmp_path: Path) -> None:
        (tmp_path / "a.json").write_text('{"aspect": 1.25}')
        assert read_picture_geometry(tmp_path / "a.json") == PictureGeometry(1.25)

    @pytest.mark.parametrize(
        "text", ["[1]", '{"shift": 1}', '{"aspect": "wide"}', '{"sigma": [1]}']
    )
    def test_a_file_of_something_else_is_refused(self, tmp_path: Path, text: str) -> None:
        (tmp_path / "a.json").write_text(text)
        with pytest.raises(DatasetFormatError, match="touchline picture --json"):
            read_picture_geometry(tmp_path / "a.json")
