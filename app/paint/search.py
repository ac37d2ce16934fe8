"""Search: from the paint of one frame to a few cameras worth snapping, best first.

Candidates that lay one marking on one piece of paint get a first look at few points of the
paint; the best are drawn onto the nearest markings and get a second look at all of it. Cameras
that show the same are kept once.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import KAPPA, PARAMETERS, ROLL, X, Z, camera_from_parameters
from app.paint import scoring_kernels as kernels
from app.paint.candidates import CameraSearchSpace, find_candidate_cameras
from app.soccer.pitch import MARKINGS, Arc, Pitch

CELL_M = 0.25
RIM_M = 6.0
"""Metres around the pitch of which the nearest marking is kept."""
SPACING_M = 0.75

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class MarkingTable:
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
def build_marking_table(pitch: Pitch) -> MarkingTable:
    """The painted markings of a pitch; goals are not painted."""
    names = [name for name in MARKINGS if not name.startswith("Goal")]
    shapes = np.array([_make_marking_row(pitch, name) for name in names])
    half = np.array([pitch.length / 2 + RIM_M, pitch.width / 2 + RIM_M])
    columns, rows = (np.ceil(2 * half / CELL_M)).astype(int)
    x = -half[0] + (np.arange(columns) + 0.5) * CELL_M
    y = -half[1] + (np.arange(rows) + 0.5) * CELL_M
    dense, owner, samples = [], [], []
    for index, name in enumerate(names):
        points = pitch.sample(name, 0.1, 0.1)[:, :2]
        dense.append(points)
        owner.append(np.full(len(points), index))
        samples.append(_append_tangents(pitch.sample(name, SPACING_M, SPACING_M)[:, :2]))
    nearest = _index_nearest_points(np.vstack(dense), np.concatenate(owner), x, y)
    return MarkingTable(shapes, nearest, np.vstack(samples), -half)


def _index_nearest_points(
    points: FloatArray, owner: npt.NDArray[np.int64], x: FloatArray, y: FloatArray
) -> npt.NDArray[np.uint8]:
    """Of the points, to the centre of each cell, shape (rows, columns)."""
    from scipy.spatial import cKDTree

    cells = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    _, index = cKDTree(points).query(cells)
    return np.asarray(owner[index].reshape(len(y), len(x)), np.uint8)


def _make_marking_row(pitch: Pitch, name: str) -> tuple[float, ...]:
    shape = pitch.shapes[name]
    if isinstance(shape, Arc):
        return (1.0, *shape.center, shape.radius, 0.0)
    return (0.0, *shape.start[:2], *shape.end[:2])


def _append_tangents(points: FloatArray) -> FloatArray:
    direction = np.gradient(points, axis=0)
    return np.column_stack([points, direction / np.linalg.norm(direction, axis=1, keepdims=True)])


@dataclass(frozen=True)
class PictureToScore:
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
    def scale_from_960_wide(self) -> float:
        """Pixels for a pixel at 960 wide."""
        return int(self.field.shape[1]) / 960.0

    @property
    def half_diagonal(self) -> float:
        """Half the image diagonal, pixels."""
        return float(np.hypot(*self.field.shape)) / 2

    @staticmethod
    def of(line_like: BoolArray, field: BoolArray, center: tuple[float, float]) -> PictureToScore:
        """The picture of a frame's line-like paint."""
        missing = np.logical_not(line_like).astype(np.uint8)
        distance = np.asarray(cv2.distanceTransform(missing, cv2.DIST_L2, 3), np.float32)
        rows, columns = np.nonzero(line_like)
        pixels = np.column_stack([columns - center[0], rows - center[1]]).astype(np.float64)
        spread = _sample_evenly(pixels, POINTS)
        return PictureToScore(
            spread[:POINTS], spread[:SOME], spread[:FEW], distance, field, np.array(center)
        )


POINTS, SOME, FEW = 400, 140, 64


def _sample_evenly(pixels: FloatArray, count: int) -> FloatArray:
    """So many of the pixels, the same for the same picture, in no order of place."""
    chosen = np.random.default_rng(0).permutation(len(pixels))[:count]
    return np.ascontiguousarray(pixels[chosen])


def compute_coarse_costs(
    parameters: FloatArray, picture: PictureToScore, pitch: Pitch, reach: float, executor: Executor
) -> FloatArray:
    """Mean truncated distance of some of the paint to the markings, 0 to 1, shape (B,)."""
    return _compute_unexplained_paint(parameters, picture.few, picture, pitch, reach, executor)


