"""sn-calibration, read: files of lines, and each image as a group of one view."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any

from app.datasets import fields
from app.datasets.file_tree import DEFAULT_LIMITS, FileTree, Limits, Root
from app.datasets.frame_names import IMAGE_SUFFIXES
from app.datasets.json_text import read_json
from app.datasets.match_info import METADATA, PLACE, match_of, place_of, read_match_info
from app.datasets.report import Report
from app.datasets.sn_calibration import LARGEST_UNIT, LineFile, split_and_size
from app.datasets.soccernet_v3 import SPLITS
from app.datasets.trees import opened_tree
from app.errors import DatasetFormatError, UnknownMarkingError
from app.soccer.annotation import Extras, Lines, make_lines
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.media import Media
from app.soccer.pitch import WITHOUT_GEOMETRY, canonical_marking

_OTHER_FILES = ("manifest.json", "findings.json", "calibrate.json", "leave_one_out.json")
_OTHER_PREFIXES = ("camera_", "Labels-", "match_info")


def read_line_files(
    path: Root,
    size: ImageSize,
    report: Report,
    limits: Limits = DEFAULT_LIMITS,
    *,
    by_folder: bool = False,
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
        by_folder: Whether a folder that is called as in our exports (``test-1280x720``) says the
            size of its images.
    """
    with opened_tree(path, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        places = _places(read_match_info(tree, names, Report()))
        sizes = _sizes(map(_whole, names), path.stem) if by_folder else {}
        yield from line_files_of(tree, names, size, report, Ours(places, sizes))


@dataclass(frozen=True)
class Ours:
    """What one of our own exports says of its files, each by its path without the ending."""

    places: Mapping[str, str] = field(default_factory=dict)
    """Where a frame would lie without the folders of the export."""
    sizes: Mapping[str, ImageSize] = field(default_factory=dict)


_NOTHING = Ours()


def line_files_of(
    tree: FileTree, names: Sequence[str], size: ImageSize, report: Report, ours: Ours = _NOTHING
) -> Iterator[LineFile]:
    """The line files among some files of a tree, with the images that lie beside them."""
    beside = _images(names)
    wholes = {name: _whole(name) for name in names if _is_line_file(name)}
    places = {name: ours.places.get(whole, whole) for name, whole in wholes.items()}
    # Names of an export are in no order of a match's frames.
    ordered = sorted(places, key=places.__getitem__) if ours.places else list(places)
    stems = Counter(PurePosixPath(place).name for place in places.values())
    for name in ordered:
        whole, place = wholes[name], PurePosixPath(places[name])
        key = place.name if stems[place.name] == 1 else str(place)
        media = _media(tree, beside.get(whole))
        empty = LineFile(key, ours.sizes.get(whole, size), {}, (), media, whole)
        file = _read_line_file(tree, name, empty, report)
        if file is not None:
            yield file


def _whole(name: str) -> str:
    return str(PurePosixPath(name).with_suffix(""))


def _places(infos: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    return {whole: place for whole, info in infos.items() if (place := place_of(info))}


def _sizes(places: Iterable[str], top: str = "") -> dict[str, ImageSize]:
    said = {whole: split_and_size(PurePosixPath(whole).parent.name or top) for whole in places}
    return {whole: found[1] for whole, found in said.items() if found}


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
    return None if image is None else tree.media(image)


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


def read_sn_calibration(
    path: Root,
    size: ImageSize,
    report: Report,
    *,
    calibration: str = "given",
    limits: Limits = DEFAULT_LIMITS,
) -> Iterator[Group]:
    """Each frame as a group of one view, keyed by its stem.

    Its match comes from match_info.json, its split from a folder ``train``, ``valid``, ``test``
    or ``challenge``. A folder of our own exports says the size, too (``test-1280x720``). Cameras
    are not read: import them as ``cameras``.

    Args:
        path: Folder, zip or JSON file.
        size: Size of the annotated images where no folder says it, pixels.
        report: Takes what had to be left out.
        calibration: What counts for a view that has a camera and lines.
        limits: Caps on what is read.
    """
    with opened_tree(path, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        infos = read_match_info(tree, names, report)
        places = _places(infos)
        ours = Ours(places, _sizes(places))
        unused = dict.fromkeys(infos)
        for file in line_files_of(tree, names, size, report, ours):
            unused.pop(file.place, None)
            yield _group(file, infos.get(file.place, {}), calibration)
        if unused:
            count = "1 image" if len(unused) == 1 else f"{len(unused):,} images"
            shown = ", ".join(list(unused)[:5]) + (", ..." if len(unused) > 5 else "")
            report.remark(f"{count} of match_info.json without a file of lines: {shown}")


def _group(file: LineFile, record: Mapping[str, Any], calibration: str) -> Group:
    info = {name: value for name, value in record.items() if name != PLACE}
    station = Station(file.stem, file.size, lines=file.lines, calibration=calibration)
    extras = Extras(lines=file.others, metadata={METADATA: info} if info else {})
    view = View(file.stem, station, media=file.media, extras=extras)
    match, folders = match_of(info), PurePosixPath(file.place).parts[:-1]
    splits = (_split(folder) for folder in reversed(folders))
    split = next((split for split in splits if split), "")
    name = PurePosixPath(file.stem).name
    label = f"{PurePosixPath(match).name} · frame {name}" if match else f"Frame {file.stem}"
    return Group(file.stem, (view,), match=match, split=split, label=label)


def _split(folder: str) -> str:
    """The split that a folder says, or nothing."""
    said = split_and_size(folder)
    return said[0] if said else folder if folder in SPLITS else ""
