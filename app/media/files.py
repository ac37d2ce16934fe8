"""Media: frames read where they are, checked before they are decoded, made small, and cached."""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import cv2
import numpy as np
import numpy.typing as npt

from app.config import Settings
from app.durable import replace_file
from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.json_text import digest_content
from app.media.images import JPEG, SIDEWAYS, ImageHeader, check_jpeg_scans, check_size, read_header
from app.media.object_frames import ArchiveMemberReader, is_in_object_store, read_object
from app.media.video import Times, make_index, open_video, read_cached_index, read_frame_at
from app.object_store.path import split_pinned_address
from app.soccer.group import Media
from app.wording import plural

JPEG_QUALITY = 88
LINK_HINT = "Put the file itself there, or import the folder again."
_ARCHIVES = ArchiveMemberReader()
_FLAGS = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
"""Pixels as stored; ``_turn_upright`` turns them as the header says, for OpenCV and browsers differ."""
_CACHE_VERSION = 2
"""Raised when the picture made of the same file is another one. 2: EXIF orientation is applied, and
frames of videos are found by their times."""
_HEADS = (16 * 1024, 1024 * 1024)
"""Bytes in which a header is looked for; a JPEG may have a small picture and a profile before it."""
_CHUNK = 1 << 20
_DECODED_BYTES = 6
"""Of a pixel while it is decoded: three channels of 16 bits at most."""


def read_encoded_frame(media: Media, width: int | None, flipped: bool, settings: Settings) -> bytes:
    """The frame of a view as JPEG, PNG or WebP.

    Args:
        media: Where it lies.
        width: Wanted width in pixels; never enlarged. None: the frame as it is.
        flipped: Turn the mirrored picture of this camera right.
        settings: Limits, and the folder of the cache.

    Returns:
        The file's own bytes where nothing is to be done to them, else a JPEG. It is upright
        without any EXIF, so that readers that ignore EXIF show it as it was annotated.

    Raises:
        NotFoundError: The file, member or video frame is not there.
        ImageError: It is no image of these kinds, or damaged.
        TooLargeError: It is larger than the limits, in bytes, declared pixels or scans.
    """
    _require_inside_root(media, settings)
    if media.frame is None and width is None and not flipped:
        data, name = _read_image_bytes(media, settings), describe_frame(media)
        if read_header(data, name).orientation == 1:
            # They are sent once they were seen to decode.
            _decode_pixels(data, settings, name)
            return data
    found = read_cached_frame(media, width, flipped, settings)
    if found is not None:
        return found
    picture = _decode_frame(media, settings)
    if flipped:
        picture = cv2.flip(picture, 1)
    data = _encode_jpeg(_shrink_to_width(picture, width))
    _write_to_cache(_cache_path(media, width, flipped, settings), data)
    return data


def read_digest_and_pixels(
    media: Media, flipped: bool, settings: Settings, known: str = ""
) -> tuple[str, npt.NDArray[np.uint8] | None]:
    """Digest of a frame's bytes, and what ``decode_frame`` gives of them.

    The frame of a video has no bytes of its own; its pixels are digested.

    Args:
        media: Where it lies.
        flipped: Turn the mirrored picture of this camera right.
        settings: Limits.
        known: A digest; the frame of these bytes is not decoded, its pixels are None.

    Raises:
        NotFoundError, ImageError, TooLargeError: As ``read_encoded_frame`` does.
    """
    _require_inside_root(media, settings)
    if media.frame is not None:
        picture = _read_video_frame(media, settings)
        digest = digest_content(np.ascontiguousarray(picture).tobytes())
    else:
        data, name = _read_image_bytes(media, settings), describe_frame(media)
        digest = digest_content(data)
        if read_header(data, name).orientation != 1:
            # What was once read of the stored pixels, under the plain digest, is read again.
            digest = digest_content(f"{digest} upright".encode())
        if digest != known:
            picture = _decode_pixels(data, settings, name)
    if digest == known:
        return digest, None
    return digest, to_rgb_as_annotated(picture, flipped)


def read_cached_frame(
    media: Media, width: int | None, flipped: bool, settings: Settings
) -> bytes | None:
    """The JPEG that was made of a frame before, where it is kept; opens no file but that.

    Raises:
        NotFoundError: The frame's file is not there.
    """
    with contextlib.suppress(OSError):
        return _cache_path(media, width, flipped, settings).read_bytes()
    return None


