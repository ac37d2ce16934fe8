"""Fit of two views by time: rays that should meet, how far they miss, and the map nearby under which they miss least."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solveh_banded

from app.geometry.arrays import FloatArray, IntArray
from app.tracking.ball_rays import (
    LONGEST_GAP_S,
    ROUNDED_S,
    BallRays,
    BoolArray,
    estimate_ray_velocities,
)
from app.tracking.link_kernels import score_ray_meetings
from app.tracking.time_map import TimeMap

SLOWEST, FASTEST = 0.1, 1.15
"""Speeds of replays that are looked for."""
FEWEST_PAIRS, LEAST_OVERLAP_S = 20, 0.8
"""Rays of the replay with a live one beside them, and live time between the first and the last."""
LEAST_SHARE = 0.6
"""Of the rays with a partner, those that meet it."""
_CLEARLY = 8.0
"""Natural logarithm of how many times less likely every other map has to be."""
_GRID_S, _COARSE_S = 0.02, 0.04
"""Between live rays that are looked up, and between offsets that are tried."""
_MOST_TRIED = 120
"""Rays of the replay in the search."""
_SEARCH_M = 0.35
"""How far rays of nearly the same instant are apart."""
_BACKGROUND_M = 16.0
"""Range over which rays of different instants miss each other."""
_WRONG = float(np.log(0.1))
"""Logarithm of the share of rays that are of something else."""
_FREEDOM = 4.0
"""Of the t distribution of misses: gross errors pull little."""
_BEND = 25.0
"""Acceleration of a ball, m/s2: how far it leaves the straight way between two rays."""
_CANDIDATES = 8
APART_S = 0.25
"""Maps whose times nowhere differ by more are one candidate."""
_KEPT_OF_SPEED = _CANDIDATES * (2 * round(APART_S / _COARSE_S) + 1)
"""Maps of one speed that can be among the candidates: each of these stands for its neighbours."""
_MOST_MAPS = 1e8
"""Maps that are tried at most: minutes of one processor."""
_FLOORS_M = (0.3, 0.3, 0.2, 0.15, 0.1, 0.07, 0.05, 0.03, *(0.0,) * 12)
"""What misses may have beside their noise, step by step of a refinement."""
_BLOCK_S = 0.4
"""Stretches of live time whose misses are taken for independent."""
_PRIOR_BLOCKS = 4
"""Such stretches that are believed to have been seen, as noisy as the rays say."""
_ROOM = np.array([(-67.5, 67.5), (-49.0, 49.0), (-45.0, 1.5)])
"""Where a ball can be, pitch frame (z down), metres."""
_NEAR_HINT_S = 0.3
"""How far a map may be from an instant that a person gives."""


def estimate_frame_interval_s(rays: BallRays) -> float:
    return float(np.median(np.diff(rays.times))) if len(rays) > 1 else 0.04


@dataclass(frozen=True)
class LinearTimeMap:
    """A map by the live time ``at`` of the replay's time ``middle``, and its speed."""

    at: float
    speed: float
    middle: float

    def to_live_times(self, times: FloatArray) -> FloatArray:
        """Live times of replay times."""
        return self.at + self.speed * (times - self.middle)

    @property
    def offset(self) -> float:
        """Live time of the replay's time 0."""
        return self.at - self.speed * self.middle


@dataclass(frozen=True)
class RayPairs:
    """Rays of the replay with the live rays of their times under a map.

    Attributes:
        replay: Numbers of the replay's rays, shape (M,).
        live: Numbers of the live rays before them, shape (M,).
        share: Of the way from there to the next live ray, shape (M,).
        gap: Seconds of that way, shape (M,).
        miss: Signed distances of the rays, metres, shape (M,).
        reach_live, reach_replay: Metres along the rays to where they are nearest, shape (M,).
        inside: Whether that is before both cameras and where a ball can be, shape (M,).
        normal: Directions of the misses, shape (M, 3).
    """

    replay: IntArray
    live: IntArray
    share: FloatArray
    gap: FloatArray
    miss: FloatArray
    reach_live: FloatArray
    reach_replay: FloatArray
    inside: BoolArray
    normal: FloatArray


