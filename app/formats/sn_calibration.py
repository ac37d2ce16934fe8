"""sn-calibration: the annotated lines of one image a JSON file (``00002.json``), and the other shapes in which
tools give field lines, of one image or of many.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from app.errors import DatasetFormatError, UnsafePathError
from app.formats.fields import parse_image_size
from app.formats.file_tree import FileTree
from app.formats.frame_names import (
    IMAGE_SUFFIXES,
    compose_name,
    frame_path_by_match,
    map_frame_names_to_owners,
    view_file_path,
)
from app.formats.json_reader import describe_document, read_json, read_json_lines
from app.formats.report import ReaderReport
from app.formats.safe_path import require_safe_path
from app.formats.soccernet_v3 import IMAGE, SPLITS
from app.formats.split_names import UNASSIGNED, split_in_file_name
from app.json_text import json_text
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, View
from app.soccer.pitch import WITHOUT_GEOMETRY, find_marking_like

DEFAULT_SIZE = ImageSize(960, 540)
LINES, CAMERAS = "lines", "cameras"
"""Folders of an export: the public evaluator takes every JSON beside the lines for a frame."""
_FOLDER = re.compile(r"(.+)-(\d{1,5})x(\d{1,5})", re.ASCII)
_PLAIN = re.compile(r"[A-Za-z0-9_-]+", re.ASCII)
LARGEST_UNIT = 2.0
"""A file in which at least half of the points have a coordinate further from 0 is in pixels."""


@dataclass(frozen=True)
class LineFile:
    """The lines of one image.

    Attributes:
        stem: Name of the frame, ``00002``.
        lines: Points per marking, pixels of ``size``, in the order of the file.
        others: Lines without geometry (``Line unknown``, unknown names), each as
            ``{"class": name, "points": [x1, y1, x2, y2, ...]}`` in pixels.
        media: The frame, when it lies beside the file.
        place: Path of the file in its folder or zip, without the ending.
    """

    stem: str
    size: ImageSize
    lines: Lines
    others: tuple[Mapping[str, Any], ...] = ()
    media: Media | None = None
    place: str = ""


def make_split_folder_name(split: str, size: ImageSize) -> str:
    """Folder of the frames of one split and one size: the evaluator takes one size at a time.

    Example:
        >>> make_split_folder_name("test", ImageSize(1280, 720))
        'test-1280x720'
    """
    return f"{split_in_file_name(split)}-{size.width}x{size.height}"


def parse_split_folder_name(folder: str, *, ours: bool = False) -> tuple[str, ImageSize] | None:
    """Back from ``make_split_folder_name``; None for any other folder.

    Args:
        folder: Its name alone.
        ours: Whether ``match_info.json`` says that we wrote it: then its split may be any, as
            ``fold-3``. People call folders ``clips-1920x1080``, too.
    """
    found = _FOLDER.fullmatch(folder)
    if found is None or min(int(found[2]), int(found[3])) < 2:
        return None
    if not ours and found[1] not in (*SPLITS, UNASSIGNED):
        return None
    split = "" if found[1] == UNASSIGNED else found[1]
    return split, ImageSize(int(found[2]), int(found[3]))


def flat_frame_name(place: str, split: str) -> str:
    """Name of a frame in the folder of its split, without ending.

    A frame that came from sn-calibration keeps its name. Any other has a digest of its place
    before it, so that no match meets another; the evaluator reads no name with a dot in it.

    Args:
        place: Folders and stem of the frame (``frame_names.view_file_path``).
        split: Split of the frame, or empty.
    """
    whole = PurePosixPath(place)
    if str(whole.parent) in (".", split) and _PLAIN.fullmatch(whole.name):
        return whole.name
    digest = hashlib.sha256(place.encode()).hexdigest()[:12]
    stem = "-".join(_PLAIN.findall(whole.name)) or "frame"
    return f"{digest}_{stem}"


def map_line_file_names_to_owners(group: Group, view: View, split: str) -> Mapping[str, Hashable]:
    """The names of a view in an export, and whose each would be (``frame_names``).

    The place of a frame is a name, too: what is read again has it for a key. A static camera has
    one file of lines for all its views.
    """
    place = view_file_path(group, view)
    name = f"{make_split_folder_name(split, view.size)}/{flat_frame_name(place, split)}"
    names = (compose_name(place).encode().hex(), name)
    if not view.station.shared:
        return dict.fromkeys(names, (group.key, view.key))
    own = dict.fromkeys(names, view.station.key)
    return {**own, **map_frame_names_to_owners(group, view, split)}


def line_frame_path(group: Group, view: View, split: str, suffix: str) -> str:
    """Where the frame of a view lies in an export: beside its lines.

    Example: ``lines/test-1280x720/3f1c0a9b2d4e_7_1.png``. A static camera has one file of lines
    and many frames, which lie by its match.
    """
    if view.station.shared:
        return frame_path_by_match(group, view, split, suffix)
    name = flat_frame_name(view_file_path(group, view), split)
    return f"{LINES}/{make_split_folder_name(split, view.size)}/{name}{suffix}"


MEANT = (
    'lines are {"Side line top": [{"x": 0.1, "y": 0.2}, ...], ...} (docs/formats.md#sn-calibration)'
)
_WITHIN = ("lines", "annotations", "annotation", "markings", "field_lines")
"""Fields in which tools keep the lines beside what else they say of an image."""
_NAMES = ("file_name", "filename", "image_name", "image", "image_id", "frame", "name")


@dataclass(frozen=True)
class LineDocument:
    """The lines of one image as they were parsed.

    Attributes:
        lines: Points by name of a marking, not yet read.
        name: Stem of the image where the document names it, else None.
        size: Size of the image where the document says it, else None.
    """

    lines: Mapping[str, Any]
    name: str | None = None
    size: ImageSize | None = None


def read_line_documents(content: bytes, path: str, report: ReaderReport) -> list[LineDocument]:
    """``read_lines_of_images`` of the text of a file, JSON or JSON lines.

    Raises:
        DatasetFormatError: It is neither, or holds something else.
    """
    try:
        value = read_json(content, path, nan="keep")
    except DatasetFormatError:
        value = read_json_lines(content, path, report)
        if value is None:
            raise
    return read_lines_of_images(value, path, report)


def read_lines_of_images(value: Any, path: str, report: ReaderReport) -> list[LineDocument]:
    """The images of a parsed file of lines.

    An object of markings, the same inside another object (``lines``), an object or a list of many
    images. Images of many that hold no lines are reported.

    Args:
        value: The parsed file.
        path: File as the user knows it, for errors.
        report: Takes images that were left out.

    Raises:
        DatasetFormatError: It is something else; the sentence says what.
    """
    alone = _read_document(value)
    if alone is not None:
        return [alone]
    if isinstance(value, dict):
        items = [(str(name), item) for name, item in value.items()]
    elif isinstance(value, list):
        items = [(_find_image_name(item) or "", item) for item in value]
    else:
        items = []
    found, problems = [], []
    for number, (name, item) in enumerate(items):
        document = _read_document(item)
        if document is None or not name:
            why = (
                f"{describe_document(item)}; {MEANT}"
                if name
                else "has no name of its image (file_name)"
            )
            problems.append(DatasetFormatError(path, name or f"image {number}", None, why))
        else:
            found.append(LineDocument(document.lines, _image_stem(name), document.size))
    if not any(document.lines for document in found):
        raise DatasetFormatError(path, None, None, f"{describe_document(value)}; {MEANT}")
    for problem in problems:
        report.read += 1
        report.add_problem(problem)
    return found


def _read_document(value: Any) -> LineDocument | None:
    """The lines of one image; None where the value is something else."""
    if not isinstance(value, dict):
        return None
    if not value or any(map(_is_line_name, value)):
        return LineDocument(value)
    for name in _WITHIN:
        inner = value.get(name)
        lines = _parse_line_list(inner) if isinstance(inner, list) else inner
        if isinstance(lines, dict) and any(map(_is_line_name, lines)):
            named = _find_image_name(value)
            return LineDocument(
                lines, None if named is None else _image_stem(named), parse_image_size(value)
            )
    return None


def _is_line_name(name: str) -> bool:
    return find_marking_like(name) is not None or name.replace("_", " ").strip() in WITHOUT_GEOMETRY


def _parse_line_list(items: list[Any]) -> dict[str, Any] | None:
    """Lines of a list of objects with a class and points, by name; None where it is another list."""
    found: dict[str, Any] = {}
    for item in items:
        if not isinstance(item, dict) or not isinstance(item.get("points"), list):
            return None
        name = item.get("class") or item.get("label") or item.get("name")
        points = item["points"]
        known = found.setdefault(str(name), [])
        if len(points) % 2 == 0 and all(isinstance(one, (int, float)) for one in points):
            points = list(zip(points[::2], points[1::2], strict=True))
        known.extend(points)
    return found


def _find_image_name(value: Any) -> str | None:
    if not isinstance(value, dict):
        return None
    found = (value.get(name) for name in _NAMES)
    return next((str(name) for name in found if isinstance(name, (str, int)) and str(name)), None)


def _image_stem(name: str) -> str:
    place = PurePosixPath(name.replace("\\", "/"))
    return place.stem if place.suffix.lower() in IMAGE_SUFFIXES else place.name


MATCH_INFO = "match_info.json"
MATCH_INFO_FILES = (MATCH_INFO, "match_info_cam_gt.json")
"""The second one is a third party's, with the kind of camera beside the match."""
PER_MATCH_INFO = "per_match_info.json"
"""Beside the other in sets of 2023: ``{match: {image: record}}``."""
NO_FRAMES = (
    *MATCH_INFO_FILES, PER_MATCH_INFO, "manifest.json", "findings.json", "calibrate.json",
    "leave_one_out.json", "propose.json", "snap.json", "track.json",
)  # fmt: skip
"""Files beside those of frames that hold neither lines nor a camera."""
MATCH_INFO_METADATA = "match_info"
"""Under this name ``Extras.metadata`` keeps the record of an image."""
MATCH_INFO_PLACE = "touchline_place"
"""Ours, in the record of an image: where its files would lie without the folders of an export."""
_PATHS = ("UrlLocal", "game", "match")
_PARTS = ("league", "season", "match")
_MOMENT = {"half": "half", "gameTime": "gameTime", "position": "ms_time"}