def _compute_unexplained_paint(
    parameters: FloatArray,
    points: FloatArray,
    picture: PictureToScore,
    pitch: Pitch,
    reach: float,
    executor: Executor,
) -> FloatArray:
    m = build_marking_table(pitch)
    cost = np.empty(len(parameters))

    def process_slice(part: slice) -> None:
        kernels.write_unexplained_paint_cost(
            parameters[part], points, m.shapes, m.nearest, m.origin, CELL_M,
            reach * picture.scale_from_960_wide, picture.half_diagonal, cost[part],
        )  # fmt: skip

    list(executor.map(process_slice, _split_range(len(parameters))))
    return cost


def compute_cost_terms(
    parameters: FloatArray, picture: PictureToScore, pitch: Pitch, reach: float, executor: Executor
) -> FloatArray:
    """Unexplained paint, unsupported markings (0 to 1), length on and off the field, pixels.

    Shape (B, 4).
    """
    m = build_marking_table(pitch)
    result = np.empty((len(parameters), 3))

    def process_slice(part: slice) -> None:
        kernels.write_unsupported_markings(
            parameters[part], m.samples, SPACING_M, picture.distance, picture.field,
            picture.center, reach * picture.scale_from_960_wide, picture.half_diagonal, result[part],
        )  # fmt: skip

    list(executor.map(process_slice, _split_range(len(parameters))))
    cost = _compute_unexplained_paint(parameters, picture.points, picture, pitch, reach, executor)
    return np.column_stack([cost, result])


