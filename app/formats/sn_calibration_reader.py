"""sn-calibration, read: files of lines, and each image as a group of one view."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from app.errors import DatasetFormatError, UnknownMarkingError
from app.formats import fields
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits, Root
from app.formats.frame_names import IMAGE_SUFFIXES
from app.formats.report import ReaderReport
from app.formats.sn_calibration import (
    LARGEST_UNIT,
    MATCH_INFO,
    MATCH_INFO_METADATA,
    MATCH_INFO_PLACE,
    NO_FRAMES,
    LineDocument,
    LineFile,
    build_match_key_of_record,
    find_original_frame_path,
    parse_split_folder_name,
    read_line_documents,
    read_match_info,
)
from app.formats.split_names import parse_split_name, read_split_name
from app.formats.trees import open_tree_context
from app.soccer.annotation import Extras, Lines, make_lines
from app.soccer.frames import HALF, ImagePoint, ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.pitch import WITHOUT_GEOMETRY, find_marking_like
from app.wording import plural

_OTHER_PREFIXES = ("camera_", "Labels-", "match_info")


def read_line_files(
    path: Root,
    size: ImageSize,
    report: ReaderReport,
    limits: ImportLimits = DEFAULT_LIMITS,
    *,
    by_folder: bool = False,
) -> Iterator[LineFile]:
    """The line files of a folder or zip (or one file), by name.

    Coordinates are normalised by (width - 1, height - 1), or pixels when at least half of a file's
    points lie beyond 2. Points outside the image are kept. Unknown markings and unreadable points
    are reported; the rest of the file is kept. A file may hold the lines of many images
    (``read_lines_of_images``).

    Args:
        path: Folder, zip or JSON file.
        size: Size of the annotated images, pixels.
        report: Takes what had to be left out.
        limits: Caps on what is read.
        by_folder: Whether a folder that is called as in our exports (``test-1280x720``), or a file
            itself, says the size of its images; else all lines are in pixels of ``size``.
    """
    with open_tree_context(path, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        places = _map_original_frame_paths(read_match_info(tree, names, ReaderReport()))
        sizes: dict[str, ImageSize] = {}
        if by_folder:
            ours = {**places, **_map_original_frames_of_export_around(path)}
            sizes = _parse_sizes_from_folders(map(_strip_path_suffix, names), ours, path.stem)
        info = OwnExportInfo(places, sizes, own_sizes=by_folder)
        yield from read_line_files_of_tree(tree, names, size, report, info)


@dataclass(frozen=True)
class OwnExportInfo:
    """What one of our own exports says of its files, each by its path without the ending."""

    places: Mapping[str, str] = field(default_factory=dict)
    """Where a frame would lie without the folders of the export."""
    sizes: Mapping[str, ImageSize] = field(default_factory=dict)
    own_sizes: bool = False
    """Whether the size that a file says itself is that of its lines."""


_NOTHING = OwnExportInfo()


def read_line_files_of_tree(
    tree: FileTree,
    names: Sequence[str],
    size: ImageSize,
    report: ReaderReport,
    ours: OwnExportInfo = _NOTHING,
) -> Iterator[LineFile]:
    """The line files among some files of a tree, with the images that lie beside them."""
    beside = _index_images_by_stem(names)
    wholes = {name: _strip_path_suffix(name) for name in names if _is_line_file(name)}
    places = {name: ours.places.get(whole, whole) for name, whole in wholes.items()}
    # Names of an export are in no order of a match's frames.
    ordered = sorted(places, key=places.__getitem__) if ours.places else list(places)
    stems = Counter(PurePosixPath(place).name for place in places.values())
    seen: set[str] = set()
    for name in ordered:
        whole, place = wholes[name], PurePosixPath(places[name])
        key = place.name if stems[place.name] == 1 else str(place)
        exported = ours.sizes.get(whole)
        for document in _read_line_documents(tree, name, report):
            named, where = key, whole
            if document.name is not None and document.name != place.name:
                named, where = document.name, str(PurePosixPath(whole).parent / document.name)
                if named in seen:
                    named = f"{key}/{named}"
            report.read += 1
            if named in seen:
                report.add_problem_at(
                    tree.shown(name), document.name, None, "is a second record of its image"
                )
                continue
            seen.add(named)
            drawn = document.size or exported or size
            stays = exported is not None or (ours.own_sizes and document.size is not None)
            made = drawn if stays else size
            shown = tree.shown(name)
            record = None if where == whole else document.name
            lines, others = lines_from_json(document.lines, made, shown, report, drawn, record)
            image = beside.get(where)
            media = None if image is None else tree.media(image)
            report.imported += 1
            yield LineFile(named, made, lines, others, media, where)


def _strip_path_suffix(name: str) -> str:
    return str(PurePosixPath(name).with_suffix(""))


def _map_original_frame_paths(infos: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    return {
        whole: place for whole, info in infos.items() if (place := find_original_frame_path(info))
    }


def _map_original_frames_of_export_around(path: Root) -> dict[str, str]:
    """``_map_original_frame_paths`` of the export that a folder of lines lies in."""
    found: dict[str, str] = {}
    if not isinstance(path, Path) or not path.is_dir():
        return found
    folder = path.resolve()
    for around in list(folder.parents)[:2]:
        if (around / MATCH_INFO).is_file():
            with open_tree_context(around, ReaderReport(), DEFAULT_LIMITS) as tree:
                infos = {} if tree is None else read_match_info(tree, [MATCH_INFO], ReaderReport())
            inside = f"{folder.relative_to(around).as_posix()}/"
            for whole, place in _map_original_frame_paths(infos).items():
                if whole.startswith(inside):
                    found[whole.removeprefix(inside)] = place
    return found


def _parse_sizes_from_folders(
    places: Iterable[str], ours: Collection[str], top: str = ""
) -> dict[str, ImageSize]:
    by_folder = {
        whole: parse_split_folder_name(PurePosixPath(whole).parent.name or top, ours=whole in ours)
        for whole in places
    }
    return {whole: found[1] for whole, found in by_folder.items() if found}


def _read_line_documents(tree: FileTree, name: str, report: ReaderReport) -> list[LineDocument]:
    try:
        return read_line_documents(tree.read_bytes(name), tree.shown(name), report)
    except DatasetFormatError as error:
        report.read += 1
        report.add_problem(error)
        return []


def _is_line_file(name: str) -> bool:
    last = PurePosixPath(name).name
    if not last.lower().endswith(".json"):
        return False
    return last not in NO_FRAMES and not last.startswith(_OTHER_PREFIXES)


def _index_images_by_stem(names: Iterable[str]) -> dict[str, str]:
    places = (PurePosixPath(name) for name in names)
    return {
        str(place.with_suffix("")): str(place)
        for place in places
        if place.suffix.lower() in IMAGE_SUFFIXES
    }


def lines_from_json(
    value: Any,
    size: ImageSize,
    path: str,
    report: ReaderReport,
    drawn: ImageSize | None = None,
    record: str | None = None,
) -> tuple[Lines, tuple[Mapping[str, Any], ...]]:
    """Lines with geometry, and the others, of one image, in pixels.

    Coordinates are pixels when at least half of all points lie beyond 2, so that no single point
    decides (decision 0067); in a normalised file such points are left out and reported.

    Args:
        value: The parsed lines.
        size: Of the image whose pixels are wanted.
        path: File as the user knows it, for problems.
        report: Takes what had to be left out.
        drawn: Size of the image that pixels of the file are of; None: ``size``.
        record: Name of the image in a file of many, for problems.

    Raises:
        DatasetFormatError: The file is no object at all.
    """
    if not isinstance(value, dict):
        raise DatasetFormatError(
            path, record, None, "is not an object that maps line names to lists of points"
        )
    place = (path, record)
    known: dict[str, list[ImagePoint]] = {}
    others = []
    points = {name: _read_points(item, place, name, report) for name, item in value.items()}
    every = [point for line in points.values() for _, point in line]
    in_pixels = 2 * sum(map(_is_far_outside, every)) >= max(len(every), 1)
    for name, numbered in points.items():
        line = [point for _, point in numbered]
        if not in_pixels:
            line = _select_points_near_image(numbered, place, name, report)
        to_pixel = partial(_rescale_pixel, drawn or size, size) if in_pixels else size.unit_to_pixel
        pixels = [to_pixel(*point) for point in line]
        marking = _read_marking_name(name, place, report)
        if marking is None:
            flat = [coordinate for point in pixels for coordinate in point]
            others.append({"class": name, "points": flat})
        elif pixels:
            known.setdefault(marking, []).extend(pixels)
    return make_lines(known), tuple(others)


def _rescale_pixel(drawn: ImageSize, size: ImageSize, x: float, y: float) -> ImagePoint:
    """A pixel where its image has another size: images are resized about the first pixel's corner."""
    if drawn == size:
        return ImagePoint(x, y)
    across, down = size.width / drawn.width, size.height / drawn.height
    return ImagePoint((x + HALF) * across - HALF, (y + HALF) * down - HALF)


