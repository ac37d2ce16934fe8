"""Fit: the smooth way of a ball through its rays, given what it does when, with its covariance.

Position, velocity and acceleration beside gravity, drag and rolling are unknown at every knot; each
interval ties its ends by the physics of its mode, or by a kick or bounce at an unknown time within it.
The normal equations are block tridiagonal, and solved in time linear in the number of knots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.tracking.ball_fit_kernels import (
    FREEDOM,
    NEAR_M,
    SIZE,
    build_normal_equations,
    compute_hit_residuals,
    factor_block_tridiagonal,
    inverse_blocks,
    solve_factored,
)
from app.tracking.ball_models import (
    BOUNCE,
    DRAG,
    FLIGHT,
    GRASS_S,
    GRASS_SIGMA,
    HELD,
    HELD_S,
    HELD_SIGMA,
    JUMP,
    JUMP_SIGMA,
    KICK,
    REST,
    ROLL,
    ROLL_S,
    ROLL_SIGMA,
    SPIN_LEAST,
    SPIN_S,
    SPIN_SHARE,
)
from app.tracking.ball_search import TrackKnots

P, V = slice(0, 3), slice(3, 6)
"""Where position and velocity stand in a state."""
_ROUNDS, _MOST_M = 30, 8.0
"""Steps of the fit, and how far one may move a ball."""
SETTLED_M = 1e-4
"""A fit is done where no place moves by more."""
_LOOSE = {FLIGHT: 0.5, ROLL: 1.0, HELD: 1.0}
"""White noise of the acceleration beside its slow part, by mode, (m/s2)2 s."""
_ROUGH = 0.0016
"""How a ball leaves the smooth way of any model, a random walk, m2/s: 8 mm in a frame of 40 ms."""


@dataclass(frozen=True)
class FittedPath:
    """The smooth way.

    Attributes:
        state: Position, velocity and acceleration at each knot, shape (K, 9).
        covariance: Of each, shape (K, 9, 9).
        miss: Of each ray, by its noise, shape (R, 2).
        slope: Derivative of these by the position, shape (R, 2, 3).
        weight: Of each ray, 1 but for gross errors, shape (R,).
        event_time: Of the event before each knot, seconds, NaN where there is none, shape (K,).
        event_sigma: Of these.
        late: How much the rays say of each view's time, per second squared, shape (V, V).
        late_pull: And in which direction, per second, shape (V,).
    """

    state: FloatArray
    covariance: FloatArray
    miss: FloatArray
    slope: FloatArray
    weight: FloatArray
    event_time: FloatArray
    event_sigma: FloatArray
    late: FloatArray
    late_pull: FloatArray


def fit_ball_path(
    knots: TrackKnots,
    mode: IntArray,
    event: IntArray,
    used: BoolArray,
    start: FloatArray,
    noise: FloatArray,
    unseen: FloatArray,
    *,
    brief: bool = False,
    settled_m: float = SETTLED_M,
) -> FittedPath:
    """Fit the way of a ball.

    Args:
        knots: Instants and rays.
        mode: At each knot, by number, shape (K,).
        event: Before each knot, by number, shape (K,).
        used: Rays that are of the ball, shape (R,).
        start: State at each knot to begin with, shape (K, 9).
        noise: Of each ray, radians, shape (R,).
        unseen: What touches that nobody saw add to the noise of the acceleration before each
            knot, (m/s2)2 s, shape (K,).
        brief: Leave out what only a result tells: ``event_sigma`` is NaN, and nothing is late.
        settled_m: Done where no place moves by more, metres.
    """
    problem = _PathProblem(knots, mode, event, used, noise, unseen, start)
    state = start
    for _ in range(_ROUNDS):
        diagonal, beside, pull = problem.compute_normal_equations(state)
        rows = factor_block_tridiagonal(diagonal, beside)
        step = -solve_factored(rows, pull.ravel()).reshape(-1, SIZE)
        most = float(np.abs(step[:, P]).max())
        state = state + step * min(1.0, _MOST_M / max(most, 1e-12))
        if most < settled_m:
            break
    diagonal, beside, _ = problem.compute_normal_equations(state)
    rows = factor_block_tridiagonal(diagonal, beside)
    covariance, after = inverse_blocks(rows)
    when, spread = problem.events(state, None if brief else (covariance, after))
    miss, slope, weight = problem.misses(state)
    late = (np.zeros((0, 0)), np.zeros(0)) if brief else problem.time_offset_equations(state, rows)
    return FittedPath(state, covariance, miss, slope, weight, when, spread, *late)


class _PathProblem:
    """The equations of a fit."""

    def __init__(
        self,
        knots: TrackKnots,
        mode: IntArray,
        event: IntArray,
        used: BoolArray,
        noise: FloatArray,
        unseen: FloatArray,
        start: FloatArray,
    ) -> None:
        self.knots, self.mode, self.event = knots, mode, event
        self.used, self.noise = used, noise
        self.dt = np.diff(knots.times)
        self.loud = np.flatnonzero((event[1:] == KICK) | (event[1:] == BOUNCE))
        turned = spin_acceleration_sigma(np.linalg.norm(start[:-1, V], axis=1))
        jumps = event[1:] == JUMP
        self.way, self.inverse = event_free_transition(mode[1:], self.dt, unseen[1:], turned, jumps)

    def misses(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Misses of the rays by their noise, (R, 2); their slopes, (R, 2, 3); and weights, (R,)."""
        knots = self.knots
        off = state[knots.at, P] - knots.centres
        reach = np.maximum((off * knots.along).sum(axis=1), NEAR_M)
        aside = np.einsum("rij,rj->ri", knots.across, off)
        miss = aside / (reach * self.noise)[:, None]
        slope = (
            knots.across / reach[:, None, None]
            - aside[:, :, None] * knots.along[:, None, :] / (reach**2)[:, None, None]
        ) / self.noise[:, None, None]
        weight = (FREEDOM + 2) / (FREEDOM + (miss**2).sum(axis=1))
        return miss, slope, np.where(self.used, np.minimum(weight, 1.0), 0.0)

    def compute_normal_equations(
        self, state: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Diagonal blocks, (K, 9, 9); those beside them, (K - 1, 9, 9); and the pull, (K, 9)."""
        knots, asked = self.knots, self.knots.asked
        # What is known before anything is seen.
        roll = self.mode[0] == ROLL
        begin = np.array([0, 0, -REST if roll else -2.0, 0, 0, 0, 0, 0, 0])
        lift = (GRASS_SIGMA, 0.1, 0.5) if roll else (4.0, 5.0, 2.0)
        sigma = np.array([40, 30, lift[0], 10, 10, lift[1], 2.0, 2.0, lift[2]])
        found: tuple[FloatArray, FloatArray, FloatArray] = build_normal_equations(
            state, self.mode, self.event, self.dt, self.way, self.inverse,
            knots.at, self.used, self.noise, knots.centres, knots.along, knots.across,
            knots.far, knots.far_sigma, asked.at, asked.normal, asked.value, asked.sigma,
            begin, sigma,
        )  # fmt: skip
        return found

    def events(
        self, state: FloatArray, blocks: tuple[FloatArray, FloatArray] | None
    ) -> tuple[FloatArray, FloatArray]:
        """Times of the events before each knot, and their sigmas, NaN without blocks of covariance, both (K,)."""
        when, spread = np.full(len(state), np.nan), np.full(len(state), np.nan)
        for at in self.loud.tolist():
            _, slopes, own, way, time, slack = compute_hit_residuals(
                state[at], state[at + 1], self.dt[at], self.mode[at], self.mode[at + 1],
                self.event[at + 1] == BOUNCE,
            )  # fmt: skip
            when[at + 1] = self.knots.times[at] + time
            if blocks is None:
                continue
            covariance, after = blocks
            rows = np.flatnonzero(np.isfinite(own))
            both = np.block([[covariance[at], after[at]], [after[at].T, covariance[at + 1]]])
            noise = np.diag(own[rows]) + slopes[rows] @ both @ slopes[rows].T
            gain = way[rows] @ np.linalg.pinv(noise, hermitian=True) @ way[rows]
            spread[at + 1] = np.sqrt(1 / (1 / slack + gain))
        return when, spread

    def time_offset_equations(
        self, state: FloatArray, rows: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """What the rays say of the views' times when the ball's way may follow, (V, V) and (V,)."""
        knots = self.knots
        miss, slope, weight = self.misses(state)
        moved = np.einsum("rki,ri->rk", slope, state[knots.at, V])
        views = int(knots.view.max(initial=-1)) + 1
        known, pull = np.zeros((views, views)), np.zeros(views)
        tied = np.zeros((views, *state.shape))
        for view in range(views):
            own = np.flatnonzero((knots.view == view) & (weight > 0))
            push = moved[own] * weight[own, None]
            known[view, view] = (push * moved[own]).sum()
            pull[view] = (push * miss[own]).sum()
            np.add.at(tied[view][:, P], knots.at[own], np.einsum("rki,rk->ri", slope[own], push))
        flat = tied.reshape(views, -1)
        for view in range(views):
            known[view] -= flat @ solve_factored(rows, flat[view])
        return (known + known.T) / 2, pull


def spin_acceleration_sigma(speed: FloatArray) -> FloatArray:
    """Standard deviation of the acceleration by spin and wind at a speed, m/s2."""
    return SPIN_SHARE * DRAG * np.minimum(speed, 30.0) ** 2 + SPIN_LEAST


def event_free_transition(
    mode: IntArray, dt: FloatArray, unseen: FloatArray, strong_spin: FloatArray, jumps: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """How states move without events and without drag, and the inverse of the noise, (N, 9, 9) each.

    Args:
        mode: Of each interval, shape (N,).
        dt: Seconds, shape (N,).
        unseen: What touches that nobody saw add to the acceleration's noise, (m/s2)2 s, shape (N,).
        strong_spin: From ``spin_acceleration_sigma``, shape (N,).
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
