"""The size of an image that a record states beside its lines or its camera."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.datasets import fields
from app.soccer.frames import MAX_SIDE, ImageSize

_SIDES = (("width", "height"), ("image_width", "image_height"), ("imageWidth", "imageHeight"))
_PAIRS = ("image_size", "img_size", "resolution")


def stated_size(value: Mapping[str, Any]) -> ImageSize | None:
    """Width and height in pixels; None where the record states none that an image can have.

    Example:
        >>> stated_size({"image_size": [1280, 720]})
        ImageSize(width=1280, height=720)
    """
    pairs = [[value.get(width), value.get(height)] for width, height in _SIDES]
    for pair in (*pairs, *(value.get(name) for name in _PAIRS)):
        try:
            width, height = map(fields.whole, fields.numbers(pair, 2))
        except ValueError:
            continue
        if min(width, height) >= 2 and max(width, height) <= MAX_SIDE:
            return ImageSize(width, height)
    return None
