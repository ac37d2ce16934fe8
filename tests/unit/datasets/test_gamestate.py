from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.datasets.gamestate_reader import read_gamestate
from app.datasets.gamestate_writer import write_gamestate
from app.datasets.report import Report
from app.soccer.annotation import Extras
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Group

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


@pytest.fixture
def read(tmp_path: Path, report: Report) -> Read:
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
        self, read: Read, labels: Value, report: Report
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

    @pytest.mark.parametrize("value", [[], {"images": {}, "annotations": []}, "x"])
    def test_what_is_no_such_file_is_reported(self, read: Read, report: Report, value: Any) -> None:
        assert read(value) == []
        assert report.problems

    def test_two_sequences_of_one_name_are_not_mixed(
        self, read: Read, labels: Value, report: Report
    ) -> None:
        read(labels, "a/SNGS-060")
        groups = read(labels, "b/SNGS-060")
        assert len(groups) == 2
        assert "is a second SNGS-060" in report.problems[-1].problem


class TestWriteGamestate:
    def test_comes_back_as_it_was(
        self, read: Read, labels: Value, tmp_path: Path, report: Report
    ) -> None:
        groups = read(labels, "SNGS-060")
        counts = write_gamestate(tmp_path / "out", groups)
        assert counts == {"groups": 2, "images": 2, "annotated_balls": 2}
        path = tmp_path / "out/SNGS-060/Labels-GameState.json"
        written = json.loads(path.read_text())
        assert list(read_gamestate(tmp_path / "out", report)) == groups
        expected = copy.deepcopy(labels)
        expected["annotations"][2]["image_id"] = 306000002
        for part in ("info", "images", "categories"):
            assert written[part] == expected[part]
        by_id = {item["id"]: item for item in written["annotations"]}
        for item in expected["annotations"]:
            again = by_id[item["id"]]
            assert {k: v for k, v in again.items() if k not in ("bbox_image", "lines")} == {
                k: v for k, v in item.items() if k not in ("bbox_image", "lines")
            }

    def test_no_name_ends_with_a_space(self, read: Read, labels: Value, tmp_path: Path) -> None:
        write_gamestate(tmp_path / "out", read(labels))
        text = (tmp_path / "out/SNGS-060/Labels-GameState.json").read_text()
        assert '"Goal left post left": ' in text
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
        write_gamestate(tmp_path, [replace(group, views=(view,))])
        (path,) = tmp_path.rglob("Labels-GameState.json")
        written = json.loads(path.read_text())["annotations"]
        assert [item["attributes"] for item in written[:2]] == [
            {"role": "goalkeeper", "jersey": "1", "team": "right"},
            {"role": "referee", "jersey": None, "team": None},
        ]
        assert written[0]["bbox_image"]["x"] == 5.0
        assert [item["category_id"] for item in written] == [2, 3, 4, 5]

    def test_a_match_that_comes_again_is_added_to_its_file(
        self, tmp_path: Path, soccer_group: Callable[..., Group]
    ) -> None:
        groups = [soccer_group(), soccer_group(match="a/b/c"), soccer_group("8.png")]
        write_gamestate(tmp_path, groups)
        counts = [
            len(json.loads(path.read_text())["images"])
            for path in sorted(tmp_path.rglob("Labels-GameState.json"))
        ]
        assert counts == [2, 4]
