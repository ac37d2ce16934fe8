from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from app.formats.guess_format import HEAD_BYTES, guess_other_format
from tests.unit.formats.foreign_coco import coco, write

VOC = "<annotation><filename>a.jpg</filename><object><name>ball</name></object></annotation>"
CVAT = "<?xml version='1.0'?><annotations><version>1.1</version><meta/></annotations>"
CASES: list[tuple[dict[str, Any], str]] = [
    ({"x.json": coco()}, "coco"),
    ({"l/Labels-v3.json": {"actions": {"7.png": {"imageMetadata": {}}}}}, "soccernet-v3"),
    ({"labels.json": {"actions": {"7.png": {"imageMetadata": {}}}}}, "soccernet-v3"),
    ({"x.json": {"annotations": [{"bbox_image": {}}], "images": []}}, "gamestate"),
    ({"x.json": {"Side line left": [{"x": 0.1, "y": 0.2}]}}, "sn-calibration"),
    ({"x.json": {"pan_degrees": 1.0}}, "cameras"),
    ({"x.xml": "<?xml version='1.0'?><viper xmlns='x'></viper>"}, "issia"),
    ({"x.json": {"images": [{"file_name": "a.jpg", "imageData": None}], "annotations": []}}, "coco"),
    ({"x.parquet": "PAR1"}, "parquet"),
    ({"x.csv": ",frame,x_cam1,y_cam1\n"}, "issia-3d"),
    ({"labels/a.txt": "0 0.5 0.5 0.1 0.1\n", "data.yaml": "names: [ball]"}, "YOLO labels"),
    ({"labels/a.txt": "3 0.51 0.52 0.11 0.1 0.93\n"}, "YOLO labels"),
    ({"gt/gt.txt": "1,1,10,20,30,40,1,-1,-1\n"}, "MOT"),
    ({"a.json": {"shapes": [], "imagePath": "a.jpg"}, "a.jpg": "x"}, "LabelMe"),
    ({"a.json": {"imageData": "x"}}, "LabelMe"),
    ({"via.json": {"a.jpg1": {"regions": [], "file_attributes": {}}}}, "VIA"),
    ({"p.json": [{"data": {}, "annotations": [{"from_name": "a", "to_name": "b"}]}]},
     "Label Studio"),
    ({"a.xml": VOC}, "Pascal VOC"),
    ({"annotations.xml": CVAT}, "CVAT"),
    ({"r.json": [{"image_id": 1, "category_id": 1, "bbox": [1, 2, 3, 4], "score": 0.5}]},
     "COCO results of a detector"),
    ({"x.csv": "filename,xmin,ymin,xmax,ymax,class\n"}, "a table of boxes"),
    ({"min.json": [{"image": "/data/1.jpg", "label": [{"rectanglelabels": ["Ball"]}]}]},
     "Label Studio's JSON-MIN"),
    ({"ls.csv": 'image,id,label\n1.jpg,1,"[{""rectanglelabels"": [""Ball""]}]"\n'},
     "Label Studio's CSV"),
    ({"labels/a.txt": "0" + " 0.5 0.25" * 40 + "\n"}, "YOLO labels"),
    ({"labels/a.txt": "", "images/a.jpg": "x"}, "YOLO labels"),
    ({"via.csv": "filename,file_size,region_shape_attributes\n"}, "VIA"),
    ({"via.json": {"project": {}, "file": {"1": {"fid": 1, "fname": "a.jpg"}}}}, "VIA"),
    ({"default.json": {"categories": {}, "items": [{"annotations": [{"label_id": 0}]}]}},
     "Datumaro"),
    ({"a.json": {"imageData": "A" * 2 * HEAD_BYTES, "shapes": [], "imagePath": "a.jpg"}}, "LabelMe"),
    ({"samples.json": {"samples": [{"filepath": "a.jpg"}]}}, "FiftyOne"),
    ({"labels.json": {"classes": [], "labels": {"a": [{"bounding_box": []}]}}}, "FiftyOne"),
    ({"x.ndjson": '{"data_row": {"id": "x"}, "projects": {}}'}, "Labelbox"),
    ({"a.json": {"item": {"name": "a.jpg", "slots": []}, "annotations": []}}, "V7"),
    ({"x.dat": "1000:0,1,10,100,200,1.5;:0,0,100,2.0,H,Alive;:\n"}, "TRACAB"),
    ({"t.jsonl": '{"frame_id": 0, "teams": {}, "ball": {"x": 1}}'}, "Common Data Format"),
    *(({f"x{ending}": "x"}, "unpack it; of packed files only zip is read")
      for ending in (".tar", ".tar.gz", ".json.gz", ".7z", ".rar")),
    ({"a.mp4": "x"}, "a video"),
    ({"a.jpg": "x"}, "pictures alone"),
    ({"a.jpg": "x", "backup.rar": "x"}, "pictures alone"),
    ({"a.mp4": "x", "old.tar.gz": "x"}, "a video"),
    ({"images/a.jpg": "x", "labels/readme.txt": "Who drew this"}, "frames"),
]  # fmt: skip


class TestLooksLike:
    @pytest.mark.parametrize(("files", "name"), CASES)
    def test_it_says_what_the_files_are(
        self, tmp_path: Path, files: dict[str, Any], name: str
    ) -> None:
        look = guess_other_format(write(tmp_path, files), "none of them")
        assert look is not None
        assert look.advice_sentence.startswith("It looks like ")
        assert name in look.advice_sentence
        formats = {"coco", "frames", "gamestate", "issia", "issia-3d", "cameras", "parquet"}
        if name in formats | {"sn-calibration", "soccernet-v3"}:
            assert (look.format, "choose that format" in look.advice_sentence) == (name, True)
        else:
            assert look.format is None

    def test_what_it_was_given_for_is_no_news(self, tmp_path: Path) -> None:
        assert guess_other_format(write(tmp_path, {"x.json": coco()}), "coco") is None
        assert guess_other_format(write(tmp_path / "y", {"notes.md": "x"}), "coco") is None
        assert guess_other_format(tmp_path / "none", "coco") is None

    @pytest.mark.parametrize("name", ["camera_1.json", "0001.json", "Labels-v3.json"])
    def test_what_a_file_holds_counts_before_its_name(self, tmp_path: Path, name: str) -> None:
        assert guess_other_format(write(tmp_path, {name: coco()}), "coco") is None
        look = guess_other_format(tmp_path, "issia")
        assert look is not None
        assert look.format == "coco"

    def test_one_file_and_a_large_one_are_told_alike(self, tmp_path: Path) -> None:
        value = coco()
        value["annotations"] *= HEAD_BYTES // 10
        write(tmp_path, {"x.json": {"info": {}, **value}})
        look = guess_other_format(tmp_path / "x.json", "gamestate")
        assert look is not None
        assert look.format == "coco"

    @pytest.mark.parametrize("suffix", ["json", "xml", "txt", "csv"])
    @pytest.mark.parametrize("unit", ['"images"', "0 0.5 ", "<annotation", "1,1,1", "a", "Goal "])
    def test_hostile_text_takes_no_time(self, tmp_path: Path, suffix: str, unit: str) -> None:
        write(tmp_path, {f"x.{suffix}": unit * (HEAD_BYTES // len(unit))})
        start = time.process_time()
        guess_other_format(tmp_path, "coco")
        assert time.process_time() - start < 2
