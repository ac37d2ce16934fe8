from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from app.datasets.export_record import ExportRecord
from app.datasets.yolo_writer import label_line, write_yolo
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Group

Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]
SIZE = ImageSize(960, 540)


class TestLabelLine:
    @pytest.mark.parametrize(
        ("box", "line"),
        [
            (Box(192.0, 54.0, 96.0, 54.0), "0 0.25 0.15 0.1 0.1"),
            (Box(-48.0, 0.0, 96.0, 54.0), "0 0.025 0.05 0.05 0.1"),
            (Box(912.0, 513.0, 96.0, 54.0), "0 0.975 0.975 0.05 0.05"),
            (Box(-96.0, 0.0, 96.0, 54.0), None),
            (Box(960.0, 0.0, 5.0, 5.0), None),
        ],
    )
    def test_parts_of_the_image_clipped_at_its_border(self, box: Box, line: str | None) -> None:
        assert label_line(box, SIZE) == line


class TestWriteYolo:
    def test_labels_lists_and_data_belong_together(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        records = [
            solved(soccer_group()),
            solved(soccer_group("8.png", split="valid")),
            solved(soccer_group("9.png", split="test")),
        ]
        counts = write_yolo(tmp_path, records)
        assert counts == {
            "groups": 3, "labels": 6, "boxes": 6, "balls": 6, "images": 0, "images_missing": 6,
        }  # fmt: skip
        data = yaml.safe_load((tmp_path / "data.yaml").read_text())
        assert (data["names"], data["nc"]) == ({0: "ball"}, 1)
        for name in ("train", "val", "test"):
            images = (tmp_path / data[name]).read_text().splitlines()
            assert len(images) == 2
            for image in images:
                # As every reader of this format finds the label of an image.
                label = Path(image.replace("/images/", "/labels/")).with_suffix(".txt")
                assert (tmp_path / label).read_text().startswith("0 ")

    def test_it_says_which_images_are_missing_and_where_they_belong(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str
    ) -> None:
        record = solved(soccer_group())
        write_yolo(tmp_path, [replace(record, frames={"7.png": "images/train/x_7.png"})])
        assert "1 images are not in this export" in (tmp_path / "data.yaml").read_text()
        with (tmp_path / "frames.csv").open(newline="") as file:
            first, second = csv.DictReader(file)
        assert (first["image"], first["present"]) == ("images/train/x_7.png", "True")
        assert (second["present"], second["view"]) == ("False", "7_1.png")
        assert second["group"] == f"{match}/7.png"

    def test_without_validation_the_test_list_stands_in(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        records = [solved(soccer_group()), solved(soccer_group("9.png", split="test"))]
        write_yolo(tmp_path, records)
        assert yaml.safe_load((tmp_path / "data.yaml").read_text())["val"] == "test.txt"
        assert not (tmp_path / "val.txt").exists()

    def test_a_view_without_a_ball_has_an_empty_label(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        group = soccer_group(replays=0)
        group = replace(group, views=(replace(group.views[0], balls=()),))
        assert write_yolo(tmp_path, [solved(group, ball=False)])["boxes"] == 0
        (label,) = tmp_path.rglob("labels/train/*.txt")
        assert label.read_text() == ""

    def test_names_are_ours_and_none_meets_another(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        groups = [soccer_group(match=f"l/s/{name}") for name in ("=cmd|x", "b c")]
        write_yolo(tmp_path, [solved(group) for group in groups])
        names = [path.name for path in tmp_path.rglob("labels/train/*.txt")]
        assert len(names) == 4
        assert all(name.replace("_", "").replace(".", "").isalnum() for name in names)
        # A match is the user's text; no spreadsheet runs it.
        assert ",=cmd" not in (tmp_path / "frames.csv").read_text()
