"""Starts: plausible stands from which a resection sets out."""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import ARC, LOG_FOCAL, PAN, PARAMETERS, TILT, Curves, X, Z
from app.solving.observations import Observations

STANDS: FloatArray = np.array(
    [
        # Main side, near to far and low to high.
        *[(x, 60.0, z) for x in (-25.0, 0.0, 25.0) for z in (-8.0, -20.0)],
        *[(x, 85.0, z) for x in (-20.0, 0.0, 20.0) for z in (-20.0,)],
        *[(x, 42.0, z) for x in (-45.0, -15.0, 15.0, 45.0) for z in (-4.0,)],
        # Behind the goals, in the middle and towards the corners.
        *[(x, y, z) for x in (-75.0, 75.0) for y in (-25.0, 0.0, 25.0) for z in (-5.0, -18.0)],
        # The opposite side.
        *[(x, -60.0, z) for x in (-25.0, 25.0) for z in (-5.0, -20.0)],
        # High above an end of the main side.
        *[(x, 55.0, -35.0) for x in (-50.0, 50.0)],
    ]
)
"""Camera positions in the pitch frame, metres, shape (S, 3)."""

_FOCAL_RANGE = (0.4, 12.0)
"""Plausible focal lengths as multiples of the image diagonal."""


def stand_starts(observations: Observations, diagonal: float) -> FloatArray:
    """One start for each stand, aimed and zoomed so that the seen markings lie where they are.

    Args:
        observations: What is seen.
        diagonal: Of the image, pixels.

    Returns:
        Parameters of ``geometry.resection``, shape (S, 8).
    """
    seen = np.unique(observations.marking)
    centers = _centers(observations.curves)[seen]
    lengths = _lengths(observations.curves)[seen]
    # Of a long marking perhaps a corner is seen, so its centre says little.
    weight = 1 / np.maximum(lengths, 5.0)
    weight = weight / weight.sum()
    image = np.array(
        [observations.pixels[observations.marking == index].mean(axis=0) for index in seen]
    )
    pan, tilt, spread = _aim(STANDS, weight @ centers, centers, weight)
    image_center = weight @ image
    image_spread = np.sqrt(weight @ ((image - image_center) ** 2).sum(axis=1))
    focal = max(image_spread, 0.1 * diagonal) / np.maximum(spread, 1e-3)
    focal = np.clip(focal, _FOCAL_RANGE[0] * diagonal, _FOCAL_RANGE[1] * diagonal)
    starts = np.zeros((len(STANDS), PARAMETERS))
    # Turn so that the aim appears where the annotation has it, not in the middle.
    starts[:, PAN] = pan - np.arctan(image_center[0] / focal)
    starts[:, TILT] = tilt + np.arctan(image_center[1] / focal)
    starts[:, X : Z + 1] = STANDS
    starts[:, LOG_FOCAL] = np.log(focal)
    return starts


def _aim(
    stands: FloatArray, target: FloatArray, points: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Level cameras that look at a target: pan and tilt, and how wide they see the points.

    The width is the weighted root mean square of the normalised image coordinates of the
    points in front, zero where none is; each result has shape (S,).
    """
    forward = target - stands
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    pan, tilt = np.arctan2(forward[:, 0], -forward[:, 1]), np.arccos(forward[:, 2])
    right = np.column_stack([np.cos(pan), np.sin(pan), np.zeros_like(pan)])
    lift = np.cos(tilt)
    down = np.column_stack([-lift * right[:, 1], lift * right[:, 0], np.sin(tilt)])
    offset = points[None] - stands[:, None]
    x, y, depth = (np.einsum("snk,sk->sn", offset, axis) for axis in (right, down, forward))
    in_front = depth > 1.0
    depth = np.where(in_front, depth, 1.0)
    squared = np.where(in_front, (x**2 + y**2) / depth**2, 0.0)
    return pan, tilt, np.sqrt(squared @ weight)


def _centers(curves: Curves) -> FloatArray:
    shapes = curves.shapes
    middle = (shapes[:, :3] + shapes[:, 3:]) / 2
    arcs = curves.kinds == ARC
    middle[arcs] = np.column_stack([shapes[arcs, :2], np.zeros(arcs.sum())])
    half_open = arcs & (shapes[:, 4] - shapes[:, 3] < 2 * np.pi - 1e-9)
    facing = (shapes[:, 3] + shapes[:, 4]) / 2
    middle[half_open, 0] += (shapes[:, 2] * np.cos(facing))[half_open]
    middle[half_open, 1] += (shapes[:, 2] * np.sin(facing))[half_open]
    return middle


def _lengths(curves: Curves) -> FloatArray:
    shapes = curves.shapes
    straight = np.linalg.norm(shapes[:, 3:] - shapes[:, :3], axis=1)
    return np.where(curves.kinds == ARC, 2 * shapes[:, 2], straight)
