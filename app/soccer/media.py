"""Where the frame of a view is, and its number in a sequence."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import PurePath, PurePosixPath

from app.object_store.address import is_address


@dataclass(frozen=True)
class Media:
    """Where the frame of a view can be read: a file, or a member of an archive."""

    path: str
    member: str | None = None
    frame: int | None = None
    """Number of the frame when ``path`` is a video."""


FARTHEST = 5
"""Frames before and after that are looked for."""
CLIP_FOLDER = "img1"
"""Holds the frames of one clip in their order (SoccerNet game state, MOT)."""
_NUMBERED = re.compile(r"(.*?)([0-9]{1,12})", re.DOTALL)
_LAST_NUMBER = re.compile(r"([0-9]+)[^0-9]*")


def is_numbered_in_time(media: Media, group: str, static: bool) -> bool:
    """Whether the name of a frame counts time, so that there may be neighbours.

    Args:
        media: Where the frame lies; one in an object store has no neighbours, for each of which the
            store would have to be asked.
        group: Key of the group, which is the number of its frame for static cameras.
        static: Whether the camera stands still, so that its files are numbered by frames.
    """
    if is_address(media.path):
        return False
    return media.frame is not None or split_frame_number(media, group, static) is not None


def split_frame_number(media: Media, group: str, static: bool) -> tuple[PurePath, str, str] | None:
    """Name of a frame, what stands before its number, and the number; None: it counts no time."""
    name = PurePosixPath(media.member) if media.member is not None else PurePath(media.path)
    found = _NUMBERED.fullmatch(name.stem)
    if found is None:
        return None
    by_frame = static and _last_number(group) == int(found[2])
    if not by_frame and name.parent.name != CLIP_FOLDER:
        return None
    return name, found[1], found[2]


def _last_number(group: str) -> int | None:
    found = _LAST_NUMBER.search(group.rsplit("/", 1)[-1])
    return int(found[1]) if found else None
