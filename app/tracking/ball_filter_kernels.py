"""Compiled steps of a Kalman filter of the ball: its motion, touches, bounces, and measurements.

States are position and velocity, shape (6,), with their covariance, shape (6, 6).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from app.tracking.ball_models import (
    DRAG,
    FLIGHT,
    GRASS_S,
    GRASS_SIGMA,
    GRAVITY,
    HELD,
    HELD_S,
    HELD_SIGMA,
    HOLDS_A_SECOND,
    JUMP_SHARE,
    JUMP_SIGMA,
    KEPT,
    KEPT_SIGMA,
    KICK_LIFT,
    KICK_SPEED,
    KICKS_A_SECOND,
    REST,
    RESTITUTION,
    RESTITUTION_SIGMA,
    ROLL,
    ROLL_S,
    ROLL_SIGMA,
    ROLLING,
    SPIN_LEAST,
    SPIN_S,
    SPIN_SHARE,
    TOUCH_SPEED,
    TOUCHED,
    TOUCHED_SIGMA,
)

OUTLIER = np.log(0.01 / 1000.0**2)
"""Logarithm of the density of a measurement of something else, per square pixel."""
UP = (0.0, 0.0, 1.0)
"""Along z; a tuple, which costs the innermost loop no memory."""


@njit(cache=True, nogil=True, error_model="numpy")
def predict_state(m, P, mode, dt):
    """Carry a state, shape (6,), and its covariance over a time without events, in place."""
    if dt <= 0.0:
        return
    speed = np.sqrt(m[3] ** 2 + m[4] ** 2 + m[5] ** 2)
    keep = 1.0
    noise = (SPIN_SHARE * DRAG * speed**2 + SPIN_LEAST) ** 2 * SPIN_S
    if mode == FLIGHT:
        keep = np.exp(-DRAG * speed * dt)
    elif mode == ROLL:
        pace = np.sqrt(m[3] ** 2 + m[4] ** 2)
        keep = max(0.0, 1.0 - ROLLING * dt / max(pace, 0.5))
        noise = ROLL_SIGMA**2 * 2 * ROLL_S
    else:
        keep = np.exp(-dt / 1.0)
        noise = HELD_SIGMA**2 * 2 * HELD_S
    for i in range(3):
        after = m[3 + i] * keep
        m[i] += dt * (m[3 + i] + after) / 2
        m[3 + i] = after
    if mode == FLIGHT:
        m[2] += GRAVITY * dt * dt / 2
        m[5] += GRAVITY * dt
    step = dt * (1 + keep) / 2
    for i in range(3):
        for j in range(6):
            P[i, j] += step * P[3 + i, j]
    for i in range(3):
        for j in range(6):
            P[3 + i, j] *= keep
    for j in range(3):
        for i in range(6):
            P[i, j] += step * P[i, 3 + j]
    for j in range(3):
        for i in range(6):
            P[i, 3 + j] *= keep
    for i in range(3):
        P[i, i] += noise * dt**3 / 3
        P[i, 3 + i] += noise * dt**2 / 2
        P[3 + i, i] += noise * dt**2 / 2
        P[3 + i, 3 + i] += noise * dt
    if mode == ROLL:
        stay = np.exp(-dt / GRASS_S)
        m[2] = -REST + stay * (m[2] + REST)
        m[5] = 0.0
        for i in range(6):
            P[2, i] *= stay
            P[i, 5] = 0.0
            P[5, i] = 0.0
        for i in range(6):
            P[i, 2] *= stay
        P[2, 2] += GRASS_SIGMA**2 * (1 - stay * stay)
        P[5, 5] = 0.01


@njit(cache=True, nogil=True, error_model="numpy")
def apply_linear_measurement(m, P, e, value, variance):
    """Take a measurement ``e . position = value``; the square of its miss by its variance, and that."""
    # Most of a search is spent here: without an array of its own, and with one division, it takes a third.
    x, y, z = e[0], e[1], e[2]
    g0 = P[0, 0] * x + P[0, 1] * y + P[0, 2] * z
    g1 = P[1, 0] * x + P[1, 1] * y + P[1, 2] * z
    g2 = P[2, 0] * x + P[2, 1] * y + P[2, 2] * z
    g3 = P[3, 0] * x + P[3, 1] * y + P[3, 2] * z
    g4 = P[4, 0] * x + P[4, 1] * y + P[4, 2] * z
    g5 = P[5, 0] * x + P[5, 1] * y + P[5, 2] * z
    total = g0 * x + g1 * y + g2 * z + variance
    miss = value - (m[0] * x + m[1] * y + m[2] * z)
    part = 1.0 / total
    gains = (g0, g1, g2, g3, g4, g5)
    for i in range(6):
        share = gains[i] * part
        m[i] += share * miss
        P[i, 0] -= share * g0
        P[i, 1] -= share * g1
        P[i, 2] -= share * g2
        P[i, 3] -= share * g3
        P[i, 4] -= share * g4
        P[i, 5] -= share * g5
    return miss * miss * part, total


@njit(cache=True, nogil=True, error_model="numpy")
def copy_state(to_m, to_P, m, P):
    for i in range(6):
        to_m[i] = m[i]
        for j in range(6):
            to_P[i, j] = P[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def clear_covariance(P, first, last):
    for i in range(first, last):
        for j in range(6):
            P[i, j] = 0.0
            P[j, i] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def apply_kick(m, P, before, mode, dt):
    """A kick at an unknown time between two knots, in place; its logarithm of probability."""
    cost = np.log(KICKS_A_SECOND * max(dt, 1e-3))
    predict_state(m, P, before, dt / 2)
    if before == FLIGHT and mode != ROLL:
        square, _ = apply_linear_measurement(m, P, UP, -TOUCHED, TOUCHED_SIGMA**2)
        cost -= min(square / 2, 12.0)
    spread = dt * dt / 12 * (m[3] ** 2 + m[4] ** 2 + KICK_SPEED**2)
    if mode == ROLL:
        cost += np.log(0.5)
        square, total = apply_linear_measurement(m, P, UP, -REST, 4 * GRASS_SIGMA**2)
        cost += min(0.0, -square / 2 - np.log(total) / 2 + np.log(0.4))
        clear_covariance(P, 3, 6)
        m[5] = 0.0
        if before == ROLL:
            P[3, 3] = P[4, 4] = TOUCH_SPEED**2
        else:
            m[3] *= 0.3
            m[4] *= 0.3
            P[3, 3] = P[4, 4] = KICK_SPEED**2 / 2
        P[5, 5] = 0.01
        P[2, 2] += GRASS_SIGMA**2
    elif mode == FLIGHT:
        cost += np.log(0.5)
        clear_covariance(P, 3, 6)
        m[3] *= 0.2
        m[4] *= 0.2
        m[5] = -3.0
        P[3, 3] = P[4, 4] = KICK_SPEED**2
        P[5, 5] = KICK_LIFT**2
    else:
        cost = np.log(HOLDS_A_SECOND * max(dt, 1e-3))
        P[3, 3] += 4.0**2
        P[4, 4] += 4.0**2
        P[5, 5] += 2.0**2
        m[3] *= 0.5
        m[4] *= 0.5
        m[5] *= 0.2
    for i in range(3):
        P[i, i] += spread
    predict_state(m, P, mode, dt / 2)
    return cost


@njit(cache=True, nogil=True, error_model="numpy")
def max_kick_log_probability(mode, dt):
    """The largest logarithm of probability that ``apply_kick`` gives."""
    if mode == HELD:
        return np.log(HOLDS_A_SECOND * max(dt, 1e-3))
    return np.log(KICKS_A_SECOND * max(dt, 1e-3)) + np.log(0.5)


@njit(cache=True, nogil=True, error_model="numpy")
def apply_bounce(m, P, mode, dt):
    """A bounce between two knots, in place; its logarithm of probability, -inf where there is none."""
    fall = m[5]
    height = -m[2] - REST
    if P[5, 5] < 4.0 and fall < -1.5:
        return -np.inf
    fall = max(fall, 0.5)
    when = min(max(height / fall, 0.0), dt)
    if abs(height - fall * when) > 1.0 + 4 * np.sqrt(P[2, 2]):
        return -np.inf
    predict_state(m, P, FLIGHT, when)
    fall = max(m[5], 0.3)
    slack = (fall * dt) ** 2 / 12 + 0.04**2
    square, total = apply_linear_measurement(m, P, UP, -REST, slack)
    cost = (
        -square / 2
        - np.log(2 * np.pi * total) / 2
        + np.log((fall + np.sqrt(P[5, 5])) * max(dt, 1e-3))
    )
    cost = min(cost, 0.0) - 0.7
    fall = m[5]
    pace = np.sqrt(m[3] ** 2 + m[4] ** 2)
    kept = KEPT
    back = -RESTITUTION
    if mode == ROLL:
        back = 0.0
        cost -= 0.7 * max(0.0, fall - 1.5) ** 2
    for i in range(3, 6):
        keep = kept if i < 5 else back
        m[i] *= keep
        for j in range(6):
            P[i, j] *= keep
        for j in range(6):
            P[j, i] *= keep
    P[3, 3] += (KEPT_SIGMA * pace + 0.4) ** 2
    P[4, 4] += (KEPT_SIGMA * pace + 0.4) ** 2
    P[5, 5] += (RESTITUTION_SIGMA * abs(fall) + 0.3) ** 2 if mode == FLIGHT else 0.01
    spread = dt * dt / 12 * (0.3 * pace) ** 2 + 1e-4
    P[0, 0] += spread
    P[1, 1] += spread
    P[2, 2] += dt * dt / 12 * (1.6 * fall) ** 2 + 1e-4
    predict_state(m, P, mode, dt - when)
    return cost


@njit(cache=True, nogil=True, error_model="numpy")
def apply_view_jump(m, P, mode, dt):
    """The place that other cameras put a ball at, in place; its logarithm of probability."""
    predict_state(m, P, mode, dt)
    for i in range(3):
        P[i, i] += JUMP_SIGMA**2
    return np.log(JUMP_SHARE)


@njit(cache=True, nogil=True, error_model="numpy")
def apply_knot_measurements(
    m, P, first, last, centres, across, along, noise, scale, far, far_sigma, kept_m, kept_P
):  # fmt: skip
    """Take the measurements of a knot, in place; their log likelihood and those left out, as bits.

    ``kept_m`` and ``kept_P`` are room for a state as it was before one that is left out.
    """
    total, left = 0.0, 0
    for row in range(first, last):
        reach = 0.0
        for i in range(3):
            reach += along[row, i] * (m[i] - centres[row, i])
        reach = min(max(reach, 3.0), 200.0)
        likely = 0.0
        copy_state(kept_m, kept_P, m, P)
        for which in range(2):
            e = across[row, which]
            value = e[0] * centres[row, 0] + e[1] * centres[row, 1] + e[2] * centres[row, 2]
            square, spread = apply_linear_measurement(m, P, e, value, (noise[row] * reach) ** 2)
            # Metres at this reach to pixels.
            pixels = np.sqrt(spread) / reach * scale[row]
            likely += -square / 2 - np.log(pixels) - 0.919
        if far_sigma[row] > 0:
            e = along[row]
            value = e[0] * centres[row, 0] + e[1] * centres[row, 1] + e[2] * centres[row, 2]
            square, spread = apply_linear_measurement(
                m, P, e, value + far[row], far_sigma[row] ** 2
            )
            likely += max(-square / 2, -4.0) - np.log(np.sqrt(spread) / far_sigma[row])
        if likely < OUTLIER:
            copy_state(m, P, kept_m, kept_P)
            likely = OUTLIER
            left |= 1 << (row - first)
        total += likely
    return total, left
