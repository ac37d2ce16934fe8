"""Seeds: small sound files of every kind, made by our own writers."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from app.config import Settings
from app.db.store import Store
from app.features.imports.edits_export import export_edits
from app.features.imports.ingest import import_groups
from app.features.policies.service import policy_to_yaml
from app.formats.camera_json import camera_to_json
from app.formats.export_formats import FORMATS, WriteOptions, write_format
from app.formats.export_record import ExportRecord
from app.soccer.annotation import Extras, make_lines
from app.soccer.group import Group, Station, View
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from tests.balls import box_around
from tests.cameras import SIZE, looking
from tests.fuzz.case import Case, Files

MATCH = "league/2015-2016/2015-08-08 - 14-00 Home 3 - 1 Away"
BALL = (21.0, -4.0, -1.5)
CAMERAS = {
    "7.png": ((5.0, 62.0, -18.0), (8.0, 0.0, 0.0), 1500.0),
    "7_1.png": ((75.0, 6.0, -9.0), (30.0, 0.0, 0.0), 1600.0),
}
"""Position, a point looked at, focal length in pixels."""
PERSON = {"class": "Person", "ID": "3", "points": {"x1": 1.0, "y1": 2.0, "x2": 9.0, "y2": 20.0}}


def broadcast() -> Group:
    """Two views with lines, a given camera, a ball and a person each."""
    return Group(f"{MATCH}/7.png", tuple(map(_view, CAMERAS)), MATCH, split="train", label="A game")


def static() -> Group:
    """The same from two static cameras."""
    views = []
    for name, key in (("cam3", "7.png"), ("cam4", "7_1.png")):
        view = _view(key)
        views.append(replace(view, key=name, station=replace(view.station, key=name, shared=True)))
    return Group("1200", tuple(views), "issia", label="Frame 1200")


def seeds() -> Iterator[Case]:
    """A sound case of every kind."""
    with tempfile.TemporaryDirectory(prefix="touchline-seeds-") as name:
        yield from _exported(Path(name))
        yield from _carried(Path(name))
    yield from _foreign()
    yield from _predicted()
    yield Case("policy", {"policy.yaml": policy_to_yaml(PAPER).encode()}, "policy.yaml")
    yield Case("text", {"licence.txt": b"Free for research.\n"}, "licence.txt")
    query = b"status:unreviewed jac<0.95 sigma>0.5 finding:low_parallax id:1,2 sort:value"
    yield Case("query", {"query.txt": query}, "query.txt")
    picture = np.full((27, 48, 3), (40, 120, 50), np.uint8)
    for ending in ("png", "jpg", "webp"):
        data = cv2.imencode(f".{ending}", picture)[1].tobytes()
        yield Case("image", {f"7.{ending}": data}, f"7.{ending}")
        yield Case("frames", {f"a/7.{ending}": data})
    yield Case("image", {"7.jpg": _turned(picture)}, "7.jpg")
    yield Case("video", {"cam3.mp4": _video(picture)}, "cam3.mp4")


def _view(key: str) -> View:
    camera = looking(*CAMERAS[key])
    corners = {"Side line bottom": [[10.0, 700.0], [600.0, 690.0], [1200.0, 715.5]]}
    station = Station(key, SIZE, lines=make_lines(corners), given=camera)
    return View(key, station, (box_around(camera, BALL),), extras=Extras((PERSON,)))


def _exported(folder: Path) -> Iterator[Case]:
    for kind in FORMATS:
        if kind in ("touchline", "yolo"):
            continue
        group = static() if kind.startswith("issia") else broadcast()
        record = ExportRecord(group, solve_group(group, PAPER), "accepted")
        root = folder / kind
        root.mkdir()
        write_format(root, [record], WriteOptions(kind, everything=True))
        yield Case(kind, _files(root))


def _carried(folder: Path) -> Iterator[Case]:
    store = Store.open(Settings(home=folder / "home"))
    try:
        import_groups(store, "seed", [broadcast(), static()], source="seed", actor="local")
        export_edits(store, "seed", folder / "touchline")
        yield Case("touchline", _files(folder / "touchline"))
    finally:
        store.close()


def _foreign() -> Iterator[Case]:
    """Cameras and lines in the shapes of other tools."""
    camera = looking(*CAMERAS["7.png"])
    k = [[1500.0, 0, 639.5], [0, 1500.0, 359.5], [0, 0, 1]]
    t = (-camera.rotation @ camera.position).tolist()
    matrices = {"K": k, "R": camera.rotation.tolist(), "t": t, "k": [0.1, 0, 0, 0, 0]}
    lines = [json.dumps({"image_ids": f"{name}.jpg", **camera_to_json(camera)}) for name in "ab"]
    arrays = io.BytesIO()
    np.savez(arrays, **{name: np.stack([value] * 2) for name, value in matrices.items()})
    for name, content in (
        ("7.json", json.dumps(matrices)),
        ("all.json", json.dumps({"7.jpg": {"cam_params": camera_to_json(camera)}})),
        ("per_sample_output.json", "\n".join(lines)),
        (
            "7.yml",
            f"%YAML:1.0\n---\nK: !!opencv-matrix\n   data: {np.ravel(k).tolist()}\nP: {matrices['R']}\n",
        ),
    ):
        yield Case("cameras", {name: content.encode()})
    yield Case("cameras", {"7.npz": arrays.getvalue()})
    drawn = {"Side_line_bottom": [[0.1, 0.9], [0.9, 0.95]], "Line unknown": []}
    shapes = {"1.jpg": {"width": 1280, "height": 720, "lines": drawn}, "2.jpg": drawn}
    yield Case("sn-calibration", {"lines.json": json.dumps(shapes).encode()})


def _predicted() -> Iterator[Case]:
    box = {"image_id": f"{MATCH}/7.png", "category_id": 1, "bbox": [10, 20, 8, 9], "score": 0.5}
    document = {"images": [{"id": 5, "file_name": "7_1.png", "width": 640, "height": 360}]}
    coco = {"r.json": json.dumps([box, {**box, "image_id": 5}]), "t.json": json.dumps(document)}
    yield Case("predictions-coco", {name: text.encode() for name, text in coco.items()})
    yield Case("predictions-yolo", {"7_1.txt": b"0 0.5 0.5 0.01 0.02 0.9\n0 0.1 0.2 0.01 0.02\n"})
    rows = b"image,x,y,w,h,score\n7.png,600,300,9,9,0.5\n7_1.png,1,2,3,4,\n"
    yield Case("predictions-csv", {"r.csv": rows})
    corners = b"Image;x1;y1;x2;y2;conf;class;name\n7.png;600,5;300;609;309;0,5;32;sports ball\n"
    yield Case("predictions-csv", {"r.csv": corners})
    yield Case("predictions-csv", {"gt.txt": b"7,1,600,300,9,9,0.5,-1,-1,-1\n"})
    table = b'frame,camera,ball_bbox,score\n358,3,"[1, 2, 3, 4]",1\n'
    yield Case("predictions-csv", {"r.csv": table})


def _foreign() -> Iterator[Case]:
    """COCO of other tools: two files of one frame, a group of two views, points and polygons."""
    size = {"width": 640, "height": 360}
    images = [
        {"id": 1, "file_name": "images\\7.png", "group_id": "kick", "view": "a", **size},
        {"id": 2.0, "file_name": "/x/8.png", "group_id": "kick", "view": "b", **size},
    ]
    annotations = [
        {"id": 1, "image_id": 1.0, "category_id": "1", "bbox": [10, 20, 8, 9], "iscrowd": 0},
        {"id": 2, "image_id": 2, "category_id": 1, "keypoints": [10, 20, 2], "area": 0.0},
        {"id": 3, "image_id": 2, "category_id": 2, "segmentation": [[1, 2, 30, 4, 5, 60]]},
    ]
    categories = [{"id": 1, "name": "sports_ball", "keypoints": ["center"]}, {"id": 2, "name": "x"}]
    first = {"images": images, "annotations": annotations, "categories": categories}
    people = {"id": 1, "image_id": 1, "category_id": 2, "bbox": [1, 2, 3, 4], "attributes": {}}
    second = {"images": images[:1], "annotations": [people], "categories": categories}
    files = {
        "annotations/instances_train.json": first,
        "annotations/person_keypoints_train.json": second,
    }
    frames = {"images/7.png": b"x", "images/8.png": b"x"}
    yield Case("coco", {name: json.dumps(value).encode() for name, value in files.items()} | frames)


def _files(root: Path) -> Files:
    return {
        path.relative_to(root).as_posix(): path.read_bytes()
        for path in sorted(root.rglob("*"))
        if path.is_file() and path.name != "manifest.json"
    }


def _turned(picture: np.ndarray) -> bytes:
    """A JPEG that EXIF turns."""
    exif, data = Image.Exif(), io.BytesIO()
    exif[0x0112] = 6
    Image.fromarray(picture).save(data, "JPEG", exif=exif.tobytes())
    return data.getvalue()


def _video(picture: np.ndarray) -> bytes:
    with tempfile.TemporaryDirectory() as name:
        path = Path(name, "v.mp4")
        video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 25, (48, 27))
        for shade in range(3):
            video.write(picture + np.uint8(shade))
        video.release()
        return path.read_bytes()
