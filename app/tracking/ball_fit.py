"""Fit: the smooth way of a ball through its rays, given what it does when, with its covariance.

Position, velocity and acceleration beside gravity, drag and rolling are unknown at every knot; each
interval ties its ends by the physics of its mode, or by a kick or bounce at an unknown time within it.
The normal equations are block tridiagonal, and solved in time linear in the number of knots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.tracking.ball_fit_kernels import factor, inverse_blocks, solve_factored
from app.tracking.ball_intervals import GRAVITY_VECTOR, SIZE, Hit, P, V, hit_of, quiet_noise, spin
from app.tracking.ball_models import (
    BOUNCE,
    DRAG,
    FLIGHT,
    GRASS_S,
    GRASS_SIGMA,
    JUMP,
    KICK,
    REST,
    ROLL,
    ROLLING,
)
from app.tracking.ball_search import Knots

_FREEDOM = 6.0
"""Of the t distribution of rays: gross errors pull little."""
_ROUNDS, _MOST_M = 30, 8.0
"""Steps of the fit, and how far one may move a ball."""
_SETTLED_M = 1e-4
_NEAR_M = 1.0
"""No ball is nearer to a camera."""


@dataclass(frozen=True)
class Fitted:
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


def fit(
    knots: Knots,
    mode: IntArray,
    event: IntArray,
    used: BoolArray,
    start: FloatArray,
    noise: FloatArray,
    unseen: FloatArray,
) -> Fitted:
    """Fit the way of a ball.

    Args:
        knots: Instants and rays.
        mode: At each knot, by number, shape (K,).
        event: Before each knot, by number, shape (K,).
        used: Rays that are of the ball, shape (R,).
        start: Position and velocity at each knot to begin with, shape (K, 6).
        noise: Of each ray, radians, shape (R,).
        unseen: What touches that nobody saw add to the noise of the acceleration before each
            knot, (m/s2)2 s, shape (K,).
    """
    problem = _Problem(knots, mode, event, used, noise, unseen, start)
    state = np.concatenate([start, np.zeros((len(start), 3))], axis=1)
    for _ in range(_ROUNDS):
        diagonal, beside, pull = problem.equations(state)
        rows = factor(diagonal, beside)
        step = -solve_factored(rows, SIZE, pull.ravel()).reshape(-1, SIZE)
        most = float(np.abs(step[:, P]).max())
        state = state + step * min(1.0, _MOST_M / max(most, 1e-12))
        if most < _SETTLED_M:
            break
    diagonal, beside, _ = problem.equations(state)
    rows = factor(diagonal, beside)
    covariance, after = inverse_blocks(rows, SIZE)
    when, spread = problem.events(state, covariance, after)
    miss, slope, weight = problem.misses(state)
    late = problem.lateness(state, rows)
    return Fitted(state, covariance, miss, slope, weight, when, spread, *late)


class _Problem:
    """The equations of a fit."""

    def __init__(
        self,
        knots: Knots,
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
        loud = (event[1:] == KICK) | (event[1:] == BOUNCE)
        self.quiet, self.loud = np.flatnonzero(~loud), np.flatnonzero(loud)
        after = mode[1:][self.quiet]
        dt = self.dt[self.quiet]
        turned = spin(np.linalg.norm(start[self.quiet, V], axis=1))
        jumps = event[1:][self.quiet] == JUMP
        self.way, self.inverse = quiet_noise(after, dt, unseen[1:][self.quiet], turned, jumps)

    def misses(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Misses of the rays by their noise, (R, 2); their slopes, (R, 2, 3); and weights, (R,)."""
        knots = self.knots
        off = state[knots.at, P] - knots.centres
        reach = np.maximum((off * knots.along).sum(axis=1), _NEAR_M)
        aside = np.einsum("rij,rj->ri", knots.across, off)
        miss = aside / (reach * self.noise)[:, None]
        slope = (
            knots.across / reach[:, None, None]
            - aside[:, :, None] * knots.along[:, None, :] / (reach**2)[:, None, None]
        ) / self.noise[:, None, None]
        weight = (_FREEDOM + 2) / (_FREEDOM + (miss**2).sum(axis=1))
        return miss, slope, np.where(self.used, np.minimum(weight, 1.0), 0.0)

    def equations(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Diagonal blocks, (K, 9, 9); those beside them, (K - 1, 9, 9); and the pull, (K, 9)."""
        count = len(state)
        diagonal = np.zeros((count, SIZE, SIZE))
        beside = np.zeros((max(count - 1, 0), SIZE, SIZE))
        pull = np.zeros((count, SIZE))
        self._see(state, diagonal, pull)
        self._begin(state, diagonal, pull)
        self._stay_above(state, diagonal, pull)
        if len(self.quiet):
            self._move(state, diagonal, beside, pull)
        for at in self.loud.tolist():
            one = self._hit(state, at)
            pushed = one.slopes.T @ one.weight
            normal, force = pushed @ one.slopes, pushed @ one.miss
            diagonal[at] += normal[:SIZE, :SIZE]
            diagonal[at + 1] += normal[SIZE:, SIZE:]
            beside[at] += normal[:SIZE, SIZE:]
            pull[at] += force[:SIZE]
            pull[at + 1] += force[SIZE:]
        return diagonal, beside, pull

    def events(
        self, state: FloatArray, covariance: FloatArray, after: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Times of the events before each knot, and their sigmas, both (K,)."""
        when, spread = np.full(len(state), np.nan), np.full(len(state), np.nan)
        for at in self.loud.tolist():
            one = self._hit(state, at)
            when[at + 1] = self.knots.times[at] + one.time
            both = np.block([[covariance[at], after[at]], [after[at].T, covariance[at + 1]]])
            noise = one.noise + one.slopes @ both @ one.slopes.T
            gain = one.way @ np.linalg.pinv(noise, hermitian=True) @ one.way
            spread[at + 1] = np.sqrt(1 / (12 / self.dt[at] ** 2 + gain))
        return when, spread

    def lateness(self, state: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
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
            known[view] -= flat @ solve_factored(rows, SIZE, flat[view])
        return (known + known.T) / 2, pull

    def _see(self, state: FloatArray, diagonal: FloatArray, pull: FloatArray) -> None:
        knots = self.knots
        miss, slope, weight = self.misses(state)
        pushed = slope * weight[:, None, None]
        normal = np.einsum("rki,rkj->rij", pushed, slope)
        force = np.einsum("rki,rk->ri", pushed, miss)
        far = np.flatnonzero((knots.far_sigma > 0) & self.used)
        if len(far):
            along = knots.along[far]
            off = ((state[knots.at[far], P] - knots.centres[far]) * along).sum(axis=1)
            off = (off - knots.far[far]) / knots.far_sigma[far]
            doubt = np.minimum(1.0, 2.0 / np.maximum(np.abs(off), 1e-9)) / knots.far_sigma[far]
            normal[far] += (doubt / knots.far_sigma[far])[:, None, None] * (
                along[:, :, None] * along[:, None, :]
            )
            force[far] += (doubt * off)[:, None] * along
        np.add.at(diagonal[:, P, P], knots.at, normal)
        np.add.at(pull[:, P], knots.at, force)
        asked = knots.asked
        if len(asked.at):
            off = (state[asked.at, P] * asked.normal).sum(axis=1) - asked.value
            sure = asked.normal / asked.sigma[:, None] ** 2
            np.add.at(diagonal[:, P, P], asked.at, sure[:, :, None] * asked.normal[:, None, :])
            np.add.at(pull[:, P], asked.at, off[:, None] * sure)

    def _begin(self, state: FloatArray, diagonal: FloatArray, pull: FloatArray) -> None:
        """What is known before anything is seen."""
        roll = self.mode[0] == ROLL
        mean = np.array([0, 0, -REST if roll else -2.0, 0, 0, 0, 0, 0, 0])
        lift = (GRASS_SIGMA, 0.1, 0.5) if roll else (4.0, 5.0, 2.0)
        sigma = np.array([40, 30, lift[0], 10, 10, lift[1], 2.0, 2.0, lift[2]])
        diagonal[0] += np.diag(sigma**-2)
        pull[0] += (state[0] - mean) / sigma**2

    def _stay_above(self, state: FloatArray, diagonal: FloatArray, pull: FloatArray) -> None:
        low = state[:, 2] + REST
        under = (low > 0) & (self.mode != ROLL)
        diagonal[under, 2, 2] += GRASS_SIGMA**-2
        pull[under, 2] += low[under] * GRASS_SIGMA**-2

    def _move(
        self, state: FloatArray, diagonal: FloatArray, beside: FloatArray, pull: FloatArray
    ) -> None:
        """Intervals without events."""
        at = self.quiet
        mode, dt = self.mode[1:][at], self.dt[at]
        velocity = state[at, V]
        speed = np.linalg.norm(velocity, axis=1)
        way = self.way.copy()
        flies, rolls = mode == FLIGHT, mode == ROLL
        pushed = np.zeros_like(velocity)
        bent = np.zeros((len(at), 3, 3))
        pushed[flies] = GRAVITY_VECTOR - DRAG * speed[flies, None] * velocity[flies]
        safe = np.maximum(speed, 1e-3)
        bent[flies] = -DRAG * (
            safe[flies, None, None] * np.eye(3)
            + velocity[flies, :, None] * velocity[flies, None, :] / safe[flies, None, None]
        )
        pace = np.sqrt((velocity[:, :2] ** 2).sum(axis=1) + 0.25)
        pushed[rolls, :2] = -ROLLING * velocity[rolls, :2] / pace[rolls, None]
        grass = np.diag([1.0, 1.0, 0.0])
        flat = velocity * (1.0, 1.0, 0.0)
        bent[rolls] = -ROLLING * (
            grass / pace[rolls, None, None]
            - flat[rolls, :, None] * flat[rolls, None, :] / pace[rolls, None, None] ** 3
        )
        step, half = dt[:, None], dt[:, None] ** 2 / 2
        way[:, P, V] += bent * half[:, :, None]
        way[:, V, V] += bent * step[:, :, None]
        moved = np.einsum("nij,nj->ni", self.way, state[at])
        moved[:, P] += pushed * half
        moved[:, V] += pushed * step
        moved[rolls, 2] -= REST * (1 - np.exp(-dt[rolls] / GRASS_S))
        miss = state[at + 1] - moved
        held = self.inverse @ way
        diagonal[at] += way.transpose(0, 2, 1) @ held
        diagonal[at + 1] += self.inverse
        beside[at] -= held.transpose(0, 2, 1)
        force = np.einsum("nij,nj->ni", self.inverse, miss)
        pull[at + 1] += force
        pull[at] -= np.einsum("nji,nj->ni", way, force)

    def _hit(self, state: FloatArray, at: int) -> Hit:
        """An interval with a kick or a bounce at an unknown time."""
        before, after = self.mode[at], self.mode[at + 1]
        bounce = self.event[at + 1] == BOUNCE
        return hit_of(state[at], state[at + 1], self.dt[at], before, after, bounce)
