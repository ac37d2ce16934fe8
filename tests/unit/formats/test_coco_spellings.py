"""One scene in every spelling that tools use: the ball is always at the same place in 3D."""

from __future__ import annotations

import itertools
import unicodedata
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.formats.camera_json import camera_to_json
from app.formats.coco_reader import read_coco
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from tests.unit.formats.foreign_coco import Item, category, write

BALL = np.array([30.5, 4.2, -1.35])
DIAMETER = 6.0


def camera(position: tuple[float, float, float], focal_length: float) -> Camera:
    """A camera that looks at the ball."""
    forward = BALL - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, -1.0])
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(forward, right), forward])
    return Camera(rotation, np.array(position), (focal_length,) * 2, (639.5, 359.5))


CAMERAS = {
    "north": camera((0.0, 62.0, -15.0), 1800.0),
    "south": camera((60.0, -20.0, -8.0), 1300.0),
}

Ids = Callable[[int], Any]
Names = Callable[[str], str]
Shape = Callable[[float, float], Item]

IDS: dict[str, tuple[Ids, Ids]] = {
    "numbers": (int, int),
    "decimals": (int, float),
    "texts": (str, int),
    "decimal texts": (float, lambda n: f"{n}.0"),
    "from 0": (lambda n: n - 1, lambda n: n - 1),
    "with zeros": (lambda n: f"00{n}", int),
}
BALLS: dict[str, Shape] = {
    "box": lambda x, y: {"bbox": [x - 3, y - 3, DIAMETER, DIAMETER]},
    "texts": lambda x, y: {"bbox": [str(x - 3), str(y - 3), "6", "6"]},
    "point": lambda x, y: {"bbox": [x, y, 0, 0], "keypoints": [x, y, 2], "num_keypoints": 1},
    "keypoint": lambda x, y: {"keypoints": [x, y, 2], "num_keypoints": 1},
    "polygon": lambda x, y: {"segmentation": [[x - 3, y, x, y - 3, x + 3, y, x, y + 3]]},
    "area not a number": lambda x, y: {"bbox": [x - 3, y - 3, 6, 6], "area": float("nan")},
}
CATEGORIES: dict[str, list[Item] | None] = {
    "ball": [category("ball"), category("player", 2)],
    "sports_ball": [category("sports_ball")],
    "Soccer-Balls": [category("Person", 7), category("Soccer-Balls")],
    "none": None,
}
NAMES: dict[str, tuple[Names, str]] = {
    "plain": (lambda name: name, "images"),
    "cvat": (lambda name: name, "images/default"),
    "fiftyone": (lambda name: name, "data"),
    "beside": (lambda name: name, "annotations"),
    "with folder": (lambda name: f"clip/{name}", "images/clip"),
    "windows": (lambda name: f"images\\{name}", "images"),
    "label studio": (lambda name: f"..\\..\\ls\\media\\upload\\4\\{name}", "images"),
    "drive": (lambda name: f"D:\\data\\{name}", "images"),
    "absolute": (lambda name: f"/home/anna/images/{name}", "images"),
    "address": (lambda name: f"file:///home/anna/my%20images/{name}", "my images"),
    "local files": (lambda name: f"/data/local-files/?d=images%2F{name}", "images"),
    "upper case": (lambda name: name.replace(".jpg", ".JPG"), "images"),
}


def scene(ids: str, shape: str, categories: str, names: str) -> Item:
    of_image, of_reference = IDS[ids]
    images, annotations = [], []
    for number, (name, view) in enumerate(CAMERAS.items(), 1):
        x, y = view.project(BALL[None])[0] + 0.5
        record = {"id": of_image(number), "width": 1280, "height": 720, "group_id": "kick"}
        spelt = NAMES[names][0](f"{name}é.jpg")
        images.append(record | {"file_name": spelt, "view": name, "camera": camera_to_json(view)})
        reference = {"id": number, "image_id": of_reference(number), "category_id": 1}
        annotations.append(reference | BALLS[shape](float(x), float(y)))
    value: Item = {"images": images, "annotations": annotations}
    listed = CATEGORIES[categories]
    return value if listed is None else value | {"categories": listed}


def combinations() -> Iterator[tuple[str, str, str, str]]:
    """Every spelling with the usual ones of the others, and a mixture of all."""
    usual = ("numbers", "box", "ball", "plain")
    tables: list[list[str]] = [list(IDS), list(BALLS), list(CATEGORIES), list(NAMES)]
    for place, table in enumerate(tables):
        for spelling in table:
            yield (*usual[:place], spelling, *usual[place + 1 :])  # type: ignore[misc]
    longest = max(map(len, tables))
    mixed = [list(itertools.islice(itertools.cycle(table), longest)) for table in tables]
    yield from zip(*mixed, strict=True)


@pytest.mark.parametrize(("ids", "shape", "categories", "names"), sorted(set(combinations())))
@pytest.mark.parametrize("form", ["NFC", "NFD"])
def test_the_ball_is_where_it_is_and_the_pictures_are_found(
    tmp_path: Path,
    report: ReaderReport,
    ids: str,
    shape: str,
    categories: str,
    names: str,
    form: Any,
) -> None:
    folder = NAMES[names][1]
    files: dict[str, Any] = {
        f"{folder}/{unicodedata.normalize(form, f'{name}é.jpg')}": "x" for name in CAMERAS
    }
    labels = "annotations/instances_default.json"
    write(tmp_path, files | {labels: scene(ids, shape, categories, names)})
    (group,) = read_coco(tmp_path, report)
    assert [view.key for view in group.views] == ["north", "south"]
    assert [Path(view.media.path).name[:5] for view in group.views if view.media] == [*CAMERAS]
    solution = solve_group(group, PAPER)
    assert solution.ball is not None
    assert np.abs(np.array(solution.ball.point) - BALL).max() < 1e-6
    assert report.problems == []
    assert any("read as missing" in remark for remark in report.remarks) == (
        shape == "area not a number"
    )
    assert any("is the ball (2 annotations)" in remark for remark in report.remarks)
