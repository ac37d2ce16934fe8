"""Compiled kernel of the search for what a ball does; ``ball_search`` is the door to this file.

Every hypothesis is a history of modes and events with a Kalman filter of position and velocity along
it. They are extended by every knot of time, and the likeliest are kept: of those whose last event is
the same only two, because their futures are nearly the same.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from app.tracking.ball_filter_kernels import (
    OUTLIER,
    apply_bounce,
    apply_kick,
    apply_knot_measurements,
    apply_linear_measurement,
    apply_view_jump,
    copy_state,
    max_kick_log_probability,
    predict_state,
)
from app.tracking.ball_models import (
    BOUNCE,
    FLIGHT,
    GRASS_SIGMA,
    HELD,
    JUMP,
    KICK,
    NOTHING,
    REACH,
    REST,
    ROLL,
)

_WORST = 35.0
"""Natural logarithm by which a hypothesis may be less likely than the best."""
_UNLIKELY = 30.0
"""The same, by which a place that is known makes one less likely at most."""
_ALIKE = 2
"""Hypotheses that are kept of those whose mode and last event are the same."""
_PER_KNOT = 6


@njit(cache=True, nogil=True, error_model="numpy")
def initialize_state(m, P, mode):
    """What is known of a ball before anything is seen, in place; its logarithm of probability."""
    m[:], P[:] = 0.0, 0.0
    m[2] = -REST if mode == ROLL else -2.0
    P[0, 0], P[1, 1] = 40.0**2, 30.0**2
    P[2, 2] = GRASS_SIGMA**2 if mode == ROLL else 4.0**2
    P[3, 3] = P[4, 4] = 10.0**2
    P[5, 5] = 0.01 if mode == ROLL else 5.0**2
    return -0.7 if mode < 2 else -4.0


@njit(cache=True, nogil=True, error_model="numpy")
def max_log_likelihood(first, last, noise, scale):
    """More than ``see`` finds for no state."""
    total = 0.0
    for row in range(first, last):
        total += max(2 * (-np.log(noise[row] * scale[row]) - 0.919), OUTLIER)
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def out_of_bounds_cost(m, P, mode, room):
    """What a place outside of the room costs, or one out of reach of who holds the ball."""
    cost = 0.0
    for i in range(3):
        slack = 2 * np.sqrt(max(P[i, i], 0.0)) + 0.1
        off = max(room[i, 0] - m[i], m[i] - room[i, 1]) - slack
        if off > 0:
            cost += min(off / 0.2, 8.0) ** 2 / 2
    if mode == HELD:
        off = -m[2] - REACH - 2 * np.sqrt(max(P[2, 2], 0.0))
        if off > 0:
            cost += min(off / 0.2, 8.0) ** 2 / 2
    return cost


@njit(cache=True, nogil=True, error_model="numpy")
def find_likeliest_modes(
    times, starts, centres, across, along, noise, scale, far, far_sigma, room, width, shortest,
    changed, wanted, begin, due, may_not, places, normal, value, sigma,
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
        shortest: Seconds between two knots, below which a ball is not touched unless somebody says so.
        changed: Whether other views see the ball at a knot than before it, shape (K,).
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
    latest, jumped = np.zeros(width, np.int64), np.zeros(width, np.int64)
    size = width * _PER_KNOT + 3
    cm, cC = np.zeros((size, 6)), np.zeros((size, 6, 6))
    cs, cp = np.zeros(size), np.zeros(size, np.int64)
    cmode, cevent = np.zeros(size, np.int64), np.zeros(size, np.int64)
    csince, cleft = np.zeros(size, np.int64), np.zeros(size, np.int64)
    clatest, cjump = np.zeros(size, np.int64), np.zeros(size, np.int64)
    order = np.zeros(size, np.int64)
    second = np.zeros((3, 4, 2))
    kept_m, kept_P = np.zeros(6), np.zeros((6, 6))
    jump_of = np.zeros((3, 4), np.int64)
    for k in range(K):
        made, best = 0, -np.inf
        most = max_log_likelihood(starts[k], starts[k + 1], noise, scale)
        for row in range(places[k], places[k + 1]):
            most -= np.log(sigma[row])
        second[:] = -np.inf
        jump_of[:] = -1
        dt = times[k] - times[k - 1] if k else 0.0
        short = dt < shortest and wanted[k] == NOTHING
        for strict in range(2):
            # Where no history can do what has to happen, it is as if nobody had said it.
            if strict == 1 and (k == 0 or made > 0):
                break
            for h in range(count):
                mode = modes[k - 1, h] if k else h
                missing = wanted[k]
                if latest[h] == missing and since[h] >= begin[k]:
                    missing = NOTHING
                now = missing != NOTHING and due[k] and strict == 0
                for way in range(_PER_KNOT if k else 1):
                    # No kick and no bounce; other cameras may take over.
                    if short and 0 < way < 5:
                        continue
                    event = NOTHING if way == 0 else BOUNCE if way == 4 else KICK
                    if way == 5:
                        if not changed[k]:
                            continue
                        event = JUMP
                    may = event == NOTHING or not (may_not[k] >> event) & 1
                    if k and (now or not may) and (event != missing or event == NOTHING):
                        continue
                    m, P = cm[made], cC[made]
                    after, cost = mode, 0.0
                    if k == 0:
                        cost = initialize_state(m, P, mode)
                    elif way == 0:
                        copy_state(m, P, M[h], C[h])
                        predict_state(m, P, mode, dt)
                    elif way == 5:
                        copy_state(m, P, M[h], C[h])
                        cost = apply_view_jump(m, P, mode, dt)
                    elif way == 4:
                        if mode != FLIGHT:
                            continue
                        copy_state(m, P, M[h], C[h])
                        cost = apply_bounce(m, P, FLIGHT, dt)
                        if cost > -np.inf and m[5] > -1.2:
                            # Too low a hop to be seen as one.
                            copy_state(m, P, M[h], C[h])
                            after = ROLL
                            cost = apply_bounce(m, P, ROLL, dt)
                    else:
                        after = FLIGHT if way == 1 else ROLL if way == 2 else HELD
                        if after == HELD and mode == HELD:
                            continue
                        # Of those that are touched now two stay: one that cannot be among them is not tried.
                        least = (
                            second[after, KICK, 1] if jump_of[after, KICK] == jumped[h] else -np.inf
                        )
                        if score[h] + max_kick_log_probability(after, dt) + most < least:
                            continue
                        copy_state(m, P, M[h], C[h])
                        cost = apply_kick(m, P, mode, after, dt)
                    if cost == -np.inf or (k and score[h] + cost + most < best - _WORST):
                        # Whatever it sees, it is not kept.
                        continue
                    likely, cleft[made] = apply_knot_measurements(
                        m, P, starts[k], starts[k + 1],
                        centres, across, along, noise, scale, far, far_sigma, kept_m, kept_P,
                    )  # fmt: skip
                    likely += cost + score[h] if k else cost
                    for row in range(places[k], places[k + 1]):
                        square, total = apply_linear_measurement(
                            m, P, normal[row], value[row], sigma[row] ** 2
                        )
                        likely -= min(square / 2, _UNLIKELY) + np.log(total) / 2
                    likely -= out_of_bounds_cost(m, P, after, room)
                    happened = event in (KICK, BOUNCE)
                    cs[made], cmode[made], cevent[made], cp[made] = likely, after, event, h
                    csince[made] = k if happened else since[h]
                    clatest[made] = event if happened else latest[h]
                    cjump[made] = k if event == JUMP else jumped[h]
                    best = max(best, likely)
                    if event == KICK:
                        if jump_of[after, event] == -1:
                            jump_of[after, event] = jumped[h]
                        if jump_of[after, event] == jumped[h] and likely > second[after, event, 1]:
                            second[after, event, 1] = min(likely, second[after, event, 0])
                            second[after, event, 0] = max(likely, second[after, event, 0])
                    made += 1
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
                same = since[other] == csince[c] and jumped[other] == cjump[c]
                if same and modes[k, other] == cmode[c]:
                    alike += events[k, other] == cevent[c]
            if alike >= _ALIKE:
                continue
            copy_state(M[kept], C[kept], cm[c], cC[c])
            for i in range(6):
                states[k, kept, i] = cm[c, i]
            score[kept] = cs[c]
            parent[k, kept], modes[k, kept], events[k, kept] = cp[c], cmode[c], cevent[c]
            lefts[k, kept] = cleft[c]
            since[kept], latest[kept], jumped[kept] = csince[c], clatest[c], cjump[c]
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
