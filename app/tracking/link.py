"""Link: which time of a live shot each time of a replay shows, from the ball's rays in both.

``t_live = offset + speed * t_replay``. Rays of the same instant meet, those of others miss each other:
every offset and speed is tried, the best are refined, and what the ball leaves open is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.geometry.arrays import FloatArray, IntArray
from app.tracking.ball_rays import LONGEST_GAP_S, ROUNDED_S, BallRays
from app.tracking.link_fit import (
    FASTEST,
    FEWEST_PAIRS,
    SLOWEST,
    LinearTimeMap,
    LinkFitter,
    estimate_frame_interval_s,
)
from app.tracking.link_reasons import judge_map
from app.tracking.time_map import TimeMap, fit_map_to_instants

_CHANGE = 15.0
"""Natural logarithm of how many times likelier a change of the map makes the rays."""
TURNED = (
    "The rays of the live shot and the replay meet once the cameras of the replay are turned to the other side "
    "of the pitch."
)
_CHANGE_S, _CHANGE_SHARE = 0.04, 0.05
"""Time and share of the speed by which the maps of two pieces differ."""


def find_time_map(
    live: BallRays, replay: BallRays, hints: Sequence[tuple[float, float]] = ()
) -> TimeMap:
    """The map of a replay's times to a live shot's, or why the ball cannot tell it.

    Args:
        live: The ball's rays in the live shot.
        replay: Those in the replay.
        hints: Live and replay time of the same instants, as a person sees them, each within about
            a frame. Two say a map where the ball says none.
    """
    given = np.array(hints, dtype=float).reshape(-1, 2)
    made = explain_by_half_turn(fit_time_map(live, replay, given), live, replay, given)
    if made.pieces:
        return made
    if made.reason is not None and len(given) > 1 and np.ptp(given[:, 1]) > 0:
        return _make_map_from_hints(live, replay, given)
    return made


def fit_time_map(
    live: BallRays, replay: BallRays, hints: FloatArray, whole: bool = True
) -> TimeMap:
    """The map that the ball says, near the hints, shape (N, 2); with its pieces where a ``whole`` replay has several."""
    for name, rays in (("live shot", live), ("replay", replay)):
        if len(rays) < FEWEST_PAIRS:
            reason = f"The {name} has {len(rays)} rays to the ball; a link needs {FEWEST_PAIRS}."
            return TimeMap(reason)
        step = estimate_frame_interval_s(rays)
        if step > (LONGEST_GAP_S if rays is live else LONGEST_GAP_S / SLOWEST) + ROUNDED_S:
            reason = (
                f"The frames of the {name} that show the ball are {step:.3g} s apart; a link needs them within "
                f"{LONGEST_GAP_S:g} s of live time. Times are in seconds."
            )
            return TimeMap(reason)
    fit = LinkFitter(live, replay, hints)
    if fit.is_too_long():
        reason = (
            f"The live shot of {np.ptp(live.times):.0f} s and the replay of {np.ptp(replay.times):.0f} s are too long "
            "to be linked: give one shot of each, or an instant that both show."
        )
        return TimeMap(reason)
    tried = [fit.refine_map(one) for one in fit.find_candidate_maps()]
    found = [one for one in tried if one is not None]
    if not found:
        where = " near the instants given" if len(hints) else ""
        reason = (
            f"The rays of the live shot and the replay do not meet long enough{where}, at no speed from {SLOWEST:g} "
            f"to {FASTEST:g}."
        )
        return TimeMap(reason)
    best = max(found, key=fit.map_log_likelihood)
    made = judge_map(fit, best, found)
    return _split_into_pieces(fit, made, best, found) if whole else made


def explain_by_half_turn(
    made: TimeMap, live: BallRays, replay: BallRays, hints: FloatArray
) -> TimeMap:
    """What ``fit_time_map`` made; where it says nothing, and would once the replay's cameras are turned, that is said."""
    if made.reason is None or made.pieces:
        return made
    other = fit_time_map(live, replay.rotate_half_turn(), hints)
    if other.reason is not None and not other.pieces:
        return made
    return replace(made, reason=TURNED, turned=True)


def measure_ray_distances(
    live: BallRays, replay: BallRays, made: TimeMap
) -> tuple[FloatArray, FloatArray]:
    """Times of the rays of a replay that have live ones beside them under a map, and how far they miss, metres."""
    times, misses = [np.zeros(0)], [np.zeros(0)]
    for piece in made.pieces or (made,):
        assert piece.offset is not None and piece.speed is not None
        inside = (replay.times >= piece.first) & (replay.times <= piece.last)
        part = replay.part(np.flatnonzero(inside))
        if len(part):
            fit = LinkFitter(live, part, np.zeros((0, 2)))
            pairs = fit.find_ray_pairs(LinearTimeMap(piece.offset, piece.speed, 0.0))
            times.append(part.times[pairs.replay])
            misses.append(np.abs(pairs.miss))
    return np.concatenate(times), np.concatenate(misses)