def make_frame_stamp(media: Media) -> str:
    """Name of a frame by content: another file under the same path has another time or size.

    The address of one in an object store says its content itself.

    Raises:
        NotFoundError: The file is not there.
    """
    if is_in_object_store(media):
        return repr((media.path, media.member))
    status = _require_regular_file(Path(media.path))
    place = (media.path, media.member, media.frame)
    return repr((*place, status.st_ino, status.st_mtime_ns, status.st_size))


def guess_content_type(data: bytes) -> str:
    """Media type by the bytes themselves; names have no say.

    Raises:
        ImageError: None of the kinds that are served.
    """
    return read_header(data).kind


def read_picture_header(media: Media) -> ImageHeader | None:
    """Size and orientation of a frame on this disk, from the beginning of its file.

    None where it lies in an object store, cannot be read, or says nothing there.
    """
    if is_in_object_store(media):
        return None
    try:
        if media.frame is not None:
            return _read_video_header(Path(media.path))
        for count in _HEADS:
            with contextlib.suppress(ImageError):
                return read_header(_read_first_bytes(media, count))
    except (NotFoundError, ImageError, StorageError):
        pass
    return None


def describe_frame(media: Media) -> str:
    """How a complaint calls a frame: by its file and its place in it, without the folder."""
    file = Path(split_pinned_address(media.path)[0]).name
    if media.member is not None:
        return f"frame {media.member} of {file}"
    return f"frame {file}" if media.frame is None else f"frame {media.frame} of {file}"


def read_video_times(
    media: Media, settings: Settings, tell: Callable[[int], None] | None = None
) -> Times:
    """When each frame of a view's video is shown; decoded where no index is kept.

    Args:
        media: A frame of the video.
        settings: Limits, and where indices are kept.
        tell: Called every now and then with how many frames are decoded; what it raises ends it.

    Raises:
        NotFoundError: The video is not there.
        ImageError: It is not a video that can be read.
        TooLargeError: It is larger than the limits, in pixels or frames.
    """
    _require_inside_root(media, settings)
    path, stamp = Path(media.path), make_video_stamp(media)
    known = read_cached_index(stamp, settings)
    if known is not None:
        return known
    check_size(_read_video_header(path), settings, path.name)
    return make_index(path, stamp, settings, tell)


def read_declared_frame_count(media: Media) -> int:
    """How many frames a view's video promises to have, which is a guess.

    Raises:
        NotFoundError: The video is not there.
        ImageError: It is not a video that can be read.
    """
    path = Path(media.path)
    _require_regular_file(path)
    with open_video(path) as video:
        if not video.isOpened():
            raise ImageError(f"{path.name} is not a video that can be read")
        return int(video.get(cv2.CAP_PROP_FRAME_COUNT))


def has_video_index(media: Media, settings: Settings) -> bool:
    """Whether the index of a view's video is kept.

    Raises:
        NotFoundError: The video is not there.
    """
    return read_cached_index(make_video_stamp(media), settings) is not None


def make_video_stamp(media: Media) -> str:
    """Name of the content of a view's video.

    Raises:
        NotFoundError: The video is not there.
    """
    return make_frame_stamp(replace(media, frame=None))


def read_media_size_and_crc(media: Media, whole: bool = False) -> dict[str, int]:
    """Size in bytes, and CRC-32 where an archive knows it; empty when the file is gone.

    Empty, too, of a frame in an object store: it is known by its address.

    Args:
        media: Where it lies.
        whole: Read a picture that is a file of its own for its CRC-32; videos are too large for that.
    """
    if is_in_object_store(media):
        return {}
    try:
        status = _require_regular_file(Path(media.path))
        if media.member is None:
            facts = {"bytes": status.st_size}
            if whole and media.frame is None:
                facts["crc32"] = _read_crc(Path(media.path))
            return facts
        size, crc = _ARCHIVES.read_size_and_crc(Path(media.path), media.member)
    except (NotFoundError, ImageError, StorageError):
        return {}
    return {"bytes": size, "crc32": crc}


