"""Cameras, read: one a file (``camera_00002.json``), ISSIA's six in one, or SynLoc's images."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

from app.datasets.camera_json import camera_from_json
from app.datasets.file_tree import DEFAULT_LIMITS, FileTree, Limits, Root
from app.datasets.json_text import read_json
from app.datasets.match_info import place_of, read_match_info
from app.datasets.report import Report
from app.datasets.sn_calibration import CAMERAS, LINES
from app.datasets.synloc import camera_from_synloc, images_of, is_synloc
from app.datasets.trees import opened_tree
from app.errors import DatasetFormatError
from app.geometry.camera import Camera

_FILE = re.compile(r"(?:camera_)?(.+)\.json", re.ASCII | re.IGNORECASE)

_NO_CAMERAS = ("manifest.json", "match_info.json", "findings.json", "calibrate.json")


def read_cameras(path: Root, report: Report, limits: Limits = DEFAULT_LIMITS) -> dict[str, Camera]:
    """Every camera below ``path``, by key.

    ``path`` is a folder or zip of ``camera_<stem>.json``, one such file, or a file with ISSIA's
    ``{"cam1": {...}, ...}`` (also inside ``{"cameras": {...}}``, also double-encoded), or a COCO
    file of SynLoc, whose cameras are called like their images. The key is the stem, with
    ``<league>/<season>/<match>/`` before it where the file lies that deep. In an export as
    sn-calibration ``match_info.json`` says where each frame came from: that is its key.
    """
    with opened_tree(path, report, limits) as tree:
        if tree is None:
            return {}
        names = tree.names()
        cameras = cameras_of(tree, _camera_files(names), report, _places(tree, names))
    report.imported += len(cameras)
    return cameras


def cameras_of(
    tree: FileTree,
    names: Sequence[str],
    report: Report,
    places: Mapping[str, str] | None = None,
) -> dict[str, Camera]:
    """The cameras of some files of a tree, by key: that of ``places``, or made from the name."""
    cameras: dict[str, Camera] = {}
    known = places or {}
    stems = Counter(_key(name, deep=False) for name in names)
    for name in names:
        deep = stems[_key(name, deep=False)] > 1
        _read_file(tree, name, known.get(name) or _key(name, deep), cameras, report)
    return cameras


def _places(tree: FileTree, names: list[str]) -> dict[str, str]:
    """Where the frames of an export as sn-calibration came from, by the files of their cameras."""
    found = {}
    # What is wrong with the file is no matter of cameras.
    for image, record in read_match_info(tree, names, Report()).items():
        lines, place = PurePosixPath(image), place_of(record)
        if place is not None and lines.parts[0] == LINES:
            file = PurePosixPath(CAMERAS, *lines.parts[1:-1], f"camera_{lines.name}.json")
            found[str(file)] = place
    return found


def _camera_files(names: Iterable[str]) -> list[str]:
    """Camera files; where none is called ``camera_...``, every JSON file may be one."""
    names = [name for name in names if name.lower().endswith(".json")]
    named = [name for name in names if PurePosixPath(name).name.startswith("camera_")]
    return named or [name for name in names if PurePosixPath(name).name not in _NO_CAMERAS]


def _key(name: str, deep: bool) -> str:
    place = PurePosixPath(name)
    found = _FILE.fullmatch(place.name)
    stem = found.group(1) if found else place.stem
    folders = place.parts[:-1]
    keep = folders if deep else folders[-3:] if len(folders) >= 3 else ()
    return "/".join((*keep, stem))


def _read_file(
    tree: FileTree, name: str, key: str, cameras: dict[str, Camera], report: Report
) -> None:
    shown = tree.shown(name)
    try:
        value = read_json(tree.read_bytes(name), shown, double_encoded=True)
    except DatasetFormatError as error:
        report.read += 1
        report.skip(error)
        return
    several = _several(value)
    for record, item in several.items() if several is not None else ((None, value),):
        report.read += 1
        try:
            read = camera_from_synloc if is_synloc(item) else camera_from_json
            cameras[record or key] = read(item, shown, record)
        except DatasetFormatError as error:
            report.skip(error)


def _several(value: Any) -> dict[str, Any] | None:
    """The cameras by name when the file holds several, else None."""
    if not isinstance(value, dict) or "pan_degrees" in value:
        return None
    if isinstance(value.get("cameras"), dict):
        return dict(value["cameras"])
    if (images := images_of(value)) is not None:
        return images
    if not any(isinstance(item, dict) for item in value.values()):
        return None
    return {name: item for name, item in value.items() if not name.startswith("_")}
