"""sn-calibration: the annotated lines of one image a JSON file (``00002.json``).

An export is what the public evaluator takes: ``lines/<split>-<width>x<height>/<name>.json`` and
``cameras/<split>-<width>x<height>/camera_<name>.json``.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

from app.formats.frame_names import (
    UNASSIGNED,
    frame_name_claims,
    frame_path_by_match,
    view_file_path,
)
from app.formats.soccernet_v3 import SPLITS
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, View

DEFAULT_SIZE = ImageSize(960, 540)
LINES, CAMERAS = "lines", "cameras"
"""Folders of an export: the public evaluator takes every JSON beside the lines for a frame."""
_FOLDER = re.compile(rf"({'|'.join((*SPLITS, UNASSIGNED))})-(\d{{1,5}})x(\d{{1,5}})", re.ASCII)
_PLAIN = re.compile(r"[A-Za-z0-9_-]+", re.ASCII)
LARGEST_UNIT = 2.0
"""A file in which at least half of the points have a coordinate further from 0 is in pixels."""
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


def soccernet_marking_name(marking: str) -> str:
    """A marking's name as SoccerNet files spell it."""
    return _SPELLING.get(marking, marking)


def split_folder_name(split: str, size: ImageSize) -> str:
    """Folder of the frames of one split and one size: the evaluator takes one size at a time.

    Example:
        >>> split_folder_of("test", ImageSize(1280, 720))
        'test-1280x720'
    """
    return f"{split or UNASSIGNED}-{size.width}x{size.height}"


def split_and_size(folder: str) -> tuple[str, ImageSize] | None:
    """Back from ``split_folder_name``; None for any other folder."""
    found = _FOLDER.fullmatch(folder)
    if found is None or min(int(found[2]), int(found[3])) < 2:
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


def line_name_claims(group: Group, view: View, split: str) -> Mapping[str, Hashable]:
    """The names of a view in an export, and whose each would be (``export_names.Claims``).

    The place of a frame is a name, too: what is read again has it for a key. A static camera has
    one file of lines for all its views.
    """
    place = view_file_path(group, view)
    name = f"{split_folder_name(split, view.size)}/{flat_frame_name(place, split)}"
    if not view.station.shared:
        return dict.fromkeys((place.encode().hex(), name), (group.key, view.key))
    own = dict.fromkeys((place.encode().hex(), name), view.station.key)
    return {**own, **frame_name_claims(group, view, split)}


def line_frame_path(group: Group, view: View, split: str, suffix: str) -> str:
    """Where the frame of a view lies in an export: beside its lines.

    Example: ``lines/test-1280x720/3f1c0a9b2d4e_7_1.png``. A static camera has one file of lines
    and many frames, which lie by its match.
    """
    if view.station.shared:
        return frame_path_by_match(group, view, split, suffix)
    name = flat_frame_name(view_file_path(group, view), split)
    return f"{LINES}/{split_folder_name(split, view.size)}/{name}{suffix}"
