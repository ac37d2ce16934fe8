"""sn-gamestate, written: one Labels-GameState.json a sequence, as it came or made anew."""

from __future__ import annotations

import json
import math
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from app.errors import InputError
from app.formats import fields
from app.formats.camera_json import camera_to_json
from app.formats.export_record import ExportRecord
from app.formats.frame_names import normalize_file_name
from app.formats.gamestate_reader import (
    BALL_ID,
    CAMERA_ID,
    IMAGES,
    LABELS,
    METADATA,
    OCCLUDED,
    PITCH_ID,
    SPLIT,
    frame_file_name,
    get_gamestate_metadata,
    read_ball_annotation,
    sequence_folder,
)
from app.formats.safe_path import resolve_inside
from app.formats.sn_calibration_writer import lines_to_json
from app.formats.soccernet_v3 import SPLITS
from app.geometry.camera import Camera
from app.json_text import json_text
from app.soccer.annotation import CORNERS, BallAnnotation
from app.soccer.group import Group, View
from app.soccer.pitch import MARKINGS
from app.soccer.policy import PAPER

_ROLES = {
    "player": 1,
    "goalkeeper": 2,
    "referee": 3,
}
_CATEGORIES: list[dict[str, Any]] = [
    {"supercategory": "object", "id": 1, "name": "player"},
    {"supercategory": "object", "id": 2, "name": "goalkeeper"},
    {"supercategory": "object", "id": 3, "name": "referee"},
    {"supercategory": "object", "id": 4, "name": "ball"},
    {"supercategory": "pitch", "id": 5, "name": "pitch", "lines": list(MARKINGS)},
    {"supercategory": "camera", "id": 6, "name": "camera"},
    {"supercategory": "object", "id": 7, "name": "other"},
]
_OTHER = 7
BOX = "bbox_image"
_BALL: dict[str, Any] = {
    "track_id": None,
    "supercategory": "object",
    "category_id": BALL_ID,
    "attributes": {"role": "ball", "jersey": None, "team": None},
    "bbox_pitch": None,
}
_SPLIT_NUMBERS = {"train": 1, "valid": 2, "test": 3, "challenge": 4}
_PITCH_BOX = tuple(
    f"{axis}_bottom_{place}" for place in ("left", "middle", "right") for axis in "xy"
)
_PLACE_DIGITS = 9
"""Decimals of a metre: of what is computed on the grass a nanometre is enough."""
_FIRST_OF_OURS = 100_001
"""Track in a sequence that brings tracks of its own."""


@dataclass
class _LabelsFile:
    """One Labels-GameState.json while it is made; each image, and the annotations of each, are JSON already."""

    name: str
    number: int
    split: str
    kept: Mapping[str, Any] = field(default_factory=dict)
    images: list[str] = field(default_factory=list)
    annotations: list[str] = field(default_factory=list)
    tracks: dict[Hashable, int] = field(default_factory=dict)

    def to_json_text(self) -> str:
        info = _compact_json(self._make_sequence_info())
        categories = _compact_json(self.kept.get("categories") or _CATEGORIES)
        images, annotations = ",\n".join(self.images), ",\n".join(self.annotations)
        return (
            f'{{"info":{info},"images":[\n{images}\n],"annotations":[\n{annotations}\n],'
            f'"categories":{categories}}}\n'
        )

    def _make_sequence_info(self) -> dict[str, Any]:
        kept, length = self.kept.get("info"), len(self.images)
        own = {SPLIT: self.split} if self.split and self.split not in SPLITS else {}
        if not kept:
            info = {"version": "1.3", "id": str(self.number), "name": self.name, "im_dir": IMAGES}
            return {**info, "seq_length": length, **own}
        info = {name: value for name, value in kept.items() if name != SPLIT} | own
        # Some of its images may not be in this export.
        is_stale = "seq_length" in kept and str(kept["seq_length"]) != str(length)
        return {**info, "seq_length": length} if is_stale else info

    def next_image_id(self) -> str:
        """Id of the next image; no sequence of an export has the same."""
        return f"{_SPLIT_NUMBERS.get(self.split, 9)}{self.number:03d}{len(self.images) + 1:06d}"

    def assign_track_number(self, who: Hashable) -> int:
        """Number of a track, beyond those that a file may have brought."""
        start = _FIRST_OF_OURS if self.kept else 1
        return self.tracks.setdefault(who, start + len(self.tracks))


