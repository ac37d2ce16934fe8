"""Candidates: cameras that lay one marking of the pitch on one straight piece of paint.

A camera whose place, focal length and level are given has two unknowns left, pan and tilt, and
one line of paint that is taken for one marking determines both. So a fixed library of stands and
focal lengths, times the pieces of paint, times the markings, holds a camera near the true one as
soon as one piece is a marking.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import KAPPA, parameters_from_camera
from app.soccer.pitch import MARKINGS, Pitch, Segment

FOCAL_STEP = 1.11
"""Between neighbouring focal lengths of the library."""
TILT_DEGREES = (35.0, 91.0)
"""Broadcast cameras look down, or level."""
KNOWN, KNOWN_FOCAL, ZOOM = "known", (0.5, 6.0), 3.0
"""Name of what a match knows; its focal lengths in widths of the image, and how much wider or
narrower than the cameras at hand another frame may be."""
KNOWN_SIGMA_M = np.array([1.5, 1.0, 0.6])
"""By which a camera is off the positions that a match knows: a lens turns before its tripod, by 1.7 m
along the touchline for each radian of pan in the median of real matches."""
SAME_STAND_M = 1.0
MOST_KAPPA = 0.3
SLACK_M = 4.0
"""How far beyond the end of its marking a piece of paint may seem to reach."""


@dataclass(frozen=True)
class CameraSearchSpace:
    """Where cameras are looked for.

    Attributes:
        name: What people read.
        stands: Positions in the pitch frame, metres, shape (S, 3).
        focal_range: Shortest and longest focal length, in widths of the image.
        position_sigma: How far from its stand a camera may be, metres, shape (3,).
        kappa: Distortion of the lens where it is known (``geometry.resection``).
    """

    name: str
    stands: FloatArray
    focal_range: tuple[float, float]
    position_sigma: FloatArray
    kappa: float | None = None

    def focals(self, width: float) -> FloatArray:
        """The focal lengths, pixels."""
        low, high = self.focal_range
        count = int(np.ceil(np.log(high / low) / np.log(FOCAL_STEP))) + 1
        focals: FloatArray = np.geomspace(low, high, max(count, 1)) * width
        return focals


def _make_position_grid(*axes: tuple[float, ...]) -> FloatArray:
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


MAIN = CameraSearchSpace(
    "main stand",
    _make_position_grid((-7.0, 0.0, 7.0), (47.0, 57.0, 69.0, 84.0), (-9.0, -13.0, -18.0, -25.0)),
    (0.6, 5.0),
    np.array([6.0, 12.0, 6.0]),
)
"""Main cameras: near the middle line, on the side that is y > 0 by convention."""

WIDE = CameraSearchSpace(
    "around the pitch",
    np.vstack(
        [
            # Beside the penalty areas and towards the corners, high and low.
            _make_position_grid(
                (-52.0, -38.0, -24.0, 24.0, 38.0, 52.0), (44.0, 56.0, 74.0), (-6.0, -12.0, -20.0)
            ),
            # At the touchline.
            _make_position_grid(
                (-45.0, -30.0, -15.0, 0.0, 15.0, 30.0, 45.0), (37.5,), (-2.0, -5.0)
            ),
            # Behind the goals.
            _make_position_grid(
                (-96.0, -78.0, -62.0, 62.0, 78.0, 96.0), (0.0, 14.0), (-5.0, -11.0, -20.0)
            ),
            _make_position_grid((-58.0, 58.0), (0.0, 8.0, 16.0), (-2.5,)),
        ]
    ),
    (0.45, 3.6),
    np.array([8.0, 10.0, 5.0]),
)
"""Replays: any side; the half turn of the pitch makes y >= 0 of every stand."""


def make_search_space_of_known_cameras(known: Sequence[Camera]) -> CameraSearchSpace:
    """Where cameras of the same match stand, and with which lenses.

    Args:
        known: At least one; the lens centre of each is the centre of its picture.
    """
    stands: list[FloatArray] = []
    focals, kappas = [], []
    for camera in known:
        if not any(np.linalg.norm(camera.position - stand) < SAME_STAND_M for stand in stands):
            stands.append(camera.position)
        width, height = (2 * center + 1 for center in camera.principal_point)
        focals.append(camera.focal_length[0] / width)
        kappas.append(parameters_from_camera(camera, float(np.hypot(width, height)) / 2)[KAPPA])
    low, high = min(focals) / ZOOM, max(focals) * ZOOM
    return CameraSearchSpace(
        KNOWN,
        np.array(stands),
        (min(max(low, KNOWN_FOCAL[0]), high), max(min(high, KNOWN_FOCAL[1]), low)),
        KNOWN_SIGMA_M,
        float(np.clip(np.median(kappas), -MOST_KAPPA, MOST_KAPPA)),
    )


def find_candidate_cameras(
    pieces: FloatArray, library: CameraSearchSpace, pitch: Pitch, width: float
) -> FloatArray:
    """The cameras of a library that project a marking onto one of the pieces.

    Args:
        pieces: Straight pieces of paint: their two ends relative to the principal point,
            pixels without distortion, shape (L, 4).
        library: Where cameras are looked for.
        pitch: The pitch.
        width: Of the image, pixels.

    Returns:
        Parameters of ``geometry.resection``, shape (N, 8); kappa is zero.
    """
    low, high = np.radians(TILT_DEGREES)
    return np.asarray(
        find_level_cameras_on_pieces(
            np.ascontiguousarray(library.stands),
            library.focals(width),
            np.ascontiguousarray(pieces, dtype=np.float64),
            list_straight_markings(pitch),
            SLACK_M,
            low,
            high,
        )
    )


def list_straight_markings(pitch: Pitch) -> FloatArray:
    """Ends of the straight markings on the grass: x, y, x, y, metres, shape (M, 4)."""
    shapes = (pitch.shapes[name] for name in MARKINGS if not name.startswith("Goal"))
    return np.array(
        [[*item.start[:2], *item.end[:2]] for item in shapes if isinstance(item, Segment)]
    )


compiled = njit(cache=True, nogil=True, error_model="numpy")


@compiled
def find_level_cameras_on_pieces(stands, focals, pieces, markings, slack, low, high):
    """Every camera that lays a marking on a piece; shape (N, 8).

    The plane through camera and marking has a normal n in the pitch frame and m in the camera's,
    known up to its sign. Pan turns n about the vertical until its first coordinate is m's, tilt
    turns the other two. As the cosine of the angle from n to that pan is known, its sine needs no arc.
    """
    most = 2 * len(stands) * len(focals) * len(pieces) * len(markings)
    found = np.empty((most, 8))
    across, raised = measure_piece_planes(pieces, focals)
    count = 0
    for s in range(len(stands)):
        for marking in range(len(markings)):
            nx, ny, nz = marking_plane(stands[s], markings[marking])
            level = np.sqrt(nx * nx + ny * ny)
            if level < 1e-9:
                continue
            nx, ny = nx / level, ny / level
            for f in range(len(focals)):
                for piece in range(len(pieces)):
                    cosine = across[f, piece] / level
                    if abs(cosine) > 1.0:
                        continue
                    sine = np.sqrt(1.0 - cosine * cosine)
                    for side in (-1.0, 1.0):
                        upward = np.arctan2(nz, -side * level * sine) - raised[f, piece]
                        for sign in (-1.0, 1.0):
                            tilt = upward if sign > 0 else upward + np.pi
                            if tilt > np.pi:
                                tilt -= 2 * np.pi
                            elif tilt < -np.pi:
                                tilt += 2 * np.pi
                            if not low <= tilt <= high:
                                continue
                            sp = ny * sign * cosine + nx * side * sine
                            cp = nx * sign * cosine - ny * side * sine
                            st, ct = np.sin(tilt), np.cos(tilt)
                            if not is_piece_on_marking(
                                stands[s], markings[marking], focals[f], pieces[piece], slack,
                                sp, cp, st, ct,
                            ):  # fmt: skip
                                continue
                            if count == most:
                                return found
                            row = found[count]
                            row[0], row[1], row[2] = np.arctan2(sp, cp), tilt, 0.0
                            row[3:6] = stands[s]
                            row[6], row[7] = np.log(focals[f]), 0.0
                            count += 1
    return found[:count].copy()


@compiled
def marking_plane(stand, marking):
    """Unit normal of the plane through camera and marking, pitch frame."""
    ax, ay = marking[0] - stand[0], marking[1] - stand[1]
    bx, by = marking[2] - stand[0], marking[3] - stand[1]
    z = -stand[2]
    nx, ny, nz = (ay - by) * z, (bx - ax) * z, ax * by - ay * bx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    return nx / length, ny / length, nz / length


@compiled
def measure_piece_planes(pieces, focals):
    """Of the unit normals of the planes through camera and pieces: their first coordinate in the camera's
    frame, and the angle of the other two, shapes (F, L)."""
    across, raised = np.empty((2, len(focals), len(pieces)))
    for f in range(len(focals)):
        for n in range(len(pieces)):
            piece = pieces[n]
            mx = (piece[1] - piece[3]) * focals[f]
            my = (piece[2] - piece[0]) * focals[f]
            mz = piece[0] * piece[3] - piece[1] * piece[2]
            across[f, n] = mx / np.sqrt(mx * mx + my * my + mz * mz)
            raised[f, n] = np.arctan2(mz, my)
    return across, raised


@compiled
def is_piece_on_marking(stand, marking, focal, piece, slack, sp, cp, st, ct):
    """Whether both ends of the piece lie in front and on the marking, not beyond its ends."""
    dx, dy = marking[2] - marking[0], marking[3] - marking[1]
    length = np.sqrt(dx * dx + dy * dy)
    dx, dy = dx / length, dy / length
    for end in (0, 2):
        u, v = piece[end] / focal, piece[end + 1] / focal
        # R^T (u, v, 1)
        x = cp * u - ct * sp * v + st * sp
        y = sp * u + ct * cp * v - st * cp
        z = st * v + ct
        if z < 1e-3:
            return False
        reach = -stand[2] / z
        along = (stand[0] + reach * x - marking[0]) * dx + (stand[1] + reach * y - marking[1]) * dy
        if along < -slack or along > length + slack:
            return False
    return True
