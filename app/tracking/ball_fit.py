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
from app.tracking.ball_models import (
    BOUNCE,
    DRAG,
    FLIGHT,
    GRASS_S,
    GRASS_SIGMA,
    GRAVITY,
    HELD_S,
    HELD_SIGMA,
    KEPT,
    KEPT_SIGMA,
    KICK_LIFT,
    KICK_SPEED,
    NOTHING,
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
from app.tracking.ball_search import Knots

SIZE = 9
"""Unknowns of a knot: position, velocity, acceleration."""
_P, _V, _A = slice(0, 3), slice(3, 6), slice(6, 9)
_FREEDOM = 6.0
"""Of the t distribution of rays: gross errors pull little."""
_ROUNDS, _MOST_M = 30, 8.0
"""Steps of the fit, and how far one may move a ball."""
_SETTLED_M = 1e-4
_SLACK_M = 0.01
"""How exactly two ways meet where the ball is touched."""
_LOOSE = {FLIGHT: 0.5, ROLL: 1.0, 2: 1.0}
"""White noise of the acceleration beside its slow part, by mode, (m/s2)2 s."""
ROUGH = 0.0016
"""How a ball leaves the smooth way of any model, a random walk, m2/s: 8 mm in a frame of 40 ms."""
_GRAVITY = np.array([0.0, 0.0, GRAVITY])
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
        most = float(np.abs(step[:, _P]).max())
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
        self.quiet = np.flatnonzero(event[1:] == NOTHING)
        self.loud = np.flatnonzero(event[1:] != NOTHING)
        after = mode[1:][self.quiet]
        dt = self.dt[self.quiet]
        spin = _spin(np.linalg.norm(start[self.quiet, _V], axis=1))
        self.way, self.inverse = _quiet_noise(after, dt, unseen[1:][self.quiet], spin)

    def misses(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Misses of the rays by their noise, (R, 2); their slopes, (R, 2, 3); and weights, (R,)."""
        knots = self.knots
        off = state[knots.at, _P] - knots.centres
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
        moved = np.einsum("rki,ri->rk", slope, state[knots.at, _V])
        views = int(knots.view.max(initial=-1)) + 1
        known, pull = np.zeros((views, views)), np.zeros(views)
        tied = np.zeros((views, *state.shape))
        for view in range(views):
            own = np.flatnonzero((knots.view == view) & (weight > 0))
            push = moved[own] * weight[own, None]
            known[view, view] = (push * moved[own]).sum()
            pull[view] = (push * miss[own]).sum()
            np.add.at(tied[view][:, _P], knots.at[own], np.einsum("rki,rk->ri", slope[own], push))
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
            off = ((state[knots.at[far], _P] - knots.centres[far]) * along).sum(axis=1)
            off = (off - knots.far[far]) / knots.far_sigma[far]
            doubt = np.minimum(1.0, 2.0 / np.maximum(np.abs(off), 1e-9)) / knots.far_sigma[far]
            normal[far] += (doubt / knots.far_sigma[far])[:, None, None] * (
                along[:, :, None] * along[:, None, :]
            )
            force[far] += (doubt * off)[:, None] * along
        np.add.at(diagonal[:, _P, _P], knots.at, normal)
        np.add.at(pull[:, _P], knots.at, force)
        asked = knots.asked
        if len(asked.at):
            off = (state[asked.at, _P] * asked.normal).sum(axis=1) - asked.value
            sure = asked.normal / asked.sigma[:, None] ** 2
            np.add.at(diagonal[:, _P, _P], asked.at, sure[:, :, None] * asked.normal[:, None, :])
            np.add.at(pull[:, _P], asked.at, off[:, None] * sure)

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
        velocity = state[at, _V]
        speed = np.linalg.norm(velocity, axis=1)
        way = self.way.copy()
        flies, rolls = mode == FLIGHT, mode == ROLL
        pushed = np.zeros_like(velocity)
        bent = np.zeros((len(at), 3, 3))
        pushed[flies] = _GRAVITY - DRAG * speed[flies, None] * velocity[flies]
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
        way[:, _P, _V] += bent * half[:, :, None]
        way[:, _V, _V] += bent * step[:, :, None]
        moved = np.einsum("nij,nj->ni", self.way, state[at])
        moved[:, _P] += pushed * half
        moved[:, _V] += pushed * step
        moved[rolls, 2] -= REST * (1 - np.exp(-dt[rolls] / GRASS_S))
        miss = state[at + 1] - moved
        held = self.inverse @ way
        diagonal[at] += way.transpose(0, 2, 1) @ held
        diagonal[at + 1] += self.inverse
        beside[at] -= held.transpose(0, 2, 1)
        force = np.einsum("nij,nj->ni", self.inverse, miss)
        pull[at + 1] += force
        pull[at] -= np.einsum("nji,nj->ni", way, force)

    def _hit(self, state: FloatArray, at: int) -> _Hit:
        """An interval with a kick or a bounce at an unknown time."""
        before, after = self.mode[at], self.mode[at + 1]
        bounce = self.event[at + 1] == BOUNCE
        return _hit_of(state[at], state[at + 1], self.dt[at], before, after, bounce)


@dataclass(frozen=True)
class _Hit:
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


def _hit_of(a: FloatArray, b: FloatArray, dt: float, before: int, after: int, bounce: bool) -> _Hit:
    dt = max(float(dt), 1e-4)
    fall_a = _GRAVITY if before == FLIGHT else np.zeros(3)
    fall_b = _GRAVITY if after == FLIGHT else np.zeros(3)
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
        float(_spin(np.linalg.norm(b[None, _V], axis=1))[0]) ** 2,
    )
    noise[9:] = height_sigma**2
    covariance = np.diag(noise)

    def at_time(time: float) -> tuple[FloatArray, FloatArray]:
        rest = dt - time
        miss, way = np.zeros(rows), np.zeros(rows)
        miss[:3] = b[_P] - b[_V] * rest + fall_b * rest**2 / 2
        miss[:3] -= a[_P] + a[_V] * time + fall_a * time**2 / 2
        way[:3] = b[_V] - fall_b * rest - a[_V] - fall_a * time
        miss[3:6] = b[_V] - fall_b * rest - kept * (a[_V] + fall_a * time) - mean
        miss[6:9] = b[_A]
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
    slopes[:3, _P], slopes[:3, _V] = -np.eye(3), -time * np.eye(3)
    slopes[:3, SIZE : SIZE + 3], slopes[:3, SIZE + 3 : SIZE + 6] = np.eye(3), -rest * np.eye(3)
    slopes[3:6, _V] = -np.diag(kept)
    slopes[3:6, SIZE + 3 : SIZE + 6] = np.eye(3)
    slopes[6:9, SIZE + 6 :] = np.eye(3)
    if mid_air:
        slopes[9, 2], slopes[9, 5] = 1.0, time
    elif low:
        slopes[9, SIZE + 2] = 1.0
    weight = np.asarray(np.linalg.inv(covariance + spread * np.outer(way, way)), dtype=float)
    straight = miss - way * (time - middle)
    return _Hit(straight, slopes, weight, covariance, way, time)


def _spin(speed: FloatArray) -> FloatArray:
    """Standard deviation of the acceleration by spin and wind at a speed, m/s2."""
    return SPIN_SHARE * DRAG * np.minimum(speed, 30.0) ** 2 + SPIN_LEAST


def _quiet_noise(
    mode: IntArray, dt: FloatArray, unseen: FloatArray, spin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """How states move without events and without drag, and the inverse of the noise, (N, 9, 9) each."""
    count = len(mode)
    rolls, flies = mode == ROLL, mode == FLIGHT
    way = np.tile(np.eye(SIZE), (count, 1, 1))
    noise = np.zeros((count, SIZE, SIZE))
    lasts = np.where(flies, SPIN_S, np.where(rolls, ROLL_S, HELD_S))
    strong = np.where(flies, spin, np.where(rolls, ROLL_SIGMA, HELD_SIGMA))
    stay = np.exp(-dt / lasts)
    # A ball in somebody's keeping slows down: its velocity would grow without end.
    slow = np.where(rolls | flies, 1.0, np.exp(-dt))
    loose = np.array([_LOOSE[each] for each in mode.tolist()]) + unseen
    for axis in range(3):
        p, v, a = axis, 3 + axis, 6 + axis
        way[:, p, v], way[:, p, a], way[:, v, a] = dt, dt**2 / 2, dt
        way[:, v, v], way[:, a, a] = slow, stay
        noise[:, p, p] = loose * dt**3 / 3 + ROUGH * dt
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
        noise[flat, 2, 2] = GRASS_SIGMA**2 * (1 - stay**2) + ROUGH * dt[flat]
        noise[flat, 5, 5] = 0.2**2
        noise[flat, 8, 8] = 1.0
    return way, np.asarray(np.linalg.inv(noise), dtype=float)