def write_gamestate(root: Path, records: Iterable[ExportRecord]) -> dict[str, int]:
    """Write ``<split>/<sequence>/Labels-GameState.json`` for the groups, sequence by sequence.

    Images, people and whatever else came from such a file are written as they came. Of other
    datasets each view becomes an image; roles and teams follow from SoccerNet's classes, places
    on the pitch from its camera.

    Args:
        root: Existing folder.
        records: Groups; one run of a match is in memory at a time.

    Returns:
        Counts: ``groups``, ``images``, ``annotated_balls``.

    Raises:
        InputError: Two matches would have one folder.
        UnsafePathError: A key would leave ``root``.
    """
    counts = {"groups": 0, "images": 0, "annotated_balls": 0}
    files, matches = dict[Path, _LabelsFile](), dict[str, str]()
    names: dict[tuple[str, str], str] = {}
    for match, run in groupby(records, key=lambda record: record.group.match):
        touched: dict[str, Path] = {}
        for record in run:
            counts["groups"] += 1
            for view in record.group.views:
                split = record.split_of_view(view)
                if split not in touched:
                    path = resolve_inside(root, f"{sequence_folder(match, split)}/{LABELS}")
                    # Whatever its split, a sequence is known by the name of its folder.
                    other = matches.setdefault(normalize_file_name(path.parent.name), match)
                    if other != match:
                        raise InputError(
                            f"the matches {other} and {match} would be written to the same folder,"
                            f" {path.parent.name}",
                            hint="Rename one of them in the source, and import it again.",
                        )
                    if path in files:
                        _reload_labels_file(files[path], path)
                    else:
                        files[path] = _LabelsFile(path.parent.name, len(files) + 1, split)
                    touched[split] = path
                _reserve_image_name(names, record, view)
                _add_view(files[touched[split]], record, view, counts)
        for path in sorted(touched.values()):
            _write_labels_file(files[path], path)
    return counts


def _reserve_image_name(
    names: dict[tuple[str, str], str], record: ExportRecord, view: View
) -> None:
    """Keep the name of an image; raises InputError where another one of its sequence has it."""
    name = frame_file_name(record.group, record.with_export_file_key(view))
    whose = f"{record.group.key}, {view.key}"
    first = names.setdefault(
        (record.group.match, normalize_file_name(PurePosixPath(name).stem)), whose
    )
    if first != whose:
        raise InputError(
            f"the images of two frames ({first} and {whose}) would both be called {name}",
            hint="Rename one of them in the source, and import it again.",
        )


def _write_labels_file(file: _LabelsFile, path: Path) -> None:
    """Write a file, and forget what it holds until its match comes again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(file.to_json_text(), encoding="utf-8")
    file.images, file.annotations = [], []


def _reload_labels_file(file: _LabelsFile, path: Path) -> None:
    earlier = json.loads(path.read_text(encoding="utf-8"))
    file.images = [_compact_json(item) for item in earlier["images"]]
    file.annotations = [_compact_json(item) for item in earlier["annotations"]]


def _compact_json(value: Any) -> str:
    return json_text(value, compact=True)


def _add_view(file: _LabelsFile, record: ExportRecord, view: View, counts: dict[str, int]) -> None:
    kept = get_gamestate_metadata(view)
    file.kept = file.kept or kept
    camera = record.camera(view)
    people = _make_people_annotations(file, record.group, view, camera)
    image = _image_to_json(file, record, view, camera, people)
    file.images.append(_compact_json(image))
    identity = str(image.get("image_id", image.get("id")))
    annotations = [
        *people,
        *_make_ball_annotations(file, record, view),
        *_make_other_annotations(view, camera),
    ]
    if annotations:
        found = [
            {"id": f"{identity}{number:03d}", "image_id": identity, **annotation}
            for number, annotation in enumerate(annotations, 1)
        ]
        file.annotations.append(_compact_json(found).removeprefix("[").removesuffix("]"))
    counts["images"] += 1
    counts["annotated_balls"] += sum(ball.center is not None for ball in view.balls)


def _image_to_json(
    file: _LabelsFile,
    record: ExportRecord,
    view: View,
    camera: Camera | None,
    people: list[dict[str, Any]],
) -> dict[str, Any]:
    kept, name = (
        get_gamestate_metadata(view).get("image"),
        frame_file_name(record.group, record.with_export_file_key(view)),
    )
    if isinstance(kept, dict):
        return {
            **kept,
            **({"file_name": name} if view.key in record.names else {}),
            **_find_labels_added_here(kept, view),
        }
    return {
        "is_labeled": True,
        "image_id": file.next_image_id(),
        "file_name": name,
        "height": view.size.height,
        "width": view.size.width,
        # An evaluation asks for the place of everybody; somebody without one would end it.
        "has_labeled_person": bool(people)
        and (camera is None or all(person["bbox_pitch"] for person in people)),
        "has_labeled_pitch": bool(view.station.lines),
        "has_labeled_camera": _can_store_camera(camera),
        "ignore_regions_y": [],
        "ignore_regions_x": [],
    }


def _find_labels_added_here(kept: Mapping[str, Any], view: View) -> dict[str, bool]:
    """What an image says it has no label of, and has one by now."""
    lines = bool(view.station.lines)
    balls = any(ball.center is not None for ball in view.balls)
    added = {"is_labeled": lines or balls, "has_labeled_pitch": lines}
    return {name: True for name, is_there in added.items() if is_there and kept.get(name) is False}


def _can_store_camera(camera: Camera | None) -> bool:
    """Whether the format has a place for a camera: it is SoccerNet's, with no wide lens."""
    return camera is not None and not camera.is_wide


