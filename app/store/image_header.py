"""The size that an image's header declares, read before anything is decoded.

A small file can declare a picture that takes gigabytes to decode, so the header decides first.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from app.config import Settings
from app.errors import ImageError, TooLargeError

JPEG, PNG, WEBP = "image/jpeg", "image/png", "image/webp"

_PNG_START = b"\x89PNG\r\n\x1a\n"
_NO_SIZE = frozenset({0xC4, 0xC8, 0xCC})
"""JPEG markers among the frame headers that are none."""
_ALONE = frozenset({0x01, *range(0xD0, 0xD9)})
"""JPEG markers without a length."""


@dataclass(frozen=True)
class ImageHeader:
    """Kind (media type) and declared size in pixels."""

    kind: str
    width: int
    height: int


class _BrokenError(Exception):
    """What is wrong with a header, to be said of the image that it belongs to."""


def read_header(data: bytes, name: str = "the image") -> ImageHeader:
    """Kind and size of an image.

    Args:
        data: Its bytes.
        name: How a complaint calls it.

    Raises:
        ImageError: Neither JPEG, PNG nor WebP, or its header is damaged.
    """
    try:
        header = _read(data)
    except (struct.error, IndexError) as error:
        raise ImageError(f"{name} is cut off within its header") from error
    except _BrokenError as error:
        raise ImageError(f"{name} {error}") from error
    if header is None:
        raise ImageError(f"{name} is no JPEG, PNG or WebP image")
    return header


def _read(data: bytes) -> ImageHeader | None:
    """Kind and size; None when the first bytes are those of no kind."""
    if data.startswith(b"\xff\xd8\xff"):
        return ImageHeader(JPEG, *_jpeg_size(data))
    if data.startswith(_PNG_START):
        return ImageHeader(PNG, *_png_size(data))
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return ImageHeader(WEBP, *_webp_size(data))
    return None


def check_size(header: ImageHeader, settings: Settings, name: str = "the image") -> None:
    """Refuse an image that is too large to decode.

    Raises:
        ImageError: A side is zero.
        TooLargeError: Too long a side or too many pixels.
    """
    width, height = header.width, header.height
    if min(width, height) < 1:
        raise ImageError(f"{name} declares {width} x {height} pixels")
    if max(width, height) > settings.max_side or width * height > settings.max_pixels:
        raise TooLargeError(
            f"{name} declares {width} x {height} pixels; {settings.max_side} a side and "
            f"{settings.max_pixels} in all are allowed"
        )


def _png_size(data: bytes) -> tuple[int, int]:
    if data[12:16] != b"IHDR":
        raise _BrokenError("is a PNG that does not begin with its header")
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def _jpeg_size(data: bytes) -> tuple[int, int]:
    place = 2
    while True:
        if data[place] != 0xFF:
            raise _BrokenError("is a JPEG without a frame header")
        marker = data[place + 1]
        if marker == 0xFF:
            place += 1
        elif marker in _ALONE:
            place += 2
        elif 0xC0 <= marker <= 0xCF and marker not in _NO_SIZE:
            height, width = struct.unpack(">HH", data[place + 5 : place + 9])
            return width, height
        elif marker in (0xD9, 0xDA):
            raise _BrokenError("is a JPEG without a frame header")
        else:
            (length,) = struct.unpack(">H", data[place + 2 : place + 4])
            if length < 2:
                raise _BrokenError("is a JPEG with a segment without a length")
            place += 2 + length


def _webp_size(data: bytes) -> tuple[int, int]:
    chunk = data[12:16]
    if chunk == b"VP8X":
        width = 1 + int.from_bytes(_need(data, 24, 27), "little")
        return width, 1 + int.from_bytes(_need(data, 27, 30), "little")
    if chunk == b"VP8L":
        bits = int.from_bytes(_need(data, 21, 25), "little")
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    if chunk == b"VP8 ":
        width, height = struct.unpack("<HH", data[26:30])
        return width & 0x3FFF, height & 0x3FFF
    raise _BrokenError("is a WebP that holds no image")


def _need(data: bytes, start: int, end: int) -> bytes:
    if len(data) < end:
        raise IndexError
    return data[start:end]
