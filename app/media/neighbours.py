"""Neighbours: the frames just before and after the frame of a view, where they are on disk."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from app.config import Settings
from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.media.files import has_member, video_times
from app.media.object_frames import is_stored
from app.soccer.group import FARTHEST, Media, split_frame_number


def neighbouring_frames(
    media: Media, group: str, static: bool, settings: Settings
) -> dict[int, Media]:
    """Frames of the same camera up to ``FARTHEST`` before and after, by how many frames later.

    Args:
        media: Where the view's own frame lies.
        group: Key of the view's group, which is the number of its frame for static cameras.
        static: Whether the camera stands still, so that its files are numbered by frames.
        settings: Where indices of videos are kept.

    None of a frame in an object store, which would have to be asked for each.
    """
    if is_stored(media):
        return {}
    try:
        if media.frame is not None:
            return dict(_neighbours_in_video(media, media.frame, len(video_times(media, settings))))
        return dict(_neighbours_among_files(media, group, static))
    except (NotFoundError, ImageError, StorageError, TooLargeError):
        return {}


def _neighbour_offsets() -> Iterator[int]:
    return (offset for offset in range(-FARTHEST, FARTHEST + 1) if offset)


def _neighbours_in_video(media: Media, frame: int, count: int) -> Iterator[tuple[int, Media]]:
    for offset in _neighbour_offsets():
        if 0 <= frame + offset < count:
            yield offset, replace(media, frame=frame + offset)


def _neighbours_among_files(media: Media, group: str, static: bool) -> Iterator[tuple[int, Media]]:
    found = split_frame_number(media, group, static)
    if found is None:
        return
    name, head, digits = found
    for offset in _neighbour_offsets():
        number = int(digits) + offset
        # 100 may follow 099 or 99.
        for text in dict.fromkeys((f"{number:0{len(digits)}d}", str(number))):
            there = _existing_neighbour(media, str(name.with_name(f"{head}{text}{name.suffix}")))
            if number >= 0 and there is not None:
                yield offset, there
                break


def _existing_neighbour(media: Media, name: str) -> Media | None:
    """The neighbour of that name, in the same folder or archive, if it is one."""
    if media.member is not None:
        return replace(media, member=name) if has_member(media, name) else None
    # A link could lead out of the folder that was imported.
    path = Path(name)
    return replace(media, path=name) if path.is_file() and not path.is_symlink() else None