def is_same_picture(old: Media, new: Media) -> bool | None:
    """Whether two frames show the same picture; None where that is not known.

    Files that are gone, videos and object stores, which would have to be fetched, tell nothing.
    """
    if old == new:
        return True
    facts = read_media_size_and_crc(old), read_media_size_and_crc(new)
    if old.frame is not None or new.frame is not None or not all(facts):
        return None
    if facts[0]["bytes"] != facts[1]["bytes"]:
        return False
    if "crc32" in facts[0] and "crc32" in facts[1]:
        return facts[0]["crc32"] == facts[1]["crc32"]
    try:
        contents = [_read_first_bytes(media, facts[0]["bytes"]) for media in (old, new)]
    except (NotFoundError, ImageError, StorageError):
        return None
    return contents[0] == contents[1]


def has_member(media: Media, member: str) -> bool:
    """Whether the archive that a frame lies in has a member of that name.

    Raises:
        NotFoundError, ImageError, StorageError: The archive is not there, damaged or unreadable.
    """
    path = Path(media.path)
    _require_regular_file(path)
    return _ARCHIVES.has(path, member)


def _decode_frame(media: Media, settings: Settings) -> Any:
    if media.frame is not None:
        return _read_video_frame(media, settings)
    return _decode_pixels(_read_image_bytes(media, settings), settings, describe_frame(media))


def _read_image_bytes(media: Media, settings: Settings) -> bytes:
    if is_in_object_store(media):
        return read_object(media, settings)
    path = Path(media.path)
    size = _require_regular_file(path).st_size
    if media.member is not None:
        return _ARCHIVES.read(path, media.member, settings.max_file_bytes)
    if size > settings.max_file_bytes:
        raise TooLargeError(f"{path.name} is larger than {settings.max_file_bytes} bytes")
    return _read_file(path, size)


def _read_first_bytes(media: Media, count: int) -> bytes:
    path = Path(media.path)
    _require_regular_file(path)
    if media.member is not None:
        return _ARCHIVES.read_first_bytes(path, media.member, count)
    return _read_file(path, count)


def _read_file(path: Path, count: int) -> bytes:
    with _open_file(path) as file:
        return file.read(count)


def _read_crc(path: Path) -> int:
    crc = 0
    with _open_file(path) as file:
        while chunk := file.read(_CHUNK):
            crc = zlib.crc32(chunk, crc)
    return crc


@contextlib.contextmanager
def _open_file(path: Path) -> Iterator[IO[bytes]]:
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file:
            yield file
    except OSError as error:
        raise StorageError(f"{path.name} cannot be read") from error


def decode_frame(media: Media, flipped: bool, settings: Settings) -> npt.NDArray[np.uint8]:
    """The pixels of a view's frame as its annotations see it: red green blue, shape (H, W, 3).

    Args:
        media: Where it lies.
        flipped: Turn the mirrored picture of this camera right.
        settings: Limits.

    Raises:
        NotFoundError: The file, member or video frame is not there.
        ImageError: It is no image of these kinds, or damaged.
        TooLargeError: It is larger than the limits, in bytes, declared pixels or scans.
    """
    _require_inside_root(media, settings)
    return to_rgb_as_annotated(_decode_frame(media, settings), flipped)


def to_rgb_as_annotated(picture: Any, flipped: bool) -> npt.NDArray[np.uint8]:
    """Red green blue, and turned right where it is mirrored."""
    return np.ascontiguousarray((cv2.flip(picture, 1) if flipped else picture)[:, :, ::-1])


def decode_picture(data: bytes, settings: Settings, name: str) -> npt.NDArray[np.uint8]:
    """The pixels of a JPEG, PNG or WebP: red green blue, shape (H, W, 3).

    Args:
        data: Its bytes.
        settings: Limits.
        name: How a complaint calls it.

    Raises:
        ImageError: It is no image of these kinds, or damaged.
        TooLargeError: It declares more pixels than the limits allow, or has too many scans.
    """
    return np.ascontiguousarray(_decode_pixels(data, settings, name)[:, :, ::-1])


