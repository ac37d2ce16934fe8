"""Scoring: how well cameras agree with line-like paint, thousands of them a second.

Both ways count. Paint that is explained: points of the paint are carried to the grass and from
the nearest marking back into the picture. Markings that are supported: points along the visible
markings are looked up in the distance transform of the paint. Degrees of freedom are those of
``geometry.resection``.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.paint import scoring_kernels as kernels
from app.soccer.pitch import MARKINGS, Arc, Pitch

CELL_M = 0.25
RIM_M = 6.0
"""Metres around the pitch of which the nearest marking is kept."""
SPACING_M = 0.75

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Markings:
    """The painted markings on the grass as the kernels read them.

    Attributes:
        shapes: Segments: 0, x, y, x, y. Arcs: 1, centre x and y, radius, 0. Shape (M, 5).
        nearest: Index of the nearest marking by cell, shape (rows, columns).
        samples: Points along the markings: x, y, tangent x and y, shape (N, 4).
        origin: x and y of the first cell's corner, metres, shape (2,).
    """

    shapes: FloatArray
    nearest: npt.NDArray[np.uint8]
    samples: FloatArray
    origin: FloatArray


@lru_cache(maxsize=8)
def markings_of(pitch: Pitch) -> Markings:
    """The painted markings of a pitch; goals are not painted."""
    names = [name for name in MARKINGS if not name.startswith("Goal")]
    shapes = np.array([_row(pitch, name) for name in names])
    half = np.array([pitch.length / 2 + RIM_M, pitch.width / 2 + RIM_M])
    columns, rows = (np.ceil(2 * half / CELL_M)).astype(int)
    x = -half[0] + (np.arange(columns) + 0.5) * CELL_M
    y = -half[1] + (np.arange(rows) + 0.5) * CELL_M
    dense, owner, samples = [], [], []
    for index, name in enumerate(names):
        points = pitch.sample(name, 0.1, 0.1)[:, :2]
        dense.append(points)
        owner.append(np.full(len(points), index))
        samples.append(_with_tangents(pitch.sample(name, SPACING_M, SPACING_M)[:, :2]))
    nearest = _nearest(np.vstack(dense), np.concatenate(owner), x, y)
    return Markings(shapes, nearest, np.vstack(samples), -half)


def _nearest(
    points: FloatArray, owner: npt.NDArray[np.int64], x: FloatArray, y: FloatArray
) -> npt.NDArray[np.uint8]:
    """Of the points, to the centre of each cell, shape (rows, columns)."""
    from scipy.spatial import cKDTree

    cells = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    _, index = cKDTree(points).query(cells)
    return np.asarray(owner[index].reshape(len(y), len(x)), np.uint8)


def _row(pitch: Pitch, name: str) -> tuple[float, ...]:
    shape = pitch.shapes[name]
    if isinstance(shape, Arc):
        return (1.0, *shape.center, shape.radius, 0.0)
    return (0.0, *shape.start[:2], *shape.end[:2])


def _with_tangents(points: FloatArray) -> FloatArray:
    direction = np.gradient(points, axis=0)
    return np.column_stack([points, direction / np.linalg.norm(direction, axis=1, keepdims=True)])


@dataclass(frozen=True)
class ScoredPicture:
    """What scoring reads of one frame.

    Attributes:
        points: Line-like paint relative to the principal point, pixels, shape (N, 2).
        some: A share of them, shape (S, 2).
        few: A small share of them for a first look, shape (M, 2).
        distance: To the nearest line-like paint, pixels, shape (H, W).
        field: The field of play as seen, shape (H, W).
        center: Principal point, pixels, shape (2,).
    """

    points: FloatArray
    some: FloatArray
    few: FloatArray
    distance: npt.NDArray[np.float32]
    field: BoolArray
    center: FloatArray

    @property
    def unit(self) -> float:
        """Pixels for a pixel at 960 wide."""
        return int(self.field.shape[1]) / 960.0

    @property
    def half_diagonal(self) -> float:
        """Half the image diagonal, pixels."""
        return float(np.hypot(*self.field.shape)) / 2

    @staticmethod
    def of(line_like: BoolArray, field: BoolArray, center: tuple[float, float]) -> ScoredPicture:
        """The picture of a frame's line-like paint."""
        missing = np.logical_not(line_like).astype(np.uint8)
        distance = np.asarray(cv2.distanceTransform(missing, cv2.DIST_L2, 3), np.float32)
        rows, columns = np.nonzero(line_like)
        pixels = np.column_stack([columns - center[0], rows - center[1]]).astype(np.float64)
        spread = _spread(pixels, POINTS)
        return ScoredPicture(
            spread[:POINTS], spread[:SOME], spread[:FEW], distance, field, np.array(center)
        )


