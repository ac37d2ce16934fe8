from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from app.errors import InputError
from app.formats.camera_json import camera_from_json
from app.formats.export_record import ExportRecord
from app.formats.gamestate_reader import read_gamestate, sequence_frame_path
from app.formats.gamestate_writer import write_gamestate
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Group, Media
from tests.cameras import WIDE_LENSES, wide

Value = dict[str, Any]


def annotation(identity: str, image: Any, category: int, **changes: Any) -> Value:
    box = {"x": 10.5, "y": 20, "x_center": 12.5, "y_center": 23, "w": 4, "h": 6}
    return {
        "id": identity, "image_id": image, "track_id": 3, "supercategory": "object",
        "category_id": category, "attributes": {"role": "player", "jersey": "10", "team": "left"},
        "bbox_image": box, "bbox_pitch": None,
    } | changes  # fmt: skip


@pytest.fixture
def labels() -> Value:
    """One sequence: two images, a ball in each, people, lines, a camera."""
    images = [
        {"is_labeled": True, "image_id": f"30600000{n}", "file_name": f"00000{n}.jpg",
         "height": 1080, "width": 1920, "ignore_regions_x": []} for n in (1, 2)
    ]  # fmt: skip
    point = {"x": 0.5, "y": 1.25, "w": 0, "h": 0}
    lines = {"Goal left post left": [{"x": 0.25, "y": 0.5}], "Line unknown": [{"x": 0.5, "y": 0.5}]}
    return {
        "info": {"version": "1.3", "name": "SNGS-060", "im_dir": "img1"},
        "images": images,
        "annotations": [
            annotation("1", "306000001", 1),
            annotation("2", "306000001", 4, attributes={"role": "ball"}),
            annotation("3", 306000002, 4, bbox_image=point),
            {"id": "4", "image_id": "306000001", "supercategory": "pitch", "category_id": 5,
             "lines": lines},
            {"id": "5", "image_id": "306000001", "supercategory": "camera", "category_id": 6,
             "parameters": {"pan": 1}},
        ],
        "categories": [{"id": n, "name": name} for n, name in enumerate(
            ("player", "goalkeeper", "referee", "ball", "pitch", "camera"), 1)],
    }  # fmt: skip


Read = Callable[..., list[Group]]
Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]
PLAYER = {"x1": 600, "y1": 300, "x2": 620, "y2": 360}


def write(root: Path, groups: list[Group]) -> dict[str, int]:
    """Groups that nobody has solved, written."""
    return write_gamestate(root, [ExportRecord(group, None, "unreviewed") for group in groups])


def written(root: Path) -> Value:
    (path,) = root.rglob("Labels-GameState.json")
    value: Value = json.loads(path.read_text())
    return value


def with_people(group: Group, *people: Value) -> Group:
    views = (replace(view, extras=Extras(boxes=people)) for view in group.views)
    return replace(group, views=tuple(views))


def person(tag: str | None, name: str = "Player team left", **corners: float) -> Value:
    return {"class": name, "ID": tag, "points": PLAYER | corners}


@pytest.fixture
def read(tmp_path: Path, report: ReaderReport) -> Read:
    def run(value: Any, folder: str = "test/SNGS-060") -> list[Group]:
        path = tmp_path / "in" / folder
        path.mkdir(parents=True, exist_ok=True)
        (path / "Labels-GameState.json").write_text(json.dumps(value))
        return list(read_gamestate(tmp_path / "in", report))

    return run