def _decode_pixels(data: bytes, settings: Settings, name: str) -> Any:
    header = read_header(data, name)
    check_size(header, settings, name)
    if header.kind == JPEG:
        check_jpeg_scans(data, name)
    try:
        picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), _FLAGS)
    except cv2.error as error:
        if error.code == cv2.Error.StsNoMem:
            raise MemoryError from error
        raise ImageError(f"{name} is damaged") from error
    if picture is None:
        _require_memory(header)
        raise ImageError(f"{name} is damaged")
    picture = _turn_upright(picture, header.orientation)
    _require_declared_size(picture, header, name)
    return picture


def _turn_upright(picture: Any, orientation: int) -> Any:
    """Stored pixels as people see them."""
    if orientation in SIDEWAYS:
        picture = cv2.transpose(picture)
    match orientation:
        case 2 | 6:
            return cv2.flip(picture, 1)
        case 3 | 7:
            return cv2.flip(picture, -1)
        case 4 | 8:
            return cv2.flip(picture, 0)
    return picture


def _require_memory(header: ImageHeader) -> None:
    """Raise MemoryError where a decoder has not the memory for a picture: OpenCV's for PNG then says
    the same as of a damaged one."""
    np.empty((header.height, header.width, _DECODED_BYTES), np.uint8)


def _require_declared_size(picture: Any, header: ImageHeader, name: str) -> None:
    height, width = picture.shape[:2]
    if (width, height) != (header.width, header.height):
        raise ImageError(f"{name} is not of the size that its header declares")


def _read_video_frame(media: Media, settings: Settings) -> Any:
    path, number = Path(media.path), media.frame or 0
    times = read_video_times(media, settings)
    if not 0 <= number < len(times):
        raise NotFoundError(
            f"{path.name} has no frame {number}; it has {plural(len(times), 'frame')}"
        )
    picture = read_frame_at(path, number, times)
    if picture is None:
        raise NotFoundError(f"frame {number} of {path.name} cannot be decoded")
    # A stream may change its size on the way.
    height, width = picture.shape[:2]
    check_size(ImageHeader("video", width, height), settings, path.name)
    return picture


def _read_video_header(path: Path) -> ImageHeader:
    _require_regular_file(path)
    with open_video(path) as video:
        if not video.isOpened():
            raise ImageError(f"{path.name} is not a video that can be read")
        return ImageHeader(
            "video",
            int(video.get(cv2.CAP_PROP_FRAME_WIDTH)),
            int(video.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        )


def _shrink_to_width(picture: Any, width: int | None) -> Any:
    height, present = picture.shape[:2]
    if width is None or width >= present:
        return picture
    size = (max(width, 1), max(round(height * width / present), 1))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _encode_jpeg(picture: Any) -> bytes:
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        raise ImageError("the image cannot be encoded as JPEG")
    return bytes(data)


def _cache_path(media: Media, width: int | None, flipped: bool, settings: Settings) -> Path:
    """Where what is made of a frame is kept."""
    key = repr((make_frame_stamp(media), width, flipped, JPEG_QUALITY, _CACHE_VERSION))
    name = hashlib.sha256(key.encode()).hexdigest()
    return settings.cache / "frames" / name[:2] / f"{name[2:34]}.jpg"


def _require_regular_file(path: Path) -> os.stat_result:
    try:
        status = path.lstat()
    except OSError as error:
        raise NotFoundError(
            f"the file {path.name} is no longer in the place that it was imported from"
        ) from error
    if stat.S_ISLNK(status.st_mode):
        raise NotFoundError(
            f"{path.name} is now a symbolic link, which the server does not follow", hint=LINK_HINT
        )
    if not stat.S_ISREG(status.st_mode):
        raise NotFoundError(f"{path.name} is not a file")
    return status


def _require_inside_root(media: Media, settings: Settings) -> None:
    """Refuse a file that a folder on its way, swapped for a link, leads out of its root."""
    if is_in_object_store(media):
        return
    path = Path(media.path)
    for root in (settings.home, *settings.import_folders):
        if not path.is_relative_to(root.absolute()):
            continue
        if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(root)):
            raise NotFoundError(
                f"{path.name} is reached through a symbolic link that leads out of its folder",
                hint=LINK_HINT,
            )


def _write_to_cache(place: Path, data: bytes) -> None:
    """Write into the cache, whole or not at all; a full disk costs the cache and no picture."""
    with contextlib.suppress(OSError):
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        replace_file(place, data)
