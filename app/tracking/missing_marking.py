"""A camera whose next marking lies elsewhere: the straight line that is there tells where it stands.

A camera that was found from a circle and a touchline may stand metres off and still lie on both.
Once the middle line comes into the picture, its paint lies far beside where the camera expects it,
farther than paint is sought. A straight line near the missing marking is then taken for it, and a
camera is made anew from what was seen and this line.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from app.errors import GeometryError
from app.geometry.arrays import FloatArray, IntArray
from app.geometry.camera import Camera
from app.paint.evidence import (
    DetectedPaint,
    has_grass_beside,
    to_paint_evidence,
    trace_visible_markings,
)
from app.paint.ridges import NEAR_PX, find_straight_pieces, measure_along_piece
from app.paint.snap import SnappedCamera
from app.paint.tracing import TracedPlaces
from app.soccer.annotation import make_lines
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.pitch import MARKINGS, Arc, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate
from app.solving.sides import turn_camera
from app.tracking.picture import FramePicture

MOST_PIECES, LEAST_PIECE_PX = 12, 80.0
"""Straight pieces that are looked at, and how long one has to be, pixels at 960 wide."""
MOST_ASIDE_PX, MOST_ASKEW_DEGREES = 70.0, 20.0
"""How far from a missing marking its paint may lie, at 960 wide, and by how much it may be turned."""
LEAST_PLACES, LEAST_SEEN_SHARE, GRASS_PX = 8, 0.25, 3.0
"""A marking is missing that has so many visible places and paint at fewer than this share of them."""
ON_PIECE = 5
"""Points of a piece that stand for its marking."""


def propose_missing_marking_cameras(
    picture: FramePicture, snapped: SnappedCamera, pitch: Pitch, policy: CalibrationPolicy
) -> Iterator[Camera]:
    """Cameras that lie on the paint that was seen and on a straight line that a missing marking may be.

    Args:
        picture: The frame.
        snapped: A camera that lies on some of its markings, pixels of the picture.
        pitch: The pitch.
        policy: Prior of the distortion.

    Yields:
        Cameras in pixels of the picture, for the nearest line first; none is sure to be right.
    """
    height, width = snapped.size
    unit = width / 960
    traced = trace_visible_markings(picture.reading, snapped.camera, pitch)
    missing = _find_missing_straight_markings(picture, snapped.evidence, traced, pitch)
    if not len(missing):
        return
    seen = dict(to_paint_evidence(snapped.evidence).thin_points())
    pieces = find_straight_pieces(picture.paint, MOST_PIECES)
    pairs = [
        (aside, index, piece)
        for index in missing.tolist()
        for piece in pieces
        if not _is_explained(piece, snapped.evidence.pixels, unit)
        and (aside := _median_distance_beside(piece, traced.pixels[traced.marking == index], unit))
        is not None
    ]
    for _, index, piece in sorted(pairs, key=lambda pair: pair[0]):
        ends = np.linspace(piece[:2], piece[2:], ON_PIECE)
        lines = {**seen, MARKINGS[index]: [ImagePoint(x, y) for x, y in ends.tolist()]}
        try:
            found = calibrate(make_lines(lines), pitch, ImageSize(width, height), policy)
        except GeometryError:
            continue
        if found.camera is not None:
            # Lines do not tell a camera from the one opposite, and are taken for the near side.
            opposite = found.camera.position[:2] @ snapped.camera.position[:2] < 0
            yield turn_camera(found.camera) if opposite else found.camera


def _find_missing_straight_markings(
    picture: FramePicture, evidence: DetectedPaint, traced: TracedPlaces, pitch: Pitch
) -> IntArray:
    """Indices into ``MARKINGS`` of the straight markings that would be seen and have no paint."""
    reading = picture.reading
    usable = has_grass_beside(reading, traced, GRASS_PX * reading.width / 960)
    shown = np.bincount(traced.marking[usable], minlength=len(MARKINGS))
    seen = np.bincount(evidence.traced.marking, minlength=len(MARKINGS))
    straight = np.array([not isinstance(pitch.shapes.get(name), Arc) for name in MARKINGS])
    missing = straight & (shown >= LEAST_PLACES) & (seen < LEAST_SEEN_SHARE * shown)
    return np.flatnonzero(missing)


def _is_explained(piece: FloatArray, paint: FloatArray, unit: float) -> bool:
    """Whether the paint that was seen already lies along a piece."""
    along, across, length = measure_along_piece(paint, piece)
    beside = (across < 2 * NEAR_PX * unit) & (along > 0) & (along < length)
    return bool(np.ptp(along[beside]) > length / 2) if beside.any() else False


def _median_distance_beside(piece: FloatArray, marking: FloatArray, unit: float) -> float | None:
    """How far a piece lies beside a marking in the median, pixels; None where it is no candidate."""
    way, along = piece[2:] - piece[:2], marking[-1] - marking[0]
    if np.hypot(*way) < LEAST_PIECE_PX * unit or not along.any():
        return None
    cosine = abs(way @ along) / (np.hypot(*way) * np.hypot(*along))
    if cosine < np.cos(np.radians(MOST_ASKEW_DEGREES)):
        return None
    places = np.linspace(piece[:2], piece[2:], ON_PIECE)
    apart = np.hypot(*np.moveaxis(places[:, None] - marking[None], 2, 0)).min(axis=1)
    aside = float(np.median(apart))
    return aside if aside < MOST_ASIDE_PX * unit else None
