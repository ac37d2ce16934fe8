"""Where the frame of a view lies in an export: beside its labels, or flat for YOLO."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from pathlib import PurePosixPath

from app.object_store.address import unseal
from app.soccer.group import Group, View

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp")
VIDEO_SUFFIXES = (
    *(".mp4", ".avi", ".mpg", ".mpeg", ".mkv", ".mov"),
    *(".m4v", ".ts", ".mts", ".m2ts", ".webm", ".wmv", ".flv", ".ogv", ".3gp"),
)
FOLDER = "Frames-v3"
"""Beside the labels of a match, where SoccerNet's readers look for loose frames."""
UNASSIGNED = "unassigned"
"""Stands for the split of groups that are in none."""
_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")


def is_system_file(name: str) -> bool:
    """Whether an operating system laid a file beside those of people, as ``Thumbs.db``."""
    place = PurePosixPath(name)
    hidden = any(part.startswith(".") or part == "__MACOSX" for part in place.parts)
    return hidden or place.name.lower() in ("thumbs.db", "desktop.ini")


FrameName = Callable[[Group, View, str, str], str]
"""Place of a frame in an export, from its group, its view, its split and the ending to give."""


def frame_path_by_match(group: Group, view: View, split: str, suffix: str) -> str:
    """``<match>/Frames-v3/7_1.png``; static cameras: ``.../cam3/358.jpg``.

    The ending of a view's key stays, whatever the frame is: labels and readers go by the name.
    """
    name = PurePosixPath(view.key)
    match = group.match or "frames"
    if view.station.shared:
        return f"{match}/{FOLDER}/{view.key}/{group.key}{suffix}"
    if name.suffix.lower() in IMAGE_SUFFIXES:
        return f"{match}/{FOLDER}/{name}"
    return f"{match}/{FOLDER}/{name}{suffix}"


def frame_path_in_split(group: Group, view: View, split: str, suffix: str) -> str:
    """``images/<split>/<digest of the group>_<view>.jpg``: no name of ours meets another.

    Labels have the name without its ending: views that would share it have a digest of theirs, too.
    """
    ending = PurePosixPath(view.key).suffix.lower()
    stem = _file_safe_stem(view.key)
    if sum(_file_safe_stem(other.key).lower() == stem.lower() for other in group.views) > 1:
        stem = f"{stem}_{_key_digest(view.key)}"
    ending = ending if ending in IMAGE_SUFFIXES else suffix
    return f"images/{split_folder(split)}/{_key_digest(group.key)}_{stem}{ending}"


def _file_safe_stem(key: str) -> str:
    return _UNSAFE.sub("-", view_stem(key))


def _key_digest(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()[:12]


def split_folder(split: str) -> str:
    """Name of a split as a folder; YOLO says ``val``, and what has no split trains."""
    return {"valid": "val", "test": "test", "challenge": "test"}.get(split, "train")


def expected_frame_suffix(view: View) -> str:
    """Ending that a copy of a view's frame would most likely have."""
    media = view.media
    name = "" if media is None else media.member or unseal(media.path)[0]
    suffix = PurePosixPath(name).suffix.lower()
    return suffix if suffix in IMAGE_SUFFIXES else ".jpg"


def view_stem(key: str) -> str:
    """Key of a view without the ending of an image's name."""
    place = PurePosixPath(key)
    return str(place.with_suffix("")) if place.suffix.lower() in IMAGE_SUFFIXES else key


def view_file_path(group: Group, view: View) -> str:
    """Where the files of a view go, without prefix and ending: ``<match>/7_1``."""
    # The key of a frame that is a group alone is the place of its file.
    match = group.match if view.key != group.key else ""
    return str(PurePosixPath(match) / view_stem(view.key))
