"""sn-gamestate, written: one Labels-GameState.json a sequence, as it came or made anew."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import Any

from app.datasets import fields
from app.datasets.archive import resolve_inside
from app.datasets.frame_names import view_stem
from app.datasets.gamestate import BALL_ID, LABELS, METADATA, PITCH_ID
from app.datasets.sn_calibration_writer import lines_to_json
from app.finite import json_text
from app.soccer.annotation import BallAnnotation
from app.soccer.group import Group, View
from app.soccer.pitch import MARKINGS

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


@dataclass
class _File:
    """One Labels-GameState.json while it is made."""

    name: str
    kept: Mapping[str, Any]
    images: list[dict[str, Any]] = field(default_factory=list)
    annotations: list[dict[str, Any]] = field(default_factory=list)

    def value(self) -> dict[str, Any]:
        info = self.kept.get("info") or {"version": "1.3", "name": self.name, "im_dir": "img1"}
        return {
            "info": info,
            "images": self.images,
            "annotations": self.annotations,
            "categories": self.kept.get("categories") or _CATEGORIES,
        }


def write_gamestate(root: Path, groups: Iterable[Group]) -> dict[str, int]:
    """Write ``<match>/Labels-GameState.json`` for the groups, sequence by sequence.

    Images, people and whatever else came from such a file are written as they came. Of other
    datasets each view becomes an image; roles and teams follow from SoccerNet's classes.

    Args:
        root: Existing folder.
        groups: Groups; one run of a match is in memory at a time.

    Returns:
        Counts: ``groups``, ``images``, ``annotated_balls``.

    Raises:
        UnsafePathError: A key would leave ``root``.
    """
    counts = {"groups": 0, "images": 0, "annotated_balls": 0}
    written: set[Path] = set()
    for match, run in groupby(groups, key=lambda group: group.match):
        name = match or "sequence"
        path = resolve_inside(root, f"{name}/{LABELS}")
        file = _File(PurePosixPath(name).name, {})
        if path in written:
            earlier = json.loads(path.read_text(encoding="utf-8"))
            file = _File(file.name, earlier, earlier["images"], earlier["annotations"])
        for group in run:
            counts["groups"] += 1
            for view in group.views:
                _add(file, group, view, counts)
        path.parent.mkdir(parents=True, exist_ok=True)
        text = json_text(file.value())
        path.write_text(text + "\n", encoding="utf-8")
        written.add(path)
    return counts


def _add(file: _File, group: Group, view: View, counts: dict[str, int]) -> None:
    kept = view.extras.metadata.get(METADATA)
    kept = kept if isinstance(kept, dict) else {}
    file.kept = file.kept or kept
    image = _image(kept, view, len(file.images) + 1, group)
    file.images.append(image)
    identity = str(image.get("image_id", image.get("id")))
    numbered = enumerate(_annotations(kept, view), 1)
    for number, annotation in numbered:
        own = {"id": f"{identity}{number:03d}", "image_id": identity}
        file.annotations.append(own | annotation)
    counts["images"] += 1
    counts["annotated_balls"] += sum(ball.center is not None for ball in view.balls)


def _image(kept: Mapping[str, Any], view: View, number: int, group: Group) -> dict[str, Any]:
    if isinstance(kept.get("image"), dict):
        return dict(kept["image"])
    stem = view_stem(view.key)
    if view.station.shared:
        stem = f"{group.key}_{stem}"
    return {
        "is_labeled": True,
        "image_id": str(1_000_000_000 + number),
        "file_name": f"{PurePosixPath(stem).name}{PurePosixPath(view.key).suffix or '.jpg'}",
        "height": view.size.height,
        "width": view.size.width,
        "has_labeled_person": bool(view.extras.boxes),
        "has_labeled_pitch": bool(view.station.lines),
        "has_labeled_camera": False,
        "ignore_regions_y": [],
        "ignore_regions_x": [],
    }


def _annotations(kept: Mapping[str, Any], view: View) -> Iterator[dict[str, Any]]:
    """The annotations of one image: people, balls, the pitch, and what else there was."""
    for box in view.extras.boxes:
        annotation = box.get(METADATA)
        made = dict(annotation) if isinstance(annotation, dict) else _person(box)
        if made is not None:
            yield made
    rest = kept.get("balls") or []
    balls = [ball for ball in view.balls if ball.center is not None]
    for index, ball in enumerate(balls):
        yield _ball(ball, rest[index] if index < len(rest) else {})
    if view.station.lines or view.extras.lines or "pitch" in kept:
        lines = lines_to_json(view.station.lines, view.size, view.extras.lines)
        head = {"supercategory": "pitch", "category_id": PITCH_ID}
        # This format spells no name with a space at its end.
        stripped = {name.strip(): points for name, points in lines.items()}
        yield head | (kept.get("pitch") or {}) | {"lines": stripped}
    yield from (dict(item) for item in kept.get("others") or [])


def _ball(ball: BallAnnotation, rest: Mapping[str, Any]) -> dict[str, Any]:
    assert ball.center is not None, "the caller leaves out what is out of view"
    x, y = ball.center
    box = ball.box
    place = (x, y, 0.0, 0.0) if box is None else (box.x, box.y, box.width, box.height)
    head = {
        "track_id": None,
        "supercategory": "object",
        "category_id": BALL_ID,
        "attributes": {"role": "ball", "jersey": None, "team": None},
        "bbox_pitch": None,
    }
    return {**head, **rest, "bbox_image": _place(*place)}


def _place(x: float, y: float, width: float, height: float) -> dict[str, float]:
    return {
        "x": x,
        "y": y,
        "x_center": x + width / 2,
        "y_center": y + height / 2,
        "w": width,
        "h": height,
    }


def _person(box: Mapping[str, Any]) -> dict[str, Any] | None:
    """A person of SoccerNet-v3 (``Player team left``, ``Main referee``); None without corners."""
    corners = box.get("points")
    try:
        x1, y1, x2, y2 = (fields.number(corners[name]) for name in ("x1", "y1", "x2", "y2"))  # type: ignore[index]
    except (TypeError, KeyError, ValueError):
        return None
    words = str(box.get("class") or "").lower().split()
    role = next((name for name in _ROLES if name in words), "other")
    team = next((side for side in ("left", "right") if side in words), None)
    number = str(box.get("ID"))
    return {
        "track_id": None,
        "supercategory": "object",
        "category_id": _ROLES.get(role, _OTHER),
        "attributes": {"role": role, "jersey": number if number.isdigit() else None, "team": team},
        "bbox_image": _place(min(x1, x2), min(y1, y2), abs(x2 - x1), abs(y2 - y1)),
        "bbox_pitch": None,
    }
