"""match_info.json of sn-calibration: which match (and moment) each image is from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from app.errors import DatasetFormatError, UnsafePathError
from app.finite import json_text
from app.formats.file_tree import FileTree
from app.formats.json_text import read_json
from app.formats.report import Report
from app.formats.safe_path import require_safe_path
from app.formats.soccernet_record import IMAGE
from app.soccer.group import Group, View

FILE = "match_info.json"
FILES = (FILE, "match_info_cam_gt.json")
"""The second one is a third party's, with the kind of camera beside the match."""
METADATA = "match_info"
"""Under this name ``Extras.metadata`` keeps the record of an image."""
PLACE = "touchline_place"
"""Ours, in the record of an image: where its files would lie without the folders of an export."""
_PATHS = ("UrlLocal", "game", "match")
_PARTS = ("league", "season", "match")
_MOMENT = {"half": "half", "gameTime": "gameTime", "position": "ms_time"}


def read_match_info(
    tree: FileTree, names: list[str], report: Report
) -> Mapping[str, Mapping[str, Any]]:
    """The record of each image, by its path in the tree without the ending.

    An image that two files name has the fields of both.
    """
    found: dict[str, dict[str, Any]] = {}
    for name in names:
        if PurePosixPath(name).name not in FILES:
            continue
        try:
            value = read_json(tree.read_bytes(name), tree.shown(name))
            if not isinstance(value, dict):
                raise DatasetFormatError(
                    tree.shown(name), None, None, "is not an object with a record for each image"
                )
        except DatasetFormatError as error:
            report.skip(error)
            continue
        folder = PurePosixPath(name).parent
        for image, item in value.items():
            record = {"match": item} if isinstance(item, str) else item
            if not PurePosixPath(image).name:
                report.note(tree.shown(name), image[:80], None, "is not the name of an image")
            elif isinstance(record, dict):
                key = str((folder / image).with_suffix(""))
                found[key] = {**found.get(key, {}), **record}
            else:
                report.note(tree.shown(name), image[:80], None, "is neither text nor an object")
    return found


def original_frame_path(record: Mapping[str, Any]) -> str | None:
    """Where the frame of one of our exports came from; None where nobody says so."""
    place = record.get(PLACE)
    if not isinstance(place, str):
        return None
    try:
        return require_safe_path(place)
    except UnsafePathError:
        return None


def match_of_record(record: Mapping[str, Any]) -> str:
    """``<league>/<season>/<match>`` of a record, or as much of it as is there."""
    parts = [record.get(name) for name in _PARTS]
    for text in ("/".join(map(str, parts)) if all(parts) else None, *map(record.get, _PATHS)):
        if isinstance(text, str) and text.strip("/ "):
            try:
                return require_safe_path(text.strip("/ "))
            except UnsafePathError:
                continue
    return ""


def match_info_of_view(group: Group, view: View) -> Mapping[str, Any]:
    """The record of a view: what its source said, else what its dataset knows."""
    kept = view.extras.metadata.get(METADATA)
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
        self._file = (root / FILE).open("w", encoding="utf-8", newline="\n")
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
