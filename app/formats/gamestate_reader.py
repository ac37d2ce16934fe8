"""sn-gamestate: ``<sequence>/Labels-GameState.json``, each image a group of one view."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Any

from app.errors import DatasetFormatError, UnsafePathError
from app.formats import fields
from app.formats.ball_names import is_ball_name
from app.formats.fields import IdIndex
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits, Root, list_files_in_folder
from app.formats.frame_names import strip_image_suffix
from app.formats.json_reader import read_json
from app.formats.report import ReaderReport
from app.formats.safe_path import require_safe_path
from app.formats.sn_calibration_reader import lines_from_json
from app.formats.soccernet_v3 import SPLITS
from app.formats.split_names import parse_split_name, read_split_name, split_in_file_name
from app.formats.trees import open_tree_context
from app.soccer.annotation import BallAnnotation, Extras, Lines
from app.soccer.frames import MAX_SIDE, Box, ImageSize
from app.soccer.group import Group, Media, Station, View
from app.wording import plural

LABELS = "Labels-GameState.json"
METADATA = "gamestate"
"""Under this name ``Extras.metadata`` keeps what the file says besides lines and boxes."""
BALL, PITCH = "ball", "pitch"
BALL_ID, PITCH_ID = 4, 5
"""Ids of the categories where a file does not list them."""
CAMERA_ID = 6
OCCLUDED = "occluded"
"""Ours, beside the box of a ball that somebody hides."""
SPLIT = "touchline_split"
"""Ours, in ``info``: a split that is called as no folder of an evaluator is."""
IMAGES = "img1"
"""Folder of the frames of a sequence."""
SEQUENCE = "sequence"
"""Stands for the match of groups that are in none."""


def sequence_folder(match: str, split: str) -> str:
    """Folder of a sequence: evaluators list the sequences of a split and look no deeper.

    Example:
        >>> sequence_folder("epl/2015-2016/2015-08-08 - 18-30 Chelsea 2 - 2 Swansea", "test")
        'test/epl_2015-2016_2015-08-08 - 18-30 Chelsea 2 - 2 Swansea'
    """
    return f"{split_in_file_name(split)}/{(match or SEQUENCE).replace('/', '_')}"


def frame_file_name(group: Group, view: View) -> str:
    """Name of the frame of a view: as its file called it, or made from its key."""
    image = get_gamestate_metadata(view).get("image")
    if isinstance(image, dict) and isinstance(image.get("file_name"), str):
        return str(image["file_name"])
    stem = strip_image_suffix(view.key)
    if view.station.shared:
        stem = f"{group.key}_{stem}"
    return f"{PurePosixPath(stem).name}{PurePosixPath(view.key).suffix or '.jpg'}"


def map_sequence_names_to_owners(group: Group, view: View, split: str) -> Mapping[str, Hashable]:
    """The name of a view in an export, and whose it is (``frame_names``).

    Files of one sequence in several splits are one sequence to who reads them, and images are
    known by their name without its ending.
    """
    stem = PurePosixPath(frame_file_name(group, view)).stem
    return {f"{sequence_folder(group.match, '')}/{stem}": (group.key, view.key)}


def get_gamestate_metadata(view: View) -> Mapping[str, Any]:
    """What the file said that a view came from; empty for views of other formats."""
    kept = view.extras.metadata.get(METADATA)
    return kept if isinstance(kept, dict) else {}


def sequence_frame_path(group: Group, view: View, split: str, suffix: str) -> str:
    """Where the frame of a view lies in an export: ``<split>/<sequence>/img1/000001.jpg``."""
    return f"{sequence_folder(group.match, split)}/{IMAGES}/{frame_file_name(group, view)}"


_IDS = {1: "player", 2: "goalkeeper", 3: "referee", 4: BALL, 5: PITCH, 6: "camera"}
_FOLDERS = ("img1/", "", "frames/")
_SIDES = ("x", "y", "w", "h")


def read_gamestate(
    root: Root,
    report: ReaderReport,
    *,
    calibration: str = "given",
    limits: ImportLimits = DEFAULT_LIMITS,
) -> Iterator[Group]:
    """Every image of every sequence below ``root``, keyed ``<sequence>/<stem>``.

    People go to ``Extras.boxes`` with their whole annotation; whatever else the file holds is
    kept for the way back.
    """
    with open_tree_context(root, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        files = [name for name in names if PurePosixPath(name).name == LABELS]
        if not files:
            report.add_problem_at(str(root), None, None, f"contains no {LABELS}")
        seen: dict[tuple[str, str], str] = {}
        stems: dict[str, set[str]] = {}
        for name in files:
            try:
                sequence = _LabelledSequence(tree, name, names, report, limits)
                # A match whose groups are in several splits has a file in each.
                place = (sequence.key, sequence.split)
                if place in seen:
                    problem = f"describes the sequence {sequence.key} again and is left out; {seen[place]} is used"
                    raise DatasetFormatError(sequence.path, None, None, problem)
            except DatasetFormatError as error:
                report.add_problem(error)
                continue
            seen[place] = sequence.path
            yield from sequence.groups(calibration, stems.setdefault(sequence.key, set()))


@dataclass
class _AnnotatedImage:
    """An image and its annotations."""

    record: dict[str, Any]
    size: ImageSize
    lines: Lines = field(default_factory=dict)
    other_lines: tuple[Mapping[str, Any], ...] = ()
    balls: list[BallAnnotation] = field(default_factory=list)
    boxes: list[Mapping[str, Any]] = field(default_factory=list)
    kept: dict[str, Any] = field(default_factory=dict)


class _LabelledSequence:
    """One Labels-GameState.json on its way to groups."""

    def __init__(
        self,
        tree: FileTree,
        name: str,
        names: list[str],
        report: ReaderReport,
        limits: ImportLimits,
    ):
        self.path, self._report, self._tree = tree.shown(name), report, tree
        content = tree.read_bytes(name)
        value = read_json(content, self.path, max_bytes=limits.file_bytes, report=report)
        if not isinstance(value, dict):
            raise DatasetFormatError(self.path, None, None, "is not an object")
        self._value = value
        self._left_out: list[DatasetFormatError] = []
        self._left_out_by_id: IdIndex[DatasetFormatError] = IdIndex()
        self._folder = name[: -len(LABELS)]
        self._inside = list_files_in_folder(names, self._folder)
        self.key = self._sequence_key()
        parts = PurePosixPath(name).parts
        self.split = self._read_own_split() or _find_split_in_folders(parts)

    def _read_own_split(self) -> str:
        info = self._value.get("info")
        said = info.get(SPLIT) if isinstance(info, dict) else None
        return read_split_name(said, self._report) if isinstance(said, str) else ""

    def _sequence_key(self) -> str:
        folders = PurePosixPath(self._folder).parts
        info = self._value.get("info")
        named = info.get("name") if isinstance(info, dict) else None
        root = self._tree.path
        name = folders[-1] if folders else named or (root.name if root.is_dir() else root.stem)
        try:
            return require_safe_path(str(name)).replace("/", "_")
        except UnsafePathError as error:
            raise DatasetFormatError(self.path, None, "info.name", error.message) from error

    def _get_list(self, name: str) -> list[Any]:
        value = self._value.get(name)
        if not isinstance(value, list):
            self._report.add_problem_at(self.path, None, name, "is missing or not a list")
            return []
        return value

    def groups(self, calibration: str, stems: set[str]) -> Iterator[Group]:
        """Image by image, in the file's order.

        Args:
            calibration: What counts for a view that has a camera and lines.
            stems: Names that other files of this sequence have already; those of this one join.
        """
        images: list[_AnnotatedImage] = []
        index: IdIndex[_AnnotatedImage] = IdIndex()
        for identity, record, size in self._read_image_records(stems):
            image = _AnnotatedImage(record, size)
            if not index.add(identity, image):
                problem = f"is {identity}, the id of an earlier image, too: that one gets all its annotations"
                self._report.add_problem_at(
                    self.path, str(record["file_name"]), "image_id", problem
                )
            images.append(image)
        self._report_left_out_images(index)
        self._join_annotations(index)
        common = {name: self._value[name] for name in ("info", "categories") if name in self._value}
        for image in images:
            record, size = image.record, image.size
            key = str(record["file_name"])
            kept = {"image": record, **image.kept, **common}
            extras = Extras(tuple(image.boxes), image.other_lines, {METADATA: kept})
            name = f"{self.key}/{PurePosixPath(key).stem}"
            station = Station(name, size, lines=image.lines, calibration=calibration)
            view = View(key, station, tuple(image.balls), self._find_frame(key), extras=extras)
            self._report.imported += 1
            label = f"{self.key} · {PurePosixPath(key).stem}"
            yield Group(name, (view,), match=self.key, split=self.split, label=label)

    def _read_image_records(
        self, names: set[str]
    ) -> Iterator[tuple[Any, dict[str, Any], ImageSize]]:
        """Sound image records with their ids, each name once."""
        for index, record in enumerate(self._get_list("images")):
            self._report.read += 1
            where, image = f"images[{index}]", record
            try:
                image = fields.require_object(record)
                key = image.get("file_name")
                if not isinstance(key, str) or "/" in require_safe_path(key):
                    raise ValueError("has no file_name, or one that is not a file name")
                if "image_id" not in image and "id" not in image:
                    raise ValueError("has no image_id")
                if PurePosixPath(key).stem in names:
                    raise ValueError(
                        f"has the file_name {key} of an earlier record; this record is left out"
                    )
                size = ImageSize(
                    self._read_side_length(image, "width", where),
                    self._read_side_length(image, "height", where),
                )
            except DatasetFormatError as error:
                self._leave_image_out(image, error)
                continue
            except UnsafePathError as error:
                problem = DatasetFormatError(self.path, where, "file_name", error.message)
                self._leave_image_out(image, problem)
                continue
            except ValueError as error:
                self._leave_image_out(image, DatasetFormatError(self.path, where, None, str(error)))
                continue
            names.add(PurePosixPath(key).stem)
            yield image.get("image_id", image.get("id")), image, size

    def _read_side_length(self, image: Mapping[str, Any], name: str, where: str) -> int:
        try:
            side = fields.parse_whole_number(image.get(name))
            if not 2 <= side <= MAX_SIDE:
                raise ValueError(f"is {side} pixels, not 2 to {MAX_SIDE:,}")
        except ValueError as error:
            raise DatasetFormatError(self.path, where, name, str(error)) from error
        return side

    def _leave_image_out(self, image: Any, error: DatasetFormatError) -> None:
        self._left_out.append(error)
        if isinstance(image, dict):
            self._left_out_by_id.add(image.get("image_id", image.get("id")), error)

    def _report_left_out_images(self, images: IdIndex[_AnnotatedImage]) -> None:
        """Say why each image is left out, with how many annotations go with it."""
        listed = self._value.get("annotations") if self._left_out else None
        counts = Counter(
            self._find_left_out_image_record(item, images)
            for item in (listed if isinstance(listed, list) else [])
        )
        for error in self._left_out:
            count = counts[error.record]
            more = f"; left out with {plural(count, 'annotation')}" if count else ""
            self._report.add_problem_at(
                self.path, error.record, error.field, f"{error.problem}{more}"
            )

    def _find_left_out_image_record(
        self, annotation: Any, images: IdIndex[_AnnotatedImage]
    ) -> str | None:
        """Which image that is left out an annotation is of, by its record; None where it is of none."""
        identity = annotation.get("image_id") if isinstance(annotation, dict) else None
        error = self._left_out_by_id.find(identity) if images.find(identity) is None else None
        return None if error is None else error.record

    def _join_annotations(self, images: IdIndex[_AnnotatedImage]) -> None:
        """Give each annotation to its image; one that joins none is named."""
        categories = self._read_category_names()
        for index, item in enumerate(self._get_list("annotations")):
            where = f"annotations[{index}]"
            image = images.find(item.get("image_id")) if isinstance(item, dict) else None
            if image is None:
                if self._find_left_out_image_record(item, images) is not None:
                    continue
                self._report.add_problem_at(
                    self.path, where, "image_id", "names no image of the file"
                )
                continue
            name = categories.find(item.get("category_id"))
            if name is None:
                shown = str(item.get("category_id"))[:40]
                problem = f"is {shown}, which is not a category; the annotation is kept for export and not used"
                self._report.add_problem_at(self.path, where, "category_id", problem)
            if name == PITCH:
                self._add_lines(image, item, image.size, where)
            elif name is not None and is_ball_name(name):
                self._add_ball(image, item, where)
            elif isinstance(item.get("bbox_image"), dict):
                image.boxes.append(_make_person_box(item))
            else:
                image.kept.setdefault("others", []).append(item)

    def _read_category_names(self) -> IdIndex[str]:
        """Name of each category by its id; the usual ones where a file does not list them."""
        found: IdIndex[str] = IdIndex()
        listed = self._value.get("categories")
        for item in listed if isinstance(listed, list) else []:
            if isinstance(item, dict) and isinstance(item.get("name"), str):
                found.add(item.get("id"), item["name"].strip().lower())
        for identity, name in _IDS.items():
            found.add(identity, name)
        return found

    def _add_lines(
        self, image: _AnnotatedImage, item: dict[str, Any], size: ImageSize, where: str
    ) -> None:
        if "pitch" in image.kept:
            self._report.add_problem_at(
                self.path, where, None, "is a second pitch of its image; left out"
            )
            return
        image.kept["pitch"] = {name: value for name, value in item.items() if name != "lines"}
        try:
            shown = f"{self.path}, {where}"
            lines = item.get("lines") or {}
            image.lines, image.other_lines = lines_from_json(lines, size, shown, self._report)
        except DatasetFormatError as error:
            self._report.add_problem_at(self.path, where, "lines", error.problem)

    def _add_ball(self, image: _AnnotatedImage, item: dict[str, Any], where: str) -> None:
        try:
            image.balls.append(read_ball_annotation(item))
        except ValueError as error:
            self._report.add_problem_at(
                self.path, where, "bbox_image", f"{error}; kept for export and not used"
            )
            image.kept.setdefault("others", []).append(item)
            return
        # With its box: the place on the pitch is that of this box alone.
        box = {name: item["bbox_image"][name] for name in _SIDES}
        image.kept.setdefault("balls", []).append({**item, "bbox_image": box})

    def _find_frame(self, key: str) -> Media | None:
        for folder in _FOLDERS:
            if folder + key in self._inside:
                name = self._folder + folder + key
                return self._tree.media(name)
        self._report.counts["views without frame"] += 1
        return None


def _find_split_in_folders(parts: tuple[str, ...]) -> str:
    """The split that a folder of a file says, the innermost first; empty where none does."""
    said = next((part for part in reversed(parts) if part in SPLITS), "")
    # A sequence may have a name like ``test-12``: the folder around the sequences says the split.
    return said or next(filter(None, map(parse_split_name, reversed(parts[:-2]))), "")


def _read_bbox_image(item: Mapping[str, Any]) -> Box:
    place = fields.require_object(item.get("bbox_image"))
    missing = [name for name in _SIDES if name not in place]
    if missing:
        raise ValueError(f"has no {missing[0]}")
    return Box(*(fields.parse_pixel_coordinate(place[name]) for name in _SIDES))


def read_ball_annotation(item: Mapping[str, Any]) -> BallAnnotation:
    """The ball of an annotation; a box without area is the ball's centre alone.

    Raises:
        ValueError: It has no sound box.
    """
    box = _read_bbox_image(item)
    if box.width < 0 or box.height < 0:
        raise ValueError("has a negative width or height")
    occluded = item.get(OCCLUDED) is True
    if box.width == 0 or box.height == 0:
        return BallAnnotation(point=box.center, occluded=occluded)
    return BallAnnotation(box=box, occluded=occluded)


def _make_person_box(item: Mapping[str, Any]) -> Mapping[str, Any]:
    """A person in the shape that all datasets show, with the annotation as it was."""
    attributes = item.get("attributes")
    details = attributes if isinstance(attributes, dict) else {}
    role = " ".join(str(details[name]) for name in ("role", "team") if details.get(name))
    value: dict[str, Any] = {
        "class": role or None,
        "ID": details.get("jersey"),
        METADATA: dict(item),
    }
    try:
        box = _read_bbox_image(item)
    except ValueError:
        return value
    corners = {"x1": box.x, "y1": box.y, "x2": box.x + box.width, "y2": box.y + box.height}
    return value | {"points": corners}
