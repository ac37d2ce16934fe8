from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from app.formats.export_record import ExportRecord
from app.formats.yolo_writer import format_yolo_label, write_yolo
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Group

Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]
SIZE = ImageSize(960, 540)


def trained_on(data: Path, split: str) -> list[Path]:
    """The images of a split as Ultralytics finds them.

    Its ``path`` is the folder of the file where none is given, but one that is relative lies
    below the working directory; ``./`` in a list is the folder of the list.
    """
    value = yaml.safe_load(data.read_text())
    root = Path(value["path"]) if value.get("path") else data.parent
    listed = (root / value[split]).resolve()
    lines = listed.read_text().splitlines()
    return [listed.parent / line.removeprefix("./") for line in lines]


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
        assert format_yolo_label(box, SIZE) == line


class TestWriteYolo:
    @pytest.mark.parametrize("every_view", [False, True])
    def test_a_ball_whose_box_lies_beside_its_picture_teaches_nothing(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, every_view: bool
    ) -> None:
        group = soccer_group()
        beside = BallAnnotation(box=Box(1279.5, 300.0, 12.0, 11.0))
        group = group.with_view(replace(group.views[1], balls=(beside,)))
        counts = write_yolo(tmp_path, [solved(group)], boxes="annotated", every_view=every_view)
        assert (counts["labels"], counts["boxes"], counts["views_left_out"]) == (1, 1, 1)
        (label,) = (tmp_path / "labels").rglob("*.txt")
        assert label.read_text().startswith("0 ")
        assert len((tmp_path / "frames.csv").read_text().splitlines()) == 2

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
            "views_left_out": 0,
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
        assert "1 image is not in this export" in (tmp_path / "data.yaml").read_text()
        with (tmp_path / "frames.csv").open(newline="") as file:
            first, second = csv.DictReader(file)
        assert (first["image"], first["present"]) == ("images/train/x_7.png", "True")
        assert (second["present"], second["view"]) == ("False", "7_1.png")
        assert second["group"] == f"{match}/7.png"

    @pytest.mark.parametrize("every_view", [False, True])
    def test_a_view_whose_ball_has_no_box_is_left_out_and_counted(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, every_view: bool
    ) -> None:
        group = soccer_group(replays=4)
        (box,) = group.views[0].balls
        balls = [
            (BallAnnotation(point=ImagePoint(5.0, 6.0)),),
            (box, replace(box, box=Box(10.0, 10.0, 9.0, 9.0))),
            (BallAnnotation(out_of_view=True),),
            (),
        ]
        views = [replace(view, balls=of) for view, of in zip(group.views[1:], balls, strict=True)]
        record = solved(replace(group, views=(group.views[0], *views)))
        counts = write_yolo(tmp_path, [record], boxes="annotated", every_view=every_view)
        assert (counts["labels"], counts["boxes"], counts["views_left_out"]) == (3, 1, 2)
        with (tmp_path / "frames.csv").open(newline="") as file:
            assert [row["view"] for row in csv.DictReader(file)] == [
                "7.png", "7_3.png", "7_4.png",
            ]  # fmt: skip
        assert len(list(tmp_path.rglob("labels/**/*.txt"))) == 3

    def test_a_group_of_which_nothing_is_written_is_not_counted(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        counts = write_yolo(tmp_path, [solved(issia_group())], boxes="annotated")
        assert (counts["groups"], counts["labels"], counts["views_left_out"]) == (0, 0, 2)

    @pytest.mark.parametrize("place", ["here", "elsewhere"])
    def test_the_data_file_works_from_anywhere(
        self,
        tmp_path: Path,
        solved: Solved,
        soccer_group: Make,
        monkeypatch: pytest.MonkeyPatch,
        place: str,
    ) -> None:
        for name in ("here", "elsewhere"):
            (tmp_path / name).mkdir()
        write_yolo(tmp_path / "here", [solved(soccer_group(split="valid"))])
        monkeypatch.chdir(tmp_path / place)
        assert {image.parts[-4] for image in trained_on(tmp_path / "here/data.yaml", "val")} == {
            "here"
        }

    def test_what_tests_never_validates(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        for count in (0, 1, 3):
            root = tmp_path / str(count)
            root.mkdir()
            groups = [soccer_group(f"{n}.png") for n in range(count)]
            groups.append(soccer_group("9.png", split="test"))
            write_yolo(root, map(solved, groups))
            images = {name: set(trained_on(root / "data.yaml", name)) for name in ("val", "test")}
            assert len(images["test"]) == 2
            assert not images["val"] & images["test"]

    def test_a_split_that_nobody_knows_has_a_list_of_its_own(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        groups = [soccer_group("7.png"), soccer_group("8.png", split="fold/3")]
        write_yolo(tmp_path, map(solved, groups))
        listed = (tmp_path / "other.txt").read_text().split()
        assert len(listed) == 2
        assert all(line.startswith("./images/other/") for line in listed)
        train, val = (trained_on(tmp_path / "data.yaml", name) for name in ("train", "val"))
        assert {image.parent.name for image in [*train, *val]} == {"train"}
        assert "# other.txt holds the images of splits" in (tmp_path / "data.yaml").read_text()

    def test_the_last_groups_of_a_few_matches_are_held_out(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        groups = [soccer_group(f"{n}.png") for n in range(20)]
        write_yolo(tmp_path, map(solved, groups))
        train, val = (trained_on(tmp_path / "data.yaml", name) for name in ("train", "val"))
        assert [image.stem.split("_", 1)[1] for image in val] == ["18", "18_1", "19", "19_1"]
        assert len(train) == 36
        assert not set(train) & set(val)
        assert "of matches that train, too" in (tmp_path / "data.yaml").read_text()

    def test_whole_matches_are_held_out_where_there_are_some(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        groups = [soccer_group("7.png", match=f"l/s/{n}") for n in range(12)]
        for order in (groups, groups[::-1]):
            root = tmp_path / order[0].match[-1]
            root.mkdir()
            write_yolo(root, map(solved, order))
        lists = [sorted((tmp_path / name / "val.txt").read_text().split()) for name in "01"]
        # Two of twelve matches are the first to be a tenth; which, their names say.
        assert len(lists[0]) == 4
        assert lists[0] == lists[1]
        train = (tmp_path / "0/train.txt").read_text().split()
        assert len(train) == 20
        assert not {line.split("/")[-1][:12] for line in lists[0]} & {
            line.split("/")[-1][:12] for line in train
        }

    def test_one_group_alone_validates_itself_and_says_so(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        write_yolo(tmp_path, [solved(soccer_group())])
        assert yaml.safe_load((tmp_path / "data.yaml").read_text())["val"] == "train.txt"
        assert "Too few groups" in (tmp_path / "data.yaml").read_text()
        assert sorted(path.name for path in tmp_path.glob("*.txt")) == ["train.txt"]

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