def read_match_info(
    tree: FileTree, names: list[str], report: ReaderReport
) -> Mapping[str, Mapping[str, Any]]:
    """The record of each image, by its path in the tree without the ending.

    An image that two files name has the fields of both. ``per_match_info.json`` counts for images
    that no other names.
    """
    found: dict[str, dict[str, Any]] = {}
    for name in names:
        if PurePosixPath(name).name not in MATCH_INFO_FILES:
            continue
        for key, record in _read_records_of_images(tree, name, report):
            found[key] = {**found.get(key, {}), **record}
    for name in names:
        if PurePosixPath(name).name == PER_MATCH_INFO:
            for key, record in _read_records_of_images(tree, name, report):
                found.setdefault(key, record)
    return found


def _read_records_of_images(
    tree: FileTree, name: str, report: ReaderReport
) -> Iterator[tuple[str, dict[str, Any]]]:
    """The records of one file, each with the path of its image without the ending."""
    shown, folder = tree.shown(name), PurePosixPath(name).parent
    try:
        value = read_json(tree.read_bytes(name), shown, report=report)
        if not isinstance(value, dict):
            raise DatasetFormatError(
                shown, None, None, "is not an object with a record for each image"
            )
    except DatasetFormatError as error:
        report.add_problem(error)
        return
    matches: dict[str, Any] = {"": value}
    if PurePosixPath(name).name == PER_MATCH_INFO:
        matches = value
    for match, images in matches.items():
        if not isinstance(images, dict):
            report.add_problem_at(
                shown, match[:80], None, "is not an object with a record for each image"
            )
            continue
        for image, item in images.items():
            record = {"match": item} if isinstance(item, str) else item
            if not PurePosixPath(image).name:
                report.add_problem_at(shown, image[:80], None, "is not the name of an image")
            elif isinstance(record, dict):
                own = {"match": match} if match else {}
                yield str((folder / image).with_suffix("")), {**own, **record}
            else:
                report.add_problem_at(shown, image[:80], None, "is neither text nor an object")


