"""Polylines in an image: clipping at the border, distance of points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray, require_shape
from app.geometry.polyline_kernels import clip_polyline_into, nearest_places


def inside_image(points: FloatArray, width: int, height: int) -> npt.NDArray[np.bool_]:
    """Whether 0 <= x < width and 0 <= y < height, shape (N,); NaN is not inside."""
    x, y = points.T
    inside: npt.NDArray[np.bool_] = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return inside


def clip_polyline(points: FloatArray, width: int, height: int) -> FloatArray:
    """The part of a polyline inside an image, joined into one polyline, shape (M, 2).

    Where the polyline crosses the border between two points, the crossing is added. Points that
    could not be projected are passed over, so its neighbours count as joined. This is how the
    public sn-calibration evaluator clips, to the letter: inside is 0 <= x < width and
    0 <= y < height; of the crossings of the line with x = 0, x = width - 1, y = 0 and
    y = height - 1 the one nearest to the inner point is taken, which is the opposite border
    where one step spans most of the image.

    Args:
        points: Pixels, NaN where a point could not be projected, shape (N, 2).
        width: Pixels.
        height: Pixels.

    Returns:
        Empty when no point lies inside: a polyline that only crosses is not visible.
    """
    points = require_shape(points, (None, 2), "points")
    room = np.empty((2 * len(points), 2))
    return room[: clip_polyline_into(np.ascontiguousarray(points), width, height, room)].copy()


def distance_to_polyline(points: FloatArray, polyline: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance of points to a polyline and the nearest places on it.

    Args:
        points: Pixels, shape (N, 2).
        polyline: Pixels, shape (M, 2), M >= 1.

    Returns:
        Distances, shape (N,), and nearest places, shape (N, 2).

    Example:
        >>> line = np.array([[0.0, 0.0], [10.0, 0.0]])
        >>> distance_to_polyline(np.array([[4.0, 3.0], [13.0, 4.0]]), line)[0]
        array([3., 5.])
    """
    points = require_shape(points, (None, 2), "points")
    polyline = require_shape(polyline, (None, 2), "polyline")
    if len(polyline) == 1:
        nearest = np.repeat(polyline, len(points), axis=0)
        return np.hypot(*(points - nearest).T), nearest
    apart, nearest = np.empty(len(points)), np.empty((len(points), 2))
    nearest_places(np.ascontiguousarray(points), np.ascontiguousarray(polyline), apart, nearest)
    return apart, nearest
