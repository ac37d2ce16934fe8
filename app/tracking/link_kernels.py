"""Compiled kernel of a link's search; ``link`` is the door to this file. Types are checked by hand."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def score_ray_meetings(
    centres, shifts, live, known, live_sigma, replay, replay_sigma, room, square, range_m, wrong
):
    """How well the rays of a replay meet those of a live shot under maps of one speed, shape (C,).

    Args:
        centres: Rows of ``live`` at the replay's middle, one a map, shape (C,).
        shifts: Rows of ``live`` from there to each ray of the replay, shape (N,).
        live: Positions and unit directions on a grid of times, shape (T, 6).
        known: Whether they are known there, shape (T,).
        live_sigma: Noise of a live direction, radians.
        replay: Positions and unit directions of the replay's rays, shape (N, 6).
        replay_sigma: Their noise, radians, shape (N,).
        room: Lowest and highest x, y and z of a ball, shape (3, 2).
        square: Variance of a miss beside noise, metres squared.
        range_m: Width of the range over which rays of different instants miss each other.
        wrong: Share of rays that are of something else.
    """
    scores = np.zeros(len(centres))
    for which in range(len(centres)):
        total = 0.0
        for ray in range(len(shifts)):
            at = int(np.rint(centres[which] + shifts[ray]))
            if at < 0 or at >= len(live) or not known[at]:
                continue
            ax, ay, az, u, v, w = live[at]
            bx, by, bz, p, q, r = replay[ray]
            nx, ny, nz = v * r - w * q, w * p - u * r, u * q - v * p
            sine = max(nx * nx + ny * ny + nz * nz, 1e-12)
            dx, dy, dz = ax - bx, ay - by, az - bz
            cosine = u * p + v * q + w * r
            along_live = u * dx + v * dy + w * dz
            along_replay = p * dx + q * dy + r * dz
            reach = (cosine * along_replay - along_live) / sine
            other = (along_replay - cosine * along_live) / sine
            density = 0.0
            x, y, z = ax + reach * u, ay + reach * v, az + reach * w
            if (
                reach > 1.0
                and other > 1.0
                and room[0, 0] < x < room[0, 1]
                and room[1, 0] < y < room[1, 1]
                and room[2, 0] < z < room[2, 1]
            ):
                miss = (dx * nx + dy * ny + dz * nz) / np.sqrt(sine)
                spread = square + (reach * live_sigma) ** 2 + (other * replay_sigma[ray]) ** 2
                density = range_m / np.sqrt(2 * np.pi * spread) * np.exp(-miss * miss / spread / 2)
            total += np.log(wrong + density)
        scores[which] = total
    return scores
