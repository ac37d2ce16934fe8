"""Paint evidence: what was seen of the painted lines of a picture, as a value that is kept."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from app.errors import InputError
from app.soccer.pitch import canonical_marking

EXTRACTOR_VERSION = "1"
"""Raised by one whenever the same picture gives other evidence."""


class PaintPoint(NamedTuple):
    """A place of paint, pixels, and its standard deviation across the marking, pixels."""

    x: float
    y: float
    sigma_px: float


@dataclass(frozen=True)
class PaintEvidence:
    """Places of paint by marking.

    Attributes:
        points: By name of the marking, sorted.
        version: Of what read the picture.
    """

    points: Mapping[str, tuple[PaintPoint, ...]]
    version: str = EXTRACTOR_VERSION

    @property
    def count(self) -> int:
        """Places in all."""
        return sum(map(len, self.points.values()))


def evidence_to_json(evidence: PaintEvidence) -> dict[str, Any]:
    """As JSON: ``{"version", "points": {marking: [[x, y, sigma_px], ...]}}``."""
    points = {name: [list(point) for point in evidence.points[name]] for name in evidence.points}
    return {"version": evidence.version, "points": points}


def evidence_from_json(value: Any) -> PaintEvidence:
    """The evidence that ``evidence_to_json`` wrote.

    Raises:
        InputError: It is none, or has a number that is not finite or a sigma that is not above 0.
        UnknownMarkingError: A name is none of the markings.
    """
    try:
        points = {
            canonical_marking(name): tuple(_point(row) for row in value["points"][name])
            for name in sorted(value["points"])
        }
        return PaintEvidence(points, str(value["version"]))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"this is no evidence of paint: {error}") from error


def _point(row: Any) -> PaintPoint:
    x, y, sigma = map(float, row)
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(sigma) and sigma > 0):
        raise ValueError(f"{row} is no place with a standard deviation")
    return PaintPoint(x, y, sigma)
