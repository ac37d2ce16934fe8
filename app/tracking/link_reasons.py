"""Why a map is refused: rays that do not meet, other maps that fit as well, times that are too uncertain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.tracking.ball_rays import BallRays
from app.tracking.link_fit import (
    APART_S,
    LEAST_OVERLAP_S,
    LEAST_SHARE,
    LinearTimeMap,
    LinkFitter,
    RayPairs,
)
from app.tracking.time_map import TimeMap

_MOST_MISS_M = 0.6
"""Median distance of rays beyond which they are not of one ball."""
_LOUD, _LONG_S = 2.0, 3.0
"""Misses that are so many times larger than the ball's own noise say something in so long an overlap
only: a wrong map of a short and smooth path fits as well."""
_USEFUL_S, _USEFUL_SHARE = 0.04, 0.05
"""Sigma of the time in the middle of the overlap and of the speed beyond which a map is no use."""
_SHIFTS_S = (-1.2, -0.5, -0.2, 0.2, 0.5, 1.2)
_STRETCHES = (0.7, 0.87, 1.15, 1.4)
"""Other maps that the ball has to exclude, with the other number as it then fits best."""
_RESTS_M = 1.0
"""Way of a ball that hardly moves."""


def judge_map(fit: LinkFitter, best: LinearTimeMap, found: Sequence[LinearTimeMap]) -> TimeMap:
    """What can be said of the best map among others."""
    for _ in range(3):
        fit.set_noise_from_misses(best)
        best = fit.refine_map(best) or best
    pairs = fit.find_ray_pairs(best)
    made = fit.to_time_map(best, pairs)
    reason = _explain_mismatch(fit, made, pairs) or _explain_ambiguity(fit, best, found, pairs)
    return replace(made, reason=reason or _explain_uncertainty(made, fit.sigma))


def _explain_mismatch(fit: LinkFitter, made: TimeMap, pairs: RayPairs) -> str | None:
    """Why the rays do not meet under a map; None where they do."""
    assert made.miss is not None
    if made.overlap < LEAST_OVERLAP_S:
        return (
            f"The live shot and the replay share {made.overlap:.1f} s with the ball; a link needs "
            f"{LEAST_OVERLAP_S} s."
        )
    loud = fit.noise > _LOUD and made.overlap < _LONG_S
    if made.miss > _MOST_MISS_M or loud:
        return (
            f"The rays of the live shot and the replay miss each other by {made.miss:.2f} m at best, "
            f"{fit.noise:.1f} times their noise: the cameras are exchanged, mirrored or not exact "
            "enough, or the replay is of another action."
        )
    meets = pairs.inside & (np.abs(pairs.miss) < 4 * fit.compute_miss_sigma(pairs))
    if meets.mean() < LEAST_SHARE:
        return (
            f"{meets.mean():.0%} of the replay's rays meet the live ones where a ball can be; a "
            f"link needs {LEAST_SHARE:.0%}: the cameras are exchanged or mirrored, or the "
            "replay is of another action."
        )
    off = np.abs((made.offset or 0.0) + (made.speed or 0.0) * fit.hints[:, 1] - fit.hints[:, 0])
    if (off > 4 * fit.hint_sigma).any():
        live, replay = fit.hints[int(off.argmax())]
        return (
            f"The ball contradicts the link {live:g}={replay:g} by {off.max():.2f} s: correct "
            "it, or leave it out."
        )
    return None


def _explain_ambiguity(
    fit: LinkFitter, best: LinearTimeMap, found: Sequence[LinearTimeMap], pairs: RayPairs
) -> str | None:
    """Why the ball cannot tell a map from others; None where it can."""
    shifted = [(replace(best, at=best.at + shift), 0) for shift in _SHIFTS_S]
    stretched = [(replace(best, speed=best.speed * factor), 1) for factor in _STRETCHES]
    for start, hold in [*((one, None) for one in found), *shifted, *stretched]:
        other = fit.refine_map(start, hold)
        if other is None or fit.max_time_difference(best, other) < APART_S / 2:
            continue
        if not fit.is_as_good(other, best):
            continue
        fits = f"an offset of {other.offset:.2f} s and a speed of {other.speed:.2f} fit as well"
        if _measure_ball_travel_m(fit.live, pairs) < _RESTS_M:
            return f"The ball hardly moves: {fits}."
        return (
            f"The ball does not tell the times: {fits}. It moves too little, or in a plane with "
            "both cameras."
        )
    return None


def _explain_uncertainty(made: TimeMap, sigma: tuple[float, float]) -> str | None:
    """Why a map is too uncertain to be used; None where it is not."""
    assert made.speed is not None
    time, speed = sigma
    if time <= _USEFUL_S and speed <= _USEFUL_SHARE * made.speed:
        return None
    return (
        f"The ball tells the times with a sigma of {time:.3f} s and the speed with {speed:.3f} "
        "only: it moves too little, or in a plane with both cameras."
    )


def _measure_ball_travel_m(live: BallRays, pairs: RayPairs) -> float:
    """How far a ball comes about, metres."""
    reach = pairs.reach_live[:, None] * live.directions[pairs.live]
    place = (live.positions[pairs.live] + reach)[pairs.inside]
    low, high = np.percentile(place, (5, 95), axis=0) if len(place) else np.zeros((2, 3))
    return float(np.linalg.norm(high - low))
