"""The size that an image's header declares, read before anything is decoded.

A small file can declare a picture that takes gigabytes to decode, so the header decides first.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from io import BytesIO

from PIL import Image

from app.config import Settings
from app.errors import ImageError, TooLargeError

JPEG, PNG, WEBP = "image/jpeg", "image/png", "image/webp"
_KINDS = {"JPEG": JPEG, "MPO": JPEG, "PNG": PNG, "WEBP": WEBP}
"""By Pillow's names; a JPEG with further pictures behind it is one of MPO."""
_BROKEN = (OSError, SyntaxError, ValueError, IndexError, KeyError, EOFError, struct.error)
"""What Pillow raises over a damaged header."""

# The limits are those of the settings, see ``check_size``.
Image.MAX_IMAGE_PIXELS = None


@dataclass(frozen=True)
class ImageHeader:
    """Kind (media type) and declared size in pixels."""

    kind: str
    width: int
    height: int


def read_header(data: bytes, name: str = "the image") -> ImageHeader:
    """Kind and size of an image; nothing is decoded.

    Args:
        data: Its bytes.
        name: How a complaint calls it.

    Raises:
        ImageError: Neither JPEG, PNG nor WebP, or its header is damaged.
    """
    try:
        with Image.open(BytesIO(data), formats=("JPEG", "PNG", "WEBP")) as image:
            return ImageHeader(_KINDS[image.format or ""], *image.size)
    except _BROKEN as error:
        known = data.startswith((b"\xff\xd8\xff", b"\x89PNG", b"RIFF"))
        problem = "is damaged in its header" if known else "is no JPEG, PNG or WebP image"
        raise ImageError(f"{name} {problem}") from error


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
