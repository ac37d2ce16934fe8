"""Polylines in an image: clipping at the border, distance of points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray, require_shape


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
    points = points[~np.isnan(points[:, 0])]
    inside = inside_image(points, width, height)
    if not inside.any():
        return np.empty((0, 2))
    parts = []
    changes = np.flatnonzero(inside[1:] != inside[:-1])
    begin = 0
    for change in changes.tolist():
        outside, within = (change, change + 1) if inside[change + 1] else (change + 1, change)
        crossing = _crossing(points[within], points[outside], width, height)
        if inside[change + 1]:
            parts.append(crossing)
        else:
            parts.extend([points[begin : change + 1], crossing])
        begin = change + 1
    if inside[-1]:
        parts.append(points[begin:])
    return np.vstack(parts)


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
    start, along = polyline[:-1], np.diff(polyline, axis=0)
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    offset = points[:, None] - start[None]
    share = np.clip((offset * along).sum(axis=2) / squared, 0.0, 1.0)
    places = start + share[:, :, None] * along
    apart = np.hypot(*np.moveaxis(points[:, None] - places, 2, 0))
    best = apart.argmin(axis=1)
    rows = np.arange(len(points))
    return apart[rows, best], places[rows, best]


def _crossing(inside: FloatArray, outside: FloatArray, width: int, height: int) -> FloatArray:
    """Crossing of the border next to ``inside``, shape (1, 2), or (0, 2) when none is within."""
    step = outside - inside
    found = []
    for axis, limit in ((0, 0.0), (0, width - 1.0), (1, 0.0), (1, height - 1.0)):
        if step[axis] == 0:
            continue
        place = inside + (limit - inside[axis]) / step[axis] * step
        place[axis] = limit
        if 0 <= place[0] < width and 0 <= place[1] < height:
            found.append(place)
    if not found:
        return np.empty((0, 2))
    nearest: FloatArray = min(found, key=lambda place: float(np.sum((place - inside) ** 2)))
    return nearest[None]
