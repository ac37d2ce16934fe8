from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.formats.coco_reader import read_coco
from app.formats.coco_writer import write_coco
from app.formats.export_record import ExportRecord
from app.formats.report import ReaderReport
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Group
from tests.unit.formats.foreign_coco import ball, coco, image, write

Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]


def foreign(**changes: Any) -> dict[str, Any]:
    """A file of another tool."""
    return {
        "images": [{"id": 5, "file_name": "clip/0001.jpg", "width": 1280, "height": 720}],
        "annotations": [
            {"id": 1, "image_id": 5, "category_id": 37, "bbox": [1, 2, 3, 4]},
            {"id": 2, "image_id": 5, "category_id": 1, "bbox": [10, 20, 30, 40]},
        ],
        "categories": [{"id": 37, "name": "sports ball"}, {"id": 1, "name": "Person"}],
    } | changes


@pytest.fixture
def read(tmp_path: Path, report: ReaderReport) -> Callable[[Any], list[Group]]:
    def run(value: Any) -> list[Group]:
        (tmp_path / "annotations").mkdir(exist_ok=True)
        path = tmp_path / "annotations/instances_test.json"
        path.write_text(value if isinstance(value, str) else json.dumps(value))
        return list(read_coco(tmp_path, report))

    return run


class TestReadCoco:
    def test_files_of_others_are_images_with_boxes(
        self, read: Callable[[Any], list[Group]], tmp_path: Path, report: ReaderReport
    ) -> None:
        (tmp_path / "images/clip").mkdir(parents=True)
        (tmp_path / "images/clip/0001.jpg").write_bytes(b"x")
        (group,) = read(foreign())
        (view,) = group.views
        assert (group.key, group.split, view.size) == (
            "clip/0001.jpg",
            "test",
            ImageSize(1280, 720),
        )
        assert view.balls[0].box == Box(0.5, 1.5, 3.0, 4.0)
        assert [dict(box) for box in view.extras.boxes] == [
            {
                "class": "person",
                "ID": "2",
                "points": {"x1": 9.5, "y1": 19.5, "x2": 39.5, "y2": 59.5},
            }
        ]
        assert view.media is not None
        assert report.problems == []

    def test_a_box_changed_in_another_tool_is_the_new_annotation(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        write_coco(tmp_path, [solved(soccer_group())])
        path = tmp_path / "annotations/instances_train.json"
        value = json.loads(path.read_text())
        value["annotations"][1]["bbox"] = [600, 301, 20, 21]
        path.write_text(json.dumps(value))
        (group,) = read_coco(tmp_path, report)
        assert group.views[0].balls[0].box == Box(610.0, 300.0, 12.0, 11.0)
        assert group.views[1].balls[0].box == Box(599.5, 300.5, 20.0, 21.0)

    def test_a_ball_drawn_in_another_tool_on_a_view_that_had_none_is_read(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group()
        bare = replace(group.views[1], balls=())
        write_coco(
            tmp_path, [solved(replace(group, views=(group.views[0], bare)))], everything=True
        )
        path = tmp_path / "annotations/instances_train.json"
        value = json.loads(path.read_text())
        (image,) = (one for one in value["images"] if not one["touchline"]["balls"])
        assert not [one for one in value["annotations"] if one["image_id"] == image["id"]]
        drawn = {"id": 99, "image_id": image["id"], "category_id": 1, "bbox": [600, 301, 20, 21]}
        value["annotations"].append(drawn)
        path.write_text(json.dumps(value))
        (again,) = read_coco(tmp_path, report)
        boxes = [ball.box for view in again.views for ball in view.balls]
        assert Box(599.5, 300.5, 20.0, 21.0) in boxes and len(boxes) == 2

    @pytest.mark.parametrize(
        ("added", "field"),
        [
            ({"category_id": 2}, 'category_id: is "Player"'),
            ({"category_id": 9}, "category_id: is 9"),
            ({"category_id": 1, "iscrowd": 1}, "iscrowd: is 1"),
            ({"category_id": 1, "bbox": [600, 301, 0, 21]}, "bbox: has a box without area"),
        ],
    )
    @pytest.mark.parametrize("bare", [True, False])
    def test_a_box_added_to_an_export_that_is_no_ball_is_named_and_no_ball(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport, added: dict,
        field: str, bare: bool,
    ) -> None:  # fmt: skip
        group = soccer_group(replays=0)
        view = replace(group.views[0], balls=()) if bare else group.views[0]
        write_coco(tmp_path, [solved(replace(group, views=(view,)), ball=False)], everything=True)
        path = tmp_path / "annotations/instances_train.json"
        value = json.loads(path.read_text())
        value["categories"].append({"id": 2, "name": "Player"})
        items = value["annotations"]
        items.append({"id": 98, "image_id": 1, "bbox": [600, 301, 20, 21]} | added)
        path.write_text(json.dumps(value))
        (again,) = read_coco(tmp_path, report)
        assert again.views[0].balls == view.balls
        (problem,) = map(str, report.problems)
        assert f"annotations[{len(items) - 1}], {field}" in problem

    def test_a_ball_that_was_added_twice_is_one(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group(replays=0)
        bare = replace(group.views[0], balls=())
        write_coco(tmp_path, [solved(replace(group, views=(bare,)), ball=False)], everything=True)
        path = tmp_path / "annotations/instances_train.json"
        value = json.loads(path.read_text())
        box = {"bbox": [600, 301, 20, 21], "attributes": {"occluded": True}}
        value["annotations"] = [ball(1, 98, **box), ball(1, 99, **box)]
        path.write_text(json.dumps(value))
        (again,) = read_coco(tmp_path, report)
        (one,) = again.views[0].balls
        assert (one.box, one.occluded) == (Box(599.5, 300.5, 20.0, 21.0), True)
        assert "second ball at the same place" in report.problems[0].problem

    def test_a_second_ball_added_to_a_view_is_named(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        write_coco(tmp_path, [solved(soccer_group(replays=0), ball=False)], everything=True)
        path = tmp_path / "annotations/instances_train.json"
        value = json.loads(path.read_text())
        value["annotations"].append(ball(1, 98, bbox=[600, 301, 20, 21]))
        path.write_text(json.dumps(value))
        (group,) = read_coco(tmp_path, report)
        assert len(group.views[0].balls) == 1
        assert [problem.problem for problem in report.problems] == [
            "adds a ball to a view that has one; left out"
        ]

    def test_a_box_added_to_a_view_with_several_balls_is_one_more_to_pick_from(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group(replays=0)
        two = tuple(BallAnnotation(box=Box(x, 300.0, 12.0, 11.0)) for x in (610.0, 700.0))
        group = group.with_view(replace(group.views[0], balls=two))
        write_coco(tmp_path, [solved(group, ball=False)], everything=True)
        (path,) = tmp_path.glob("annotations/*.json")
        value = json.loads(path.read_text())
        assert value["annotations"] == []
        value["annotations"] = [
            ball(1, 98, bbox=[600, 301, 20, 21]),
            ball(1, 99, bbox=[610.5, 300.5, 12, 11]),
        ]
        path.write_text(json.dumps(value))
        (again,) = read_coco(tmp_path, report)
        assert again.views[0].balls == (*two, BallAnnotation(box=Box(599.5, 300.5, 20.0, 21.0)))
        assert [(item.record, item.problem) for item in report.problems] == [
            ("annotations[1]", "puts a second ball at the same place; left out")
        ]

    @pytest.mark.parametrize("left", [[], [{"category_id": 2}]])
    def test_a_box_that_was_removed_leaves_no_ball_and_is_said(
        self,
        tmp_path: Path,
        solved: Solved,
        soccer_group: Make,
        report: ReaderReport,
        left: list[dict[str, Any]],
    ) -> None:
        write_coco(tmp_path, [solved(soccer_group(), ball=False)], everything=True)
        path = tmp_path / "annotations/instances_train.json"
        value = json.loads(path.read_text())
        value["annotations"] = value["annotations"][1:] + [ball(1, 98) | item for item in left]
        value["categories"].append({"id": 2, "name": "Player"})
        path.write_text(json.dumps(value))
        (group,) = read_coco(tmp_path, report)
        assert [len(view.balls) for view in group.views] == [0, 1]
        (remark,) = report.remarks
        assert "the ball box of 1 view (7.png) was removed since the export" in remark

    def test_a_file_without_a_list_of_annotations_removes_no_ball(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group()
        write_coco(tmp_path, [solved(group, ball=False)], everything=True)
        path = tmp_path / "annotations/instances_train.json"
        value = json.loads(path.read_text())
        del value["annotations"]
        path.write_text(json.dumps(value))
        (again,) = read_coco(tmp_path, report)
        assert [view.balls for view in again.views] == [view.balls for view in group.views]
        assert report.remarks == []

    def test_an_export_of_ours_that_says_no_origin_has_its_boxes_in_our_frame(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        write_coco(tmp_path, [solved(soccer_group())], boxes="annotated")
        path = tmp_path / "annotations/instances_train.json"
        value = json.loads(path.read_text())
        del value["info"]["bbox_origin"]
        for older, item in zip(value["images"], value["annotations"], strict=True):
            del older["touchline"]["bbox_origin"]
            item["bbox"] = item["written_bbox"] = [610.0, 300.0, 12.0, 11.0]
        value["annotations"][1]["bbox"] = [600, 301, 20, 21]
        path.write_text(json.dumps(value))
        (group,) = read_coco(tmp_path, report)
        assert group.views[0].balls[0].box == Box(610.0, 300.0, 12.0, 11.0)
        assert group.views[1].balls[0].box == Box(600.0, 301.0, 20.0, 21.0)
        assert report.problems == []

    @pytest.mark.parametrize("x", [0.1, 1 / 3, -0.3, 1e-9, 610.0000000001, 959.7])
    def test_import_export_import_changes_no_digit_of_a_box(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport, x: float
    ) -> None:
        group = soccer_group(replays=0)
        ball = BallAnnotation(box=Box(x, x / 7, 12.1, 11.3))
        group = replace(group, views=(replace(group.views[0], balls=(ball,)),))
        for out in ("first", "second"):
            (tmp_path / out).mkdir()
            write_coco(tmp_path / out, [solved(group, ball=False)], every_view=True)
            (group,) = read_coco(tmp_path / out, report)
            assert group.views[0].balls == (ball,)
        texts = {path.read_text() for path in tmp_path.rglob("instances_*.json")}
        assert len(texts) == 1

    def test_a_group_whose_views_are_in_two_files_is_one(
        self, tmp_path: Path, solved: Solved, issia_group: Make, report: ReaderReport
    ) -> None:
        groups = [issia_group(), issia_group(400)]
        splits = {"cam3": "train", "cam4": "test"}
        write_coco(tmp_path, [replace(solved(group), splits=splits) for group in groups])
        again = sorted(read_coco(tmp_path, report), key=lambda group: group.key)
        assert [group.views for group in again] == [group.views for group in groups]
        assert again[0].views[0].station is again[1].views[0].station

    @pytest.mark.parametrize(
        ("value", "field"),
        [
            (foreign(images=[{"id": 5, "file_name": "a/..%2fx.jpg", "width": 9, "height": 9}]),
             "file_name"),
            (foreign(images=[{"id": 5, "file_name": "..", "width": 9, "height": 9}]),
             "file_name"),
            (foreign(images=[{"id": 5, "file_name": "x.jpg", "width": 1e9, "height": 9}]), "width"),
            (foreign(images=["x"]), None),
            (foreign(annotations=[{"image_id": 5, "category_id": 37, "bbox": [1, 2, -3, 4]}]),
             "bbox"),
            (foreign(annotations=[{"category_id": 37}]), "image_id"),
        ],
    )  # fmt: skip
    def test_what_is_wrong_is_named(
        self,
        read: Callable[[Any], list[Group]],
        report: ReaderReport,
        value: Any,
        field: str | None,
    ) -> None:
        read(value)
        assert field in [item.field for item in report.problems]

    def test_a_state_that_was_tampered_with_leaves_its_image_out(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        write_coco(tmp_path, [solved(soccer_group(replays=2))], every_view=True)
        path = tmp_path / "annotations/instances_train.json"
        value = json.loads(path.read_text())
        images = value["images"]
        images[0]["touchline"]["group"] = "../../etc"
        images[1]["touchline"]["lines"] = {"Midfield": [[1, 2]]}
        images[2]["touchline"]["given"] = {"pan_degrees": 1}
        path.write_text(json.dumps(value))
        assert list(read_coco(tmp_path, report)) == []
        assert [item.record for item in report.problems] == [f"images[{n}]" for n in range(3)]

    def test_boxes_and_lines_beside_the_ball_come_back(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        person = {"class": "person", "ID": "2", "points": {"x1": 1.5, "y1": 2, "x2": 3, "y2": 4}}
        line = {"class": "Line unknown", "points": [1.0, 2.0, 3.0, 4.0]}
        group = soccer_group(replays=1)
        view = replace(group.views[0], extras=Extras((person,), (line,)))
        write_coco(tmp_path, [solved(group.with_view(view))])
        (again,) = read_coco(tmp_path, report)
        assert [found.extras for found in again.views] == [view.extras, group.views[1].extras]
        assert report.problems == []

    def test_views_outside_come_back_to_their_group(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group(replays=2)
        write_coco(tmp_path, [solved(group)])
        assert len(list((tmp_path / "annotations").iterdir())) == 2
        assert list(read_coco(tmp_path, report)) == [group]
        assert report.problems == []

    def test_the_groups_of_others_are_groups(
        self, read: Callable[[Any], list[Group]], report: ReaderReport
    ) -> None:
        size = {"width": 1280, "height": 720}
        images = [
            {"id": 1, "file_name": "a/1.jpg", "group_id": "m/7", "view": "main", **size},
            {"id": 2, "file_name": "b/1.jpg", **size},
            {"id": 5, "file_name": "c/1.jpg", "group_id": "m/7", "view": "goal", **size},
            {"id": 6, "file_name": "d/1.jpg", "group_id": 8, **size},
        ]
        groups = {group.key: group for group in read(foreign(images=images))}
        assert {key: [view.key for view in group.views] for key, group in groups.items()} == {
            "m/7": ["main", "goal"],
            "b/1.jpg": ["b/1.jpg"],
            "8": ["1.jpg"],
        }
        assert groups["m/7"].split == "test"
        assert groups["m/7"].views[1].balls[0].box == Box(0.5, 1.5, 3.0, 4.0)
        stations = [view.station.key for group in groups.values() for view in group.views]
        assert len(set(stations)) == 4
        assert report.problems == []

    def test_the_cameras_of_others_are_given_cameras(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        write_coco(tmp_path, [record := solved(soccer_group())])
        path = tmp_path / "annotations/instances_train.json"
        value = json.loads(path.read_text())
        for item in value["images"]:
            del item["touchline"]
        path.write_text(json.dumps(value))
        (group,) = read_coco(tmp_path, report)
        for found, written in zip(group.views, record.group.views, strict=True):
            assert found.station.given is not None
            assert found.station.given == record.camera(written)
        assert report.problems == []

    def test_the_cameras_of_synloc_are_given_cameras(
        self, read: Callable[[Any], list[Group]], report: ReaderReport
    ) -> None:
        across = [[0, 1, 0, 0], [0, 0, -1, 0], [-1, 0, 0, 60]]
        image = foreign()["images"][0] | {"camera_matrix": across, "dist_poly": [1.0, 0.0]}
        (group,) = read(foreign(images=[image]))
        camera = group.views[0].station.given
        assert camera is not None
        assert (camera.lens, camera.position[1]) == ("arctan_polynomial", 60.0)
        assert report.problems == []

    @pytest.mark.parametrize(
        ("changes", "field"),
        [
            ({"camera": "main"}, "camera"),
            ({"camera": {"pan_degrees": 1}}, "camera.tilt_degrees"),
            ({"camera_matrix": [[1]], "dist_poly": [1, 0]}, "camera_matrix"),
        ],
    )
    def test_a_camera_that_is_none_is_named_and_its_image_stays(
        self,
        read: Callable[[Any], list[Group]],
        report: ReaderReport,
        changes: dict[str, Any],
        field: str,
    ) -> None:
        (group,) = read(foreign(images=[foreign()["images"][0] | changes]))
        assert group.views[0].station.given is None
        assert [item.field for item in report.problems] == [field]

    def test_the_split_is_in_the_name_of_the_file(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        (tmp_path / "outside_valid.json").write_text(json.dumps(foreign()))
        (group,) = read_coco(tmp_path, report)
        assert group.split == "valid"

    @pytest.mark.parametrize(
        ("changes", "field"),
        [
            ({"group_id": "../x"}, "group_id"),
            ({"group_id": "g", "view": "/etc/x"}, "view"),
            ({"group_id": "g", "view": [1]}, "view"),
        ],
    )
    def test_names_that_are_none_are_named(
        self, read: Callable[[Any], list[Group]], report: ReaderReport, changes: Any, field: str
    ) -> None:
        image = foreign()["images"][0] | changes
        assert read(foreign(images=[image])) == []
        assert [item.field for item in report.problems] == [field]

    def test_categories_that_are_no_list_are_named(
        self, read: Callable[[Any], list[Group]], report: ReaderReport
    ) -> None:
        (group,) = read(foreign(categories=3.5))
        assert group.views[0].balls == ()
        first, last = report.problems
        assert (first.field, first.problem) == ("categories", "is not a list; left out")
        assert "none of its categories (id 37, id 1) is recognised as the ball" in last.problem

    def test_a_box_with_infinity_is_left_out_and_the_rest_is_read(
        self, read: Callable[[Any], list[Group]], report: ReaderReport
    ) -> None:
        (group,) = read(json.dumps(foreign()).replace("[1, 2, 3, 4]", "[1, 2, Infinity, 4]"))
        assert group.views[0].balls == ()
        assert len(group.views[0].extras.boxes) == 1
        assert ("annotations[0]", "bbox") in [(item.record, item.field) for item in report.problems]
        assert any("read as missing" in remark for remark in report.remarks)


class TestJoins:
    """Every record that joins nothing is counted and named."""

    @pytest.mark.parametrize(
        ("annotation", "record", "field", "words"),
        [
            ({"image_id": 99}, "annotations[1]", "image_id", "is 99, which no image"),
            ({"image_id": None}, "annotations[1]", "image_id", "is null, which no image"),
            ({"category_id": 9}, "annotations[1]", "category_id", "is 9, which no category"),
            ({"iscrowd": 1}, "annotations[1]", "iscrowd", "a crowd cannot be one ball"),
            ({"bbox": None, "segmentation": {"counts": "x"}}, "annotations[1]", "bbox", "RLE"),
            ({}, "annotations[1]", "id", "the id of an equal annotation before it"),
            ({"id": 3}, "annotations[1]", "bbox", "a second ball at the same place"),
        ],
    )
    def test_an_annotation(
        self,
        read: Callable[[Any], list[Group]],
        report: ReaderReport,
        annotation: dict[str, Any],
        record: str,
        field: str,
        words: str,
    ) -> None:
        value = coco(annotations=[ball(), ball() | annotation])
        (group,) = read(value)
        assert len(group.views[0].balls) == 1
        (problem,) = report.problems
        assert (problem.record, problem.field) == (record, field)
        assert words in problem.problem

    @pytest.mark.parametrize("name", ["a.jpg", "images\\a.jpg", "/x/a.jpg"])
    def test_images_and_categories_may_be_referred_to_by_their_names(
        self, read: Callable[[Any], list[Group]], report: ReaderReport, name: str
    ) -> None:
        (group,) = read(coco([image(identity=7)], [ball(name, category="Ball")]))
        assert len(group.views[0].balls) == 1
        assert report.problems == []

    def test_an_annotation_of_no_category_is_kept_as_a_box(
        self, read: Callable[[Any], list[Group]], report: ReaderReport
    ) -> None:
        (group,) = read(coco(annotations=[ball(), ball(identity=2, category="x")]))
        assert [box["class"] for box in group.views[0].extras.boxes] == [None]
        assert [problem.field for problem in report.problems] == ["category_id"]

    def test_annotations_of_one_id_are_all_read_and_counted(
        self, read: Callable[[Any], list[Group]], report: ReaderReport
    ) -> None:
        images = [image(), image("b.jpg", 2), image("c.jpg", 3)]
        groups = read(coco(images, [ball(1, 0), ball(2, 0), ball(3, 0)]))
        assert [len(group.views[0].balls) for group in groups] == [1, 1, 1]
        assert any("2 annotations have the id of another one" in it for it in report.remarks)

    @pytest.mark.parametrize("identity", [1, 1.0, "1", None])
    def test_an_image_whose_id_is_none_or_taken_is_named(
        self, read: Callable[[Any], list[Group]], report: ReaderReport, identity: Any
    ) -> None:
        groups = read(coco([image(), image("b.jpg", identity)]))
        assert [len(group.views[0].balls) for group in groups] == [1, 0]
        (problem,) = report.problems
        assert (problem.record, problem.field) == ("images[1]", "id")
        assert "no annotations are assigned to this image" in problem.problem

    def test_an_image_that_is_left_out_says_how_many_annotations_go_with_it(
        self, read: Callable[[Any], list[Group]], report: ReaderReport
    ) -> None:
        images = [image(width=None), image("b.jpg", 2)]
        read(coco(images, [ball(), ball(identity=2), ball(2, 3)]))
        (problem,) = report.problems
        assert (problem.record, problem.field) == ("images[0]", "width")
        assert problem.problem.endswith("left out with 2 annotations")

    def test_annotations_without_an_image_are_counted(
        self, read: Callable[[Any], list[Group]], report: ReaderReport
    ) -> None:
        read(coco(annotations=[ball(), ball(2, 2), ball(3, 3)]))
        assert report.counts["annotations without image"] == 2

    def test_a_file_of_sn_gamestate_is_said_to_be_one(
        self, read: Callable[[Any], list[Group]], report: ReaderReport
    ) -> None:
        person = {"id": "1", "image_id": "1", "category_id": 1, "bbox_image": {"x": 1, "y": 2}}
        assert read(coco(annotations=[person])) == []
        assert "import it as gamestate" in report.problems[0].problem

    def test_a_json_file_of_something_else_is_said(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        write(tmp_path, {"x.json": coco(), "package.json": {"name": "x"}})
        assert len(list(read_coco(tmp_path, report))) == 1
        assert any("package.json: is not a COCO file" in remark for remark in report.remarks)
        assert report.problems == []


class TestSplits:
    @pytest.mark.parametrize(
        ("file", "name", "split"),
        [
            ("train/_annotations.coco.json", "a.jpg", "train"),
            ("valid/_annotations.coco.json", "a.jpg", "valid"),
            ("annotations/instances_val2017.json", "a.jpg", "valid"),
            ("annotations/instances_Test.json", "a.jpg", "test"),
            ("labels.json", "test/a.jpg", "test"),
            ("labels.json", "a.jpg", ""),
            ("train/labels_test.json", "a.jpg", "test"),
        ],
    )
    def test_they_are_in_the_name_of_the_file_or_of_a_folder(
        self, tmp_path: Path, report: ReaderReport, file: str, name: str, split: str
    ) -> None:
        write(tmp_path, {file: coco([image(name)])})
        (group,) = read_coco(tmp_path, report)
        assert group.split == split


class TestKeys:
    @pytest.mark.parametrize(
        ("names", "keys"),
        [
            (["images\\a.jpg"], ["images/a.jpg"]),
            (["/home/anna/a.jpg", "/home/anna/b.jpg"], ["a.jpg", "b.jpg"]),
            (["/home/p/a.jpg", "/home/q/a.jpg"], ["home/p/a.jpg", "home/q/a.jpg"]),
            (["..\\..\\media\\4\\a.jpg"], ["a.jpg"]),
        ],
    )
    def test_names_of_another_machine_are_as_short_as_they_can_be(
        self, read: Callable[[Any], list[Group]], names: list[str], keys: list[str]
    ) -> None:
        images = [image(name, number) for number, name in enumerate(names, 1)]
        assert [group.key for group in read(coco(images))] == keys
