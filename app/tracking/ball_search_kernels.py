"""Compiled kernel of the search for what a ball does; ``ball_search`` is the door to this file.

Every hypothesis is a history of modes and events with a Kalman filter of position and velocity along
it. They are extended by every knot of time, and the likeliest are kept: of those whose last event is
the same only two, because their futures are nearly the same.
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
    HELD,
    HELD_S,
    HELD_SIGMA,
    HOLDS_A_SECOND,
    KEPT,
    KEPT_SIGMA,
    KICK,
    KICK_LIFT,
    KICK_SPEED,
    KICKS_A_SECOND,
    NOTHING,
    REACH,
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

_OUTLIER = np.log(0.01 / 1000.0**2)
"""Logarithm of the density of a measurement of something else, per square pixel."""
_WORST = 35.0
"""Natural logarithm by which a hypothesis may be less likely than the best."""
_UNLIKELY = 30.0
"""The same, by which a place that is known makes one less likely at most."""
_ALIKE = 2
"""Hypotheses that are kept of those whose mode and last event are the same."""
_PER_KNOT = 5


@njit(cache=True, nogil=True, error_model="numpy")
def _move(m, P, mode, dt):
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
def _pin(m, P, e, value, variance):
    """Take a measurement ``e . position = value``; the square of its miss by its variance, and that."""
    g = np.zeros(6)
    for i in range(6):
        g[i] = P[i, 0] * e[0] + P[i, 1] * e[1] + P[i, 2] * e[2]
    total = g[0] * e[0] + g[1] * e[1] + g[2] * e[2] + variance
    miss = value - (m[0] * e[0] + m[1] * e[1] + m[2] * e[2])
    for i in range(6):
        m[i] += g[i] * miss / total
        for j in range(6):
            P[i, j] -= g[i] * g[j] / total
    return miss * miss / total, total


@njit(cache=True, nogil=True, error_model="numpy")
def _copy(to_m, to_P, m, P):
    for i in range(6):
        to_m[i] = m[i]
        for j in range(6):
            to_P[i, j] = P[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _forget(P, first, last):
    for i in range(first, last):
        for j in range(6):
            P[i, j] = 0.0
            P[j, i] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _touch(m, P, before, mode, dt):
    """A kick at an unknown time between two knots, in place; its logarithm of probability."""
    cost = np.log(KICKS_A_SECOND * max(dt, 1e-3))
    _move(m, P, before, dt / 2)
    if before == FLIGHT and mode != ROLL:
        up = np.array([0.0, 0.0, 1.0])
        square, _ = _pin(m, P, up, -TOUCHED, TOUCHED_SIGMA**2)
        cost -= min(square / 2, 12.0)
    spread = dt * dt / 12 * (m[3] ** 2 + m[4] ** 2 + KICK_SPEED**2)
    if mode == ROLL:
        cost += np.log(0.5)
        square, total = _pin(m, P, np.array([0.0, 0.0, 1.0]), -REST, 4 * GRASS_SIGMA**2)
        cost += min(0.0, -square / 2 - np.log(total) / 2 + np.log(0.4))
        _forget(P, 3, 6)
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
        _forget(P, 3, 6)
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
    _move(m, P, mode, dt / 2)
    return cost


@njit(cache=True, nogil=True, error_model="numpy")
def _bounce(m, P, mode, dt):
    """A bounce between two knots, in place; its logarithm of probability, -inf where there is none."""
    fall = m[5]
    height = -m[2] - REST
    if P[5, 5] < 4.0 and fall < -1.5:
        return -np.inf
    fall = max(fall, 0.5)
    when = min(max(height / fall, 0.0), dt)
    if abs(height - fall * when) > 1.0 + 4 * np.sqrt(P[2, 2]):
        return -np.inf
    _move(m, P, FLIGHT, when)
    fall = max(m[5], 0.3)
    slack = (fall * dt) ** 2 / 12 + 0.04**2
    square, total = _pin(m, P, np.array([0.0, 0.0, 1.0]), -REST, slack)
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
    _move(m, P, mode, dt - when)
    return cost


@njit(cache=True, nogil=True, error_model="numpy")
def _see(m, P, first, last, centres, across, along, noise, scale, far, far_sigma):
    """Take the measurements of a knot, in place; their log likelihood and those left out, as bits."""
    total, left = 0.0, 0
    kept_m, kept_P = np.zeros(6), np.zeros((6, 6))
    for row in range(first, last):
        reach = 0.0
        for i in range(3):
            reach += along[row, i] * (m[i] - centres[row, i])
        reach = min(max(reach, 3.0), 200.0)
        likely = 0.0
        _copy(kept_m, kept_P, m, P)
        for which in range(2):
            e = across[row, which]
            value = e[0] * centres[row, 0] + e[1] * centres[row, 1] + e[2] * centres[row, 2]
            square, spread = _pin(m, P, e, value, (noise[row] * reach) ** 2)
            # Metres at this reach to pixels.
            pixels = np.sqrt(spread) / reach * scale[row]
            likely += -square / 2 - np.log(pixels) - 0.919
        if far_sigma[row] > 0:
            e = along[row]
            value = e[0] * centres[row, 0] + e[1] * centres[row, 1] + e[2] * centres[row, 2]
            square, spread = _pin(m, P, e, value + far[row], far_sigma[row] ** 2)
            likely += max(-square / 2, -4.0) - np.log(np.sqrt(spread) / far_sigma[row])
        if likely < _OUTLIER:
            _copy(m, P, kept_m, kept_P)
            likely = _OUTLIER
            left |= 1 << (row - first)
        total += likely
    return total, left


@njit(cache=True, nogil=True, error_model="numpy")
def likeliest(
    times, starts, centres, across, along, noise, scale, far, far_sigma, room, width,
    wanted, begin, due, may_not, places, normal, value, sigma,
):  # fmt: skip
    """The likeliest history of modes and events.

    Args:
        times: Of the knots, seconds, shape (K,).
        starts: Rows of the measurements at each knot, shape (K + 1,).
        centres: Of the cameras, metres, shape (M, 3), as every place.
        across: Two unit vectors at right angles to each ray, shape (M, 2, 3).
        along: Unit directions, shape (M, 3).
        noise: Of a direction, radians, shape (M,).
        scale: Pixels per radian, shape (M,).
        far, far_sigma: Distances from the cameras by size, and noise, 0 where unknown, shape (M,).
        room: Lowest and highest x, y and z of a ball, shape (3, 2).
        width: Hypotheses kept.
        wanted: Kind of the event that happens once before a knot of its window, or ``NOTHING``, (K,).
        begin: First knot of that window, shape (K,).
        due: Whether a knot is its last, shape (K,).
        may_not: Other kinds that do not happen before each knot, as bits, shape (K,).
        places: Rows of what is known of places at each knot, shape (K + 1,).
        normal, value, sigma: Directions, metres along them and how surely, (Q, 3), (Q,), (Q,).

    Returns:
        Mode at each knot and event before it, both shape (K,); bits of measurements left out,
        (K,); the filter's states, (K, 6); the log likelihood.
    """
    K = len(times)
    parent = np.zeros((K, width), np.int64)
    modes = np.zeros((K, width), np.int64)
    events = np.zeros((K, width), np.int64)
    lefts = np.zeros((K, width), np.int64)
    states = np.zeros((K, width, 6))
    count = 3
    M, C = np.zeros((width, 6)), np.zeros((width, 6, 6))
    score, since = np.zeros(width), np.zeros(width, np.int64)
    latest = np.zeros(width, np.int64)
    size = width * _PER_KNOT + 3
    cm, cC = np.zeros((size, 6)), np.zeros((size, 6, 6))
    cs, cp = np.zeros(size), np.zeros(size, np.int64)
    cmode, cevent = np.zeros(size, np.int64), np.zeros(size, np.int64)
    csince, cleft = np.zeros(size, np.int64), np.zeros(size, np.int64)
    clatest = np.zeros(size, np.int64)
    order = np.zeros(size, np.int64)
    for k in range(K):
        made = 0
        if k == 0:
            for mode in range(3):
                m, P = np.zeros(6), np.zeros((6, 6))
                m[2] = -REST if mode == ROLL else -2.0
                P[0, 0], P[1, 1] = 40.0**2, 30.0**2
                P[2, 2] = GRASS_SIGMA**2 if mode == ROLL else 4.0**2
                P[3, 3] = P[4, 4] = 10.0**2
                P[5, 5] = 0.01 if mode == ROLL else 5.0**2
                _copy(cm[made], cC[made], m, P)
                cs[made] = -0.7 if mode < 2 else -4.0
                cmode[made], cevent[made], cp[made], csince[made] = mode, NOTHING, 0, 0
                clatest[made] = NOTHING
                made += 1
        else:
            dt = times[k] - times[k - 1]
            for strict in range(2):
                # Where no history can do what has to happen, it is as if nobody had said it.
                if strict == 1 and made > 0:
                    break
                for h in range(count):
                    mode = modes[k - 1, h]
                    missing = wanted[k]
                    if latest[h] == missing and since[h] >= begin[k]:
                        missing = NOTHING
                    now = missing != NOTHING and due[k] and strict == 0
                    for way in range(_PER_KNOT):
                        event = NOTHING if way == 0 else BOUNCE if way == 4 else KICK
                        may = event == NOTHING or not (may_not[k] >> event) & 1
                        if (now or not may) and (event != missing or event == NOTHING):
                            continue
                        m, P = cm[made], cC[made]
                        _copy(m, P, M[h], C[h])
                        after, cost = mode, 0.0
                        if way == 0:
                            _move(m, P, mode, dt)
                        elif way == 1:
                            after = FLIGHT
                            cost = _touch(m, P, mode, FLIGHT, dt)
                        elif way == 2:
                            after = ROLL
                            cost = _touch(m, P, mode, ROLL, dt)
                        elif way == 3:
                            if mode == HELD:
                                continue
                            after = HELD
                            cost = _touch(m, P, mode, HELD, dt)
                        else:
                            if mode != FLIGHT:
                                continue
                            cost = _bounce(m, P, FLIGHT, dt)
                            if cost > -np.inf and m[5] > -1.2:
                                # Too low a hop to be seen as one.
                                _copy(m, P, M[h], C[h])
                                after = ROLL
                                cost = _bounce(m, P, ROLL, dt)
                        if cost == -np.inf:
                            continue
                        cmode[made], cevent[made], cp[made] = after, event, h
                        csince[made] = since[h] if event == NOTHING else k
                        clatest[made] = latest[h] if event == NOTHING else event
                        cs[made] = score[h] + cost
                        made += 1
        best = -np.inf
        for c in range(made):
            m, P = cm[c], cC[c]
            likely, left = _see(
                m, P, starts[k], starts[k + 1], centres, across, along, noise, scale, far, far_sigma
            )
            cs[c] += likely
            cleft[c] = left
            for row in range(places[k], places[k + 1]):
                square, total = _pin(m, P, normal[row], value[row], sigma[row] ** 2)
                cs[c] -= min(square / 2, _UNLIKELY) + np.log(total) / 2
            for i in range(3):
                slack = 2 * np.sqrt(max(P[i, i], 0.0)) + 0.1
                off = max(room[i, 0] - m[i], m[i] - room[i, 1]) - slack
                if off > 0:
                    cs[c] -= min(off / 0.2, 8.0) ** 2 / 2
            if cmode[c] == HELD:
                off = -m[2] - REACH - 2 * np.sqrt(max(P[2, 2], 0.0))
                if off > 0:
                    cs[c] -= min(off / 0.2, 8.0) ** 2 / 2
            best = max(best, cs[c])
        # numba takes seconds to compile a sort of its own.
        for c in range(made):
            at = c
            while at > 0 and cs[order[at - 1]] < cs[c]:
                order[at] = order[at - 1]
                at -= 1
            order[at] = c
        kept = 0
        for rank in range(made):
            c = order[rank]
            if kept == width or cs[c] < best - _WORST:
                break
            alike = 0
            for other in range(kept):
                if modes[k, other] == cmode[c] and since[other] == csince[c]:
                    alike += events[k, other] == cevent[c]
            if alike >= _ALIKE:
                continue
            _copy(M[kept], C[kept], cm[c], cC[c])
            for i in range(6):
                states[k, kept, i] = cm[c, i]
            score[kept] = cs[c]
            parent[k, kept], modes[k, kept], events[k, kept] = cp[c], cmode[c], cevent[c]
            lefts[k, kept] = cleft[c]
            since[kept], latest[kept] = csince[c], clatest[c]
            kept += 1
        count = kept
    path = np.zeros(K, np.int64)
    for k in range(K - 1, 0, -1):
        path[k - 1] = parent[k, path[k]]
    found_mode, found_event = np.zeros(K, np.int64), np.zeros(K, np.int64)
    found_left, found_state = np.zeros(K, np.int64), np.zeros((K, 6))
    for k in range(K):
        found_mode[k], found_event[k] = modes[k, path[k]], events[k, path[k]]
        found_left[k] = lefts[k, path[k]]
        for i in range(6):
            found_state[k, i] = states[k, path[k], i]
    return found_mode, found_event, found_left, found_state, score[0]