def _make_people_annotations(
    file: _LabelsFile, group: Group, view: View, camera: Camera | None
) -> list[dict[str, Any]]:
    """The people of an image, as they came or made anew, each track once."""
    seen: set[int] = set()
    people: list[dict[str, Any]] = []
    made: list[dict[str, Any]] = []
    for index, box in enumerate(view.extras.boxes):
        if isinstance(box.get(METADATA), dict):
            people.append(dict(box[METADATA]))
            continue
        person = _make_person_annotation(box)
        if person is None:
            continue
        track = file.assign_track_number(_identify_track_owner(box, group, view, index))
        if track in seen:
            track = file.assign_track_number((group.key, view.key, index))
        seen.add(track)
        person["track_id"] = track
        people.append(person)
        made.append(person)
    standing = _project_boxes_to_pitch(camera, [person["bbox_image"] for person in made])
    for person, place in zip(made, standing, strict=True):
        person["bbox_pitch"] = place
    return people


def _identify_track_owner(box: Mapping[str, Any], group: Group, view: View, index: int) -> Hashable:
    """Whose box it is: a shirt number is the same all match long, another tag in its group."""
    # A class that is no text is kept as it came, like all that datasets bring.
    name, tag = str(box.get("class")), box.get("ID")
    if tag is None:
        return (group.key, view.key, index)
    text = str(tag)
    return (name, text) if text.isdigit() else (name, text, group.key)


def _project_boxes_to_pitch(
    camera: Camera | None, boxes: Sequence[Mapping[str, float]]
) -> list[dict[str, float] | None]:
    """Where the lower edge of each box stands on the grass, metres; None without a place there."""
    if camera is None or not boxes:
        return [None] * len(boxes)
    left, wide, low = np.array([(box["x"], box["w"], box["y"] + box["h"]) for box in boxes]).T
    edges = np.column_stack([left, low, left + wide / 2, low, left + wide, low])
    places = np.round(camera.project_to_ground(edges.reshape(-1, 2)).reshape(-1, 6), _PLACE_DIGITS)
    stand = np.isfinite(places.sum(axis=1)).tolist()
    return [
        _make_bbox_pitch(place) if stands else None
        for place, stands in zip(places.tolist(), stand, strict=True)
    ]


def _make_bbox_pitch(place: Sequence[float]) -> dict[str, float]:
    """``bbox_pitch`` of x and y of the left, middle and right of a lower edge, pitch frame."""
    return dict(zip(_PITCH_BOX, place, strict=True))


