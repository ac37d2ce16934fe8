"""What people and datasets said about one image."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from app.soccer.frames import Box, ImagePoint

Lines = Mapping[str, tuple[ImagePoint, ...]]
"""Annotated points per marking; keys are names from ``pitch.MARKINGS``, sorted."""

CORNERS = ("x1", "y1", "x2", "y2")


def make_lines(lines: Mapping[str, Any]) -> Lines:
    """Lines from any mapping of marking to points, in the order of names; none without points."""
    return {
        marking: tuple(ImagePoint(float(x), float(y)) for x, y in lines[marking])
        for marking in sorted(lines)
        if len(lines[marking])
    }


def remove_markings(lines: Lines, markings: Collection[str]) -> Lines:
    """The lines but for some markings."""
    return make_lines({name: points for name, points in lines.items() if name not in markings})


@dataclass(frozen=True)
class BallAnnotation:
    """One ball as annotated: a box, or (ISSIA) its centre alone.

    Exactly one of ``box`` and ``point`` is set, unless the ball is out of view.
    """

    box: Box | None = None
    point: ImagePoint | None = None
    occluded: bool = False
    out_of_view: bool = False
    predicted_by: str = ""
    """The set of predictions that a person accepted it from, or what it was followed from; empty: a dataset or a
    person said it."""
    inferred: bool = False
    """Put where the 3D ball of the other views is seen: it is exported, and confirms nothing."""

    @property
    def center(self) -> ImagePoint | None:
        """Centre of the ball in the image, pixels; None when it is out of view."""
        if self.out_of_view:
            return None
        return self.box.center if self.box is not None else self.point


def format_followed_from_group(group: str) -> str:
    """What a ball says it comes from that was followed from one of another group, by its key."""
    return f"followed from {group}"


@dataclass(frozen=True)
class Extras:
    """What a dataset brings and the ball pipeline does not use; exported unchanged.

    ``boxes`` are players, referees and unclassified boxes, ``lines`` have no geometry
    (``Line unknown``, null class), ``metadata`` is the source's own record of the image.
    """

    boxes: tuple[Mapping[str, Any], ...] = ()
    lines: tuple[Mapping[str, Any], ...] = ()
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def to_plain_values(self) -> dict[str, Any] | None:
        """As plain values; None where there is nothing."""
        if not (self.boxes or self.lines or self.metadata):
            return None
        return {
            "boxes": [dict(box) for box in self.boxes],
            "lines": [dict(line) for line in self.lines],
            "metadata": dict(self.metadata),
        }

    @property
    def pixel_boxes(self) -> tuple[Box, ...]:
        """Where its boxes lie, pixels; what has no corners that are numbers is left out."""
        return tuple(box for item in self.boxes if (box := _box_from_corners(item)) is not None)


def _box_from_corners(item: Mapping[str, Any]) -> Box | None:
    """A box in the shape that all readers give them: ``{"points": {"x1", "y1", "x2", "y2"}}``."""
    try:
        left, top, right, bottom = (float(item["points"][name]) for name in CORNERS)
    except (KeyError, TypeError, ValueError):
        return None
    box = Box(min(left, right), min(top, bottom), abs(right - left), abs(bottom - top))
    return box if math.isfinite(box.x + box.y + box.width + box.height) else None
