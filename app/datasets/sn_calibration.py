"""sn-calibration: the annotated lines of one image a JSON file (``00002.json``)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

from app.datasets import fields
from app.datasets.archive import DEFAULT_LIMITS, FileTree, Limits, open_tree, resolve_inside
from app.datasets.exact import exact_inverse
from app.datasets.json_text import read_json
from app.datasets.report import Report
from app.errors import DatasetFormatError, UnknownMarkingError
from app.finite import json_text
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.group import Media
from app.soccer.pitch import WITHOUT_GEOMETRY, canonical_marking

DEFAULT_SIZE = ImageSize(960, 540)
LARGEST_UNIT = 2.0
"""A file in which any coordinate lies further from 0 is in pixels."""

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp")
_OTHER_FILES = ("manifest.json", "findings.json", "calibrate.json", "leave_one_out.json")
_OTHER_PREFIXES = ("camera_", "Labels-", "match_info")
# SoccerNet spells this one with a space at the end; its readers look it up that way.
_SPELLING = {"Goal left post left": "Goal left post left "}


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


def spelling(marking: str) -> str:
    """A marking's name as SoccerNet files spell it."""
    return _SPELLING.get(marking, marking)


def read_line_files(
    path: Path, size: ImageSize, report: Report, limits: Limits = DEFAULT_LIMITS
) -> Iterator[LineFile]:
    """The line files of a folder or zip (or one file), by name.

    Coordinates are normalised by (width - 1, height - 1), or pixels when any lies beyond 2.
    Points outside the image are kept. Unknown markings and unreadable points are reported; the
    rest of the file is kept.

    Args:
        path: Folder, zip or JSON file.
        size: Size of the annotated images, pixels.
        report: Takes what had to be left out.
        limits: Caps on what is read.
    """
    tree = open_tree(path, report, limits)
    if tree is None:
        return
    with closing(tree):
        yield from line_files_of(tree, tree.names(), size, report)


def line_files_of(
    tree: FileTree, names: Sequence[str], size: ImageSize, report: Report
) -> Iterator[LineFile]:
    """The line files among some files of a tree, with the images that lie beside them."""
    beside = _images(names)
    line_files = [name for name in names if _is_line_file(name)]
    stems = Counter(PurePosixPath(name).stem for name in line_files)
    for name in line_files:
        whole = str(PurePosixPath(name).with_suffix(""))
        stem = PurePosixPath(name).stem
        key = stem if stems[stem] == 1 else whole
        empty = LineFile(key, size, {}, (), _media(tree, beside.get(whole)), whole)
        file = _read_line_file(tree, name, empty, report)
        if file is not None:
            yield file


def _read_line_file(tree: FileTree, name: str, empty: LineFile, report: Report) -> LineFile | None:
    report.read += 1
    try:
        value = read_json(tree.read_bytes(name), tree.shown(name))
        lines, others = lines_from_json(value, empty.size, tree.shown(name), report)
    except DatasetFormatError as error:
        report.skip(error)
        return None
    report.imported += 1
    return replace(empty, lines=lines, others=others)


def _is_line_file(name: str) -> bool:
    last = PurePosixPath(name).name
    if not last.lower().endswith(".json"):
        return False
    return last not in _OTHER_FILES and not last.startswith(_OTHER_PREFIXES)


def _images(names: Iterable[str]) -> dict[str, str]:
    places = (PurePosixPath(name) for name in names)
    return {
        str(place.with_suffix("")): str(place)
        for place in places
        if place.suffix.lower() in IMAGE_SUFFIXES
    }


def _media(tree: FileTree, image: str | None) -> Media | None:
    if image is None:
        return None
    if tree.path.is_dir():
        return Media(tree.shown(image))
    return Media(str(tree.path), image)


