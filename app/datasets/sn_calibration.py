"""sn-calibration: the annotated lines of one image a JSON file (``00002.json``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.group import Media

DEFAULT_SIZE = ImageSize(960, 540)
LARGEST_UNIT = 2.0
"""A file in which any coordinate lies further from 0 is in pixels."""
# SoccerNet spells this one with a space at the end; its readers look it up that way.
_SPELLING = {"Goal left post left": "Goal left post left "}


@dataclass(frozen=True)
class LineFile:
    """The lines of one image.

    Attributes:
        stem: Name of the frame, ``00002``.
        lines: Points per marking, pixels of ``size``, in the order of the file.
        others: Lines without geometry (``Line unknown``, unknown names), each as
            ``{"class": name, "points": [x1, y1, x2, y2, ...]}`` in pixels.
        media: The frame, when it lies beside the file.
        place: Path of the file in its folder or zip, without the ending.
    """

    stem: str
    size: ImageSize
    lines: Lines
    others: tuple[Mapping[str, Any], ...] = ()
    media: Media | None = None
    place: str = ""


def spelling(marking: str) -> str:
    """A marking's name as SoccerNet files spell it."""
    return _SPELLING.get(marking, marking)
