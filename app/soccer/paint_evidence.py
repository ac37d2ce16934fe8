"""Paint evidence: what was seen of the painted lines of a picture, as a value that is kept."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, get_args

import numpy as np

from app.errors import InputError
from app.json_text import digest_content
from app.soccer.annotation import Lines, make_lines
from app.soccer.choices import ProposalOutcome
from app.soccer.frames import ImagePoint
from app.soccer.pitch import canonical_marking

EXTRACTOR_VERSION = "2"
"""Raised by one whenever the same picture gives other evidence."""
NO_PAINT, PAINT_DISAGREES, NO_FRAME = "no_paint", "paint_disagrees", "no_frame"
"""Why a camera stays that of its clicks: too little paint, paint that contradicts them, and a
picture that is missing or cannot be read."""
POINTS_PER_MARKING = 12
"""Points that lines have of each marking of evidence; more say nothing more."""


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

    def thin_points(self) -> Lines:
        """At most ``POINTS_PER_MARKING`` places of each marking, spread along it."""
        lines = {}
        for marking, points in self.points.items():
            chosen = np.linspace(0, len(points) - 1, min(len(points), POINTS_PER_MARKING))
            chosen = chosen.round().astype(int)
            places = (points[index] for index in np.unique(chosen).tolist())
            lines[marking] = [ImagePoint(place.x, place.y) for place in places]
        return make_lines(lines)


PROPOSAL_OUTCOMES: tuple[ProposalOutcome, ...] = get_args(ProposalOutcome)


class TripodPitchCamera(NamedTuple):
    """The camera of a frame on the pitch that the frames of its tripod show together.

    Attributes:
        parameters: Of ``geometry.resection``, eight numbers.
        covariance: Of them, 8 x 8, row by row.
    """

    parameters: tuple[float, ...]
    covariance: tuple[float, ...]


@dataclass(frozen=True)
class PaintReading:
    """What was read of the paint in the picture of one view.

    Attributes:
        frame: Digest of the picture's bytes; empty where there are none.
        sought_for: Key of the camera of the clicks that it was sought from (``compute_paint_search_key``): of
            other clicks it says nothing.
        evidence: Places of paint, pixels of the annotated size.
        reason: Why it is not solved with, ``no_paint``, ``paint_disagrees`` or ``no_frame``; None
            where it is.
        supported: Agreement of the camera that was found with the picture (``paint.agreement``);
            None where nothing was measured.
        explained: The same of the paint that lies near a marking.
        people: Digest of the boxes in which nothing was believed; empty where there were none.
        tripod: What the main cameras of its match know together (``solving.match_tripod``); None:
            nothing, and what nobody knows of the pitch is in the covariance of its camera.
    """

    frame: str
    sought_for: str
    evidence: PaintEvidence
    reason: str | None = None
    supported: float | None = None
    explained: float | None = None
    people: str = ""
    tripod: TripodPitchCamera | None = None

    @cached_property
    def canonical_json(self) -> str:
        """The one JSON text of it."""
        return json.dumps(
            reading_to_json(self),
            sort_keys=True,
            separators=(",", ":"),
            ensure_ascii=False,
            allow_nan=False,
        )

    @cached_property
    def digest(self) -> str:
        """Digest of all of it, 32 hexadecimal digits."""
        return digest_content(self.canonical_json.encode())


def reading_to_json(reading: PaintReading) -> dict[str, Any]:
    """As JSON; what was not measured is null, and ``people`` and ``tripod`` are there where there are any."""
    value: dict[str, Any] = {
        "frame": reading.frame,
        "sought_for": reading.sought_for,
        "evidence": evidence_to_json(reading.evidence),
        "reason": reading.reason,
        "supported": reading.supported,
        "explained": reading.explained,
    }
    if reading.people:
        value["people"] = reading.people
    if reading.tripod is not None:
        value["tripod"] = [list(numbers) for numbers in reading.tripod]
    return value


def reading_from_json(value: Any) -> PaintReading:
    """The reading that ``reading_to_json`` wrote.

    Raises:
        InputError: It is none.
    """
    try:
        supported, explained = (
            None if (share := value[name]) is None else float(share)
            for name in ("supported", "explained")
        )
        return PaintReading(
            str(value["frame"]),
            str(value["sought_for"]),
            evidence_from_json(value["evidence"]),
            None if value["reason"] is None else str(value["reason"]),
            supported,
            explained,
            str(value.get("people", "")),
            _tripod_from_json(value.get("tripod")),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"this is not a valid paint measurement: {error}") from error


def _tripod_from_json(value: Any) -> TripodPitchCamera | None:
    if value is None:
        return None
    parameters, covariance = (tuple(map(float, numbers)) for numbers in value)
    finite = all(map(math.isfinite, parameters + covariance))
    if not finite or (len(parameters), len(covariance)) != (8, 64):
        raise ValueError("the camera of a tripod must have 8 numbers, and its covariance 64")
    return TripodPitchCamera(parameters, covariance)


def reading_from_canonical_json(text: str) -> PaintReading:
    """The reading whose text this is; its digest is that of the text.

    Raises:
        InputError: It is none.
    """
    try:
        reading = reading_from_json(json.loads(text))
    except json.JSONDecodeError as error:
        raise InputError(f"this is not a valid paint measurement: {error}") from error
    # It need not be written again to be digested.
    vars(reading)["canonical_json"] = text
    return reading


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
            canonical_marking(name): _paint_points_from_rows(value["points"][name])
            for name in sorted(value["points"])
        }
        return PaintEvidence(points, str(value["version"]))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"these are not valid paint points: {error}") from error


def _paint_points_from_rows(rows: Any) -> tuple[PaintPoint, ...]:
    points = tuple(PaintPoint(float(x), float(y), float(sigma)) for x, y, sigma in rows)
    if not math.isfinite(sum(map(sum, points))) or any(not point.sigma_px > 0 for point in points):
        raise ValueError("a point is not x, y and a standard deviation above zero")
    return points
