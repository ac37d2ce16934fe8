"""Intervals between two knots of a fit: what ties their states, quietly or by a kick or bounce.

A state is position, velocity, and acceleration beside gravity, drag and rolling, shape (9,).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.tracking.ball_models import (
    DRAG,
    FLIGHT,
    GRASS_S,
    GRASS_SIGMA,
    GRAVITY,
    HELD_S,
    HELD_SIGMA,
    JUMP_SIGMA,
    KEPT,
    KEPT_SIGMA,
    KICK_LIFT,
    KICK_SPEED,
    REST,
    RESTITUTION,
    RESTITUTION_SIGMA,
    ROLL,
    ROLL_S,
    ROLL_SIGMA,
    SPIN_LEAST,
    SPIN_S,
    SPIN_SHARE,
    TOUCH_SPEED,
    TOUCHED,
    TOUCHED_SIGMA,
)

SIZE = 9
"""Unknowns of a knot: position, velocity, acceleration."""
P, V, A = slice(0, 3), slice(3, 6), slice(6, 9)
"""Where these stand in a state."""
_SLACK_M = 0.01
"""How exactly two ways meet where the ball is touched."""
_LOOSE = {FLIGHT: 0.5, ROLL: 1.0, 2: 1.0}
"""White noise of the acceleration beside its slow part, by mode, (m/s2)2 s."""
_ROUGH = 0.0016
"""How a ball leaves the smooth way of any model, a random walk, m2/s: 8 mm in a frame of 40 ms."""
GRAVITY_VECTOR = np.array([0.0, 0.0, GRAVITY])
"""Metres per second squared."""


@dataclass(frozen=True)
class Hit:
    """Residuals of an interval with an event, shape (N,), their slopes by both ends, (N, 18).

    ``noise`` is without what the unknown time adds, ``way`` the residuals' slope by that time,
    ``weight`` the inverse of all of it.
    """

    miss: FloatArray
    slopes: FloatArray
    weight: FloatArray
    noise: FloatArray
    way: FloatArray
    time: float


def hit_of(a: FloatArray, b: FloatArray, dt: float, before: int, after: int, bounce: bool) -> Hit:
    """An interval with a kick or a bounce at an unknown time.

    Args:
        a, b: States at its ends, shape (9,).
        dt: Seconds.
        before, after: Modes.
        bounce: Whether it is one; else it is a kick.
    """
    dt = max(float(dt), 1e-4)
    fall_a = GRAVITY_VECTOR if before == FLIGHT else np.zeros(3)
    fall_b = GRAVITY_VECTOR if after == FLIGHT else np.zeros(3)
    middle, spread = dt / 2, dt**2 / 12
    kept, sigma = np.zeros(3), np.zeros(3)
    mean = np.zeros(3)
    pace = float(np.hypot(a[3], a[4]))
    if bounce:
        kept[:2], sigma[:2] = KEPT, KEPT_SIGMA * pace + 0.4
        if after == FLIGHT:
            fall = abs(float(a[5]))
            kept[2], sigma[2] = -RESTITUTION, RESTITUTION_SIGMA * fall + 0.3
        else:
            sigma[2] = 0.3
    elif after == FLIGHT:
        kept[:2], mean[2] = 0.2, -3.0
        sigma[:2], sigma[2] = KICK_SPEED, KICK_LIFT
    elif after == ROLL:
        kept[:2] = 1.0 if before == ROLL else 0.3
        sigma[:2], sigma[2] = TOUCH_SPEED if before == ROLL else KICK_SPEED / 1.4, 0.3
    else:
        kept[:2], kept[2] = 0.5, 0.2
        sigma[:2], sigma[2] = 4.0, 2.0
    # A bounce, or a touch of a ball in the air, has a height; a ball that rolls from here has one too.
    mid_air = bounce or (before == FLIGHT and after != ROLL)
    low = mid_air or after == ROLL
    height, height_sigma = (
        (REST, GRASS_SIGMA) if bounce or after == ROLL else (TOUCHED, TOUCHED_SIGMA)
    )
    rows = 10 if low else 9
    noise = np.zeros(rows)
    noise[:3], noise[3:6], noise[6:9] = (
        _SLACK_M**2,
        sigma**2,
        float(spin(np.linalg.norm(b[None, V], axis=1))[0]) ** 2,
    )
    noise[9:] = height_sigma**2
    covariance = np.diag(noise)

    def at_time(time: float) -> tuple[FloatArray, FloatArray]:
        rest = dt - time
        miss, way = np.zeros(rows), np.zeros(rows)
        miss[:3] = b[P] - b[V] * rest + fall_b * rest**2 / 2
        miss[:3] -= a[P] + a[V] * time + fall_a * time**2 / 2
        way[:3] = b[V] - fall_b * rest - a[V] - fall_a * time
        miss[3:6] = b[V] - fall_b * rest - kept * (a[V] + fall_a * time) - mean
        miss[6:9] = b[A]
        if mid_air:
            miss[9] = a[2] + a[5] * time + fall_a[2] * time**2 / 2 + height
            way[9] = a[5] + fall_a[2] * time
        elif low:
            miss[9] = b[2] + height
        return miss, way

    time = middle
    for _ in range(3):
        miss, way = at_time(time)
        straight = miss - way * (time - middle)
        gain = spread * way / np.diag(covariance)
        time = middle - float(gain @ straight / (1 + gain @ way))
        time = min(max(time, -dt), 2 * dt)
    miss, way = at_time(time)
    rest = dt - time
    slopes = np.zeros((rows, 2 * SIZE))
    slopes[:3, P], slopes[:3, V] = -np.eye(3), -time * np.eye(3)
    slopes[:3, SIZE : SIZE + 3], slopes[:3, SIZE + 3 : SIZE + 6] = np.eye(3), -rest * np.eye(3)
    slopes[3:6, V] = -np.diag(kept)
    slopes[3:6, SIZE + 3 : SIZE + 6] = np.eye(3)
    slopes[6:9, SIZE + 6 :] = np.eye(3)
    if mid_air:
        slopes[9, 2], slopes[9, 5] = 1.0, time
    elif low:
        slopes[9, SIZE + 2] = 1.0
    weight = np.asarray(np.linalg.inv(covariance + spread * np.outer(way, way)), dtype=float)
    straight = miss - way * (time - middle)
    return Hit(straight, slopes, weight, covariance, way, time)


def spin(speed: FloatArray) -> FloatArray:
    """Standard deviation of the acceleration by spin and wind at a speed, m/s2."""
    return SPIN_SHARE * DRAG * np.minimum(speed, 30.0) ** 2 + SPIN_LEAST


def quiet_noise(
    mode: IntArray, dt: FloatArray, unseen: FloatArray, strong_spin: FloatArray, jumps: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """How states move without events and without drag, and the inverse of the noise, (N, 9, 9) each.

    Args:
        mode: Of each interval, shape (N,).
        dt: Seconds, shape (N,).
        unseen: What touches that nobody saw add to the acceleration's noise, (m/s2)2 s, shape (N,).
        strong_spin: From ``spin``, shape (N,).
        jumps: Whether other cameras, which are not exact, see the ball from there on, shape (N,).
    """
    count = len(mode)
    rolls, flies = mode == ROLL, mode == FLIGHT
    way = np.tile(np.eye(SIZE), (count, 1, 1))
    noise = np.zeros((count, SIZE, SIZE))
    lasts = np.where(flies, SPIN_S, np.where(rolls, ROLL_S, HELD_S))
    strong = np.where(flies, strong_spin, np.where(rolls, ROLL_SIGMA, HELD_SIGMA))
    stay = np.exp(-dt / lasts)
    # A ball in somebody's keeping slows down: its velocity would grow without end.
    slow = np.where(rolls | flies, 1.0, np.exp(-dt))
    loose = np.array([_LOOSE[each] for each in mode.tolist()]) + unseen
    for axis in range(3):
        p, v, a = axis, 3 + axis, 6 + axis
        way[:, p, v], way[:, p, a], way[:, v, a] = dt, dt**2 / 2, dt
        way[:, v, v], way[:, a, a] = slow, stay
        noise[:, p, p] = loose * dt**3 / 3 + _ROUGH * dt
        noise[:, p, v] = noise[:, v, p] = loose * dt**2 / 2
        noise[:, v, v] = loose * dt + 1e-6
        noise[:, a, a] = strong**2 * (1 - stay**2) + 1e-6
    flat = np.flatnonzero(rolls)
    if len(flat):
        for row in (2, 5, 8):
            way[flat, row] = 0.0
            noise[flat, row] = 0.0
            noise[flat, :, row] = 0.0
        stay = np.exp(-dt[flat] / GRASS_S)
        way[flat, 2, 2] = stay
        noise[flat, 2, 2] = GRASS_SIGMA**2 * (1 - stay**2) + _ROUGH * dt[flat]
        noise[flat, 5, 5] = 0.2**2
        noise[flat, 8, 8] = 1.0
    for row in range(3):
        noise[jumps, row, row] += JUMP_SIGMA**2
    return way, np.asarray(np.linalg.inv(noise), dtype=float)
