"""Compiled kernels of the candidates: pan and tilt from one line.

Types are checked by hand here; ``candidates`` is the door to this file.
"""

from __future__ import annotations

import numpy as np
from numba import njit

compiled = njit(cache=True, nogil=True, error_model="numpy")


@compiled
def anchor_all(stands, focals, pieces, markings, slack, low, high):
    """Every camera that lays a marking on a piece; shape (N, 8)."""
    most = 2 * len(stands) * len(focals) * len(pieces) * len(markings)
    found = np.empty((most, 8))
    count = 0
    for s in range(len(stands)):
        for m in range(len(markings)):
            for f in range(len(focals)):
                for piece in range(len(pieces)):
                    count = anchor(
                        stands[s], markings[m], focals[f], pieces[piece], slack, low, high,
                        found, count,
                    )  # fmt: skip
    return found[:count].copy()


@compiled
def anchor(stand, marking, focal, piece, slack, low, high, found, count):
    """Writes the level cameras at a stand that see the marking along the piece.

    The plane through camera and marking has a normal n in the pitch frame and m in the camera's,
    known up to its sign. Pan turns n about the vertical until its first coordinate is m's, tilt
    turns the other two.
    """
    ax, ay = marking[0] - stand[0], marking[1] - stand[1]
    bx, by = marking[2] - stand[0], marking[3] - stand[1]
    z = -stand[2]
    nx, ny, nz = (ay - by) * z, (bx - ax) * z, ax * by - ay * bx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / length, ny / length, nz / length
    mx = (piece[1] - piece[3]) * focal
    my = (piece[2] - piece[0]) * focal
    mz = piece[0] * piece[3] - piece[1] * piece[2]
    length = np.sqrt(mx * mx + my * my + mz * mz)
    mx, my, mz = mx / length, my / length, mz / length
    level = np.sqrt(nx * nx + ny * ny)
    if level < 1e-9 or abs(mx) > level:
        return count
    facing = np.arctan2(ny, nx)
    for sign in (-1.0, 1.0):
        for side in (-1.0, 1.0):
            pan = facing + side * np.arccos(sign * mx / level)
            sp, cp = np.sin(pan), np.cos(pan)
            across = -sp * nx + cp * ny
            tilt = np.arctan2(nz, across) - np.arctan2(sign * mz, sign * my)
            tilt = (tilt + np.pi) % (2 * np.pi) - np.pi
            if not low <= tilt <= high:
                continue
            st, ct = np.sin(tilt), np.cos(tilt)
            if not within(stand, marking, focal, piece, slack, sp, cp, st, ct):
                continue
            if count == len(found):
                return count
            row = found[count]
            row[0] = (pan + np.pi) % (2 * np.pi) - np.pi
            row[1], row[2] = tilt, 0.0
            row[3:6] = stand
            row[6], row[7] = np.log(focal), 0.0
            count += 1
    return count


@compiled
def within(stand, marking, focal, piece, slack, sp, cp, st, ct):
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