class TestReadGamestate:
    def test_each_image_is_a_group_of_one_view(self, read: Read, labels: Value) -> None:
        first, second = read(labels)
        assert (first.key, first.match, first.split) == ("SNGS-060/000001", "SNGS-060", "test")
        assert first.views[0].size == ImageSize(1920, 1080)
        assert first.views[0].balls[0].box == Box(10.5, 20.0, 4.0, 6.0)
        assert list(first.views[0].station.lines) == ["Goal left post left"]
        assert second.views[0].station.lines == {}

    def test_ids_may_be_numbers_and_a_box_without_area_is_a_centre(
        self, read: Read, labels: Value
    ) -> None:
        _, second = read(labels)
        assert second.views[0].balls[0].point == ImagePoint(0.5, 1.25)

    @pytest.mark.parametrize("spelt", [float, str, lambda n: f"{n}.0"])
    def test_ids_that_are_equal_as_numbers_join(
        self, read: Read, labels: Value, report: ReaderReport, spelt: Callable[[int], Any]
    ) -> None:
        for item in labels["annotations"]:
            item["image_id"] = spelt(int(item["image_id"]))
            item["category_id"] = spelt(item["category_id"])
        first, second = read(labels)
        assert (len(first.views[0].balls), len(second.views[0].balls)) == (1, 1)
        assert list(first.views[0].station.lines) == ["Goal left post left"]

    def test_a_category_that_is_not_listed_is_named(
        self, read: Read, labels: Value, report: ReaderReport
    ) -> None:
        labels["annotations"][0]["category_id"] = 77
        before = len(report.problems)
        read(labels)
        assert ("annotations[0]", "category_id") in [
            (problem.record, problem.field) for problem in report.problems[before:]
        ]

    def test_another_spelling_of_the_ball_is_the_ball(self, read: Read, labels: Value) -> None:
        (category,) = (item for item in labels["categories"] if item["name"] == "ball")
        category["name"] = "Sports_Ball"
        assert len(read(labels)[0].views[0].balls) == 1

    def test_one_number_that_is_none_loses_no_sequence(
        self, read: Read, labels: Value, report: ReaderReport
    ) -> None:
        labels["annotations"][0]["score"] = float("nan")
        assert len(read(labels)) == 2
        # Nobody reads a score, so nothing is left out.
        assert report.problems == []
        assert any("annotations[0], score: is NaN" in remark for remark in report.remarks)

    def test_people_are_shown_like_everywhere_and_kept_whole(
        self, read: Read, labels: Value
    ) -> None:
        (box,) = read(labels)[0].views[0].extras.boxes
        assert (box["class"], box["ID"]) == ("player left", "10")
        assert box["points"] == {"x1": 10.5, "y1": 20.0, "x2": 14.5, "y2": 26.0}
        assert box["gamestate"] == labels["annotations"][0]

    def test_frames_lie_in_img1(self, read: Read, labels: Value, tmp_path: Path) -> None:
        folder = tmp_path / "in/test/SNGS-060/img1"
        folder.mkdir(parents=True)
        (folder / "000001.jpg").write_bytes(b"x")
        first, second = read(labels)
        assert first.views[0].media is not None
        assert first.views[0].media.path.endswith("img1/000001.jpg")
        assert second.views[0].media is None

    def test_unsound_records_are_named_and_the_rest_is_read(
        self, read: Read, labels: Value, report: ReaderReport
    ) -> None:
        labels["images"] += [
            {"image_id": "9", "file_name": "../x.jpg", "width": 10, "height": 10},
            {"image_id": "10", "file_name": "y.jpg", "width": "wide", "height": 10},
            {"file_name": "z.jpg", "width": 10, "height": 10},
            "nothing",
            {"image_id": "11", "file_name": "000001.png", "width": 10, "height": 10},
        ]
        labels["annotations"] += [
            annotation("6", "nobody", 1),
            annotation("7", "306000001", 4, bbox_image={"x": 1, "y": 2, "w": -3, "h": 4}),
            annotation("8", "306000001", 5, lines={}),
            17,
        ]
        assert len(read(labels)) == 2
        places = [item.record for item in report.problems]
        assert places == [f"images[{n}]" for n in range(2, 7)] + [
            f"annotations[{n}]" for n in range(5, 9)
        ]

    def test_an_image_that_is_left_out_names_its_field_and_takes_its_annotations(
        self, read: Read, labels: Value, report: ReaderReport
    ) -> None:
        labels["images"].append({"image_id": "9", "file_name": "y.jpg", "width": None, "height": 9})
        labels["annotations"] += [annotation("6", "9", 1), annotation("7", "9", 1)]
        read(labels)
        (problem,) = report.problems
        assert (problem.record, problem.field) == ("images[2]", "width")
        assert problem.problem == "is null, not a number; left out with 2 annotations"

    @pytest.mark.parametrize("value", [[], {"images": {}, "annotations": []}, "x"])
    def test_what_is_no_such_file_is_reported(
        self, read: Read, report: ReaderReport, value: Any
    ) -> None:
        assert read(value) == []
        assert report.problems

    def test_two_sequences_of_one_name_are_not_mixed(
        self, read: Read, labels: Value, report: ReaderReport
    ) -> None:
        read(labels, "a/SNGS-060")
        groups = read(labels, "b/SNGS-060")
        assert len(groups) == 2
        assert "describes the sequence SNGS-060 again" in report.problems[-1].problem

    def test_a_match_in_two_splits_is_one_sequence_with_each_image_once(
        self, tmp_path: Path, soccer_group: Make, report: ReaderReport
    ) -> None:
        pairs = (("7.png", "train"), ("8.png", "test"))
        write(tmp_path, [soccer_group(name, split=split) for name, split in pairs])
        groups = list(read_gamestate(tmp_path, report))
        assert [group.split for group in groups] == ["test", "test", "train", "train"]
        assert len({group.match for group in groups}) == 1
        assert report.problems == []
        (again,) = tmp_path.glob("train/*/Labels-GameState.json")
        (first,) = tmp_path.glob("test/*/Labels-GameState.json")
        again.write_text(first.read_text())
        assert len(list(read_gamestate(tmp_path, report))) == 2
        assert "has the file_name 8.png" in report.problems[0].problem


