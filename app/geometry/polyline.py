"""Polylines in an image: clipping at the border, distance of points, the arc along points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from app.geometry.arrays import FloatArray, require_shape

_LEAST_POINTS = 5
"""So many points determine a conic."""
_ARC_POINTS = 360
"""Of an arc: its chords leave it by hundredths of a pixel."""
_NEAR = 0.05
"""Farther than this share of the extent of the points none of them lies from their arc."""
_LEAST_WIDTH = 1e-9
"""Narrower than this share of their extent points lie on a straight line."""


def is_inside_image(points: FloatArray, width: int, height: int) -> npt.NDArray[np.bool_]:
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
    find_nearest_places(
        np.ascontiguousarray(points), np.ascontiguousarray(polyline), apart, nearest
    )
    return apart, nearest


# Types are checked by hand from here on: numba compiles these functions from their arguments.
compiled = njit(cache=True, error_model="numpy", nogil=True)


@compiled
def find_nearest_places(points, polyline, apart, nearest):
    """Distances, shape (N,), and nearest places, shape (N, 2), written to the last two; M >= 2."""
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        for m in range(len(polyline) - 1):
            along_x = polyline[m + 1, 0] - polyline[m, 0]
            along_y = polyline[m + 1, 1] - polyline[m, 1]
            squared = max(along_x**2 + along_y**2, 1e-300)
            share = ((x - polyline[m, 0]) * along_x + (y - polyline[m, 1]) * along_y) / squared
            share = min(max(share, 0.0), 1.0)
            place_x, place_y = polyline[m, 0] + share * along_x, polyline[m, 1] + share * along_y
            distance = np.hypot(x - place_x, y - place_y)
            if m == 0 or distance < apart[n]:
                apart[n], nearest[n, 0], nearest[n, 1] = distance, place_x, place_y


@compiled
def clip_polyline_into(points, width, height, room):
    """How many points of the clipped polyline were written to ``room``, shape (2 N, 2).

    ``points`` of shape (N, 2), pixels; those that are NaN are left out, and their neighbours are
    joined. Crossings of the border are added.
    """
    count, before, was_inside = 0, -1, False
    for n in range(len(points)):
        if np.isnan(points[n, 0]):
            continue
        inside = is_inside(points[n, 0], points[n, 1], width, height)
        if before >= 0 and inside != was_inside:
            within, outside = (points[n], points[before]) if inside else (points[before], points[n])
            count += find_border_crossing(within, outside, width, height, room[count])
        if inside:
            room[count] = points[n]
            count += 1
        before, was_inside = n, inside
    return count


@compiled
def is_inside(x, y, width, height):
    """Whether a pixel lies in the image."""
    return x >= 0 and x < width and y >= 0 and y < height


@compiled
def find_border_crossing(within, outside, width, height, place):
    """1 and the crossing of the border next to ``within`` in ``place``; 0 where there is none."""
    least, found = np.inf, 0
    step_x, step_y = outside[0] - within[0], outside[1] - within[1]
    for border in range(4):
        limit = 0.0
        if border < 2:
            if step_x == 0:
                continue
            limit = 0.0 if border == 0 else width - 1.0
            x, y = limit, within[1] + (limit - within[0]) / step_x * step_y
        else:
            if step_y == 0:
                continue
            limit = 0.0 if border == 2 else height - 1.0
            x, y = within[0] + (limit - within[1]) / step_y * step_x, limit
        squared = (x - within[0]) ** 2 + (y - within[1]) ** 2
        if is_inside(x, y, width, height) and (found == 0 or squared < least):
            least, found = squared, 1
            place[0], place[1] = x, y
    return found


def trace_ellipse_arc(points: FloatArray) -> FloatArray | None:
    """The arc of an ellipse along points in any order, as a polyline.

    It goes from the one end of the points to the other: the widest gap between them stays open.

    Args:
        points: Pixels, shape (N, 2).

    Returns:
        Shape (360, 2); None where fewer than five points are given or they lie on no ellipse.

    Source: R. Halir, J. Flusser, "Numerically stable direct least squares fitting of ellipses", 1998.
    """
    points = require_shape(points, (None, 2), "points")
    if len(points) < _LEAST_POINTS:
        return None
    center = points.mean(axis=0)
    # The fit is the same in all affine frames; in that of the points nothing cancels.
    _, sizes, axes = np.linalg.svd(points - center, full_matrices=False)
    if not sizes[1] > _LEAST_WIDTH * sizes[0]:
        return None
    frame = axes * (sizes / np.sqrt(len(points)))[:, None]
    found = _fit_ellipse((points - center) @ np.linalg.inv(frame))
    if found is None:
        return None
    middle, root, angles = found
    angles = np.sort(angles)
    gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
    widest = int(np.argmax(gaps))
    first = angles[(widest + 1) % len(angles)]
    turn = np.linspace(first, first + 2 * np.pi - gaps[widest], _ARC_POINTS)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    arc: FloatArray = center + (middle + circle @ np.linalg.inv(root)) @ frame
    far = distance_to_polyline(points, arc)[0].max()
    return arc if far <= _NEAR * np.linalg.norm(np.ptp(points, axis=0)) else None


def _fit_ellipse(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Centre c, shape (2,), and R, shape (2, 2), with which (p - c) R lies on the unit circle for
    points p of the ellipse, and the angles there of the given ones, shape (N,)."""
    x, y = points.T
    square, linear = (
        np.column_stack([x * x, x * y, y * y]),
        np.column_stack([x, y, np.ones(len(x))]),
    )
    try:
        back = -np.linalg.solve(linear.T @ linear, linear.T @ square)
        scatter = square.T @ square + square.T @ linear @ back
        _, vectors = np.linalg.eig(np.array([scatter[2] / 2, -scatter[1], scatter[0] / 2]))
        vectors = vectors.real
        (best,) = np.flatnonzero(4 * vectors[0] * vectors[2] - vectors[1] ** 2 > 0)[:1]
        a, b, c = vectors[:, best] * np.sign(vectors[0, best])
        d, e, f = back @ (a, b, c)
        form = np.array([[a, b / 2], [b / 2, c]])
        middle = -np.linalg.solve(form, (d, e)) / 2
        root = np.linalg.cholesky(form / (middle @ form @ middle - f))
    except (np.linalg.LinAlgError, ValueError):
        return None
    u, v = ((points - middle) @ root).T
    return middle, root, np.arctan2(v, u)