POINTS, SOME, FEW = 400, 140, 64


def _spread(pixels: FloatArray, count: int) -> FloatArray:
    """So many of the pixels, the same for the same picture, in no order of place."""
    chosen = np.random.default_rng(0).permutation(len(pixels))[:count]
    return np.ascontiguousarray(pixels[chosen])


def first_look(
    parameters: FloatArray, picture: ScoredPicture, pitch: Pitch, reach: float, executor: Executor
) -> FloatArray:
    """Mean truncated distance of some of the paint to the markings, 0 to 1, shape (B,)."""
    return _unexplained(parameters, picture.few, picture, pitch, reach, executor)


def _unexplained(
    parameters: FloatArray,
    points: FloatArray,
    picture: ScoredPicture,
    pitch: Pitch,
    reach: float,
    executor: Executor,
) -> FloatArray:
    m = markings_of(pitch)
    cost = np.empty(len(parameters))

    def run(part: slice) -> None:
        kernels.unexplained(
            parameters[part], points, m.shapes, m.nearest, m.origin, CELL_M,
            reach * picture.unit, picture.half_diagonal, cost[part],
        )  # fmt: skip

    list(executor.map(run, _parts(len(parameters))))
    return cost


def second_look(
    parameters: FloatArray, picture: ScoredPicture, pitch: Pitch, reach: float, executor: Executor
) -> FloatArray:
    """Unexplained paint, unsupported markings (0 to 1), length on and off the field, pixels.

    Shape (B, 4).
    """
    m = markings_of(pitch)
    result = np.empty((len(parameters), 3))

    def run(part: slice) -> None:
        kernels.unsupported(
            parameters[part], m.samples, SPACING_M, picture.distance, picture.field,
            picture.center, reach * picture.unit, picture.half_diagonal, result[part],
        )  # fmt: skip

    list(executor.map(run, _parts(len(parameters))))
    cost = _unexplained(parameters, picture.points, picture, pitch, reach, executor)
    return np.column_stack([cost, result])


def refine(
    parameters: FloatArray,
    mean: FloatArray,
    sigma: FloatArray,
    picture: ScoredPicture,
    points: FloatArray,
    pitch: Pitch,
    scales: Sequence[float],
    executor: Executor,
) -> FloatArray:
    """The cameras moved so that paint lies on markings; what is no marking loses its weight.

    Args:
        parameters: Shape (B, 8).
        mean: Where the prior expects each camera, shape (B, 8).
        sigma: Standard deviations of the prior, shape (8,).
        picture: The frame.
        points: Paint to use, relative to the principal point, pixels, shape (N, 2).
        pitch: The pitch.
        scales: Of the robust weights, step by step, pixels at 960 wide.
        executor: Runs parts of it side by side.

    Returns:
        Shape (B, 8).
    """
    m = markings_of(pitch)
    moved = np.ascontiguousarray(parameters).copy()
    pixels = np.asarray(scales) * picture.unit

    def run(part: slice) -> None:
        kernels.refine(
            moved[part], points, m.shapes, m.nearest, m.origin, CELL_M,
            pixels, mean[part], sigma, picture.half_diagonal,
        )  # fmt: skip

    list(executor.map(run, _parts(len(parameters), 32)))
    return moved


def _parts(count: int, most: int = 4096) -> list[slice]:
    return [slice(first, min(first + most, count)) for first in range(0, count, most)]
