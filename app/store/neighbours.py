"""Neighbours: the frames just before and after the frame of a view, where they are on disk.

Only names that count time are followed. ``7.png`` and ``8.png`` of SoccerNet are two actions, and
the images of most datasets are numbered in no order, so their numbers say nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path, PurePath, PurePosixPath

import cv2

from app.errors import ImageError, NotFoundError, StorageError
from app.soccer.media import Media
from app.store.media import has_member
from app.store.object_frames import is_stored
from app.store.video import open_video

FARTHEST = 5
"""Frames before and after that are looked for."""
CLIP_FOLDER = "img1"
"""Holds the frames of one clip in their order (SoccerNet game state, MOT)."""
_NUMBERED = re.compile(r"(.*?)([0-9]{1,12})", re.DOTALL)
_LAST_NUMBER = re.compile(r"([0-9]+)[^0-9]*")


def counts_time(media: Media, group: str, static: bool) -> bool:
    """Whether the name of a frame counts time, so that there may be neighbours; opens nothing."""
    if is_stored(media):
        return False
    return media.frame is not None or _numbered(media, group, static) is not None


def neighbours(media: Media, group: str, static: bool) -> dict[int, Media]:
    """Frames of the same camera up to ``FARTHEST`` before and after, by how many frames later.

    Args:
        media: Where the view's own frame lies.
        group: Key of the view's group, which is the number of its frame for static cameras.
        static: Whether the camera stands still, so that its files are numbered by frames.

    None of a frame in an object store, which would have to be asked for each.
    """
    if is_stored(media):
        return {}
    try:
        if media.frame is not None:
            return dict(_of_video(media, media.frame))
        return dict(_of_files(media, group, static))
    except (NotFoundError, ImageError, StorageError):
        return {}


def _offsets() -> Iterator[int]:
    return (offset for offset in range(-FARTHEST, FARTHEST + 1) if offset)


def _of_video(media: Media, frame: int) -> Iterator[tuple[int, Media]]:
    count = _video_length(Path(media.path))
    for offset in _offsets():
        if 0 <= frame + offset < count:
            yield offset, replace(media, frame=frame + offset)


def _video_length(path: Path) -> int:
    if not path.is_file():
        raise NotFoundError(f"the file {path.name} is not where it was imported from")
    with open_video(path) as video:
        return int(video.get(cv2.CAP_PROP_FRAME_COUNT)) if video.isOpened() else 0


def _of_files(media: Media, group: str, static: bool) -> Iterator[tuple[int, Media]]:
    numbered = _numbered(media, group, static)
    if numbered is None:
        return
    name, head, digits = numbered
    for offset in _offsets():
        number = int(digits) + offset
        # 100 may follow 099 or 99.
        for text in dict.fromkeys((f"{number:0{len(digits)}d}", str(number))):
            there = _there(media, str(name.with_name(f"{head}{text}{name.suffix}")))
            if number >= 0 and there is not None:
                yield offset, there
                break


def _numbered(media: Media, group: str, static: bool) -> tuple[PurePath, str, str] | None:
    """Name of a frame, what stands before its number, and the number; None: it counts no time."""
    name = PurePosixPath(media.member) if media.member is not None else PurePath(media.path)
    numbered = _NUMBERED.fullmatch(name.stem)
    if numbered is None:
        return None
    by_frame = static and _number(group) == int(numbered[2])
    if not by_frame and name.parent.name != CLIP_FOLDER:
        return None
    return name, numbered[1], numbered[2]


def _number(group: str) -> int | None:
    found = _LAST_NUMBER.search(group.rsplit("/", 1)[-1])
    return int(found[1]) if found else None


def _there(media: Media, name: str) -> Media | None:
    """The neighbour of that name, in the same folder or archive, if it is one."""
    if media.member is not None:
        return replace(media, member=name) if has_member(media, name) else None
    # A link could lead out of the folder that was imported.
    path = Path(name)
    return replace(media, path=name) if path.is_file() and not path.is_symlink() else None
