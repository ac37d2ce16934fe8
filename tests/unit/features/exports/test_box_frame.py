"""A reader of COCO or YOLO that crops a ball by its box finds the ball in the middle."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from app.features.exports.service import export_dataset
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group, Media
from tests.cameras import SIZE

RADIUS, SIDE = 6.0, 18.0
CENTERS = (
    ImagePoint(500.0, 300.0), ImagePoint(500.5, 300.5), ImagePoint(641.27, 122.81),
    ImagePoint(77.9, 601.13),
)  # fmt: skip
"""Of the balls that are drawn, in our frame: the centre of the first pixel is (0, 0)."""


def disk(center: ImagePoint) -> np.ndarray:
    """A picture with a white disk, each pixel as bright as it is covered."""
    fine = 16
    steps = (np.arange(fine) + 0.5) / fine - 0.5
    x = (np.arange(SIZE.width)[:, None] + steps).ravel() - center.x
    y = (np.arange(SIZE.height)[:, None] + steps).ravel() - center.y
    inside = np.zeros((SIZE.height, SIZE.width))
    rows = np.flatnonzero(np.abs(np.arange(SIZE.height) - center.y) < RADIUS + 1)
    for row in rows:
        part = y[row * fine : (row + 1) * fine, None] ** 2 + x**2 <= RADIUS**2
        inside[row] = part.reshape(fine, SIZE.width, fine).mean(axis=(0, 2))
    return np.repeat((inside * 255).round().astype(np.uint8)[..., None], 3, axis=2)


@pytest.fixture
def balls(store, fill, make_group, tmp_path: Path) -> Path:
    """The dataset "demo": a ball a view, drawn and annotated around the same centre."""
    groups: list[Group] = []
    for number in range(len(CENTERS) // 2):
        group = make_group(number + 7)
        views = []
        for view, center in zip(group.views, CENTERS[2 * number :], strict=False):
            path = tmp_path / "in" / view.key
            path.parent.mkdir(exist_ok=True)
            assert cv2.imwrite(str(path), disk(center))
            ball = BallAnnotation(box=Box.square(center, SIDE))
            views.append(replace(view, balls=(ball,), media=Media(str(path))))
        groups.append(replace(group, views=tuple(views)))
    fill(*groups)
    return tmp_path / "out"


def coco_crops(out: Path) -> Iterator[tuple[Path, list[float]]]:
    value = json.loads((out / "annotations/instances_train.json").read_text())
    names = {image["id"]: image["file_name"] for image in value["images"]}
    for item in value["annotations"]:
        for field in ("bbox", "written_bbox", "annotated_bbox"):
            yield out / names[item["image_id"]], item[field]


def yolo_crops(out: Path) -> Iterator[tuple[Path, list[float]]]:
    with (out / "frames.csv").open(newline="") as file:
        images = [row["image"] for row in csv.DictReader(file)]
    for image in images:
        label = (out / image.replace("images/", "labels/")).with_suffix(".txt")
        _, x, y, width, height = map(float, label.read_text().split())
        width, height = width * SIZE.width, height * SIZE.height
        corner = [x * SIZE.width - width / 2, y * SIZE.height - height / 2]
        yield out / image, [*corner, width, height]


def off_centre(picture: Path, box: list[float]) -> np.ndarray:
    """How far the middle of what is white lies from that of the crop, pixels."""
    x, y, width, height = box
    finer = 8
    sides = (round(width * finer), round(height * finer))
    with Image.open(picture) as opened:
        # Pillow takes (0, 0) for the corner of the first pixel, as everybody who crops does.
        crop = opened.convert("L").resize(
            sides, Image.Resampling.BILINEAR, box=(x, y, x + width, y + height)
        )
    bright = np.asarray(crop, float)
    places = [np.arange(side) + 0.5 for side in sides]
    found = [bright.sum(axis=axis) @ places[axis] / bright.sum() for axis in (0, 1)]
    return (np.array(found) - np.array(sides) / 2) / finer


@pytest.mark.parametrize(("name", "crops"), [("coco", coco_crops), ("yolo", yolo_crops)])
def test_a_crop_by_the_box_has_the_ball_in_its_middle(store, balls: Path, name: str, crops) -> None:
    export_dataset(store, "demo", name, balls, everything=True, boxes="annotated", images="copy")
    found = [off_centre(picture, box) for picture, box in crops(balls)]
    assert len(found) >= len(CENTERS)
    assert np.abs(found).max() < 0.1