def _make_map_from_hints(live: BallRays, replay: BallRays, hints: FloatArray) -> TimeMap:
    """The map of a person's instants alone."""
    made = fit_map_to_instants(hints, estimate_frame_interval_s(live))
    if made.reason is not None or min(len(live), len(replay)) < 2:
        return made
    assert made.offset is not None and made.speed is not None
    pairs = LinkFitter(live, replay, hints).find_ray_pairs(
        LinearTimeMap(made.offset, made.speed, 0.0)
    )
    count = len(pairs.miss)
    miss = float(np.median(np.abs(pairs.miss))) if count else None
    return replace(made, miss=miss, pairs=count)


def _split_into_pieces(
    fit: LinkFitter, made: TimeMap, best: LinearTimeMap, found: Sequence[LinearTimeMap]
) -> TimeMap:
    """What became of a link, refused where one map does not fit the whole replay.

    Every ray is given one of the maps that were found, or none, changes being dear (Viterbi); the
    rays of each stretch are then linked by themselves.
    """
    live, replay = fit.live, fit.replay
    # What one map of a changing speed leaves hangs together, and says nothing of the noise.
    fit.run = 1.0
    maps = [best, *found]
    for rows in np.array_split(np.arange(len(replay)), 3):
        near = LinkFitter(live, replay.part(rows), fit.hints[:0])
        at = float(best.to_live_times(np.array(near.middle)))
        one = near.refine_map(replace(best, at=at, middle=near.middle))
        if one is not None:
            near.set_noise_from_misses(one)
            fit.noise = min(fit.noise, near.noise)
            maps.append(one)
    left = [
        rows
        for rows in _find_stretches_by_map(fit, [best], none=True)
        if fit.has_enough_pairs(best, rows)
    ]
    for rows in left:
        near = LinkFitter(live, replay.part(rows), fit.hints[:0])
        maps += [one for one in map(near.refine_map, near.find_candidate_maps()) if one is not None]
    parts = [replay.part(rows) for rows in _find_stretches_by_map(fit, maps)]
    pieces: list[TimeMap] = []
    for part in parts if len(parts) > 1 else ():
        piece = fit_time_map(live, part, fit.hints[:0], whole=False)
        if piece.reason is None and (not pieces or _are_maps_different(pieces[-1], piece)):
            pieces.append(piece)
    if len(pieces) > 1:
        changes = " and ".join(f"{one.first:.2f} s" for one in pieces[1:])
        reason = f"One offset and speed do not fit the whole replay: they change near {changes}."
        return replace(made, reason=reason, pieces=tuple(pieces))
    if made.reason is None and left:
        first, last = replay.times[left[0][[0, -1]]]
        reason = (
            f"One offset and speed do not fit the whole replay: from {first:.2f} to {last:.2f} s its "
            "rays miss the live ones. The speed changes there, or another ball is marked."
        )
        return replace(made, reason=reason, pieces=tuple(pieces))
    return made


def _find_stretches_by_map(
    fit: LinkFitter, maps: Sequence[LinearTimeMap], none: bool = False
) -> list[IntArray]:
    """Rays of the replay that follow each other and fit one map best; or with ``none`` no map."""
    gains = np.array([np.zeros(len(fit.replay)), *(fit.ray_log_likelihoods(one) for one in maps)])
    ways = _find_best_path(gains, _CHANGE)
    stretches = np.split(np.arange(len(ways)), np.flatnonzero(np.diff(ways)) + 1)
    return [rows for rows in stretches if (ways[rows[0]] == 0) == none]


def _are_maps_different(a: TimeMap, b: TimeMap) -> bool:
    """Whether two pieces have maps that no noise makes of one."""
    assert a.offset is not None and a.speed is not None and a.covariance is not None
    assert b.offset is not None and b.speed is not None and b.covariance is not None
    ends = np.array([a.first, b.last])
    change = np.array([b.offset - a.offset, b.speed - a.speed])
    chi_square = float(change @ np.linalg.pinv(a.covariance + b.covariance) @ change)
    times = np.abs(change[0] + change[1] * ends).max()
    return (
        chi_square > 2 * _CHANGE
        and times > _CHANGE_S
        and abs(change[1]) > _CHANGE_SHARE * min(a.speed, b.speed)
    )


def _find_best_path(gains: FloatArray, change: float) -> IntArray:
    """The row of each column on the way with the greatest sum, each change of row being dear.

    Args:
        gains: Shape (rows, columns).
        change: What it takes.
    """
    rows, columns = gains.shape
    total, back = gains[:, 0].copy(), np.zeros((columns, rows), dtype=int)
    for column in range(1, columns):
        top = int(total.argmax())
        jump = total[top] - change > total
        back[column] = np.where(jump, top, np.arange(rows))
        total = np.where(jump, total[top] - change, total) + gains[:, column]
    way = np.empty(columns, dtype=int)
    way[-1] = int(total.argmax())
    for column in range(columns - 1, 0, -1):
        way[column - 1] = back[column, way[column]]
    return way