def refine_cameras(
    parameters: FloatArray,
    mean: FloatArray,
    sigma: FloatArray,
    picture: PictureToScore,
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
    m = build_marking_table(pitch)
    moved = np.ascontiguousarray(parameters).copy()
    pixels = np.asarray(scales) * picture.scale_from_960_wide

    def process_slice(part: slice) -> None:
        kernels.refine_camera_rows(
            moved[part], points, m.shapes, m.nearest, m.origin, CELL_M,
            pixels, mean[part], sigma, picture.half_diagonal,
        )  # fmt: skip

    list(executor.map(process_slice, _split_range(len(parameters), 32)))
    return moved


def _split_range(count: int, most: int = 4096) -> list[slice]:
    return [slice(first, min(first + most, count)) for first in range(0, count, most)]


FIRST_REACH_PX, SECOND_REACH_PX = 20.0, 8.0
"""Beyond these distances, at 960 wide, paint and marking have nothing to do with each other."""
SCOUTED, SEARCHED = 700, 60
SCOUT_SCALES = (24.0, 20.0, 16.0, 12.0, 8.0, 6.0)
SEARCH_SCALES = (8.0, 6.0, 4.0, 4.0, 3.0)
ROLL_SIGMA, FOCAL_SIGMA, KAPPA_SIGMA = np.radians(1.0), 0.2, 0.01
KAPPA_MEAN = 0.015
"""Broadcast lenses: what the calibrator expects, too."""
LEAST_LENGTH_PX = 150.0
"""Of markings in the picture: less determines no camera."""
COMPARED = 32
"""Points of the paint at which cameras are compared."""
SAME_PX = 12.0
"""Cameras that show the paint nearer than this to each other, at 960 wide, are the same."""


@dataclass(frozen=True)
class FoundCamera:
    """A camera of the search and how well it agrees with the paint, 0 to 1."""

    parameters: FloatArray
    camera: Camera
    score: float


def search_cameras(
    picture: PictureToScore,
    pieces: FloatArray,
    library: CameraSearchSpace,
    pitch: Pitch,
    executor: Executor,
    most: int,
    scouted: int = SCOUTED,
    searched: int = SEARCHED,
    kappa: float = KAPPA_MEAN,
) -> list[FoundCamera]:
    """The best cameras of a library, none like another.

    Args:
        picture: The paint.
        pieces: Its straight pieces (``ridges.find_straight_pieces``), pixels, shape (L, 4).
        library: Where cameras are looked for.
        pitch: The pitch.
        executor: Runs parts of it side by side; threads, as the kernels let go of the GIL.
        most: How many are wanted.
        scouted: How many candidates are drawn onto the markings.
        searched: How many of these once more, and looked at closely.
        kappa: The lens's distortion to start with.
    """
    width = float(picture.field.shape[1])
    rows = find_candidate_cameras(pieces - np.tile(picture.center, 2), library, pitch, width)
    if not len(rows):
        return []
    cost = compute_coarse_costs(rows, picture, pitch, FIRST_REACH_PX, executor)
    rows = rows[_find_smallest_indices(cost, scouted)]
    rows[:, KAPPA] = kappa
    sigma = _prior_sigma_of_library(library)
    start = rows.copy()
    start[:, ROLL] = 0.0
    rows = refine_cameras(rows, start, sigma, picture, picture.some, pitch, SCOUT_SCALES, executor)
    score = _combine_scores(
        compute_cost_terms(rows, picture, pitch, SECOND_REACH_PX, executor), picture
    )
    chosen = _find_smallest_indices(-score, searched)
    rows, start = rows[chosen], start[chosen]
    rows = refine_cameras(
        rows, start, sigma, picture, picture.points, pitch, SEARCH_SCALES, executor
    )
    score = _combine_scores(
        compute_cost_terms(rows, picture, pitch, SECOND_REACH_PX, executor), picture
    )
    return _select_distinct_cameras(rows, score, picture, most)


def _prior_sigma_of_library(library: CameraSearchSpace) -> FloatArray:
    sigma = np.full(PARAMETERS, np.inf)
    sigma[ROLL], sigma[X : Z + 1] = ROLL_SIGMA, library.position_sigma
    sigma[Z + 1], sigma[KAPPA] = FOCAL_SIGMA, KAPPA_SIGMA
    return sigma


def _combine_scores(looked: FloatArray, picture: PictureToScore) -> FloatArray:
    """Explained times supported; markings drawn where no grass is count half."""
    unexplained, unsupported, on, off = looked.T
    score = (1 - unexplained) * (1 - unsupported) * (1 - 0.5 * off / (on + off + 1))
    score = np.where(on > LEAST_LENGTH_PX * picture.scale_from_960_wide, score, 0.0)
    return np.where(np.isfinite(score), score, 0.0)


def _find_smallest_indices(cost: FloatArray, count: int) -> npt.NDArray[np.int64]:
    return np.asarray(np.argsort(cost, kind="stable")[:count], np.int64)


def _select_distinct_cameras(
    rows: FloatArray, score: FloatArray, picture: PictureToScore, most: int
) -> list[FoundCamera]:
    found: list[FoundCamera] = []
    shown: list[VisiblePaint] = []
    x0, y0 = picture.center
    for index in np.argsort(-score, kind="stable"):
        if len(found) == most or score[index] <= 0 or not np.isfinite(rows[index]).all():
            break
        camera = camera_from_parameters(rows[index], (x0, y0), picture.half_diagonal)
        if not is_view_among(shown, camera, picture):
            found.append(FoundCamera(rows[index], camera, float(score[index])))
            shown.append(find_visible_paint(camera, picture))
    return found


@dataclass(frozen=True)
class VisiblePaint:
    """Where on the grass a camera sees some of the paint.

    Attributes:
        ground: Pitch frame, metres, shape (N, 3).
        pixels: The paint, shape (N, 2).
    """

    ground: FloatArray
    pixels: FloatArray


def find_visible_paint(camera: Camera, picture: PictureToScore) -> VisiblePaint:
    """Where a camera sees some of the paint; what it sees above the horizon is left out."""
    pixels = picture.few[:COMPARED] + picture.center
    rays = camera.rays(pixels)
    down = rays[:, 2] > 1e-3 * np.linalg.norm(rays, axis=1)
    rays, pixels = rays[down], pixels[down]
    return VisiblePaint(camera.position - camera.position[2] / rays[:, 2:] * rays, pixels)


def is_view_among(shown: Sequence[VisiblePaint], other: Camera, picture: PictureToScore) -> bool:
    """Whether a camera sees the same places as one of those, or those of the pitch turned by half a turn."""
    shown = [item for item in shown if len(item.pixels) >= len(picture.few[:COMPARED]) / 2]
    if not shown:
        return False
    counts = np.array([len(item.pixels) for item in shown])
    ground = np.vstack([item.ground for item in shown])
    pixels = np.vstack([item.pixels for item in shown])
    apart = np.full((2, len(shown), counts.max()), np.inf)
    within = np.arange(counts.max()) < counts[:, None]
    for row, turn in zip(apart, (1.0, -1.0), strict=True):
        row[within] = np.hypot(*(other.project(ground * (turn, turn, 1.0)) - pixels).T)
    apart = np.sort(np.where(np.isfinite(apart), apart, np.inf))
    each = np.arange(len(shown))
    middle = 0.5 * (apart[:, each, (counts - 1) // 2] + apart[:, each, counts // 2])
    return bool((middle < SAME_PX * picture.scale_from_960_wide).any())


@cache
def get_kernel_executor() -> Executor:
    """Threads for the compiled kernels, which let go of the GIL."""
    return ThreadPoolExecutor(os.cpu_count() or 1, "propose")