_Numbered = list[tuple[int, tuple[float, float]]]
"""Points of a line, each with its number in the file, from 1."""
_Place = tuple[str, str | None]
"""File, and image of a file of many, for problems."""


def _is_far_outside(point: tuple[float, float]) -> bool:
    return max(map(abs, point)) > LARGEST_UNIT


def _select_points_near_image(
    line: _Numbered, place: _Place, name: str, report: ReaderReport
) -> list[tuple[float, float]]:
    """The points of a line of a normalised file that can be normalised; others are reported."""
    far = [number for number, point in line if _is_far_outside(point)]
    if far:
        x, y = next(point for _, point in line if _is_far_outside(point))
        problem = f"({x:g}, {y:g}) is far outside the image, and the file is normalised"
        report.add_problem_at(*place, name, f"{problem}; {_describe_left_out_points(far)}")
    return [point for _, point in line if not _is_far_outside(point)]


def _describe_left_out_points(numbers: Sequence[int]) -> str:
    listed = ", ".join(map(str, numbers[:10])) + (", ..." if len(numbers) > 10 else "")
    return f"points {listed} are left out" if len(numbers) > 1 else f"point {listed} is left out"


def _read_points(value: Any, place: _Place, name: str, report: ReaderReport) -> _Numbered:
    """The sound points of a line; they are in no order, so that one less says nothing false."""
    points: _Numbered = []
    bad: list[int] = []
    first = ""
    try:
        listed = fields.require_list(value)
    except ValueError as error:
        report.add_problem_at(*place, name, f"{error}; the line is left out")
        return []
    for number, item in enumerate(listed, 1):
        try:
            points.append((number, _parse_point(item)))
        except ValueError as error:
            bad.append(number)
            first = first or str(error)
    if bad:
        report.add_problem_at(*place, name, f"{first}; {_describe_left_out_points(bad)}")
    return points