def _make_ball_annotations(
    file: _LabelsFile, record: ExportRecord, view: View
) -> Iterator[dict[str, Any]]:
    rest: list[dict[str, Any]] = [*(get_gamestate_metadata(view).get("balls") or [])]
    for index, ball in enumerate(view.balls):
        if ball.center is None:
            continue
        nearest, box = rest[index : index + 1], _make_bbox_of_ball(ball)
        kept = next((item for item in nearest + rest if _is_ball_as_it_came(item, ball)), None)
        if kept is not None:
            made = {**_BALL, **kept, BOX: {**box, **kept[BOX]}}
        elif nearest and BOX not in nearest[0]:
            # Read before its box was kept with it.
            made = {**_BALL, **nearest[0], BOX: box}
        else:
            # Drawn here, or moved: then it is the same ball at another place.
            kept = (
                nearest[0] if nearest else {"track_id": file.assign_track_number(("ball", index))}
            )
            place = _locate_spot_below_ball(record, view)
            made = {**_BALL, **kept, "bbox_pitch": place, BOX: box}
        if ball.occluded or made.get(OCCLUDED) is True:
            made[OCCLUDED] = ball.occluded
        yield made


def _is_ball_as_it_came(item: Mapping[str, Any], ball: BallAnnotation) -> bool:
    """Whether an annotation that was kept is of the box or point that a ball has now."""
    try:
        came = read_ball_annotation(item)
    except ValueError:
        return False
    return (came.box, came.point) == (ball.box, ball.point)


def _locate_spot_below_ball(record: ExportRecord, view: View) -> dict[str, float] | None:
    """The spot below the 3D ball, where that holds: the box of a ball in the air stands elsewhere."""
    camera, point = record.camera(view), record.ball_point
    if camera is None or point is None or not record.has_ball_3d(view):
        return None
    # To the right in the image, along the grass.
    x, y = camera.rotation[0, :2].tolist()
    share = PAPER.ball_diameter_m / 2 / max(math.hypot(x, y), 1e-9)
    (east, south, _), right, down = point, x * share, y * share
    edge = (east - right, south - down, east, south, east + right, south + down)
    return _make_bbox_pitch([round(value, _PLACE_DIGITS) for value in edge])


def _make_other_annotations(view: View, camera: Camera | None) -> Iterator[dict[str, Any]]:
    """The lines, the camera, and what else there was."""
    kept = get_gamestate_metadata(view)
    if view.station.lines or view.extras.lines or "pitch" in kept:
        lines = lines_to_json(view.station.lines, view.size, view.extras.lines)
        head = {"supercategory": "pitch", "category_id": PITCH_ID}
        # This format spells no name with a space at its end.
        stripped = {name.strip(): points for name, points in lines.items()}
        yield head | (kept.get("pitch") or {}) | {"lines": stripped}
    if camera is not None and _can_store_camera(camera) and not kept:
        head = {"supercategory": "camera", "category_id": CAMERA_ID}
        measured = {"relative_mean_reproj": None, "accuracy@5": None}
        yield {**head, "parameters": camera_to_json(camera), **measured}
    yield from (dict(item) for item in kept.get("others") or [])


def _make_bbox_of_ball(ball: BallAnnotation) -> dict[str, float]:
    assert ball.center is not None, "the caller leaves out what is out of view"
    x, y = ball.center
    box = ball.box
    return _make_bbox_image(
        *((x, y, 0.0, 0.0) if box is None else (box.x, box.y, box.width, box.height))
    )


def _make_bbox_image(x: float, y: float, width: float, height: float) -> dict[str, float]:
    return {
        "x": x,
        "y": y,
        "x_center": x + width / 2,
        "y_center": y + height / 2,
        "w": width,
        "h": height,
    }


@lru_cache(maxsize=256)
def _parse_role_and_team(name: str) -> tuple[str, str | None]:
    """What SoccerNet's class of a person says."""
    words = name.lower().split()
    role = next((role for role in _ROLES if role in words), "other")
    return role, next((side for side in ("left", "right") if side in words), None)


def _make_person_annotation(box: Mapping[str, Any]) -> dict[str, Any] | None:
    """A person of SoccerNet-v3 (``Player team left``, ``Main referee``); None without corners."""
    corners = box.get("points")
    try:
        x1, y1, x2, y2 = [fields.parse_number(corners[name]) for name in CORNERS]  # type: ignore[index]
    except (TypeError, KeyError, ValueError):
        return None
    role, team = _parse_role_and_team(str(box.get("class") or ""))
    number = str(box.get("ID"))
    return {
        "track_id": None,
        "supercategory": "object",
        "category_id": _ROLES.get(role, _OTHER),
        "attributes": {"role": role, "jersey": number if number.isdigit() else None, "team": team},
        "bbox_image": _make_bbox_image(min(x1, x2), min(y1, y2), abs(x2 - x1), abs(y2 - y1)),
        "bbox_pitch": None,
    }
