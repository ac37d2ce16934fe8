"""Pixels of COCO and YOLO: measured from the corner of the first pixel, ours from its centre."""

from __future__ import annotations

from app.soccer.frames import Box

HALF = 0.5
"""What a coordinate of theirs is larger than ours, in pixels, along x and y alike."""


def box_from_corner(box: Box) -> Box:
    """A box of COCO or YOLO in our pixel frame.

    Args:
        box: Upper left corner and size in pixels, the corner of the image's first pixel at (0, 0).

    Returns:
        The same box with the centre of the first pixel at (0, 0): half a pixel less, as large.
    """
    return Box(box.x - HALF, box.y - HALF, box.width, box.height)


def box_to_corner(box: Box) -> Box:
    """The inverse of ``box_from_corner``."""
    return Box(box.x + HALF, box.y + HALF, box.width, box.height)