def lines_from_json(
    value: Any, size: ImageSize, path: str, report: Report
) -> tuple[Lines, tuple[Mapping[str, Any], ...]]:
    """Lines with geometry, and the others, of one parsed line file, in pixels.

    Raises:
        DatasetFormatError: The file is no object at all.
    """
    if not isinstance(value, dict):
        raise DatasetFormatError(path, None, None, "is not an object of lines")
    known: dict[str, list[ImagePoint]] = {}
    others = []
    points = {name: _points(item, path, name, report) for name, item in value.items()}
    in_pixels = any(max(map(abs, p)) > LARGEST_UNIT for line in points.values() for p in line)
    for name, line in points.items():
        pixels = [ImagePoint(*p) if in_pixels else size.unit_to_pixel(*p) for p in line]
        marking = _marking(name, path, report)
        if marking is None:
            flat = [coordinate for point in pixels for coordinate in point]
            others.append({"class": name, "points": flat})
        elif pixels:
            known.setdefault(marking, []).extend(pixels)
    return make_lines(known), tuple(others)


def _points(value: Any, path: str, name: str, report: Report) -> list[tuple[float, float]]:
    points = []
    try:
        for item in fields.sequence(value):
            point = fields.mapping(item)
            if "x" not in point or "y" not in point:
                raise ValueError("has a point without x or y")
            points.append((fields.pixel(point["x"]), fields.pixel(point["y"])))
    except ValueError as error:
        # A line that lost points in the middle would say something its annotator did not.
        report.note(path, None, name, f"{error}; the line is left out")
        return []
    return points


def _marking(name: str, path: str, report: Report) -> str | None:
    """The marking of that name; None (reported unless the format knows it) for any other."""
    try:
        return canonical_marking(name)
    except UnknownMarkingError as error:
        if name.strip() not in WITHOUT_GEOMETRY:
            report.note(path, None, name, f"{error.message}; kept without geometry")
        return None


def lines_to_json(
    lines: Lines,
    size: ImageSize,
    others: Sequence[Mapping[str, Any]] = (),
    *,
    pixels: bool = False,
) -> dict[str, list[dict[str, float]]]:
    """One line file's object under SoccerNet's own spelling of the names.

    Normalised, or in pixels where that is asked for, or where a point lies so far outside that
    it would be taken for one. Not every pixel has a normalised number that gives it back to the
    last bit; numbers that came normalised have one.
    """
    flat = [line.get("points") or [] for line in others]
    points = {spelling(marking): list(line) for marking, line in lines.items()}
    for line, numbers in zip(others, flat, strict=True):
        extra = [ImagePoint(x, y) for x, y in zip(numbers[::2], numbers[1::2], strict=False)]
        points.setdefault(str(line.get("class")), []).extend(extra)
    everything = [point for line in points.values() for point in line]
    # Far outside, a normalised coordinate would be read back as a pixel.
    units = not pixels and all(
        max(map(abs, size.pixel_to_unit(point))) <= LARGEST_UNIT for point in everything
    )
    return {name: [_written(p, size, units) for p in line] for name, line in points.items()}


def _written(point: ImagePoint, size: ImageSize, units: bool) -> dict[str, float]:
    if not units:
        return {"x": point.x, "y": point.y}
    x, y = size.pixel_to_unit(point)
    return {
        "x": exact_inverse(x, point.x, lambda unit: unit * (size.width - 1)),
        "y": exact_inverse(y, point.y, lambda unit: unit * (size.height - 1)),
    }


def line_file_text(
    lines: Lines,
    size: ImageSize,
    others: Sequence[Mapping[str, Any]] = (),
    *,
    pixels: bool = False,
) -> str:
    """The text of one line file."""
    return json_text(lines_to_json(lines, size, others, pixels=pixels), ascii_=True) + "\n"


def write_line_files(root: Path, files: Iterable[LineFile]) -> list[Path]:
    """Write ``<stem>.json`` per frame below an existing folder; the paths written.

    Raises:
        UnsafePathError: A stem that would leave the folder.
    """
    written = []
    for file in files:
        path = resolve_inside(root, f"{file.stem}.json")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(line_file_text(file.lines, file.size, file.others), encoding="utf-8")
        written.append(path)
    return written