def find_original_frame_path(record: Mapping[str, Any]) -> str | None:
    """Where the frame of one of our exports came from; None where nobody says so."""
    place = record.get(MATCH_INFO_PLACE)
    if not isinstance(place, str):
        return None
    try:
        return require_safe_path(place)
    except UnsafePathError:
        return None


def build_match_key_of_record(record: Mapping[str, Any]) -> str:
    """``<league>/<season>/<match>`` of a record, or as much of it as is there."""
    parts = [record.get(name) for name in _PARTS]
    for text in ("/".join(map(str, parts)) if all(parts) else None, *map(record.get, _PATHS)):
        if isinstance(text, str) and text.strip("/ "):
            try:
                return require_safe_path(text.strip("/ "))
            except UnsafePathError:
                continue
    return ""


def find_match_info_of_view(group: Group, view: View) -> Mapping[str, Any]:
    """The record of a view: what its source said, else what its dataset knows."""
    kept = view.extras.metadata.get(MATCH_INFO_METADATA)
    if isinstance(kept, dict):
        return kept
    parts = group.match.split("/")
    record: dict[str, Any] = dict(zip(_PARTS, parts, strict=True)) if len(parts) == 3 else {}
    if not record and group.match:
        record = {"match": group.match}
    metadata = view.extras.metadata.get(IMAGE)
    image = metadata if isinstance(metadata, dict) else {}
    return record | {ours: image[name] for name, ours in _MOMENT.items() if name in image}


class MatchInfoWriter:
    """Writes the file image by image."""

    def __init__(self, root: Path):
        self._file = (root / MATCH_INFO).open("w", encoding="utf-8", newline="\n")
        self._count = 0

    def __enter__(self) -> MatchInfoWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.write("\n}\n" if self._count else "{}\n")
        self._file.close()

    def add(self, image: str, record: Mapping[str, Any]) -> None:
        """One image; its name is relative to the export."""
        head = ",\n" if self._count else "{\n"
        text = json_text(dict(record))
        self._file.write(f"{head} {json_text(image)}: {text}")
        self._count += 1
