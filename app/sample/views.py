"""Many trial cameras at once: what each would see of the markings, in arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.geometry.camera import MIN_DEPTH
from app.soccer.pitch import CIRCLES, MARKINGS, Pitch

WIDTH, HEIGHT = 1280, 720
CENTER = np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2])
CORNER_RADIUS = float(np.hypot(*CENTER))
PITCH = Pitch()


Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class MarkingPoints:
    """Points along every marking of the pitch, one after the other.

    Attributes:
        points: Pitch frame, metres, shape (N, 3).
        tangents: Unit direction of the marking at each point, shape (N, 3).
        starts: Where each marking of ``MARKINGS`` begins, shape (26,).
        ends: Where it ends (exclusive), shape (26,).
        marking: Number of the marking of each point, shape (N,).
        runs_along_x: Whether each marking is straight and parallel to x, shape (26,).
        runs_along_y: The same for y; the goals' parts count as neither.
    """

    points: FloatArray
    tangents: FloatArray
    starts: Indices
    ends: Indices
    marking: Indices
    runs_along_x: Mask
    runs_along_y: Mask


def sample_marking_points(spacing: float, fewest: int) -> MarkingPoints:
    """Sample the markings at most ``spacing`` metres apart, each at ``fewest`` points or more."""
    points, tangents, counts = [], [], []
    for marking in MARKINGS:
        dense = PITCH.sample(marking, 0.1, 0.1)
        # Circles bend, so their samples stand twice as close.
        wanted = spacing / (2 if marking in CIRCLES else 1)
        step = max(1, min(int(wanted / 0.1), (len(dense) - 1) // (fewest - 1)))
        keep = np.unique(np.append(np.arange(0, len(dense), step), len(dense) - 1))
        direction = np.gradient(dense, axis=0)[keep]
        points.append(dense[keep])
        tangents.append(direction / np.linalg.norm(direction, axis=1, keepdims=True))
        counts.append(len(keep))
    ends = np.cumsum(counts, dtype=np.int64)
    straight = [name not in CIRCLES and not name.startswith("Goal") for name in MARKINGS]
    first = [tangent[0] for tangent in tangents]
    return MarkingPoints(
        points=np.vstack(points),
        tangents=np.vstack(tangents),
        starts=ends - np.array(counts, dtype=np.int64),
        ends=ends,
        marking=np.repeat(np.arange(len(MARKINGS)), counts),
        runs_along_x=np.array(
            [s and abs(t[0]) > 0.99 for s, t in zip(straight, first, strict=True)]
        ),
        runs_along_y=np.array(
            [s and abs(t[1]) > 0.99 for s, t in zip(straight, first, strict=True)]
        ),
    )


COARSE = sample_marking_points(spacing=3.0, fewest=5)
FINE = sample_marking_points(spacing=0.6, fewest=9)


@dataclass(frozen=True)
class TrialCameras:
    """Trial cameras: position (N, 3), pan, tilt, roll in radians, focal length, k1, all (N,)."""

    position: FloatArray
    pan: FloatArray
    tilt: FloatArray
    roll: FloatArray
    focal: FloatArray
    k1: FloatArray

    @property
    def rotation(self) -> FloatArray:
        """Pitch to camera, shape (N, 3, 3); the same as ``rotation_from_pan_tilt_roll``."""
        cp, sp = np.cos(self.pan), np.sin(self.pan)
        ct, st = np.cos(self.tilt), np.sin(self.tilt)
        cr, sr = np.cos(self.roll), np.sin(self.roll)
        rows = [
            [cp * cr - sp * ct * sr, sp * cr + cp * ct * sr, st * sr],
            [-cp * sr - sp * ct * cr, -sp * sr + cp * ct * cr, st * cr],
            [sp * st, -cp * st, ct],
        ]
        return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def project_trials(trials: TrialCameras, points: FloatArray) -> FloatArray:
    """Pixels of every point under every trial camera, NaN where not visible, shape (N, M, 2).

    Args:
        points: Pitch frame, metres, shape (M, 3).
    """
    offset = points[None] - trials.position[:, None]
    # Sums of three products, written out: no BLAS, so the same bits on every machine.
    R = trials.rotation[:, None]
    x, y, z = (
        R[..., i, 0] * offset[..., 0]
        + R[..., i, 1] * offset[..., 1]
        + R[..., i, 2] * offset[..., 2]
        for i in range(3)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = x / z, y / z
        r2 = x * x + y * y
        k1 = trials.k1[:, None]
        visible = (z > MIN_DEPTH) & (3 * k1 * r2 > -1.0)
        scale = np.where(visible, trials.focal[:, None] * (1 + k1 * r2), np.nan)
    return np.stack([x * scale + CENTER[0], y * scale + CENTER[1]], axis=-1)


def is_inside_image(pixels: FloatArray, margin: float = 0.0) -> Mask:
    """Whether each pixel lies in the image, at least ``margin`` pixels from its border."""
    with np.errstate(invalid="ignore"):
        x, y = pixels[..., 0], pixels[..., 1]
        return (
            (x >= margin) & (x <= WIDTH - 1 - margin) & (y >= margin) & (y <= HEIGHT - 1 - margin)
        )


def count_seen_points(seen: Mask, skeleton: MarkingPoints) -> Indices:
    """How many points of each marking are seen, (..., N) booleans to (..., 26) counts."""
    return np.add.reduceat(seen.astype(np.int64), skeleton.starts, axis=-1)
