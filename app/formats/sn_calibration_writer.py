"""sn-calibration, written: lines, and cameras in a folder of their own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from app.errors import InputError
from app.formats import fields
from app.formats.cameras import camera_file_name, find_camera_owner, format_camera_file
from app.formats.export_record import ExportRecord
from app.formats.fields import find_exact_inverse
from app.formats.frame_names import normalize_file_name, view_file_path
from app.formats.sn_calibration import (
    CAMERAS,
    LARGEST_UNIT,
    LINES,
    MATCH_INFO_PLACE,
    LineFile,
    MatchInfoWriter,
    find_match_info_of_view,
    flat_frame_name,
    make_split_folder_name,
)
from app.formats.soccernet_v3 import soccernet_marking_name
from app.formats.view_files import PutText, make_disk_writer, write_file_below
from app.json_text import json_text
from app.soccer.annotation import Lines
from app.soccer.frames import ImagePoint, ImageSize


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
    flat = [_parse_flat_coordinates(line) for line in others]
    points = {soccernet_marking_name(marking): list(line) for marking, line in lines.items()}
    for line, numbers in zip(others, flat, strict=True):
        extra = [ImagePoint(x, y) for x, y in zip(numbers[::2], numbers[1::2], strict=False)]
        points.setdefault(str(line.get("class")), []).extend(extra)
    across, down = size.width - 1, size.height - 1
    # Far outside, a normalised coordinate would be read back as a pixel.
    far_x = [abs(x) for line in points.values() for x, _ in line]
    far_y = [abs(y) for line in points.values() for _, y in line]
    if pixels or max((max(far_x) / across, max(far_y) / down) if far_x else (0.0,)) > LARGEST_UNIT:
        return {name: [{"x": x, "y": y} for x, y in line] for name, line in points.items()}
    return {
        name: [
            {
                "x": unit
                if (unit := x / across) * across == x
                else _normalize_coordinate(x, across),
                "y": unit if (unit := y / down) * down == y else _normalize_coordinate(y, down),
            }
            for x, y in line
        ]
        for name, line in points.items()
    }


def _normalize_coordinate(pixel: float, extent: int) -> float:
    """The normalised number that is read as this pixel, where the nearest one is not."""
    return find_exact_inverse(pixel / extent, pixel, lambda unit: unit * extent)


def format_line_file(
    lines: Lines,
    size: ImageSize,
    others: Sequence[Mapping[str, Any]] = (),
    *,
    pixels: bool = False,
) -> str:
    """The text of one line file."""
    return json_text(lines_to_json(lines, size, others, pixels=pixels), ascii_=True) + "\n"


def _parse_flat_coordinates(line: Mapping[str, Any]) -> list[float]:
    """Coordinates of a line that is no marking; none where they are not all numbers."""
    points = line.get("points")
    try:
        return (
            [fields.parse_number(item) for item in points]
            if isinstance(points, (list, tuple))
            else []
        )
    except ValueError:
        return []


def write_line_files(root: Path, files: Iterable[LineFile]) -> list[Path]:
    """Write ``<stem>.json`` per frame below an existing folder; the paths written.

    Raises:
        UnsafePathError: A stem that would leave the folder.
    """
    return [
        write_file_below(
            root, f"{file.stem}.json", format_line_file(file.lines, file.size, file.others)
        )
        for file in files
    ]


def write_sn_calibration(
    root: Path, records: Iterable[ExportRecord], put: PutText | None = None
) -> dict[str, int]:
    """Write ``lines/<folder>/<name>.json`` and ``cameras/<folder>/camera_<name>.json``.

    A folder holds the frames of one split and one size, and its name says both: the public
    evaluator wants all frames of a split in one folder, nothing else in it, and one size.
    ``match_info.json`` names the match of every image, and the place that it came from.

    Args:
        root: Existing folder.
        records: Groups; one is in memory at a time.
        put: Takes the files of lines and cameras; below ``root`` by default.

    Returns:
        Counts: ``groups``, ``frames`` and ``cameras``.

    Raises:
        InputError: Two frames of a split would have one name.
        UnsafePathError: A key would leave ``root``.
    """
    counts = {"groups": 0, "frames": 0, "cameras": 0}
    names, with_camera = _FrameNameAssigner(), set[str]()
    put = put or make_disk_writer(root)
    with MatchInfoWriter(root) as info:
        for record in records:
            counts["groups"] += 1
            for view in record.group.views:
                place = view_file_path(record.group, record.with_export_file_key(view))
                camera = record.camera(view)
                # A static camera that many groups share is written once.
                known = place in names.of_place
                owner = find_camera_owner(record.group, view)
                name = names.assign_frame_name(place, record.split_of_view(view), view.size, owner)
                if not known:
                    lines, others = view.station.lines, view.extras.lines
                    put(f"{LINES}/{name}.json", format_line_file(lines, view.size, others))
                    origin = {
                        **find_match_info_of_view(record.group, view),
                        MATCH_INFO_PLACE: place,
                    }
                    info.add(f"{LINES}/{name}.jpg", origin)
                    counts["frames"] += 1
                if camera is not None and name not in with_camera:
                    text = format_camera_file(camera, record.camera_covariance(view), view.size)
                    put(camera_file_name(f"{CAMERAS}/{name}"), text)
                    with_camera.add(name)
    return counts | {"cameras": len(with_camera)}


class _FrameNameAssigner:
    """Folder and name of each frame, by its place."""

    def __init__(self) -> None:
        self.of_place: dict[str, str] = {}
        self._place_of: dict[str, str] = {}
        self._owners: dict[str, tuple[str, ...]] = {}

    def assign_frame_name(
        self, place: str, split: str, size: ImageSize, owner: tuple[str, ...]
    ) -> str:
        """The name of a frame; that of a static camera stays what it was at first.

        Raises:
            InputError: Another frame has its place or its name.
        """
        first = self._owners.setdefault(place, owner)
        if first != owner:
            whose = f"{', '.join(first)} and {', '.join(owner)}"
            raise InputError(
                f"two frames ({whose}) have the same path {place}",
                hint="Rename one of them in the source, and import it again.",
            )
        if place in self.of_place:
            return self.of_place[place]
        name = f"{make_split_folder_name(split, size)}/{flat_frame_name(place, split)}"
        other = self._place_of.setdefault(normalize_file_name(name), place)
        if other != place:
            raise InputError(
                f"the frames {other} and {place} would both be called {name}",
                hint="Rename one of them in the source, and import it again.",
            )
        self.of_place[place] = name
        return name