def _parse_point(item: Any) -> tuple[float, float]:
    """A point as ``{"x", "y"}`` or ``[x, y]``."""
    if isinstance(item, (list, tuple)):
        x, y = fields.parse_numbers(item, 2)
    else:
        point = fields.require_object(item)
        if "x" not in point or "y" not in point:
            raise ValueError("has a point without x or y")
        x, y = point["x"], point["y"]
    return fields.parse_pixel_coordinate(x), fields.parse_pixel_coordinate(y)


def _read_marking_name(name: str, place: _Place, report: ReaderReport) -> str | None:
    """The marking of that name; None (reported unless the format knows it) for any other."""
    found = find_marking_like(name)
    if found is None and name.replace("_", " ").strip() not in WITHOUT_GEOMETRY:
        problem = UnknownMarkingError(name).message
        report.add_problem_at(*place, name, f"{problem}; kept for export and not used")
    return found


def read_sn_calibration(
    path: Root,
    size: ImageSize,
    report: ReaderReport,
    *,
    calibration: str = "given",
    limits: ImportLimits = DEFAULT_LIMITS,
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
    with open_tree_context(path, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        infos = read_match_info(tree, names, report)
        places = _map_original_frame_paths(infos)
        sizes = _parse_sizes_from_folders(places, places)
        ours = OwnExportInfo(places, sizes, own_sizes=True)
        unused = dict.fromkeys(infos)
        for file in read_line_files_of_tree(tree, names, size, report, ours):
            unused.pop(file.place, None)
            yield _make_group(file, infos.get(file.place, {}), calibration, report)
        if unused:
            count = plural(len(unused), "image")
            shown = ", ".join(list(unused)[:5]) + (", ..." if len(unused) > 5 else "")
            report.add_remark(f"{count} of match_info.json without a file of lines: {shown}")


def _make_group(
    file: LineFile, record: Mapping[str, Any], calibration: str, report: ReaderReport
) -> Group:
    info = {name: value for name, value in record.items() if name != MATCH_INFO_PLACE}
    station = Station(file.stem, file.size, lines=file.lines, calibration=calibration)
    extras = Extras(lines=file.others, metadata={MATCH_INFO_METADATA: info} if info else {})
    view = View(file.stem, station, media=file.media, extras=extras)
    match, folders = build_match_key_of_record(info), PurePosixPath(file.place).parts[:-1]
    ours = find_original_frame_path(record) is not None
    splits = (_parse_split_of_folder(folder, ours) for folder in reversed(folders))
    split = read_split_name(next((split for split in splits if split), ""), report)
    name = PurePosixPath(file.stem).name
    label = f"{PurePosixPath(match).name} · frame {name}" if match else f"Frame {file.stem}"
    return Group(file.stem, (view,), match=match, split=split, label=label)


def _parse_split_of_folder(folder: str, ours: bool) -> str:
    """The split that a folder says, or nothing."""
    named = parse_split_folder_name(folder, ours=ours)
    return named[0] if named else parse_split_name(folder)
