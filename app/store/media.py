"""Media: frames read where they are, checked before they are decoded, made small, and cached."""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from app.config import Settings
from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.soccer.group import Media
from app.store.archives import Archives
from app.store.image_header import ImageHeader, check_size, read_header

JPEG_QUALITY = 88
_ARCHIVES = Archives()
_FLAGS = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
"""Annotations were made on the pixels as stored, so no note about rotation counts."""


def read_frame(media: Media, width: int | None, flipped: bool, settings: Settings) -> bytes:
    """The frame of a view as JPEG, PNG or WebP.

    Args:
        media: Where it lies.
        width: Wanted width in pixels; never enlarged. None: the frame as it is.
        flipped: Turn the mirrored picture of this camera right.
        settings: Limits, and the folder of the cache.

    Returns:
        The file's own bytes where nothing is to be done to them, else a JPEG.

    Raises:
        NotFoundError: The file, member or video frame is not there.
        ImageError: It is no image of these kinds, or damaged.
        TooLargeError: It is larger than the limits, in bytes or in declared pixels.
    """
    if media.frame is None and width is None and not flipped:
        return _checked(_source(media, settings), settings, frame_name(media))
    place = settings.cache / "frames" / _cache_name(media, width, flipped)
    with contextlib.suppress(OSError):
        return place.read_bytes()
    picture = _decode(media, settings)
    if flipped:
        picture = cv2.flip(picture, 1)
    data = _encode(_narrowed(picture, width))
    _keep(place, data)
    return data


def content_type(data: bytes) -> str:
    """Media type by the bytes themselves; names have no say.

    Raises:
        ImageError: None of the kinds that are served.
    """
    return read_header(data).kind


def frame_name(media: Media) -> str:
    """How a complaint calls a frame: by its file and its place in it, without the folder."""
    file = Path(media.path).name
    if media.member is not None:
        return f"frame {media.member} of {file}"
    return f"frame {file}" if media.frame is None else f"frame {media.frame} of {file}"


def media_facts(media: Media) -> dict[str, int]:
    """Size in bytes, and CRC-32 where an archive knows it; empty when the file is gone."""
    try:
        if media.member is None:
            return {"bytes": _stat(Path(media.path)).st_size}
        size, crc = _ARCHIVES.facts(Path(media.path), media.member)
    except (NotFoundError, ImageError, StorageError):
        return {}
    return {"bytes": size, "crc32": crc}


def has_member(media: Media, member: str) -> bool:
    """Whether the archive that a frame lies in has a member of that name.

    Raises:
        NotFoundError, ImageError, StorageError: The archive is not there, damaged or unreadable.
    """
    return _ARCHIVES.has(Path(media.path), member)


def _checked(data: bytes, settings: Settings, name: str) -> bytes:
    """The bytes unchanged, once they were seen to decode."""
    _pixels(data, settings, name)
    return data


def _decode(media: Media, settings: Settings) -> Any:
    if media.frame is not None:
        return _video_frame(Path(media.path), media.frame, settings)
    return _pixels(_source(media, settings), settings, frame_name(media))


def _source(media: Media, settings: Settings) -> bytes:
    path = Path(media.path)
    if media.member is not None:
        return _ARCHIVES.read(path, media.member, settings.max_file_bytes)
    if _stat(path).st_size > settings.max_file_bytes:
        raise TooLargeError(f"{path.name} is larger than {settings.max_file_bytes} bytes")
    try:
        return path.read_bytes()
    except OSError as error:
        raise StorageError(f"{path.name} cannot be read") from error


def _pixels(data: bytes, settings: Settings, name: str) -> Any:
    header = read_header(data, name)
    check_size(header, settings, name)
    try:
        picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), _FLAGS)
    except cv2.error as error:
        raise ImageError(f"{name} is damaged") from error
    if picture is None:
        raise ImageError(f"{name} is damaged")
    _require_declared(picture, header, name)
    return picture


def _require_declared(picture: Any, header: ImageHeader, name: str) -> None:
    height, width = picture.shape[:2]
    if (width, height) != (header.width, header.height):
        raise ImageError(f"{name} is not of the size that its header declares")


def _video_frame(path: Path, number: int, settings: Settings) -> Any:
    _stat(path)
    video = cv2.VideoCapture(str(path))
    try:
        if not video.isOpened():
            raise ImageError(f"{path.name} is no video that can be read")
        size = (video.get(cv2.CAP_PROP_FRAME_WIDTH), video.get(cv2.CAP_PROP_FRAME_HEIGHT))
        check_size(ImageHeader("video", int(size[0]), int(size[1])), settings, path.name)
        video.set(cv2.CAP_PROP_POS_FRAMES, number)
        done, picture = video.read()
    finally:
        video.release()
    if number < 0 or not done:
        raise NotFoundError(f"{path.name} has no frame {number}")
    return picture


def _narrowed(picture: Any, width: int | None) -> Any:
    height, present = picture.shape[:2]
    if width is None or width >= present:
        return picture
    size = (max(width, 1), max(round(height * width / present), 1))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _encode(picture: Any) -> bytes:
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        raise ImageError("the image cannot be encoded as JPEG")
    return bytes(data)


def _cache_name(media: Media, width: int | None, flipped: bool) -> str:
    """Name by content: another file under the same path has another time or size."""
    path = Path(media.path)
    status = _stat(path)
    facts = _ARCHIVES.facts(path, media.member) if media.member is not None else ()
    parts = (media.path, status.st_mtime_ns, status.st_size, media.member, *facts)
    key = repr((*parts, media.frame, width, flipped, JPEG_QUALITY))
    name = hashlib.sha256(key.encode()).hexdigest()
    return f"{name[:2]}/{name[2:34]}.jpg"


def _stat(path: Path) -> os.stat_result:
    try:
        status = path.stat()
    except OSError as error:
        raise NotFoundError(f"the file {path.name} is not where it was imported from") from error
    if not stat.S_ISREG(status.st_mode):
        raise NotFoundError(f"{path.name} is not a file")
    return status


def _keep(place: Path, data: bytes) -> None:
    """Write into the cache, whole or not at all; a full disk costs the cache and no picture."""
    with contextlib.suppress(OSError):
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=".", dir=place.parent)
        partial = Path(name)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(place)
        finally:
            partial.unlink(missing_ok=True)
