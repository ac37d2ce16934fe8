"""COCO, read: our own files as they were said, anybody's as images with boxes and points."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

from app.errors import DatasetFormatError, UnsafePathError
from app.formats.ball_names import (
    CAMERA,
    CORNER,
    ORIGIN,
    OUTSIDE,
    PREFIX,
    STATE,
    CocoCategories,
    CocoCategory,
)
from app.formats.camera_json import camera_from_json
from app.formats.coco_annotation import (
    Annotation,
    AnnotationsByImage,
    MissingPositionError,
    ball_from_annotation,
    box_from_annotation,
    is_occluded,
    quote_value,
)
from app.formats.coco_frames import CocoFileFrames, CocoFrame, find_split_in_folders, group_frames
from app.formats.fields import id_to_text
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits, Root
from app.formats.json_reader import describe_document, is_gamestate, read_json
from app.formats.picture_finder import (
    LabelLocation,
    PictureFinder,
    find_split_in_word,
    split_picture_name,
)
from app.formats.report import ReaderReport
from app.formats.safe_path import require_safe_path
from app.formats.split_names import UNASSIGNED
from app.formats.synloc import camera_from_synloc, is_synloc_image_record
from app.formats.trees import open_tree_context
from app.formats.view_state import (
    GroupAssembler,
    RecordFieldReader,
    ViewWithGroupHead,
    extras_from_json,
)
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, box_from_corner_origin
from app.soccer.group import Group, Media, View
from app.wording import plural

_OURS = ("manifest.json", "findings.json", "propose.json", "calibrate.json")
"""JSON files that lie in folders of exports and are no labels."""
_TASK = re.compile(
    r"(?:instances|person_keypoints|keypoints|captions|stuff|panoptic|image_info)_(.+)"
)
"""Names of files of one set of images: what is before it says the task."""


def read_coco(
    root: Root,
    report: ReaderReport,
    *,
    calibration: str = "given",
    limits: ImportLimits = DEFAULT_LIMITS,
    ball_category: str = "",
) -> Iterator[Group]:
    """The images of every COCO file below ``root``.

    Images with the field ``touchline`` come back as the groups that they were; a box that
    somebody has changed since is the new annotation. Of any other file images with one
    ``group_id`` are a group, whose views are called as ``view`` says; an image without is a group
    of one view, keyed by its file name. Boxes of other categories are kept beside the ball. A
    ``camera`` as SoccerNet spells it, and one of SynLoc, is the view's given camera.

    Args:
        root: Folder, zip or one JSON file.
        report: Takes what had to be left out, and which category was taken for the ball.
        calibration: What counts for a view that has a camera and lines (images of others).
        limits: Caps on what is read.
        ball_category: Name or id of the category of others that is the ball; empty: by its name.
    """
    with open_tree_context(root, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        finder, groups = PictureFinder(names), GroupAssembler(report)
        files: list[_CocoFileReader] = []
        for name in names:
            place = PurePosixPath(name)
            if place.suffix.lower() != ".json" or place.name in _OURS:
                continue
            value = _read_coco_file(tree, name, report, limits)
            if value is not None:
                file = _CocoFileReader(tree, name, finder, value, report, ball_category)
                files.append(file)
                for view in file.read_views_and_frames():
                    yield from groups.add(view, tree.shown(name))
                file.release_parsed_content()
        yield from groups.release_incomplete_groups()
        foreign = [file.frames for file in files if file.frames.frames]
        yield from group_frames(foreign, tree, names, calibration, report)
        _report_ball_categories(files, report)
        if not files:
            report.add_problem_at(
                str(root), None, None, "contains no COCO file (images and annotations)"
            )


def _read_coco_file(
    tree: FileTree, name: str, report: ReaderReport, limits: ImportLimits
) -> dict[str, Any] | None:
    """A file with a list of images; None for any other, which is said."""
    shown = tree.shown(name)
    try:
        content = tree.read_bytes(name)
        value = read_json(content, shown, max_bytes=limits.file_bytes, report=report)
    except DatasetFormatError as error:
        report.add_problem(error)
        return None
    if isinstance(value, dict) and isinstance(value.get("images"), list):
        if not is_gamestate(value.get("annotations")):
            return value
        report.add_problem_at(shown, None, None, describe_document(value))
        return None
    report.add_remark(f"{shown}: is not a COCO file (it has no list of images) and was not read")
    return None


def _report_ball_categories(files: list[_CocoFileReader], report: ReaderReport) -> None:
    """Which category of each foreign file was taken for the ball, or that it brought none."""
    some = any(file.categories.ball_count for file in files)
    foreign = [file for file in files if file.frames.frames]
    for file in [file for file in foreign if not file.captions] or foreign:
        file.categories.report_ball_category(alone=not some)


class _CocoFileReader:
    """One file on its way to views (images of ours) and frames (of others)."""

    def __init__(
        self,
        tree: FileTree,
        name: str,
        finder: PictureFinder,
        value: Mapping[str, Any],
        report: ReaderReport,
        ball_category: str,
    ):
        self.path, self._tree, self._finder = tree.shown(name), tree, finder
        self._value, self._report = value, report
        place = PurePosixPath(name)
        stem = place.stem.removeprefix(PREFIX).removeprefix(OUTSIDE)
        task = _TASK.fullmatch(place.stem)
        subset = stem if task is None else task[1]
        split = (
            ""
            if stem == UNASSIGNED
            else find_split_in_word(stem) or find_split_in_folders(place.parts[:-1])
        )
        folder = "" if str(place.parent) == "." else str(place.parent)
        known = task is not None or bool(find_split_in_word(stem))
        self._home = LabelLocation(folder, subset if known and subset != "default" else "", split)
        self.frames = CocoFileFrames(self.path, self._home, [])
        annotations = self._get_list("annotations")
        self.categories = CocoCategories(
            self._get_list("categories"), annotations, self.path, report, ball_category
        )
        self._has_annotations = isinstance(value.get("annotations"), list)
        self._removed: list[str] = []
        self._joined = AnnotationsByImage(value["images"], annotations, self.path, report)
        self.captions = self._joined.captions

    def release_parsed_content(self) -> None:
        """Let go of everything but the frames: the next file may be as large."""
        self._value, self._joined = {}, AnnotationsByImage([], [], self.path, self._report)

    def _get_list(self, name: str) -> list[Any]:
        """A list that need not be there."""
        found = self._value.get(name)
        if found is not None and not isinstance(found, list):
            self._report.add_problem_at(self.path, None, name, "is not a list; left out")
        return found if isinstance(found, list) else []

    def _report_problem(self, record: str, field: str | None, problem: str) -> None:
        self._report.add_problem_at(self.path, record, field, problem)

    def read_views_and_frames(self) -> Iterator[ViewWithGroupHead]:
        """Images of ours as views; those of others become ``frames``.

        What is wrong with one is reported and leaves it out.
        """
        for index, item in enumerate(self._value["images"]):
            record = f"images[{index}]"
            self._report.read += 1
            try:
                image = RecordFieldReader(item, self.path, record)
                if STATE in image.value:
                    yield self._read_image_of_our_export(image, index)
                else:
                    self.frames.frames.append(self._read_foreign_image(image, index))
            except DatasetFormatError as error:
                self._report.add_problem(self._add_annotation_count_to_error(error, index))
        self._report_removed_balls()

    def _add_annotation_count_to_error(
        self, error: DatasetFormatError, index: int
    ) -> DatasetFormatError:
        """Why an image is left out, with how many annotations go with it."""
        count = len(self._joined.of_image[index])
        if not count:
            return error
        problem = f"{error.problem}; left out with {plural(count, 'annotation')}"
        return DatasetFormatError(error.path, error.record, error.field, problem)

    def _read_image_of_our_export(self, image: RecordFieldReader, index: int) -> ViewWithGroupHead:
        state = RecordFieldReader(image.value[STATE], self.path, image.record)
        view = state.read_view(image.read_size(), extras_from_json(state.value.get("extras")))
        changed = self._apply_box_changes(index, view, state.value.get(ORIGIN) == CORNER)
        media = self._find_media_of_our_export(image.read_short_text("file_name", ""))
        view = replace(view, balls=changed, media=media)
        return ViewWithGroupHead(state.read_group_head(), state.read_count("position"), view)

    def _apply_box_changes(
        self, index: int, view: View, from_corner: bool
    ) -> tuple[BallAnnotation, ...]:
        """The balls, with the boxes that somebody changed, added or removed after they were written.

        Args:
            index: Of the image, whose annotations are looked at.
            view: As it was when it was written.
            from_corner: Whether boxes are measured from the corner of the first pixel; those of
                our files of before are in our own frame.
        """
        annotations = self._joined.of_image[index]
        added = self._read_added_balls(annotations, from_corner)
        if not view.balls:
            return tuple(added)
        if view.ball is None and any(ball.box for ball in view.balls):
            # Of several balls no box was written, so that every box is one more to pick from.
            return self._join_candidates(view, added)
        # A tool that drops fields that it does not know hands the written box on as a new one.
        written = any("written_bbox" in item for _, item in annotations)
        if written or not any(ball.box for ball in view.balls):
            for record in added.values():
                self._report_problem(record, "bbox", "adds a ball to a view that has one; left out")
        if self._lacks_written_box(view, annotations):
            self._removed.append(view.key)
            return tuple(ball for ball in view.balls if ball.out_of_view)
        if len(view.balls) != 1:
            return view.balls
        for record, item in annotations:
            if item.get("bbox") != item.get("written_bbox", item.get("bbox")):
                box = self._read_bbox(item, record)
                if box is not None:
                    box = box_from_corner_origin(box) if from_corner else box
                    return (replace(view.balls[0], box=box, point=None),)
        return view.balls

    def _join_candidates(
        self, view: View, added: Mapping[BallAnnotation, str]
    ) -> tuple[BallAnnotation, ...]:
        """The balls of a view with several, and those that were added."""
        known = {ball.box for ball in view.balls}
        for ball, record in added.items():
            if ball.box in known:
                self._report_problem(
                    record, "bbox", "puts a second ball at the same place; left out"
                )
        return (*view.balls, *(ball for ball in added if ball.box not in known))

    def _lacks_written_box(self, view: View, annotations: list[Annotation]) -> bool:
        """Whether the box of a view's ball, which every export writes, is gone: a person removed it."""
        if view.ball is None or view.ball.box is None or not self._has_annotations:
            return False
        for _, item in annotations:
            category = self.categories.find(item.get("category_id"))
            if "written_bbox" in item or category is None or category.ball:
                return False
        return True

    def _report_removed_balls(self) -> None:
        if self._removed:
            names = ", ".join(self._removed[:5]) + (", ..." if len(self._removed) > 5 else "")
            views = plural(len(self._removed), "view")
            self._report.add_remark(
                f"{self.path}: the ball box of {views} ({names}) was removed since the export; its"
                " ball is removed here, too"
            )

    def _read_added_balls(
        self, annotations: list[Annotation], from_corner: bool
    ) -> dict[BallAnnotation, str]:
        """The balls that were added since, each with its place in the file; the rest is reported."""
        balls: dict[BallAnnotation, str] = {}
        for record, item in annotations:
            if "written_bbox" in item:
                continue
            category = self.categories.find(item.get("category_id"))
            if category is None or not category.ball:
                shown = quote_value(item.get("category_id")) if category is None else category.shown
                problem = f"is {shown}: of boxes added to an export only the ball is read; left out"
                self._report_problem(record, "category_id", problem)
            elif (
                not self._is_crowd(item, record)
                and (box := self._read_bbox(item, record)) is not None
            ):
                box = box_from_corner_origin(box) if from_corner else box
                ball = BallAnnotation(box=box, occluded=is_occluded(item))
                if ball in balls:
                    self._report_problem(
                        record, "bbox", "puts a second ball at the same place; left out"
                    )
                balls.setdefault(ball, record)
        return balls

    def _read_bbox(self, item: Mapping[str, Any], record: str) -> Box | None:
        try:
            return RecordFieldReader.parse_box(item.get("bbox"))
        except ValueError as error:
            self._report_problem(record, "bbox", f"{error}; left out")
            return None

    def _find_media_of_our_export(self, name: str) -> Media | None:
        """The frame of an image of ours, where it lies in the tree."""
        place = self._finder.find_picture(split_picture_name(name), self._home).place
        return None if place is None else self._tree.media(place)

    def _read_foreign_image(self, image: RecordFieldReader, index: int) -> CocoFrame:
        parts = split_picture_name(image.read_short_text("file_name"))
        key = self._make_image_key(image, parts)
        group, view = self._read_group_and_view(image, key)
        split = self._home.split or find_split_in_folders(parts[:-1])
        frame = CocoFrame(
            self.path, image.record, parts, key, group, view, image.read_size(), split,
            self._read_foreign_camera(image), named=image.value.get("view") is not None,
        )  # fmt: skip
        for record, item in self._joined.of_image[index]:
            self._add_annotation(frame, item, record)
        return frame

    def _make_image_key(self, image: RecordFieldReader, parts: tuple[str, ...]) -> str:
        """Key of an image: its name; of one on another machine the last part, where that is enough."""
        text = image.read_short_text("file_name")
        key = "/".join(parts)
        try:
            if not parts:
                require_safe_path(text)
                raise image.make_field_error("file_name", "is not a file name")
            if not _is_relative_path(text) and self._joined.is_unique_image_name(parts[-1]):
                key = parts[-1]
            return require_safe_path(key)
        except UnsafePathError as error:
            raise image.make_field_error("file_name", error.message) from error

    def _add_annotation(self, frame: CocoFrame, item: Mapping[str, Any], record: str) -> None:
        """One annotation of a frame: its ball, or the box of something else."""
        category = self.categories.find(item.get("category_id"))
        if category is None:
            shown = quote_value(item["category_id"]) if "category_id" in item else "missing"
            problem = f"is {shown}, which no category of the file has; kept as a box without class"
            self._report_problem(record, "category_id", problem)
        try:
            if category is not None and category.ball:
                self._add_ball(frame, item, category, record)
            else:
                name = "" if category is None else category.name.lower()
                frame.boxes.append(
                    _make_box_of_other_category(name, item, box_from_annotation(item))
                )
        except MissingPositionError as error:
            self._report_problem(record, error.field, f"{error.problem}; left out")

    def _add_ball(
        self, frame: CocoFrame, item: Mapping[str, Any], category: CocoCategory, record: str
    ) -> None:
        if self._is_crowd(item, record):
            return
        ball = ball_from_annotation(item, category.keypoints)
        if ball in frame.balls:
            self._report_problem(record, "bbox", "puts a second ball at the same place; left out")
            return
        frame.balls.append(ball)
        self.categories.count_ball(category)

    def _is_crowd(self, item: Mapping[str, Any], record: str) -> bool:
        """Whether an annotation is a crowd, which is reported: it is not one ball."""
        crowd = item.get("iscrowd") in (1, "1")
        if crowd:
            self._report_problem(record, "iscrowd", "is 1: a crowd cannot be one ball; left out")
        return crowd

    def _read_foreign_camera(self, image: RecordFieldReader) -> Camera | None:
        """The camera that a file of somebody else gives; one that is none is reported."""
        given = image.value.get(CAMERA)
        try:
            if is_synloc_image_record(image.value):
                return camera_from_synloc(image.value, self.path, image.record)
            return None if given is None else camera_from_json(given, self.path, image.record)
        except DatasetFormatError as error:
            of_camera = [] if is_synloc_image_record(image.value) else [CAMERA]
            field = ".".join([*of_camera, *filter(None, [error.field])])
            self._report_problem(image.record, field, f"{error.problem}; left out")
            return None

    def _read_group_and_view(self, image: RecordFieldReader, key: str) -> tuple[str | None, str]:
        """Group and name of a view; no group where the file says none."""
        group, view = image.value.get("group_id"), image.value.get("view")
        if group is None or isinstance(group, bool) or not isinstance(group, str | int | float):
            return None, key
        if view is None:
            view = PurePosixPath(key).name
        if isinstance(view, bool) or not isinstance(view, str | int | float):
            raise image.make_field_error("view", "is not a name that a view can have")
        return _require_safe_path(image, "group_id", group), _require_safe_path(image, "view", view)


def _require_safe_path(image: RecordFieldReader, field: str, value: str | float) -> str:
    text = value if isinstance(value, str) else id_to_text(value) or ""
    try:
        return str(PurePosixPath(require_safe_path(text)))
    except UnsafePathError as error:
        raise image.make_field_error(field, error.message) from error


def _is_relative_path(name: str) -> bool:
    """Whether a name leads to a file below a folder, whichever that is."""
    try:
        return (
            bool(require_safe_path(name.replace("\\", "/")))
            and "://" not in name
            and "?" not in name
        )
    except UnsafePathError:
        return False


def _make_box_of_other_category(
    category: str, item: Mapping[str, Any], box: Box
) -> Mapping[str, Any]:
    """A box of another category in the shape that all datasets show."""
    corners = {"x1": box.x, "y1": box.y, "x2": box.x + box.width, "y2": box.y + box.height}
    return {"class": category or None, "ID": str(item.get("id", "")), "points": corners}
