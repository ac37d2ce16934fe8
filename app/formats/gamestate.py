"""sn-gamestate: names that its reader and its writer share."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from pathlib import PurePosixPath
from typing import Any

from app.formats.frame_names import UNASSIGNED, view_stem
from app.soccer.group import Group, View

LABELS = "Labels-GameState.json"
METADATA = "gamestate"
"""Under this name ``Extras.metadata`` keeps what the file says besides lines and boxes."""
BALL, PITCH = "ball", "pitch"
BALL_ID, PITCH_ID = 4, 5
"""Ids of the categories where a file does not list them."""
CAMERA_ID = 6
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
    return f"{split or UNASSIGNED}/{(match or SEQUENCE).replace('/', '_')}"


def frame_file_name(group: Group, view: View) -> str:
    """Name of the frame of a view: as its file called it, or made from its key."""
    image = source_fields(view).get("image")
    if isinstance(image, dict) and isinstance(image.get("file_name"), str):
        return str(image["file_name"])
    stem = view_stem(view.key)
    if view.station.shared:
        stem = f"{group.key}_{stem}"
    return f"{PurePosixPath(stem).name}{PurePosixPath(view.key).suffix or '.jpg'}"


def sequence_name_claims(group: Group, view: View, split: str) -> Mapping[str, Hashable]:
    """The name of a view in an export, and whose it is (``export_names.Claims``).

    Files of one sequence in several splits are one sequence to who reads them, and images are
    known by their name without its ending.
    """
    stem = PurePosixPath(frame_file_name(group, view)).stem
    return {f"{sequence_folder(group.match, '')}/{stem}": (group.key, view.key)}


def source_fields(view: View) -> Mapping[str, Any]:
    """What the file said that a view came from; empty for views of other formats."""
    kept = view.extras.metadata.get(METADATA)
    return kept if isinstance(kept, dict) else {}


def sequence_frame_path(group: Group, view: View, split: str, suffix: str) -> str:
    """Where the frame of a view lies in an export: ``<split>/<sequence>/img1/000001.jpg``."""
    return f"{sequence_folder(group.match, split)}/{IMAGES}/{frame_file_name(group, view)}"