class TestWriteGamestate:
    def test_comes_back_as_it_was(
        self, read: Read, labels: Value, tmp_path: Path, report: ReaderReport
    ) -> None:
        groups = read(labels)
        counts = write(tmp_path / "out", groups)
        assert counts == {"groups": 2, "images": 2, "annotated_balls": 2}
        found = json.loads((tmp_path / "out/test/SNGS-060/Labels-GameState.json").read_text())
        assert list(read_gamestate(tmp_path / "out", report)) == groups
        expected = copy.deepcopy(labels)
        expected["annotations"][2]["image_id"] = 306000002
        for part in ("info", "images", "categories"):
            assert found[part] == expected[part]
        by_id = {item["id"]: item for item in found["annotations"]}
        for item in expected["annotations"]:
            again = by_id[item["id"]]
            assert {k: v for k, v in again.items() if k not in ("bbox_image", "lines")} == {
                k: v for k, v in item.items() if k not in ("bbox_image", "lines")
            }

    def test_no_name_ends_with_a_space(self, read: Read, labels: Value, tmp_path: Path) -> None:
        write(tmp_path / "out", read(labels))
        text = (tmp_path / "out/test/SNGS-060/Labels-GameState.json").read_text()
        assert '"Goal left post left":' in text
        assert "left " not in text.replace("Goal left post", "")

    def test_roles_and_teams_of_soccernet_v3(
        self, tmp_path: Path, soccer_group: Callable[..., Group]
    ) -> None:
        corners = {"x1": 9, "y1": 2, "x2": 5, "y2": 8}
        boxes = (
            {"class": "Goalkeeper team right", "ID": "1", "points": corners},
            {"class": "Main referee", "ID": "x", "points": corners},
            {"class": None, "ID": None, "points": None},
            {"class": "Main referee", "ID": "2", "points": {**corners, "x2": "Infinity"}},
        )
        group = soccer_group(replays=0)
        odd = ({"class": "Odd", "points": "text"}, {"class": "Odder", "points": [1, "x"]})
        view = replace(group.views[0], extras=Extras(boxes, odd))
        write(tmp_path, [replace(group, views=(view,))])
        found = written(tmp_path)["annotations"]
        assert [item["attributes"] for item in found[:2]] == [
            {"role": "goalkeeper", "jersey": "1", "team": "right"},
            {"role": "referee", "jersey": None, "team": None},
        ]
        assert found[0]["bbox_image"]["x"] == 5.0
        assert [item["category_id"] for item in found] == [2, 3, 4, 5]

    def test_a_match_that_comes_again_is_added_to_its_file(
        self, tmp_path: Path, soccer_group: Callable[..., Group]
    ) -> None:
        groups = [soccer_group(), soccer_group(match="a/b/c"), soccer_group("8.png")]
        write(tmp_path, groups)
        counts = [
            len(json.loads(path.read_text())["images"])
            for path in sorted(tmp_path.rglob("Labels-GameState.json"))
        ]
        assert counts == [2, 4]


