"""Compiled equations of the fit of a ball's way, and the solution of such block tridiagonal systems.

``ball_fit`` is the door to this file. A state is position, velocity, and acceleration beside gravity, drag and
rolling, shape (9,). LAPACK's banded solver asks for threads that systems as narrow as these only wait for.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from app.tracking.ball_models import (
    BOUNCE,
    DRAG,
    FLIGHT,
    GRASS_S,
    GRASS_SIGMA,
    GRAVITY,
    KEPT,
    KEPT_SIGMA,
    KICK,
    KICK_LIFT,
    KICK_SPEED,
    REST,
    RESTITUTION,
    RESTITUTION_SIGMA,
    ROLL,
    ROLLING,
    SPIN_LEAST,
    SPIN_SHARE,
    TOUCH_SPEED,
    TOUCHED,
    TOUCHED_SIGMA,
)

SIZE = 9
"""Unknowns of a knot: position, velocity, acceleration."""
FREEDOM = 6.0
"""Of the t distribution of rays: gross errors pull little."""
NEAR_M = 1.0
"""No ball is nearer to a camera."""
_SLACK_M = 0.01
"""How exactly two ways meet where the ball is touched."""
_ROWS = 10


@njit(cache=True, nogil=True, error_model="numpy")
def compute_hit_residuals(a, b, dt, before, after, bounce):
    """An interval with a kick or a bounce at an unknown time.

    Args:
        a, b: States at its ends, shape (9,).
        dt: Seconds.
        before, after: Modes.
        bounce: Whether it is one; else it is a kick.

    Returns:
        Residuals, shape (10,), the last one nought with an infinite noise where the ball has no known height;
        their slopes by both ends, (10, 18); their variances without what the unknown time adds, (10,); their
        slopes by that time, (10,); the time, seconds after the first end; and its variance.
    """
    dt = max(dt, 1e-4)
    fall_a = GRAVITY if before == FLIGHT else 0.0
    fall_b = GRAVITY if after == FLIGHT else 0.0
    middle, spread = dt / 2, dt**2 / 12
    kept, sigma, mean = np.zeros(3), np.zeros(3), np.zeros(3)
    pace = np.sqrt(a[3] ** 2 + a[4] ** 2)
    if bounce:
        kept[:2], sigma[:2] = KEPT, KEPT_SIGMA * pace + 0.4
        if after == FLIGHT:
            kept[2], sigma[2] = -RESTITUTION, RESTITUTION_SIGMA * abs(a[5]) + 0.3
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
    grass = bounce or after == ROLL
    height, height_sigma = (REST, GRASS_SIGMA) if grass else (TOUCHED, TOUCHED_SIGMA)
    speed = np.sqrt(b[3] ** 2 + b[4] ** 2 + b[5] ** 2)
    noise = np.full(_ROWS, np.inf)
    for i in range(3):
        noise[i], noise[3 + i] = _SLACK_M**2, sigma[i] ** 2
        noise[6 + i] = (SPIN_SHARE * DRAG * min(speed, 30.0) ** 2 + SPIN_LEAST) ** 2
    if low:
        noise[9] = height_sigma**2
    miss, way = np.zeros(_ROWS), np.zeros(_ROWS)
    time = middle
    for turn in range(4):
        rest = dt - time
        for i in range(3):
            down_a, down_b = (fall_a, fall_b) if i == 2 else (0.0, 0.0)
            miss[i] = b[i] - b[3 + i] * rest + down_b * rest**2 / 2
            miss[i] -= a[i] + a[3 + i] * time + down_a * time**2 / 2
            way[i] = b[3 + i] - down_b * rest - a[3 + i] - down_a * time
            miss[3 + i] = b[3 + i] - down_b * rest - kept[i] * (a[3 + i] + down_a * time) - mean[i]
            miss[6 + i] = b[6 + i]
        if mid_air:
            miss[9] = a[2] + a[5] * time + fall_a * time**2 / 2 + height
            way[9] = a[5] + fall_a * time
        elif low:
            miss[9] = b[2] + height
        if turn == 3:
            break
        pull, known = 0.0, 1.0
        for i in range(_ROWS):
            gain = spread * way[i] / noise[i]
            pull += gain * (miss[i] - way[i] * (time - middle))
            known += gain * way[i]
        time = min(max(middle - pull / known, -dt), 2 * dt)
    slopes = np.zeros((_ROWS, 2 * SIZE))
    for i in range(3):
        slopes[i, i], slopes[i, 3 + i] = -1.0, -time
        slopes[i, SIZE + i], slopes[i, SIZE + 3 + i] = 1.0, time - dt
        slopes[3 + i, 3 + i], slopes[3 + i, SIZE + 3 + i] = -kept[i], 1.0
        slopes[6 + i, SIZE + 6 + i] = 1.0
    if mid_air:
        slopes[9, 2], slopes[9, 5] = 1.0, time
    elif low:
        slopes[9, SIZE + 2] = 1.0
    for i in range(_ROWS):
        miss[i] -= way[i] * (time - middle)
    return miss, slopes, noise, way, time, spread


@njit(cache=True, nogil=True, error_model="numpy")
def build_normal_equations(
    state, mode, event, dt, way, inverse, at, used, noise, centres, along, across, far, far_sigma,
    places, normal, value, sigma, begin, begin_sigma,
):  # fmt: skip
    """Normal equations of a Gauss-Newton step.

    Args:
        state: At the knots, shape (K, 9).
        mode, event: At each knot, and before it, by number, shape (K,).
        dt: Between the knots, seconds, shape (K - 1,).
        way, inverse: Of intervals without events, how states move without drag and the inverse of their noise,
            shape (K - 1, 9, 9).
        at: Knot of each ray, shape (R,).
        used: Whether rays are of the ball, shape (R,).
        noise: Of rays, radians, shape (R,).
        centres, along, across: Cameras and directions of rays, (R, 3), (R, 3), (R, 2, 3).
        far, far_sigma: Distances by size, 0 where unknown, metres, shape (R,).
        places, normal, value, sigma: Knots of what is known of places, directions, metres along them and how
            surely, (Q,), (Q, 3), (Q,), (Q,).
        begin, begin_sigma: What is known of the first state before anything is seen, shape (9,).

    Returns:
        Diagonal blocks, (K, 9, 9); those beside them, (K - 1, 9, 9); and the pull, (K, 9).
    """
    count = len(state)
    diagonal, pull = np.zeros((count, SIZE, SIZE)), np.zeros((count, SIZE))
    beside = np.zeros((max(count - 1, 0), SIZE, SIZE))
    for i in range(SIZE):
        diagonal[0, i, i] += begin_sigma[i] ** -2
        pull[0, i] += (state[0, i] - begin[i]) * begin_sigma[i] ** -2
    for ray in range(len(at)):
        if used[ray]:
            _add_ray_equations(
                state[at[ray]], diagonal[at[ray]], pull[at[ray]], noise[ray], centres[ray],
                along[ray], across[ray], far[ray], far_sigma[ray],
            )  # fmt: skip
    for row in range(len(places)):
        knot, off = places[row], -value[row]
        for i in range(3):
            off += state[knot, i] * normal[row, i]
        for i in range(3):
            sure = normal[row, i] / sigma[row] ** 2
            pull[knot, i] += off * sure
            for j in range(3):
                diagonal[knot, i, j] += sure * normal[row, j]
    for knot in range(count):
        low = state[knot, 2] + REST
        if low > 0 and mode[knot] != ROLL:
            diagonal[knot, 2, 2] += GRASS_SIGMA**-2
            pull[knot, 2] += low * GRASS_SIGMA**-2
    for before in range(count - 1):
        after = before + 1
        if event[after] == KICK or event[after] == BOUNCE:
            _add_hit_equations(
                state, mode, event[after] == BOUNCE, dt, before, diagonal, beside, pull
            )
        else:
            _add_motion_equations(
                state, mode[after], dt[before], before, way[before], inverse[before],
                diagonal, beside, pull,
            )  # fmt: skip
    return diagonal, beside, pull


@njit(cache=True, nogil=True, error_model="numpy")
def _add_ray_equations(state, diagonal, pull, noise, centre, along, across, far, far_sigma):
    """A ray, and the distance by size."""
    off, reach = np.zeros(3), 0.0
    for i in range(3):
        off[i] = state[i] - centre[i]
        reach += off[i] * along[i]
    depth, reach = reach, max(reach, NEAR_M)
    miss, slope = np.zeros(2), np.zeros((2, 3))
    for which in range(2):
        aside = 0.0
        for i in range(3):
            aside += across[which, i] * off[i]
        miss[which] = aside / (reach * noise)
        for i in range(3):
            slope[which, i] = (across[which, i] / reach - aside * along[i] / reach**2) / noise
    weight = min((FREEDOM + 2) / (FREEDOM + miss[0] ** 2 + miss[1] ** 2), 1.0)
    for which in range(2):
        for i in range(3):
            pull[i] += weight * slope[which, i] * miss[which]
            for j in range(3):
                diagonal[i, j] += weight * slope[which, i] * slope[which, j]
    if far_sigma > 0:
        beyond = (depth - far) / far_sigma
        doubt = min(1.0, 2.0 / max(abs(beyond), 1e-9)) / far_sigma
        for i in range(3):
            pull[i] += doubt * beyond * along[i]
            for j in range(3):
                diagonal[i, j] += doubt / far_sigma * along[i] * along[j]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_hit_equations(state, mode, bounce, dt, before, diagonal, beside, pull):
    """An interval with a kick or a bounce."""
    after = before + 1
    miss, slopes, noise, way, _, spread = compute_hit_residuals(
        state[before], state[after], dt[before], mode[before], mode[after], bounce
    )
    # The inverse of the noise and of what the unknown time adds to it: Sherman and Morrison.
    turned, pushed, known = np.zeros(2 * SIZE), 0.0, 1.0
    for row in range(_ROWS):
        gain = way[row] / noise[row]
        known += spread * way[row] * gain
        pushed += gain * miss[row]
        for i in range(2 * SIZE):
            turned[i] += gain * slopes[row, i]
    share = spread / known
    for i in range(2 * SIZE):
        force = -share * turned[i] * pushed
        for row in range(_ROWS):
            force += slopes[row, i] * miss[row] / noise[row]
        pull[before if i < SIZE else after, i % SIZE] += force
        for j in range(2 * SIZE):
            entry = -share * turned[i] * turned[j]
            for row in range(_ROWS):
                if slopes[row, i] != 0.0 and slopes[row, j] != 0.0:
                    entry += slopes[row, i] * slopes[row, j] / noise[row]
            if i < SIZE and j < SIZE:
                diagonal[before, i, j] += entry
            elif i >= SIZE and j >= SIZE:
                diagonal[after, i - SIZE, j - SIZE] += entry
            elif i < SIZE:
                beside[before, i, j - SIZE] += entry


@njit(cache=True, nogil=True, error_model="numpy")
def _add_motion_equations(state, mode, dt, before, still, inverse, diagonal, beside, pull):
    """An interval without an event."""
    after, half = before + 1, dt**2 / 2
    a, b = state[before], state[after]
    way, miss, pushed = still.copy(), b.copy(), np.zeros(3)
    for i in range(SIZE):
        for j in range(SIZE):
            miss[i] -= still[i, j] * a[j]
    if mode == FLIGHT:
        speed = np.sqrt(a[3] ** 2 + a[4] ** 2 + a[5] ** 2)
        safe = max(speed, 1e-3)
        for i in range(3):
            pushed[i] = -DRAG * speed * a[3 + i]
            for j in range(3):
                bent = -DRAG * a[3 + i] * a[3 + j] / safe - (DRAG * safe if i == j else 0.0)
                way[i, 3 + j] += bent * half
                way[3 + i, 3 + j] += bent * dt
        pushed[2] += GRAVITY
    elif mode == ROLL:
        pace = np.sqrt(a[3] ** 2 + a[4] ** 2 + 0.25)
        for i in range(2):
            pushed[i] = -ROLLING * a[3 + i] / pace
            for j in range(2):
                bent = ROLLING * a[3 + i] * a[3 + j] / pace**3 - (ROLLING / pace if i == j else 0.0)
                way[i, 3 + j] += bent * half
                way[3 + i, 3 + j] += bent * dt
        miss[2] += REST * (1 - np.exp(-dt / GRASS_S))
    for i in range(3):
        miss[i] -= pushed[i] * half
        miss[3 + i] -= pushed[i] * dt
    held, force = np.zeros((SIZE, SIZE)), np.zeros(SIZE)
    for i in range(SIZE):
        for m in range(SIZE):
            entry = inverse[i, m]
            if entry == 0.0:
                continue
            force[i] += entry * miss[m]
            diagonal[after, i, m] += entry
            for j in range(SIZE):
                held[i, j] += entry * way[m, j]
    for i in range(SIZE):
        pull[after, i] += force[i]
        for j in range(SIZE):
            beside[before, j, i] -= held[i, j]
            entry = way[i, j]
            if entry == 0.0:
                continue
            pull[before, j] -= entry * force[i]
            for m in range(SIZE):
                diagonal[before, j, m] += entry * held[i, m]


@njit(cache=True, nogil=True, error_model="numpy")
def factor_block_tridiagonal(diagonal, beside):
    """Cholesky factor of a positive definite block tridiagonal matrix.

    Args:
        diagonal: Blocks on the diagonal, shape (K, S, S).
        beside: Those right of them, shape (K - 1, S, S).

    Returns:
        Rows of the upper factor by block, from the block itself to the end of the next one, shape (K, S, 2 * S).
    """
    count, size = diagonal.shape[0], diagonal.shape[1]
    wide = 2 * size
    rows = np.zeros((count, size, wide))
    for k in range(count):
        own = rows[k]
        own[:, :size] = diagonal[k]
        if k + 1 < count:
            own[:, size:] = beside[k]
        for m in range(size if k else 0):
            before = rows[k - 1, m]
            for i in range(size):
                share = before[size + i]
                for j in range(i, size):
                    own[i, j] -= share * before[size + j]
        for i in range(size):
            part = 1.0 / np.sqrt(max(own[i, i], 1e-12))
            for j in range(i):
                own[i, j] = 0.0
            for j in range(i, wide):
                own[i, j] *= part
            for m in range(i + 1, size):
                share = own[i, m]
                for j in range(m, wide):
                    own[m, j] -= share * own[i, j]
    return rows


@njit(cache=True, nogil=True, error_model="numpy")
def solve_factored(rows, right):
    """Solve for a right side, shape (K * S,), with the factor of ``factor_block_tridiagonal``."""
    count, size, wide = rows.shape
    found = np.zeros((count + 1) * size)
    found[: count * size] = right
    for k in range(count):
        for i in range(size):
            at = k * size + i
            found[at] /= rows[k, i, i]
            for j in range(i + 1, wide):
                found[k * size + j] -= rows[k, i, j] * found[at]
    for k in range(count - 1, -1, -1):
        for i in range(size - 1, -1, -1):
            at = k * size + i
            total = found[at]
            for j in range(i + 1, wide):
                total -= rows[k, i, j] * found[k * size + j]
            found[at] = total / rows[k, i, i]
    return found[: count * size]


@njit(cache=True, nogil=True, error_model="numpy")
def inverse_blocks(rows):
    """Blocks of the inverse on the diagonal, (K, S, S), and right of them, (K - 1, S, S).

    Source: K. Takahashi, J. Fagan, M. Chin, 1973: the inverse within the pattern of its factor.
    """
    count, size, wide = rows.shape
    own, beside = np.zeros((count, size, size)), np.zeros((max(count - 1, 0), size, size))
    for k in range(count - 1, -1, -1):
        # The inverse of the block of the factor itself, and that times what is right of it.
        both = np.zeros((size, wide))
        for i in range(size - 1, -1, -1):
            both[i, i] = 1.0
            for j in range(size, wide):
                both[i, j] = rows[k, i, j]
            for m in range(i + 1, size):
                share = rows[k, i, m]
                for j in range(m, wide):
                    both[i, j] -= share * both[m, j]
            part = 1.0 / rows[k, i, i]
            for j in range(i, wide):
                both[i, j] *= part
        for i in range(size):
            for j in range(i, size):
                total = 0.0
                for m in range(j, size):
                    total += both[i, m] * both[j, m]
                own[k, i, j] = total
        if k + 1 < count:
            for i in range(size):
                for m in range(size):
                    share = both[i, size + m]
                    for j in range(size):
                        beside[k, i, j] -= share * own[k + 1, m, j]
            for i in range(size):
                for j in range(i, size):
                    total = own[k, i, j]
                    for m in range(size):
                        total -= beside[k, i, m] * both[j, size + m]
                    own[k, i, j] = total
        for i in range(size):
            for j in range(i):
                own[k, i, j] = own[k, j, i]
    return own, beside
