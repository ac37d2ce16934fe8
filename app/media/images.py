"""What an image says of itself, read before anything is decoded: its size and orientation, and how
often it is drawn.

A small file can declare a picture that takes gigabytes or minutes to decode, so this decides first.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from itertools import islice

from PIL import Image

from app.config import Settings
from app.errors import ImageError, TooLargeError

JPEG, PNG, WEBP = "image/jpeg", "image/png", "image/webp"
_KINDS = {"JPEG": JPEG, "MPO": JPEG, "PNG": PNG, "WEBP": WEBP}
"""By Pillow's names; a JPEG with further pictures behind it is one of MPO."""
_BROKEN = (OSError, SyntaxError, ValueError, IndexError, KeyError, EOFError, struct.error)
"""What Pillow raises over a damaged header."""
SIDEWAYS = (5, 6, 7, 8)
"""Orientations whose stored pixels lie on their side."""
_ORIENTATION = (0x0112, 3, 1)
"""Tag, type (a short) and count of the entry."""
MAX_SCANS = 100
"""Of a JPEG; each goes through the whole picture, and a progressive one has about ten."""
_SCAN, _END = b"\xda", b"\xd9"
_MARKER = re.compile(rb"\xff([\xc0-\xcf\xd9-\xfe])")
"""What follows FF where a decoder stops to look: neither a stuffed byte of a scan's data, nor a
restart of it, nor one of the reserved ones, which a decoder that looks for a restart passes over."""

# The limits are those of the settings, see ``check_size``.
Image.MAX_IMAGE_PIXELS = None


@dataclass(frozen=True)
class ImageHeader:
    """What an image declares.

    Attributes:
        kind: Media type.
        width, height: Size in pixels as people see the picture, upright.
        orientation: Of the stored pixels, as EXIF counts (1 to 8); 1: they are stored upright.
    """

    kind: str
    width: int
    height: int
    orientation: int = 1


def read_header(data: bytes, name: str = "the image") -> ImageHeader:
    """Kind, size and orientation of an image; nothing is decoded.

    Orientation counts where browsers apply it: in a JPEG, and in a PNG before its pixels. They
    show a WebP as it is stored.

    Args:
        data: Its bytes.
        name: How a complaint calls it.

    Raises:
        ImageError: Neither JPEG, PNG nor WebP, or its header is damaged.
    """
    try:
        with Image.open(BytesIO(data), formats=("JPEG", "PNG", "WEBP")) as image:
            kind, (width, height) = _KINDS[image.format or ""], image.size
            exif = b"" if kind == WEBP else image.info.get("exif", b"")
    except _BROKEN as error:
        known = data.startswith((b"\xff\xd8\xff", b"\x89PNG", b"RIFF"))
        problem = "is damaged in its header" if known else "is not a JPEG, PNG or WebP image"
        raise ImageError(f"{name} {problem}") from error
    orientation = _read_exif_orientation(exif)
    if orientation in SIDEWAYS:
        width, height = height, width
    return ImageHeader(kind, width, height, orientation)


def _read_exif_orientation(exif: bytes) -> int:
    """The orientation that a block of EXIF declares; 1 where it declares none that counts."""
    tiff = exif.removeprefix(b"Exif\0\0")
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(tiff[:4])
    if order is None:
        return 1
    try:
        (first,) = struct.unpack_from(f"{order}I", tiff, 4)
        (count,) = struct.unpack_from(f"{order}H", tiff, first)
        for number in range(count):
            entry = struct.unpack_from(f"{order}HHIH", tiff, first + 2 + 12 * number)
            if entry[:3] == _ORIENTATION:
                return entry[3] if 1 <= entry[3] <= 8 else 1
    except struct.error:
        pass
    return 1


def check_size(header: ImageHeader, settings: Settings, name: str = "the image") -> None:
    """Refuse an image that is too large to decode.

    Raises:
        TooLargeError: Too long a side or too many pixels.
    """
    width, height = header.width, header.height
    if max(width, height) > settings.max_side or width * height > settings.max_pixels:
        raise TooLargeError(
            f"{name} declares {width} x {height} pixels; {settings.max_side} a side and "
            f"{settings.max_pixels} in all are allowed"
        )


def check_jpeg_scans(data: bytes, name: str = "the image") -> None:
    """Refuse a JPEG that draws its picture over and over.

    Args:
        data: Its bytes.
        name: How a complaint calls it.

    Raises:
        TooLargeError: It has more than ``MAX_SCANS`` scans.
    """
    if next(islice(_find_jpeg_scans(data), MAX_SCANS, None), None) is not None:
        raise TooLargeError(
            f"{name} is drawn in more than {MAX_SCANS} scans; progressive pictures have about 10"
        )


def _find_jpeg_scans(data: bytes) -> Iterator[int]:
    """Where each scan of a JPEG begins, as a decoder comes by them."""
    place = 0
    while (found := _MARKER.search(data, place)) is not None and found[1] != _END:
        if found[1] == _SCAN:
            yield found.start()
        place = found.end() + int.from_bytes(data[found.end() : found.end() + 2], "big")