class TestWriteWhatWasChanged:
    PLACE: ClassVar = {"x_bottom_middle": 1.5, "y_bottom_middle": 2.5}

    def balls(self, root: Path) -> list[Value]:
        return [item for item in written(root)["annotations"] if item["category_id"] == 4]

    def test_a_ball_keeps_its_place_on_the_pitch_while_it_is_the_one_that_came(
        self, read: Read, labels: Value, tmp_path: Path
    ) -> None:
        labels["annotations"][1]["bbox_pitch"] = self.PLACE
        group = read(labels)[0]
        view = group.views[0]
        moved = replace(view, balls=(BallAnnotation(box=Box(90.0, 80.0, 4.0, 6.0)),))
        for name, shown, place in (("same", view, self.PLACE), ("moved", moved, None)):
            write(tmp_path / name, [group.with_view(shown)])
            (ball,) = self.balls(tmp_path / name)
            # It is the same ball, wherever it is.
            assert (ball["bbox_pitch"], ball["track_id"]) == (place, 3)

    def test_a_ball_out_of_view_takes_nothing_from_the_next_one(
        self, read: Read, labels: Value, tmp_path: Path
    ) -> None:
        other = {"x": 50, "y": 60, "w": 4, "h": 6}
        labels["annotations"].append(
            annotation("9", "306000001", 4, bbox_image=other, track_id=8, bbox_pitch=self.PLACE)
        )
        group = read(labels)[0]
        _, second = group.views[0].balls
        gone = replace(group.views[0], balls=(BallAnnotation(out_of_view=True), second))
        write(tmp_path / "out", [group.with_view(gone)])
        (ball,) = self.balls(tmp_path / "out")
        assert (ball["track_id"], ball["bbox_pitch"]) == (8, self.PLACE)

    def test_balls_that_were_read_without_their_box_stay_as_they_came(
        self, read: Read, labels: Value, tmp_path: Path
    ) -> None:
        labels["annotations"][1]["bbox_pitch"] = self.PLACE
        group = read(labels)[0]
        view = group.views[0]
        kept = dict(view.extras.metadata["gamestate"])
        kept["balls"] = [{k: v for k, v in kept["balls"][0].items() if k != "bbox_image"}]
        extras = replace(view.extras, metadata={"gamestate": kept})
        write(tmp_path / "out", [group.with_view(replace(view, extras=extras))])
        (ball,) = self.balls(tmp_path / "out")
        assert (ball["track_id"], ball["bbox_pitch"]) == (3, self.PLACE)

    def test_lines_that_were_drawn_since_are_said_to_be_labelled(
        self, read: Read, labels: Value, tmp_path: Path
    ) -> None:
        for image in labels["images"]:
            image |= {"is_labeled": False, "has_labeled_pitch": False}
        labels["annotations"] = labels["annotations"][3:4]
        write(tmp_path / "out", read(labels))
        said = [
            (image["is_labeled"], image["has_labeled_pitch"])
            for image in written(tmp_path / "out")["images"]
        ]
        assert said == [(True, True), (False, False)]

    def test_the_length_of_a_sequence_is_that_of_the_export(
        self, read: Read, labels: Value, tmp_path: Path
    ) -> None:
        for name, said, told in (("part", 750, 1), ("text", "1", "1")):
            labels["info"]["seq_length"] = said
            write(tmp_path / name, read(labels)[:1])
            assert written(tmp_path / name)["info"] == labels["info"] | {"seq_length": told}

    def test_a_split_makes_one_folder_whatever_it_is_called(
        self, tmp_path: Path, soccer_group: Make
    ) -> None:
        write(tmp_path, [soccer_group(match="m", split="fold/../1")])
        assert (tmp_path / "fold-..-1/m/Labels-GameState.json").is_file()

    def test_a_split_of_any_name_comes_back_and_a_usual_one_adds_nothing(
        self, tmp_path: Path, soccer_group: Make, report: ReaderReport
    ) -> None:
        write(tmp_path / "a", [soccer_group(split="fold-3")])
        (first, *_) = again = list(read_gamestate(tmp_path / "a", report))
        assert {group.split for group in again} == {"fold-3"}
        write(tmp_path / "b", [replace(group, split="test") for group in again])
        assert {group.split for group in read_gamestate(tmp_path / "b", report)} == {"test"}
        assert "touchline_split" not in written(tmp_path / "b")["info"]
        assert first.views[0].extras.metadata["gamestate"]["info"]["touchline_split"] == "fold-3"

    def test_a_hidden_ball_is_hidden_when_it_comes_back_and_no_more_once_it_is_not(
        self, tmp_path: Path, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group(replays=0)

        def round_trip(group: Group, name: str, occluded: bool) -> Group:
            (view,) = group.views
            ball = replace(view.balls[0], occluded=occluded)
            write(tmp_path / name, [group.with_view(replace(view, balls=(ball,)))])
            (again,) = read_gamestate(tmp_path / name, report)
            return again

        hidden = round_trip(group, "a", occluded=True)
        assert hidden.views[0].balls[0].occluded
        seen = round_trip(hidden, "b", occluded=False)
        assert not seen.views[0].balls[0].occluded

    @pytest.mark.parametrize(
        ("folder", "split"),
        [("Validation/test-12", "valid"), ("val/a", "valid"), ("b/test-12", ""), ("test", "test")],
    )
    def test_a_folder_around_the_sequences_says_the_split(
        self, read: Read, labels: Value, folder: str, split: str
    ) -> None:
        assert {group.split for group in read(labels, folder)} == {split}


class TestWhatEvaluatorsAskFor:
    """What sn-trackeval and TrackLab were seen to need before they take a frame."""

    def test_every_frame_with_people_a_camera_and_lines_is_labelled(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        write_gamestate(tmp_path, [solved(with_people(soccer_group(), person("9")))])
        found = written(tmp_path)
        for image in found["images"]:
            assert all(image[f"has_labeled_{what}"] for what in ("person", "pitch", "camera"))
        assert len({image["image_id"] for image in found["images"]}) == 2
        assert all(image["image_id"].isdigit() for image in found["images"])
        assert found["info"]["seq_length"] == 2

    def test_people_stand_where_the_camera_sees_the_lower_edge_of_their_box(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, camera: Camera
    ) -> None:
        write_gamestate(tmp_path, [solved(with_people(soccer_group(replays=0), person("9")))])
        place = written(tmp_path)["annotations"][0]["bbox_pitch"]
        for name, x in (("left", 600.0), ("middle", 610.0), ("right", 620.0)):
            foot = [place[f"x_bottom_{name}"], place[f"y_bottom_{name}"], 0.0]
            assert camera.project(np.array([foot]))[0] == pytest.approx([x, 360.0], abs=1e-6)

    def test_tracks_are_numbers_and_a_shirt_keeps_its_own(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        people = [person("9"), person("9"), person("a"), person(None), person(None)]
        groups = [with_people(soccer_group(action), *people) for action in ("7.png", "8.png")]
        write_gamestate(tmp_path, map(solved, groups))
        by_image: dict[str, list[int]] = {}
        for item in written(tmp_path)["annotations"]:
            if item["supercategory"] == "object":
                by_image.setdefault(item["image_id"], []).append(item["track_id"])
        first, second, third, fourth = by_image.values()
        for tracks in by_image.values():
            # Five people and the ball.
            assert len(tracks) == len(set(tracks)) == 6
            assert (tracks[0], tracks[5]) == (first[0], first[5])
        # A letter means somebody among the views of one moment.
        assert first[2] == second[2] != third[2] == fourth[2]

    def test_a_frame_with_somebody_above_the_horizon_is_not_labelled_with_people(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        group = with_people(soccer_group(replays=0), person("9"), person("8", y1=-9e4, y2=-8e4))
        write_gamestate(tmp_path, [solved(group)])
        found = written(tmp_path)
        assert [item.get("bbox_pitch") is None for item in found["annotations"][:2]] == [
            False,
            True,
        ]
        assert (found["images"][0]["has_labeled_person"], found["images"][0]["has_labeled_camera"]) == (
            False, True,
        )  # fmt: skip

    def test_the_ball_is_below_its_3d_point_or_nowhere(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        write_gamestate(tmp_path, [solved(soccer_group(replays=2))])
        first, second, third = (
            item["bbox_pitch"]
            for item in written(tmp_path)["annotations"]
            if item["category_id"] == 4
        )
        assert (first["x_bottom_middle"], first["y_bottom_middle"]) == (1.5, -2.25)
        width = [first[f"{axis}_bottom_right"] - first[f"{axis}_bottom_left"] for axis in "xy"]
        assert np.hypot(*width) == pytest.approx(0.226)
        assert first == second
        # The third view is in no valid pair.
        assert third is None

    def test_the_camera_is_there_and_comes_back(
        self,
        tmp_path: Path,
        solved: Solved,
        soccer_group: Make,
        camera: Camera,
        report: ReaderReport,
    ) -> None:
        write_gamestate(tmp_path / "out", [solved(soccer_group(replays=0))])
        (item,) = (
            item for item in written(tmp_path)["annotations"] if item["supercategory"] == "camera"
        )
        assert camera_from_json(item["parameters"], "f") == camera
        again = list(read_gamestate(tmp_path / "out", report))
        assert report.problems == []
        write(tmp_path / "second", again)
        assert written(tmp_path / "second") == written(tmp_path / "out")

    def test_a_wide_lens_has_no_place(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, camera: Camera
    ) -> None:
        record = solved(soccer_group(replays=0))
        lens = wide((0.0, 60.0, -15.0), (0.0, 0.0, 0.0), next(iter(WIDE_LENSES)), focal=700.0)
        (view,) = record.solution.views
        seen = replace(view, calibration=replace(view.calibration, camera=lens))
        write_gamestate(
            tmp_path, [replace(record, solution=replace(record.solution, views=(seen,)))]
        )
        found = written(tmp_path)
        assert found["images"][0]["has_labeled_camera"] is False
        assert {item["supercategory"] for item in found["annotations"]} == {"object", "pitch"}

    def test_sequences_lie_flat_in_the_folder_of_their_split(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        groups = [soccer_group(match="a/b/c", split="test"), soccer_group(match="d", split="")]
        write_gamestate(tmp_path, map(solved, groups))
        paths = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.json"))
        assert paths == [f"{name}/Labels-GameState.json" for name in ("test/a_b_c", "unassigned/d")]
        infos = [json.loads((tmp_path / path).read_text())["info"] for path in paths]
        # Predictions are called like the sequence, which is called like its folder.
        assert [info["name"] for info in infos] == ["a_b_c", "d"]

    def test_two_matches_that_would_be_one_sequence_are_refused(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        with pytest.raises(
            InputError, match="a/b and a_b would be written to the same folder, a_b"
        ):
            write_gamestate(tmp_path, [solved(soccer_group(match=name)) for name in ("a/b", "a_b")])

    def test_frames_lie_where_a_sequence_looks_for_them(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group(replays=0)
        write_gamestate(tmp_path, [solved(group)])
        place = tmp_path / sequence_frame_path(group, group.views[0], "train", ".jpg")
        place.parent.mkdir()
        place.write_bytes(b"x")
        (again,) = read_gamestate(tmp_path, report)
        assert again.views[0].media == Media(str(place))
