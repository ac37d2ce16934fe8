"""Paint files: pictures and lines in, cameras out; bad pictures are rows with a reason."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.config import Settings
from app.errors import InputError
from app.features.file_tools.paint import (
    UniqueNameGenerator,
    measure_paint_agreement_of_files,
    snap_cameras_to_paint,
)
from app.formats.cameras import read_cameras
from app.formats.report import ReaderReport
from app.formats.sn_calibration import LineFile
from app.formats.sn_calibration_reader import read_line_files
from app.formats.sn_calibration_writer import write_line_files
from app.sample.render import render_view
from app.soccer.frames import ImageSize
from tests.cameras import write_cameras
from tests.scenes import make_scenes

SIZE = ImageSize(1280, 720)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A good picture, and every kind of bad one, each with the same lines and camera."""
    root = tmp_path_factory.mktemp("paint")
    scene = make_scenes(1, 1, faults=False)[0]
    view = scene.group.views[0]
    good = render_view(scene, view.key)
    grey = cv2.cvtColor(cv2.cvtColor(good, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    pictures = {
        "good": good,
        "grey": grey,
        "small": cv2.resize(good, (100, 100)),
        "crowd": np.full((720, 1280, 3), (120, 80, 130), np.uint8),
    }
    (root / "images").mkdir()
    for stem, picture in pictures.items():
        cv2.imwrite(str(root / "images" / f"{stem}.png"), picture)
    whole = (root / "images" / "good.png").read_bytes()
    (root / "images" / "cut.png").write_bytes(whole[: len(whole) // 3])
    header = bytearray(whole)
    header[16:24] = (60000).to_bytes(4, "big") * 2
    (root / "images" / "huge.png").write_bytes(header)
    stems = [*pictures, "cut", "huge"]
    (root / "lines").mkdir()
    lines = view.station.lines
    write_line_files(root / "lines", [LineFile(stem, SIZE, lines) for stem in stems])
    (root / "cameras").mkdir()
    truth = scene.truth.view(view.key)
    assert truth is not None
    write_cameras(root / "cameras", dict.fromkeys(stems, truth.camera))
    return root


class TestSnapFiles:
    def test_a_good_picture_is_snapped_and_a_bad_one_is_a_row_with_its_reason(
        self, folder, tmp_path
    ):
        rows = snap_cameras_to_paint(
            folder / "lines", [folder / "images"], tmp_path, settings=Settings()
        )
        by_frame = {row["frame"]: row for row in rows}
        assert {name: row["outcome"] for name, row in by_frame.items()} == {
            "good": "proposed", "grey": "unsure", "small": "nothing",
            "crowd": "unsure", "cut": "nothing", "huge": "nothing",
        }  # fmt: skip
        assert by_frame["good"]["error_px"] < 0.2 and by_frame["good"]["supported"] > 0.8
        for name in ("grey", "small", "crowd", "cut", "huge"):
            assert by_frame[name]["reason"], name
        assert json.loads((tmp_path / "snap.json").read_text()) == rows
        known: dict[str, object] = {}
        assert set(read_cameras(tmp_path, ReaderReport(), covariances=known)) >= {
            "good",
            "grey",
            "crowd",
        }
        assert set(known) == {"good", "grey", "crowd"}
        (file,) = (
            f for f in read_line_files(tmp_path / "lines", SIZE, ReaderReport()) if f.stem == "good"
        )
        assert all(2 <= len(points) <= 12 for points in file.lines.values() if len(points) > 1)

    def test_what_names_and_files_are_wrong_takes_no_picture_and_no_old_camera_along(
        self, folder, tmp_path
    ):
        lines, images, out = tmp_path / "lines", tmp_path / "images", tmp_path / "out"
        good = (folder / "images" / "good.png").read_bytes()
        for place in ("a/1.png", "b/1.png", "broken.png"):
            (images / place).parent.mkdir(parents=True, exist_ok=True)
            (images / place).write_bytes(good)
        (lines / "a").mkdir(parents=True)
        (lines / "a" / "1.json").write_bytes((folder / "lines" / "good.json").read_bytes())
        (lines / "broken.json").write_text("{")
        (out / "lines").mkdir(parents=True)
        (out / "camera_broken.json").write_text("of an earlier run")
        (out / "lines" / "broken.json").write_text("of an earlier run")
        rows = snap_cameras_to_paint(lines, [images], out, settings=Settings())
        assert {row["frame"]: row["outcome"] for row in rows} == {
            "a/1": "proposed",
            "broken": "nothing",
        }
        broken = next(row for row in rows if row["frame"] == "broken")
        assert broken["reason"] and broken["points"] == 0
        assert not (out / "camera_broken.json").exists()
        assert not (out / "lines" / "broken.json").exists()

    def test_invented_names_take_no_other_pictures_name(self):
        names = UniqueNameGenerator()
        assert [names.name(stem) for stem in ("a", "a", "a_2")] == ["a", "a_2", "a_2_2"]

    def test_pictures_without_a_line_file_are_an_error_when_there_is_no_other(
        self, folder, tmp_path
    ):
        (tmp_path / "empty").mkdir()
        with pytest.raises(InputError):
            snap_cameras_to_paint(
                tmp_path / "empty", [folder / "images"], tmp_path / "out", settings=Settings()
            )


class TestAgreeFiles:
    def test_a_zip_of_pictures_is_measured_and_bad_ones_are_told(self, folder, tmp_path):
        archive = tmp_path / "images.zip"
        with zipfile.ZipFile(archive, "w") as file:
            for name in ("good.png", "cut.png", "crowd.png"):
                file.write(folder / "images" / name, name)
        rows = measure_paint_agreement_of_files(folder / "cameras", [archive], settings=Settings())
        by_frame = {row["frame"]: row for row in rows}
        assert by_frame["good"]["supported"] > 0.8
        assert by_frame["crowd"]["outcome"] == by_frame["cut"]["outcome"] == "nothing"


class TestCommands:
    def test_agree_prints_one_json_document(self, folder, touchline):
        code, out, err = touchline(
            "agree", folder / "cameras", folder / "images" / "good.png", "--json"
        )
        assert code == 0
        (row,) = json.loads(out)
        assert "5 cameras without a picture: " in err
        assert row["frame"] == "good" and row["supported"] > 0.8

    def test_snap_takes_several_files_and_a_folder_to_write(self, folder, tmp_path, touchline):
        images = [folder / "images" / f"{name}.png" for name in ("good", "cut")]
        code, out, err = touchline("snap", folder / "lines", *images, tmp_path / "out")
        assert (code, "good  proposed" in out) == (0, True)
        assert "4 line files without a picture: crowd, grey, huge, small" in err
        assert (tmp_path / "out" / "camera_good.json").is_file()
