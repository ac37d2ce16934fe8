"""Every field of a sn-gamestate file that is made anew, and where its value comes from."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.formats.export_record import ExportRecord
from app.formats.gamestate_reader import read_gamestate
from app.formats.gamestate_writer import write_gamestate
from app.formats.report import ReaderReport
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group
from app.soccer.split import Split

Value = dict[str, Any]
CLASSES = {
    "Player team left": ("player", 1, "left"),
    "Player team right": ("player", 1, "right"),
    "Goalkeeper team left": ("goalkeeper", 2, "left"),
    "Main referee": ("referee", 3, None),
    "Side referee": ("referee", 3, None),
    "Staff members": ("other", 7, None),
}
CORNERS = {"x1": 620, "y1": 360, "x2": 600, "y2": 300}


def written(root: Path, *records: ExportRecord) -> Value:
    write_gamestate(root, records)
    (path,) = root.rglob("Labels-GameState.json")
    value: Value = json.loads(path.read_text())
    return value


@pytest.fixture
def sequence(
    tmp_path: Path, solved: Callable[..., ExportRecord], soccer_group: Callable[..., Group]
) -> Value:
    """Two views: people of every class and a ball with a box in the first, a bare point in the second."""
    first, second = soccer_group().views
    boxes = [{"class": name, "ID": str(n), "points": CORNERS} for n, name in enumerate(CLASSES, 7)]
    first = replace(
        first,
        balls=(BallAnnotation(box=Box(100.5, 40.0, 11.0, 9.0)),),
        extras=Extras(boxes=tuple(boxes)),
    )
    second = replace(second, balls=(BallAnnotation(point=ImagePoint(300.25, 41.5)),))
    return written(tmp_path, solved(replace(soccer_group(), views=(first, second))))


def objects(sequence: Value) -> list[Value]:
    return [item for item in sequence["annotations"] if item["supercategory"] == "object"]


def balls(sequence: Value) -> list[Value]:
    return [item for item in objects(sequence) if item["attributes"]["role"] == "ball"]


def test_the_middle_of_every_box_is_the_middle(sequence: Value) -> None:
    for item in objects(sequence):
        box = item["bbox_image"]
        assert box["x_center"] == box["x"] + box["w"] / 2, item
        assert box["y_center"] == box["y"] + box["h"] / 2, item


def test_boxes_are_those_of_the_labels(sequence: Value) -> None:
    person = {"x": 600, "y": 300, "x_center": 610, "y_center": 330, "w": 20, "h": 60}
    boxed = {"x": 100.5, "y": 40, "x_center": 106, "y_center": 44.5, "w": 11, "h": 9}
    point = {"x": 300.25, "y": 41.5, "x_center": 300.25, "y_center": 41.5, "w": 0, "h": 0}
    boxes = [item["bbox_image"] for item in objects(sequence)]
    assert boxes == [*[person] * len(CLASSES), boxed, point]


def test_role_category_and_team_are_those_of_the_class(sequence: Value) -> None:
    people = objects(sequence)[: len(CLASSES)]
    said = [
        (item["attributes"]["role"], item["category_id"], item["attributes"]["team"])
        for item in people
    ]
    assert said == list(CLASSES.values())
    assert [item["attributes"]["jersey"] for item in people] == ["7", "8", "9", "10", "11", "12"]


def test_categories_name_what_annotations_refer_to(sequence: Value) -> None:
    names = {item["id"]: item["name"] for item in sequence["categories"]}
    for item in objects(sequence):
        assert names[item["category_id"]] == item["attributes"]["role"]
    rest = [item for item in sequence["annotations"] if item["supercategory"] != "object"]
    assert {item["supercategory"] for item in rest} == {"pitch", "camera"}
    for item in rest:
        assert names[item["category_id"]] == item["supercategory"]


def test_the_ball_keeps_its_track_and_nobody_else_has_it(sequence: Value) -> None:
    (first,), (second,) = ([ball["track_id"]] for ball in balls(sequence))
    others = {item["track_id"] for item in objects(sequence)} - {first}
    assert first == second
    assert len(others) == len(CLASSES)
    assert all(isinstance(track, int) and track >= 1 for track in others | {first})


def test_the_same_shirt_of_the_other_team_is_somebody_else(
    tmp_path: Path, solved: Callable[..., ExportRecord], soccer_group: Callable[..., Group]
) -> None:
    boxes = tuple(
        {"class": name, "ID": "9", "points": CORNERS}
        for name in ("Player team left", "Player team right")
    )
    view = replace(soccer_group(replays=0).views[0], extras=Extras(boxes=boxes))
    found = written(tmp_path, solved(replace(soccer_group(replays=0), views=(view,))))
    one, other, _ball = (item["track_id"] for item in objects(found))
    assert one != other


def test_the_same_shirt_of_the_other_team_keeps_its_track_in_every_image(
    tmp_path: Path, solved: Callable[..., ExportRecord], soccer_group: Callable[..., Group]
) -> None:
    names = ("Player team left", "Player team right")
    views = []
    for view, order in zip(soccer_group().views, (names, names[::-1]), strict=True):
        boxes = tuple({"class": name, "ID": "9", "points": CORNERS} for name in order)
        views.append(replace(view, extras=Extras(boxes=boxes)))
    found = written(tmp_path, solved(replace(soccer_group(), views=tuple(views))))
    people = [item for item in objects(found) if item["attributes"]["role"] == "player"]
    left = {item["track_id"] for item in people if item["attributes"]["team"] == "left"}
    right = {item["track_id"] for item in people if item["attributes"]["team"] == "right"}
    assert (len(left), len(right), len(left | right)) == (1, 1, 2)


def test_annotations_belong_to_their_image_and_no_id_comes_twice(sequence: Value) -> None:
    images = [image["image_id"] for image in sequence["images"]]
    assert [ball["image_id"] for ball in balls(sequence)] == images
    identities = [item["id"] for item in sequence["annotations"]]
    assert len(set(identities)) == len(identities)
    for item in sequence["annotations"]:
        assert item["id"].startswith(item["image_id"])
        assert item["image_id"] in images


@pytest.mark.parametrize(("split", "first"), [("train", "1"), ("valid", "2"), ("test", "3")])
def test_images_are_numbered_by_split_sequence_and_place(
    tmp_path: Path, soccer_group: Callable[..., Group], split: Split, first: str
) -> None:
    groups = [soccer_group(match=match, split=split) for match in ("a", "b")]
    write_gamestate(tmp_path, [ExportRecord(group, None, "unreviewed") for group in groups])
    found = [
        [image["image_id"] for image in json.loads(path.read_text())["images"]]
        for path in sorted(tmp_path.rglob("Labels-GameState.json"))
    ]
    assert found == [
        [f"{first}001000001", f"{first}001000002"],
        [f"{first}002000001", f"{first}002000002"],
    ]


def test_an_image_says_its_size_and_file(sequence: Value) -> None:
    for image in sequence["images"]:
        assert (image["width"], image["height"], image["is_labeled"]) == (1280, 720, True)
        assert Path(image["file_name"]).suffix in (".jpg", ".png")
    names = [image["file_name"] for image in sequence["images"]]
    assert len(set(names)) == len(names)


def test_the_head_names_the_sequence_and_counts_its_images(sequence: Value) -> None:
    info = sequence["info"]
    assert (info["version"], info["im_dir"], info["seq_length"]) == ("1.3", "img1", 2)
    assert info["name"]
    assert info["id"].isdigit()


def test_what_was_not_annotated_is_not_said_to_be_labelled(
    tmp_path: Path, soccer_group: Callable[..., Group]
) -> None:
    group = soccer_group(replays=0)
    bare = replace(group.views[0], balls=(), station=replace(group.views[0].station, lines={}))
    record = ExportRecord(replace(group, views=(bare,)), None, "unreviewed")
    (image,) = written(tmp_path, record)["images"]
    assert not any(image[f"has_labeled_{what}"] for what in ("person", "pitch", "camera"))


@pytest.fixture
def brought(tmp_path: Path, report: ReaderReport) -> Group:
    """An image of a sequence with tracks and a camera of its own, to which a ball was added."""
    box = {"x": 10, "y": 20, "x_center": 12, "y_center": 23, "w": 4, "h": 6}
    head = {"image_id": "3060000001", "supercategory": "object", "bbox_image": box}
    player = {"role": "player", "jersey": "10", "team": "left"}
    people = [
        {**head, "id": str(track), "track_id": track, "category_id": 1, "attributes": player}
        for track in (1, 2, 3)
    ]
    camera = {"id": "9", "image_id": "3060000001", "supercategory": "camera", "category_id": 6}
    image = {"is_labeled": True, "image_id": "3060000001", "file_name": "000001.jpg"}
    value = {
        "info": {"version": "1.3", "name": "SNGS-060", "im_dir": "img1"},
        "images": [{**image, "height": 1080, "width": 1920}],
        "annotations": [*people, {**camera, "parameters": {"pan": 1}}],
        "categories": [],
    }
    path = tmp_path / "in" / "test" / "SNGS-060" / "Labels-GameState.json"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(value))
    (group,) = read_gamestate(tmp_path / "in", report)
    ball = BallAnnotation(point=ImagePoint(300.25, 41.5))
    return replace(group, views=(replace(group.views[0], balls=(ball,)),))


def test_a_ball_that_is_added_has_no_track_that_the_file_has_given_to_somebody(
    tmp_path: Path, brought: Group
) -> None:
    found = written(tmp_path / "out", ExportRecord(brought, None, "unreviewed"))
    tracks = [item["track_id"] for item in objects(found)]
    assert sorted(tracks)[:3] == [1, 2, 3]
    assert len(set(tracks)) == 4


def test_the_camera_that_came_is_the_only_one(
    tmp_path: Path, solved: Callable[..., ExportRecord], brought: Group
) -> None:
    found = written(tmp_path / "out", solved(brought))
    cameras = [item for item in found["annotations"] if item["supercategory"] == "camera"]
    assert [camera["parameters"] for camera in cameras] == [{"pan": 1}]
