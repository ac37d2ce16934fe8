"""The same frame in several files, and frames of one name that are several."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from app.formats.coco_reader import read_coco
from app.formats.report import ReaderReport
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group
from tests.unit.formats.foreign_coco import ball, category, coco, image, write

OTHER = [50.0, 60.0, 20.0, 20.0]
PLAYER = {"keypoints": [100, 100, 2], "bbox": [100, 100, 0, 0]}


def read(root: Path, report: ReaderReport, **files: Any) -> dict[str, Group]:
    """The groups by key; ``train__b`` is the file train/b."""
    named = {name.replace("__", "/"): content for name, content in files.items()}
    return {group.key: group for group in read_coco(write(root, named), report)}


def pictures(groups: dict[str, Group], root: Path) -> dict[str, str | None]:
    found = {}
    for key, group in groups.items():
        (view,) = group.views
        found[key] = None if view.media is None else str(Path(view.media.path).relative_to(root))
    return found


class TestOneFrameInSeveralFiles:
    def test_people_and_captions_beside_instances_lose_no_ball(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {
            "annotations__captions_default.json": coco(
                annotations=[{"id": 1, "image_id": 1, "caption": "a ball in the air"}]
            ),
            "annotations__instances_default.json": coco(),
            "annotations__person_keypoints_default.json": coco(
                annotations=[ball(category=2, **PLAYER)]
            ),
        }
        groups = read(tmp_path, report, **files, **{"images__a.jpg": "x"})
        (view,) = groups["a.jpg"].views
        assert view.ball is not None
        assert [box["class"] for box in view.extras.boxes] == ["player"]
        assert (report.read, report.imported) == (3, 1)
        assert (report.counts["balls"], report.counts["captions"]) == (1, 1)
        assert report.problems == []

    @pytest.mark.parametrize("pictured", [False, True])
    def test_files_of_one_folder_speak_of_the_same_frames(
        self, tmp_path: Path, report: ReaderReport, pictured: bool
    ) -> None:
        files: dict[str, Any] = {
            "balls.json": coco(),
            "players.json": coco([image(identity=9)], [ball(9, category=2)]),
        }
        groups = read(tmp_path, report, **files, **({"a.jpg": "x"} if pictured else {}))
        (view,) = groups["a.jpg"].views
        assert (len(view.balls), len(view.extras.boxes)) == (1, 1)

    @pytest.mark.parametrize(
        ("second", "balls"),
        [
            ({}, [BallAnnotation(box=Box(89.5, 39.5, 20, 20))]),
            ({"occluded": True}, [BallAnnotation(box=Box(89.5, 39.5, 20, 20), occluded=True)]),
            ({"bbox": [90.4, 40, 20, 20]}, [BallAnnotation(box=Box(89.5, 39.5, 20, 20))]),
            ({"bbox": [101, 51, 0, 0]}, [BallAnnotation(box=Box(89.5, 39.5, 20, 20))]),
        ],
    )
    def test_the_same_ball_is_one_ball(
        self,
        tmp_path: Path,
        report: ReaderReport,
        second: dict[str, Any],
        balls: list[BallAnnotation],
    ) -> None:
        other = coco(annotations=[ball(**second)])
        groups = read(tmp_path, report, **{"a.json": coco(), "b.json": other})
        assert list(groups["a.jpg"].views[0].balls) == balls
        assert report.counts["balls"] == 1
        assert report.problems == []

    def test_a_box_says_more_than_a_point(self, tmp_path: Path, report: ReaderReport) -> None:
        point = coco(annotations=[ball(bbox=[100, 50, 0, 0])])
        groups = read(tmp_path, report, **{"a.json": point, "b.json": coco()})
        assert groups["a.jpg"].views[0].balls == (BallAnnotation(box=Box(89.5, 39.5, 20, 20)),)

    def test_balls_that_lie_apart_are_both_kept_and_named(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        other = coco(annotations=[ball(bbox=OTHER)])
        groups = read(tmp_path, report, **{"a.json": coco(), "b.json": other})
        assert len(groups["a.jpg"].views[0].balls) == 2
        (problem,) = report.problems
        assert problem.path.endswith("b.json")
        assert "places the ball elsewhere than" in problem.problem

    def test_sizes_and_splits_that_contradict_are_named(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {
            "annotations__instances_test.json": coco(annotations=[ball(bbox=OTHER)]),
            "annotations__instances_train.json": coco(annotations=[ball(bbox=OTHER)]),
            "annotations__other.json": coco([image(width=640, height=360)]),
        }
        groups = read(tmp_path, report, **files, **{"images__a.jpg": "x"})
        assert (groups["a.jpg"].split, len(groups["a.jpg"].views[0].balls)) == ("test", 1)
        assert sorted((item.field or "", item.problem.split(",")[0]) for item in report.problems) == [
            ("split", "puts this image into the split train"),
            ("width", "is 640x360"),
        ]  # fmt: skip

    def test_a_picture_under_two_ids_of_one_file_is_one_frame(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        value = coco([image(), image(identity=2)], [ball(1), ball(2, 2, 2)])
        groups = read(tmp_path, report, **{"a.json": value})
        (view,) = groups["a.jpg"].views
        assert (len(view.balls), len(view.extras.boxes), report.imported) == (1, 1, 1)

    def test_who_names_no_group_speaks_of_the_view_that_has_the_picture(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        grouped = coco([image(group_id="kick", view="north")])
        people = coco(annotations=[ball(category=2)])
        files = {"a.json": people, "b.json": grouped, "images__a.jpg": "x"}
        groups = read(tmp_path, report, **files)
        (view,) = groups["kick"].views
        assert (view.key, len(view.balls), len(view.extras.boxes)) == ("north", 1, 1)


class TestFramesOfOneName:
    def test_subsets_are_kept_apart_each_with_its_picture(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {
            "annotations__instances_Train.json": coco(),
            "annotations__instances_Validation.json": coco(annotations=[ball(bbox=OTHER)]),
            "images__Train__a.jpg": "one",
            "images__Validation__a.jpg": "two",
        }
        groups = read(tmp_path, report, **files)
        assert pictures(groups, tmp_path) == {
            "Train/a.jpg": "images/Train/a.jpg",
            "Validation/a.jpg": "images/Validation/a.jpg",
        }
        assert [group.split for group in groups.values()] == ["train", "valid"]
        assert [group.views[0].balls[0].box for group in groups.values()] == [
            Box(89.5, 39.5, 20, 20),
            Box(49.5, 59.5, 20, 20),
        ]
        assert (report.imported, report.problems) == (2, [])

    def test_subsets_without_pictures_are_kept_apart(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {
            "annotations__instances_one.json": coco(),
            "annotations__instances_two.json": coco(),
        }
        assert list(read(tmp_path, report, **files)) == ["one/a.jpg", "two/a.jpg"]

    def test_a_subset_whose_picture_is_missing_does_not_take_the_other_one(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {
            "annotations__instances_one.json": coco(),
            "annotations__instances_two.json": coco(),
            "images__two__a.jpg": "x",
        }
        groups = read(tmp_path, report, **files)
        assert pictures(groups, tmp_path) == {"one/a.jpg": None, "two/a.jpg": "images/two/a.jpg"}
        (problem,) = report.problems
        assert (problem.path.endswith("instances_one.json"), problem.field) == (True, "file_name")
        assert (
            "1 picture was not found: a.jpg (looked in annotations/images/one/" in problem.problem
        )

    def test_folders_are_kept_apart(self, tmp_path: Path, report: ReaderReport) -> None:
        files = {
            f"{task}__{name}": content
            for task in ("task1", "task2")
            for name, content in [
                ("annotations__instances_default.json", coco()),
                ("images__a.jpg", "x"),
            ]
        }
        groups = read(tmp_path, report, **files)
        assert pictures(groups, tmp_path) == {
            "task1/a.jpg": "task1/images/a.jpg",
            "task2/a.jpg": "task2/images/a.jpg",
        }

    def test_groups_that_only_share_their_number_are_kept_apart(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {f"{task}__x.json": coco([image(group_id=1, view="n")]) for task in ("p", "q")}
        groups = read(tmp_path, report, **files)
        assert {key: [view.key for view in group.views] for key, group in groups.items()} == {
            "p/1": ["n"],
            "q/1": ["n"],
        }
        stations = {view.station.key for group in groups.values() for view in group.views}
        assert stations == {"p/1/n", "q/1/n"}

    def test_the_views_of_a_group_may_lie_in_several_files(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {
            f"{name}__x.json": coco([image(f"{name}.jpg", group_id=1, view=name)])
            for name in ("north", "south")
        }
        groups = read(tmp_path, report, **files)
        assert [view.key for view in groups["1"].views] == ["north", "south"]

    def test_views_without_a_name_whose_files_share_one_have_their_folders_in_it(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        images = [image("north/f.jpg", 1, group_id="g"), image("south/f.jpg", 2, group_id="g")]
        files = {"x.json": coco(images, [ball(1), ball(2, 2)])}
        files |= {f"{side}__y.json": coco([image(group_id=2)]) for side in ("east", "west")}
        groups = read(tmp_path, report, **files)
        assert {key: [view.key for view in group.views] for key, group in groups.items()} == {
            "g": ["north/f.jpg", "south/f.jpg"],
            "2": ["east/a.jpg", "west/a.jpg"],
        }
        assert report.problems == []

    def test_views_without_a_name_in_different_splits_are_of_different_groups(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {f"{split}__y.json": coco([image(group_id=2)]) for split in ("train", "test")}
        assert list(read(tmp_path, report, **files)) == ["test/2", "train/2"]

    def test_two_pictures_for_one_view_are_named(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        images = [image(f"{n}.jpg", n, group_id="g", view="north") for n in (1, 2)]
        groups = read(tmp_path, report, **{"x.json": coco(images, [ball(1), ball(2, 2)])})
        assert (len(groups["g"].views), report.imported) == (1, 1)
        assert "is a second view north of group g" in report.problems[0].problem


class TestPicturesOfFrames:
    def test_two_frames_never_share_a_picture_that_only_one_names(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        images = [image("clip1/a.jpg"), image("clip2/a.jpg", 2)]
        value = coco(images, [ball(1), ball(2, 2)])
        groups = read(tmp_path, report, **{"x.json": value, "clip2__a.jpg": "x"})
        assert pictures(groups, tmp_path) == {"clip1/a.jpg": None, "clip2/a.jpg": "clip2/a.jpg"}
        (problem,) = report.problems
        assert (problem.record, problem.field) == ("images[0]", "file_name")
        assert "clip2/a.jpg fits another image as well" in problem.problem

    def test_pictures_that_cannot_be_told_apart_are_named(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {"x.json": coco(), "p__1__a.jpg": "x", "p__2__a.jpg": "y"}
        assert pictures(read(tmp_path, report, **files), tmp_path) == {"a.jpg": None}
        assert "p/1/a.jpg and p/2/a.jpg cannot be told apart by a.jpg" in str(report.problems[0])

    def test_a_name_may_be_written_as_a_part_of_an_address(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {"x.json": coco([image("a%20b.jpg")]), "images__a b.jpg": "x"}
        found = pictures(read(tmp_path, report, **files), tmp_path)
        assert found == {"a%20b.jpg": "images/a b.jpg"}

    def test_captions_alone_bring_no_ball(self, tmp_path: Path, report: ReaderReport) -> None:
        caption = {"id": 1, "image_id": 1, "caption": "a ball"}
        read(tmp_path, report, **{"captions_default.json": coco(annotations=[caption])})
        assert "the file contains no ball" in report.problems[0].problem

    def test_a_picture_found_by_the_end_of_its_name_is_said(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        files = {"x.json": coco([image("C:\\shots\\a.jpg")]), "pictures__a.jpg": "x"}
        assert pictures(read(tmp_path, report, **files), tmp_path) == {"a.jpg": "pictures/a.jpg"}
        assert any("1 picture was found by the end of the name" in it for it in report.remarks)
        assert report.problems == []

    def test_files_without_any_picture_are_sound(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        read(tmp_path, report, **{"x.json": coco(categories=[category()])})
        assert report.problems == []
        assert any("1 picture was not found: a.jpg" in remark for remark in report.remarks)

    def test_a_point_outside_the_other_box_is_another_ball(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        point = coco(annotations=[ball(bbox=[300, 50, 0, 0])])
        groups = read(tmp_path, report, **{"a.json": coco(), "b.json": point})
        assert groups["a.jpg"].views[0].balls[1].point == ImagePoint(299.5, 49.5)
