"""Search: from the paint of one frame to a few cameras worth snapping, best first.

Candidates that lay one marking on one piece of paint get a first look at few points of the
paint; the best are drawn onto the nearest markings and get a second look at all of it. Cameras
that show the same are kept once.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import KAPPA, PARAMETERS, ROLL, X, Z, camera_from_parameters
from app.paint.candidates import Library, candidates
from app.paint.scoring import ScoredPicture, first_look, refine, second_look
from app.soccer.pitch import Pitch

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
class Found:
    """A camera of the search and how well it agrees with the paint, 0 to 1."""

    parameters: FloatArray
    camera: Camera
    score: float


def search(
    picture: ScoredPicture,
    pieces: FloatArray,
    library: Library,
    pitch: Pitch,
    executor: Executor,
    most: int,
    scouted: int = SCOUTED,
    searched: int = SEARCHED,
    kappa: float = KAPPA_MEAN,
) -> list[Found]:
    """The best cameras of a library, none like another.

    Args:
        picture: The paint.
        pieces: Its straight pieces (``straight.straight_pieces``), pixels, shape (L, 4).
        library: Where cameras are looked for.
        pitch: The pitch.
        executor: Runs parts of it side by side; threads, as the kernels let go of the GIL.
        most: How many are wanted.
        scouted: How many candidates are drawn onto the markings.
        searched: How many of these once more, and looked at closely.
        kappa: The lens's distortion to start with.
    """
    width = float(picture.field.shape[1])
    rows = candidates(pieces - np.tile(picture.center, 2), library, pitch, width)
    if not len(rows):
        return []
    cost = first_look(rows, picture, pitch, FIRST_REACH_PX, executor)
    rows = rows[_smallest(cost, scouted)]
    rows[:, KAPPA] = kappa
    sigma = _sigma(library)
    start = rows.copy()
    start[:, ROLL] = 0.0
    rows = refine(rows, start, sigma, picture, picture.some, pitch, SCOUT_SCALES, executor)
    score = _score(second_look(rows, picture, pitch, SECOND_REACH_PX, executor), picture)
    chosen = _smallest(-score, searched)
    rows, start = rows[chosen], start[chosen]
    rows = refine(rows, start, sigma, picture, picture.points, pitch, SEARCH_SCALES, executor)
    score = _score(second_look(rows, picture, pitch, SECOND_REACH_PX, executor), picture)
    return _distinct(rows, score, picture, most)


def _sigma(library: Library) -> FloatArray:
    sigma = np.full(PARAMETERS, np.inf)
    sigma[ROLL], sigma[X : Z + 1] = ROLL_SIGMA, library.position_sigma
    sigma[Z + 1], sigma[KAPPA] = FOCAL_SIGMA, KAPPA_SIGMA
    return sigma


def _score(looked: FloatArray, picture: ScoredPicture) -> FloatArray:
    """Explained times supported; markings drawn where no grass is count half."""
    unexplained, unsupported, on, off = looked.T
    score = (1 - unexplained) * (1 - unsupported) * (1 - 0.5 * off / (on + off + 1))
    score = np.where(on > LEAST_LENGTH_PX * picture.unit, score, 0.0)
    return np.where(np.isfinite(score), score, 0.0)


def _smallest(cost: FloatArray, count: int) -> npt.NDArray[np.int64]:
    return np.asarray(np.argsort(cost, kind="stable")[:count], np.int64)


def _distinct(
    rows: FloatArray, score: FloatArray, picture: ScoredPicture, most: int
) -> list[Found]:
    found: list[Found] = []
    shown: list[VisiblePaint] = []
    x0, y0 = picture.center
    for index in np.argsort(-score, kind="stable"):
        if len(found) == most or score[index] <= 0 or not np.isfinite(rows[index]).all():
            break
        camera = camera_from_parameters(rows[index], (x0, y0), picture.half_diagonal)
        if not any(shows_the_same(other, camera, picture) for other in shown):
            found.append(Found(rows[index], camera, float(score[index])))
            shown.append(shown_by(camera, picture))
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


def shown_by(camera: Camera, picture: ScoredPicture) -> VisiblePaint:
    """Where a camera sees some of the paint; what it sees above the horizon is left out."""
    pixels = picture.few[:COMPARED] + picture.center
    rays = camera.rays(pixels)
    down = rays[:, 2] > 1e-3 * np.linalg.norm(rays, axis=1)
    rays, pixels = rays[down], pixels[down]
    return VisiblePaint(camera.position - camera.position[2] / rays[:, 2:] * rays, pixels)


def shows_the_same(shown: VisiblePaint, other: Camera, picture: ScoredPicture) -> bool:
    """Whether another camera sees the same places, or those of the pitch turned by half a turn."""
    if len(shown.pixels) < len(picture.few[:COMPARED]) / 2:
        return False
    for turn in (1.0, -1.0):
        apart = np.hypot(*(other.project(shown.ground * (turn, turn, 1.0)) - shown.pixels).T)
        if np.median(np.where(np.isfinite(apart), apart, np.inf)) < SAME_PX * picture.unit:
            return True
    return False