def _find_closest_approach(
    live_at: FloatArray, live_way: FloatArray, replay_at: FloatArray, replay_way: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray, FloatArray]:
    """Misses of rays of unit length, reaches along both, whether a ball can be there, and normals.

    Source: Ericson, Real-Time Collision Detection, sec. 5.1.8 (nearest points of two lines).
    """
    normal = np.cross(live_way, replay_way)
    square = np.maximum((normal * normal).sum(axis=1), 1e-12)
    between = live_at - replay_at
    cosine = (live_way * replay_way).sum(axis=1)
    along_live = (live_way * between).sum(axis=1)
    along_replay = (replay_way * between).sum(axis=1)
    reach_live = (cosine * along_replay - along_live) / square
    reach_replay = (along_replay - cosine * along_live) / square
    normal = normal / np.sqrt(square)[:, None]
    miss = (between * normal).sum(axis=1)
    place = live_at + reach_live[:, None] * live_way
    inside = (reach_live > 1) & (reach_replay > 1)
    inside &= ((place > _ROOM[:, 0]) & (place < _ROOM[:, 1])).all(axis=1)
    return miss, reach_live, reach_replay, inside, normal


def _interpolate_rays(
    rays: BallRays, before: IntArray, times: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Positions and directions on the way from a ray to the next, and whether that is near enough."""
    gap = rays.times[before + 1] - rays.times[before]
    share = (times - rays.times[before]) / gap
    known = (gap <= LONGEST_GAP_S + ROUNDED_S) & (share >= 0) & (share <= 1)
    share = share[:, None]
    positions = (1 - share) * rays.positions[before] + share * rays.positions[before + 1]
    directions = (1 - share) * rays.directions[before] + share * rays.directions[before + 1]
    return positions, directions / np.linalg.norm(directions, axis=1, keepdims=True), known


class LinkFitter:
    """Maps between two views, compared at the noise that their rays have."""

    def __init__(self, live: BallRays, replay: BallRays, hints: FloatArray):
        self.live, self.replay, self.hints = live, replay, hints
        self.middle = float(replay.times[0] + replay.times[-1]) / 2
        self.span = float(replay.times[-1] - replay.times[0])
        self.hint_sigma = estimate_frame_interval_s(live)
        self.slopes = estimate_ray_velocities(live)
        """Velocities of the live cameras, of the live rays, and the variance of the latter."""
        self.noise = 1.0
        """Misses by those that the noise of the rays leaves."""
        self.run = 1.0
        """Neighbours that say the same, beyond those that share a ray."""
        self.sigma = (0.0, 0.0)
        """Of the live time in the middle of the last map's rays, seconds, and of its speed."""

    def max_time_difference(self, a: LinearTimeMap, b: LinearTimeMap) -> float:
        """Most seconds between the live times that two maps give the replay."""
        ends = self.replay.times[[0, -1]]
        return float(np.abs(a.to_live_times(ends) - b.to_live_times(ends)).max())

    def is_too_long(self) -> bool:
        """Whether there are more maps than can be tried."""
        of_speed = (self.live.times[-1] - self.live.times[0] + self.span / 2) / _COARSE_S
        return not len(self.hints) and of_speed * FASTEST / self._speed_step() > _MOST_MAPS

    def _speed_step(self) -> float:
        shown = float(self.live.times[-1] - self.live.times[0]) / SLOWEST
        return 0.1 / max(min(self.span, 2 * shown), 1.0)

    def find_candidate_maps(self) -> list[LinearTimeMap]:
        """Maps under which most rays meet, best first: every offset with every speed."""
        live, replay = self.live, self.replay
        some = np.unique(np.linspace(0, len(replay) - 1, _MOST_TRIED).astype(int))
        begin, end = live.times[0], live.times[-1]
        grid = np.arange(begin, end + _GRID_S, _GRID_S)
        before = np.clip(np.searchsorted(live.times, grid) - 1, 0, len(live) - 2)
        positions, directions, known = _interpolate_rays(live, before, grid)
        seen = np.hstack([positions, directions])
        rays = np.hstack([replay.positions[some], replay.directions[some]])
        sigma_live = float(np.median(live.sigma))
        step = self._speed_step()
        scores, maps = [np.zeros(0)], [np.zeros((0, 2))]
        for speed in np.arange(SLOWEST, FASTEST, step):
            shifts = speed * (replay.times[some] - self.middle) / _GRID_S
            first = int(np.floor((LEAST_OVERLAP_S - speed * self.span / 2) / _GRID_S))
            centres = np.arange(first, len(grid) - first, round(_COARSE_S / _GRID_S))
            centres = centres[self._is_near_hints(begin + _GRID_S * centres, float(speed))]
            score = score_ray_meetings(
                centres, shifts, seen, known, sigma_live, rays, replay.sigma[some], _ROOM,
                _SEARCH_M**2, _BACKGROUND_M, float(np.exp(_WRONG)),
            )  # fmt: skip
            best = np.sort(np.argsort(-score, kind="stable")[:_KEPT_OF_SPEED])
            scores.append(score[best])
            maps.append(
                np.column_stack([begin + _GRID_S * centres[best], np.full(len(best), speed)])
            )
        score, table = np.concatenate(scores), np.vstack(maps)
        chosen: list[LinearTimeMap] = []
        for row in np.argsort(-score, kind="stable"):
            if len(chosen) == _CANDIDATES or score[row] <= 0:
                break
            one = LinearTimeMap(float(table[row, 0]), float(table[row, 1]), self.middle)
            if all(self.max_time_difference(one, other) > APART_S for other in chosen):
                chosen.append(one)
        return chosen

    def _is_near_hints(self, at: FloatArray, speed: float) -> BoolArray:
        seen = at[:, None] + speed * (self.hints[:, 1] - self.middle)
        off = np.abs(seen - self.hints[:, 0]).max(axis=1, initial=0.0)
        near: BoolArray = off <= _NEAR_HINT_S
        return near

    def find_ray_pairs(self, one: LinearTimeMap) -> RayPairs:
        """The rays that have a partner under a map."""
        live, replay = self.live, self.replay
        times = one.to_live_times(replay.times)
        before = np.clip(np.searchsorted(live.times, times) - 1, 0, len(live) - 2)
        positions, directions, known = _interpolate_rays(live, before, times)
        rays = np.flatnonzero(known)
        before = before[rays]
        gap = live.times[before + 1] - live.times[before]
        share = (times[rays] - live.times[before]) / gap
        miss, reach_live, reach_replay, inside, normal = _find_closest_approach(
            positions[rays], directions[rays], replay.positions[rays], replay.directions[rays]
        )
        return RayPairs(rays, before, share, gap, miss, reach_live, reach_replay, inside, normal)

    def _split_miss_sigma(self, pairs: RayPairs) -> tuple[FloatArray, FloatArray]:
        """Deviations of the misses: of each alone, shape (M,), and by its two live rays, (M, 2)."""
        own = pairs.reach_replay * self.replay.sigma[pairs.replay]
        # All rays of the replay between the same two live ones are bent the same way.
        alike = np.sqrt(np.bincount(pairs.live, minlength=len(self.live))[pairs.live])
        bend = _BEND / 2 * pairs.share * (1 - pairs.share) * pairs.gap**2 * alike
        sigma = self.live.sigma
        shared = np.column_stack(
            [(1 - pairs.share) * sigma[pairs.live], pairs.share * sigma[pairs.live + 1]]
        )
        return np.hypot(own, bend), shared * pairs.reach_live[:, None]

    def compute_miss_sigma(self, pairs: RayPairs) -> FloatArray:
        """Deviation of each miss, metres, shape (M,)."""
        own, shared = self._split_miss_sigma(pairs)
        sigma: FloatArray = self.noise * np.sqrt(own**2 + (shared**2).sum(axis=1))
        return sigma

    def _jacobian(self, pairs: RayPairs) -> FloatArray:
        """Derivatives of the misses by the map's time and speed, shape (M, 2)."""
        at, way, _ = self.slopes
        share = pairs.share[:, None]
        moved = (1 - share) * at[pairs.live] + share * at[pairs.live + 1]
        turned = (1 - share) * way[pairs.live] + share * way[pairs.live + 1]
        slope = ((moved + pairs.reach_live[:, None] * turned) * pairs.normal).sum(axis=1)
        return np.column_stack([slope, slope * (self.replay.times[pairs.replay] - self.middle)])

    def refine_map(self, one: LinearTimeMap, hold: int | None = None) -> LinearTimeMap | None:
        """The map nearby that fits best, or None; ``hold`` keeps its time (0) or its speed (1)."""
        free = [at for at in (0, 1) if at != hold]
        at = np.array([one.at, one.speed])
        most = np.array([0.1, 0.2 / max(self.span, 1.0)])[free]
        hinted = np.column_stack([np.ones(len(self.hints)), self.hints[:, 1] - self.middle])
        for floor in _FLOORS_M:
            pairs = self.find_ray_pairs(replace(one, at=float(at[0]), speed=float(at[1])))
            if len(pairs.miss) < FEWEST_PAIRS:
                return None
            pulled = self._make_weighting(pairs, floor)(jacobian := self._jacobian(pairs))
            normal, pull = jacobian.T @ pulled, pulled.T @ pairs.miss
            normal += hinted.T @ hinted / self.hint_sigma**2
            pull += hinted.T @ (hinted @ at - self.hints[:, 0]) / self.hint_sigma**2
            step = -np.linalg.pinv(normal[np.ix_(free, free)], hermitian=True) @ pull[free]
            step *= min(1.0, float((most / np.maximum(np.abs(step), 1e-12)).min()))
            at[free] += step
            if not 0.8 * SLOWEST <= at[1] <= 1.2 * FASTEST:
                return None
            if floor == 0.0 and np.abs(step / most).max() < 1e-4:
                break
        return replace(one, at=float(at[0]), speed=float(at[1]))

    def _make_weighting(
        self, pairs: RayPairs, floor: float = 0.0
    ) -> Callable[[FloatArray], FloatArray]:
        """The inverse covariance of the misses, gross errors doubted, as a function of columns.

        Two rays of the replay between the same live rays share those rays' noise: the covariance
        is D + S S^T with two entries in a row of S, and its inverse by Woodbury's identity asks
        for a tridiagonal system alone.
        """
        own, shared = self._split_miss_sigma(pairs)
        own, shared = self.noise * own, self.noise * shared
        total = own**2 + (shared**2).sum(axis=1) + floor**2
        weight = (_FREEDOM + 1) / (_FREEDOM + pairs.miss**2 / total)
        weight = np.where(pairs.inside, weight, 1e-3)
        diagonal = np.maximum((own**2 + floor**2) / weight, 1e-6)
        parts = shared / np.sqrt(weight)[:, None]
        band = np.zeros((2, len(self.live)))
        band[1] = 1.0
        np.add.at(band[1], pairs.live, parts[:, 0] ** 2 / diagonal)
        np.add.at(band[1], pairs.live + 1, parts[:, 1] ** 2 / diagonal)
        np.add.at(band[0], pairs.live + 1, parts[:, 0] * parts[:, 1] / diagonal)

        def apply_inverse_covariance(columns: FloatArray) -> FloatArray:
            scaled = columns / diagonal[:, None]
            held = np.zeros((len(self.live), columns.shape[1]))
            np.add.at(held, pairs.live, parts[:, :1] * scaled)
            np.add.at(held, pairs.live + 1, parts[:, 1:] * scaled)
            held = solveh_banded(band, held)
            back = parts[:, :1] * held[pairs.live] + parts[:, 1:] * held[pairs.live + 1]
            result: FloatArray = scaled - back / diagonal[:, None]
            return result

        return apply_inverse_covariance

    def ray_log_likelihoods(self, one: LinearTimeMap) -> FloatArray:
        """Logarithm of how much likelier each ray's miss is under a map than by chance, (N,).

        0 where a ray has no partner.
        """
        pairs = self.find_ray_pairs(one)
        sigma = self.compute_miss_sigma(pairs)
        # The density of the t distribution with four degrees of freedom.
        ratio = np.log(0.375 * _BACKGROUND_M / sigma) - 2.5 * np.log1p(
            (pairs.miss / sigma) ** 2 / _FREEDOM
        )
        ratio = np.where(pairs.inside, np.maximum(ratio, _WRONG), _WRONG)
        # Rays of the replay between the same two live ones say nearly the same.
        count = np.bincount(pairs.live, minlength=len(self.live))
        result = np.zeros(len(self.replay))
        result[pairs.replay] = ratio / count[pairs.live] / self.run
        return result

    def has_enough_pairs(self, one: LinearTimeMap, rows: IntArray) -> bool:
        """Whether so many of some rays have partners under a map that they could be linked."""
        times = self.replay.times[np.intersect1d(rows, self.find_ray_pairs(one).replay)]
        if len(times) < FEWEST_PAIRS:
            return False
        return one.speed * float(np.ptp(times)) >= LEAST_OVERLAP_S / 2

    def map_log_likelihood(self, one: LinearTimeMap) -> float:
        """The same of all rays, and of a person's instants."""
        off = (one.to_live_times(self.hints[:, 1]) - self.hints[:, 0]) / self.hint_sigma
        return float(self.ray_log_likelihoods(one).sum() - (off**2).sum() / 2)

    def is_as_good(self, other: LinearTimeMap, best: LinearTimeMap) -> bool:
        """Whether another map explains the rays as well, or most of them: those with partners."""
        if self.map_log_likelihood(other) > self.map_log_likelihood(best) - _CLEARLY:
            return True
        mine, others = self.ray_log_likelihoods(best), self.ray_log_likelihoods(other)
        both = (mine != 0) & (others != 0)
        if both.sum() < LEAST_SHARE * (mine != 0).sum():
            return False
        of_hints = (
            self.map_log_likelihood(other)
            - others.sum()
            - (self.map_log_likelihood(best) - mine.sum())
        )
        return bool(others[both].sum() + of_hints > mine[both].sum() - _CLEARLY)

    def set_noise_from_misses(self, one: LinearTimeMap) -> None:
        """Take the noise from the misses under a map."""
        pairs = self.find_ray_pairs(one)
        if pairs.inside.sum() >= FEWEST_PAIRS // 2:
            ratio = np.abs(pairs.miss / self.compute_miss_sigma(pairs))[pairs.inside]
            self.noise = max(self.noise * float(np.median(ratio)) / 0.6745, 1.0)

    def to_time_map(self, one: LinearTimeMap, pairs: RayPairs) -> TimeMap:
        """A map with its covariance, wider where neighbouring misses hang together."""
        jacobian, weigh = self._jacobian(pairs), self._make_weighting(pairs)
        hinted = np.column_stack([np.ones(len(self.hints)), self.hints[:, 1] - self.middle])
        held = hinted.T @ hinted / self.hint_sigma**2
        normal = jacobian.T @ weigh(jacobian) + held
        # Noise of the slopes looks like motion that tells the time; it tells nothing.
        noise = self.noise * pairs.reach_live * np.sqrt(self.slopes[2][pairs.live])
        lever = np.column_stack([noise, noise * (self.replay.times[pairs.replay] - self.middle)])
        told = normal - lever.T @ (lever * np.maximum(weigh(np.ones((len(noise), 1))), 0.0))
        known = np.linalg.pinv(told, hermitian=True)
        known = known @ normal @ known
        pulls = jacobian * weigh(pairs.miss[:, None])
        times = self.live.times[pairs.live]
        block = np.floor((times - times[0]) / _BLOCK_S).astype(int)
        sums = np.column_stack([np.bincount(block, pulls[:, at]) for at in (0, 1)])
        blocks = len(np.unique(block))
        # The two numbers of the map fit two of the blocks.
        run = float(((sums @ known) * sums).sum()) / 2 * blocks / max(blocks - 2, 1)
        self.run = max(1.0, (run * blocks + _PRIOR_BLOCKS) / (blocks + _PRIOR_BLOCKS))
        turn = np.array([[1.0, -self.middle], [0.0, 1.0]])
        rays = self.replay.times[pairs.replay]
        # The offset may lie so far from the rays that its covariance tells nothing of them.
        middle = np.array([1.0, float(np.median(rays)) - self.middle])
        variances = self.run * middle @ known @ middle, self.run * known[1, 1]
        self.sigma = float(np.sqrt(variances[0])), float(np.sqrt(variances[1]))
        return TimeMap(
            None,
            one.offset,
            one.speed,
            self.run * (turn @ known @ turn.T),
            float(np.median(np.abs(pairs.miss))),
            len(rays),
            float(one.speed * (rays[-1] - rays[0])),
            first=float(self.replay.times[0]),
            last=float(self.replay.times[-1]),
        )
