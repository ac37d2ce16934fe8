from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.formats.camera_json import camera_from_json
from app.formats.coco_writer import write_coco
from app.formats.export_record import ExportRecord
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import ImagePoint
from app.soccer.group import Group

Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]


def instances(root: Path, split: str) -> dict[str, Any]:
    value: dict[str, Any] = json.loads((root / f"annotations/instances_{split}.json").read_text())
    return value


class TestWriteCoco:
    def test_one_file_a_split_with_ids_that_are_nobody_elses(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        records = [
            solved(soccer_group()),
            solved(soccer_group("8.png", split="test")),
            solved(soccer_group("9.png", split="")),
        ]
        counts = write_coco(tmp_path, records)
        assert counts == {
            "groups": 3,
            "images": 6,
            "annotations": 6,
            "balls": 6,
            "images_outside": 0,
        }
        names = ("train", "test", "unassigned")
        assert sorted(path.name for path in (tmp_path / "annotations").iterdir()) == sorted(
            f"instances_{name}.json" for name in names
        )
        ids = [image["id"] for name in names for image in instances(tmp_path, name)["images"]]
        assert sorted(ids) == [1, 2, 3, 4, 5, 6]

    def test_the_evaluator_of_everybody_reads_it(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        from pycocotools.coco import COCO

        write_coco(tmp_path, [solved(soccer_group(replays=2))])
        coco = COCO(str(tmp_path / "annotations/instances_train.json"))
        assert [item["name"] for item in coco.loadCats(coco.getCatIds())] == ["ball"]
        annotation = coco.loadAnns(coco.getAnnIds(imgIds=[1]))[0]
        assert annotation["bbox"] == [611.25, 300.75, 10.5, 10.5]
        assert annotation["area"] == 10.5 * 10.5

    def test_an_image_says_which_view_it_is_and_what_its_camera_was(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str, camera: Camera
    ) -> None:
        write_coco(tmp_path, [solved(soccer_group())])
        image = instances(tmp_path, "train")["images"][1]
        assert image["file_name"] == f"{match}/Frames-v3/7_1.png"
        assert (image["group_id"], image["view"]) == (f"{match}/7.png", "7_1.png")
        assert camera_from_json(image["camera"], "f") == camera
        assert image["ball_3d"] == [1.5, -2.25, -0.113]
        assert image["jac"] == {"0.5": 0.9, "1": 1.0, "2": 1.0, "1.0": 1.0, "2.0": 1.0}
        assert image["verdict"] == "accepted"

    def test_a_view_that_fell_says_nothing_of_the_3d_ball_unless_all_is_asked(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        for everything in (False, True):
            root = tmp_path / str(everything)
            root.mkdir()
            write_coco(root, [solved(soccer_group(replays=2))], everything=everything)
            name = "instances_train" if everything else "outside_train"
            value = json.loads((root / f"annotations/{name}.json").read_text())
            third = next(image for image in value["images"] if image["view"] == "7_2.png")
            assert (third["ball_3d"] is not None) is everything

    def test_a_ball_that_no_other_view_confirms_teaches_nobody_unless_asked(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        from pycocotools.coco import COCO

        group = soccer_group(replays=3)
        # The last view shows no ball: it may teach that.
        group = replace(group, views=(*group.views[:3], replace(group.views[3], balls=())))
        for asked, taught in ((False, 3), (True, 4)):
            root = tmp_path / str(asked)
            root.mkdir()
            counts = write_coco(root, [solved(group)], every_view=asked)
            assert (counts["images"], counts["images_outside"]) == (taught, 4 - taught)
            coco = COCO(str(root / "annotations/instances_train.json"))
            assert len(coco.getImgIds()) == taught
            assert len(coco.getAnnIds()) == counts["annotations"] == taught - 1
        outside = COCO(str(tmp_path / "False/annotations/outside_train.json"))
        (image,) = outside.loadImgs(outside.getImgIds())
        (annotation,) = outside.loadAnns(outside.getAnnIds())
        assert (image["view"], annotation["image_id"]) == ("7_2.png", image["id"])
        assert annotation["bbox"] == annotation["annotated_bbox"]

    @pytest.mark.parametrize("boxes", ["annotated", "exact"])
    def test_the_box_is_the_chosen_one(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, boxes: str
    ) -> None:
        write_coco(tmp_path, [solved(soccer_group())], boxes=boxes)
        item = instances(tmp_path, "train")["annotations"][0]
        wanted = {"annotated": [610.5, 300.5, 12.0, 11.0], "exact": [611.0, 300.5, 10.6, 10.4]}
        assert item["bbox"] == item["written_bbox"] == wanted[boxes]
        assert item["annotated_bbox"] == [610.5, 300.5, 12.0, 11.0]

    def test_boxes_are_measured_from_the_corner_and_the_file_says_so(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        write_coco(tmp_path, [solved(soccer_group())], info={"description": "demo"})
        value = instances(tmp_path, "train")
        assert value["info"] == {"description": "demo", "bbox_origin": "corner"}
        state = value["images"][0]["touchline"]
        assert state["bbox_origin"] == "corner"
        # What was annotated stays in our own frame.
        assert state["balls"][0]["box"] == [610.0, 300.0, 12.0, 11.0]

    def test_a_centre_without_a_box_has_no_annotation(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        group = soccer_group(replays=0)
        ball = BallAnnotation(point=ImagePoint(5.0, 6.0))
        group = replace(group, views=(replace(group.views[0], balls=(ball,)),))
        counts = write_coco(tmp_path, [solved(group, ball=False)], every_view=True)
        assert (counts["annotations"], counts["images"], counts["images_outside"]) == (0, 0, 1)
        # Among those that teach it would say that there is no ball.
        (path,) = (tmp_path / "annotations").iterdir()
        assert path.name == "outside_train.json"
        (image,) = json.loads(path.read_text())["images"]
        assert image["touchline"]["balls"][0]["point"] == [5.0, 6.0]

    def test_a_view_with_several_balls_lies_outside_though_every_view_is_asked(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        group = soccer_group()
        (ball,) = group.views[1].balls
        several = replace(group.views[1], balls=(ball, ball))
        counts = write_coco(tmp_path, [solved(group.with_view(several))], every_view=True)
        assert (counts["images"], counts["images_outside"]) == (1, 1)
        assert len(instances(tmp_path, "train")["annotations"]) == 1

    def test_a_split_is_part_of_a_file_name_whatever_it_holds(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        write_coco(tmp_path, [solved(soccer_group(split="fold/1"))])
        (path,) = (tmp_path / "annotations").iterdir()
        assert path.name == "instances_fold-1.json"

    def test_views_of_one_group_may_be_in_two_splits(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        record = replace(solved(issia_group()), splits={"cam3": "train", "cam4": "test"})
        write_coco(tmp_path, [record])
        assert [len(instances(tmp_path, name)["images"]) for name in ("train", "test")] == [1, 1]

    def test_nothing_waits_beside_it_in_the_end(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        write_coco(tmp_path, [solved(soccer_group())])
        assert list(tmp_path.rglob("*.part")) == []
