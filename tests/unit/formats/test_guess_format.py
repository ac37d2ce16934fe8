from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from app.formats import guess_format as module
from app.formats.guess_format import guess_format, holds_only_videos

CASES = [
    ("soccernet-v3", "l/s/m/Labels-v3.json"),
    ("soccernet-v3d", "l/s/m/Labels-v3D.json"),
    ("soccernet-v3d", "SNv3D.csv"),
    ("issia", "ground_truth_1.xgtf.gz"),
    ("issia-3d", "ISSIA-3D.csv"),
    ("gamestate", "test/SNGS-1/Labels-GameState.json"),
    ("sn-calibration", "valid/00002.json"),
    ("cameras", "camera_00002.json"),
    ("coco", "annotations/instances_train.json"),
    ("coco", "my-coco-file.json"),
    ("parquet", "views.parquet"),
    ("issia", "cam1.xml"),
    ("frames", "still_00001.PNG"),
    ("frames", "day 1/DSC_0001.jpeg"),
    (None, "match.mp4"),
    (None, "notes.txt"),
    (None, "coco.json.txt"),
]


class TestGuessFormat:
    @pytest.mark.parametrize(("form", "name"), CASES)
    def test_knows_folders_zips_and_files(
        self, tmp_path: Path, make_zip: Callable[..., Path], form: str | None, name: str
    ) -> None:
        path = tmp_path / "in" / name
        path.parent.mkdir(parents=True)
        path.write_text("x")
        assert guess_format(tmp_path / "in") == form
        assert guess_format(path) == form
        assert guess_format(make_zip({name: "x"})) == form

    def test_pictures_beside_files_of_the_system_are_frames_and_beside_others_are_not(
        self, make_zip: Callable[..., Path]
    ) -> None:
        pictures = {"a/1.jpg": "x", "a/2.webp": "x"}
        system = {"__MACOSX/a/._1.jpg": "x", "a/Thumbs.db": "x", ".DS_Store": "x"}
        assert guess_format(make_zip(pictures | system)) == "frames"
        assert guess_format(make_zip(pictures | {"labels/1.txt": "x"})) is None
        beside = {"README.txt": "x", "terms.pdf": "x", "a/clip.mp4": "x"}
        assert guess_format(make_zip(pictures | beside)) == "frames"

    @pytest.mark.parametrize(
        ("names", "is_one"),
        [
            (("match.MP4",), True),
            (("a/match.mov", "readme.txt", ".DS_Store"), True),
            (("a/match.mov", "a/1.jpg"), False),
            (("match.mp4", "Labels-v3.json"), False),
            (("1.jpg",), False),
            ((".DS_Store",), False),
        ],
    )
    def test_videos_without_labels_are_known(
        self, make_zip: Callable[..., Path], tmp_path: Path, names: tuple[str, ...], is_one: bool
    ) -> None:
        assert holds_only_videos(make_zip(dict.fromkeys(names, "x"))) is is_one
        for name in names:
            path = tmp_path / "in" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("x")
        assert holds_only_videos(tmp_path / "in") is is_one

    def test_labels_count_more_than_the_cameras_beside_them(self, tmp_path: Path) -> None:
        for name in ("camera_00002.json", "00002.json", "manifest.json"):
            (tmp_path / name).write_text("{}")
        assert guess_format(tmp_path) == "sn-calibration"

    def test_a_zip_with_a_long_list_is_guessed_from_its_first_names(
        self, make_zip: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = make_zip({"a.txt": "x", "Labels-v3.json": "x", "SNv3D.csv": "x"})
        monkeypatch.setattr(module, "MAX_NAMES", 2)
        monkeypatch.setattr(zipfile, "ZipFile", lambda *_: pytest.fail("the whole list is read"))
        assert guess_format(path) == "soccernet-v3"

    def test_a_name_that_fits_on_no_disk_is_not_looked_at(
        self, make_zip: Callable[..., Path]
    ) -> None:
        assert guess_format(make_zip({f"a/{'camera_' * 40}.json": "x"})) is None

    def test_a_damaged_zip_and_a_missing_file_are_nothing(self, tmp_path: Path) -> None:
        (tmp_path / "a.zip").write_bytes(b"PK\x03\x04")
        assert guess_format(tmp_path / "a.zip") is None
        assert guess_format(tmp_path / "b.zip") is None
