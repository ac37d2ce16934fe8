"""COCO, read: our own files as they were said, anybody's as images with boxes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

from app.datasets.camera_json import camera_from_json
from app.datasets.coco import CAMERA, CORNER, ORIGIN, OUTSIDE, PREFIX, STATE
from app.datasets.corner_origin import box_from_corner
from app.datasets.file_tree import DEFAULT_LIMITS, FileTree, Limits, Root
from app.datasets.frame_names import IMAGE_SUFFIXES, UNASSIGNED
from app.datasets.json_text import read_json
from app.datasets.report import Report
from app.datasets.safe_path import check_name
from app.datasets.soccernet_v3 import SPLITS
from app.datasets.synloc import camera_from_synloc, is_synloc
from app.datasets.trees import opened_tree
from app.datasets.view_groups import PlacedView, ViewGroups
from app.datasets.view_state import GroupHead, StateReader
from app.errors import DatasetFormatError, UnsafePathError
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import Box
from app.soccer.group import Group, Station, View
from app.soccer.media import Media
from app.soccer.pitch import Pitch

BALLS = frozenset({"ball", "sports ball", "sports-ball", "soccer ball", "football"})
"""Names of categories that are the ball, in lower case."""
_FOLDERS = ("", "images/", "train/", "val/", "valid/", "test/")


def read_coco(
    root: Root,
    report: Report,
    *,
    calibration: str = "given",
    limits: Limits = DEFAULT_LIMITS,
) -> Iterator[Group]:
    """The images of every COCO file below ``root``.

    Images with the field ``touchline`` come back as the groups that they were; a box that
    somebody has changed since is the new annotation. Of any other file images with one
    ``group_id`` are a group, whose views are called as ``view`` says; an image without is a group
    of one view, keyed by its file name. Boxes of other categories are kept beside the ball. A
    ``camera`` as SoccerNet spells it, and one of SynLoc, is the view's given camera.

    Args:
        root: Folder, zip or one JSON file.
        report: Takes what had to be left out.
        calibration: What counts for a view that has a camera and lines (images of others).
        limits: Caps on what is read.
    """
    with opened_tree(root, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        groups = ViewGroups(report)
        found = False
        for name in names:
            place = PurePosixPath(name)
            if place.suffix.lower() != ".json" or place.name == "manifest.json":
                continue
            value = _value(tree, name, report, limits)
            if value is not None:
                found = True
                for view in _File(tree, name, names, value, report, calibration).views():
                    yield from groups.add(view, tree.shown(name))
        yield from groups.rest()
        if not found:
            report.note(str(root), None, None, "holds no COCO file (images and annotations)")


def _value(tree: FileTree, name: str, report: Report, limits: Limits) -> dict[str, Any] | None:
    try:
        shown = tree.shown(name)
        value = read_json(tree.read_bytes(name), shown, max_bytes=limits.file_bytes)
    except DatasetFormatError as error:
        report.skip(error)
        return None
    lists = isinstance(value, dict) and all(
        isinstance(value.get(part), list) for part in ("images", "annotations")
    )
    return value if lists else None


class _File:
    """One file on its way to views."""

    def __init__(
        self,
        tree: FileTree,
        name: str,
        names: list[str],
        value: Mapping[str, Any],
        report: Report,
        calibration: str,
    ):
        self.path, self._tree, self._names = tree.shown(name), tree, set(names)
        self._value, self._report, self._calibration = value, report, calibration
        stem = PurePosixPath(name).stem.removeprefix(PREFIX).removeprefix(OUTSIDE)
        self._split = stem if stem in SPLITS and stem != UNASSIGNED else ""
        self._top = str(PurePosixPath(name).parent.parent)
        self._categories = {
            str(item.get("id")): str(item.get("name", "")).strip().lower()
            for item in self._listed("categories")
            if isinstance(item, dict)
        }
        self._of_image = self._by_image()

    def _listed(self, name: str) -> list[Any]:
        """A list that need not be there."""
        found = self._value.get(name)
        if found is not None and not isinstance(found, list):
            self._report.note(self.path, None, name, "is not a list; left out")
        return found if isinstance(found, list) else []

    def _by_image(self) -> dict[str, list[Mapping[str, Any]]]:
        found: dict[str, list[Mapping[str, Any]]] = {}
        for index, item in enumerate(self._value["annotations"]):
            if isinstance(item, dict) and "image_id" in item:
                found.setdefault(str(item["image_id"]), []).append(item)
            else:
                self._note(f"annotations[{index}]", "image_id", "is missing")
        return found

    def _note(self, record: str, field: str | None, problem: str) -> None:
        self._report.note(self.path, record, field, problem)

    def views(self) -> Iterator[PlacedView]:
        """Image by image; what is wrong with one is reported and leaves it out."""
        for index, item in enumerate(self._value["images"]):
            record = f"images[{index}]"
            self._report.read += 1
            try:
                image = StateReader(item, self.path, record)
                if STATE in image.value:
                    yield self._ours(image)
                else:
                    yield self._theirs(image, index)
            except DatasetFormatError as error:
                self._report.skip(error)

    def _ours(self, image: StateReader) -> PlacedView:
        state = StateReader(image.value[STATE], self.path, image.record)
        view = state.view(image.size(), Extras())
        changed = self._changed(image, view, state.value.get(ORIGIN) == CORNER)
        media = self._media(image.text("file_name", ""))
        view = replace(view, balls=changed, media=media)
        return PlacedView(state.head(), state.count("position"), view)

    def _changed(
        self, image: StateReader, view: View, from_corner: bool
    ) -> tuple[BallAnnotation, ...]:
        """The balls, with the boxes that somebody changed after they were written.

        Args:
            image: Its annotations are looked at.
            view: As it was when it was written.
            from_corner: Whether boxes are measured from the corner of the first pixel; those of
                our files of before are in our own frame.
        """
        if len(view.balls) != 1:
            return view.balls
        for item in self._annotations(image):
            if item.get("bbox") != item.get("written_bbox", item.get("bbox")):
                box = self._box(item, image.record)
                if box is not None:
                    box = box_from_corner(box) if from_corner else box
                    return (replace(view.balls[0], box=box, point=None),)
        return view.balls

    def _annotations(self, image: StateReader) -> list[Mapping[str, Any]]:
        return self._of_image.get(str(image.value.get("id")), [])

    def _box(self, item: Mapping[str, Any], record: str) -> Box | None:
        try:
            return StateReader.box(item.get("bbox"))
        except ValueError as error:
            self._note(record, "bbox", f"{error}; left out")
            return None

    def _theirs(self, image: StateReader, index: int) -> PlacedView:
        name = image.text("file_name")
        key = _safe(image, "file_name", name)
        group, view_key = self._placed(image, key)
        balls, boxes = [], []
        for item in self._annotations(image):
            box = self._box(item, image.record)
            if box is None:
                continue
            category = self._categories.get(str(item.get("category_id")), "")
            if category in BALLS:
                balls.append(BallAnnotation(box=box, occluded=item.get("occluded") is True))
            else:
                boxes.append(_shown(category, item, box))
        station_key = key if group is None else f"{group}/{view_key}"
        station = Station(station_key, image.size(), calibration=self._calibration)
        if (camera := self._camera(image)) is not None:
            station = station.with_given(camera)
        media, extras = self._media(name), Extras(tuple(boxes))
        view = View(view_key, station, tuple(balls), media, extras=extras)
        if group is None:
            label = f"Image {PurePosixPath(key).name}"
            return PlacedView(GroupHead(key, "", self._split, label, Pitch(), 1), 0, view)
        label = f"Group {PurePosixPath(group).name}"
        # How many views it has is known once everything is read.
        return PlacedView(GroupHead(group, "", self._split, label, Pitch()), index, view)

    def _camera(self, image: StateReader) -> Camera | None:
        """The camera that a file of somebody else gives; one that is none is reported."""
        given = image.value.get(CAMERA)
        try:
            if is_synloc(image.value):
                return camera_from_synloc(image.value, self.path, image.record)
            return None if given is None else camera_from_json(given, self.path, image.record)
        except DatasetFormatError as error:
            of_camera = [] if is_synloc(image.value) else [CAMERA]
            field = ".".join([*of_camera, *filter(None, [error.field])])
            self._note(image.record, field, f"{error.problem}; left out")
            return None

    def _placed(self, image: StateReader, key: str) -> tuple[str | None, str]:
        """Group and name of a view; no group where the file says none."""
        group, view = image.value.get("group_id"), image.value.get("view")
        if group is None or isinstance(group, bool) or not isinstance(group, str | int):
            return None, key
        if view is None:
            view = PurePosixPath(key).name
        if isinstance(view, bool) or not isinstance(view, str | int):
            raise image.error("view", "is no name of a view")
        return _safe(image, "group_id", str(group)), _safe(image, "view", str(view))

    def _media(self, name: str) -> Media | None:
        """The frame beside the annotations, where it lies in the tree."""
        tops = ("", f"{self._top}/") if self._top != "." else ("",)
        for top in tops:
            for folder in _FOLDERS:
                place = f"{top}{folder}{name}"
                if place in self._names and PurePosixPath(place).suffix.lower() in IMAGE_SUFFIXES:
                    return self._tree.media(place)
        return None


def _safe(image: StateReader, field: str, text: str) -> str:
    try:
        return str(PurePosixPath(check_name(text)))
    except UnsafePathError as error:
        raise image.error(field, error.message) from error


def _shown(category: str, item: Mapping[str, Any], box: Box) -> Mapping[str, Any]:
    """A box of another category in the shape that all datasets show."""
    corners = {"x1": box.x, "y1": box.y, "x2": box.x + box.width, "y2": box.y + box.height}
    return {"class": category or None, "ID": str(item.get("id", "")), "points": corners}
