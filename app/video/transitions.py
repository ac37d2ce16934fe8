"""Soft transitions: dissolves, wipes, flying logos and fades, as intervals of frames.

Frames that lie some time apart, with no hard cut between them, and show nothing of each other are a
candidate. What lies between is then looked at cell by cell (``measures.CELLS``): where it goes dark
it is a fade; where many cells change at once, frame after frame, between two calm stretches, a wipe
or a logo; where all cells go evenly from one picture to the other, a dissolve. A camera that turns
moves everything one way, and is none of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.video.measures import Measured, convert_lags_to_frames

TransitionKind = Literal["dissolve", "wipe", "fade"]

LEAST_APART = 0.25
"""Of a candidate: product of what is left after motion and of the share of other colours."""
DARK, LEAST_LIGHT = 24.0, 0.45
"""Mean grey level of the darkest frame of a fade, and its share of the light beside it."""
LEAST_TORN, LEAST_CELLS, LEAST_SHARE, TORN_TIMES = 14, 4, 0.18, 1.3
"""Torn cells of the most torn frame of a wipe, and of each of its frames: so many, such a share of
the most torn one, and so many times as many as beside it."""
LEAST_FOREIGN = 46.0
"""Distance of a logo that fills the picture from any mix of what is shown before and after, grey levels."""
CALM_CELLS = 8
"""Torn cells of most frames of a calm shot."""
MOST_CALM, ALL_TORN, MOST_BUSY, BESIDE = 0.45, 118, 0.75, 6
"""Beside a wipe so little is torn, by its most torn frame; beside a logo that tears everything more may
be. Frames that are looked at beside it, beyond the lag."""
WHIP_MOTION, WHIP_TOGETHER, MOST_TURNING = 3.0, 0.6, 0.35
"""Motion of a camera's fast turn, pixels of the small picture, how much agrees with it, and share of
the frames of a transition that may show one."""
RAMP_JUMP, RAMP_SLOPE, RAMP_RMS = (0.6, 1.6), 0.6, 0.1
"""Of a dissolve: how much of the way the ramp goes, slope beside it by its own, misfit."""
MOST_OFF, MOST_UNREST, LEAST_DISTANCE = 0.55, 0.72, 14.0
"""Of a dissolve: what is no mix of both pictures and how much they change beside it, both by their
distance; that distance, grey levels."""


ALIKE = 30.0
"""Of pictures before and after that may be of one restless shot, grey levels."""
MOST_UNEVEN, MOST_OFF_MIXED = 0.25, 0.7
"""Of a dissolve: how far cells are from the mix of the whole, and what is no mix at all."""
WORST_SCORE, MOST_LIT = 0.72, 0.25
"""Of a transition: how badly it may fit, and share of its frames that a flash may light."""
OFF, UNREST, LENGTH = 0.5, 0.5, 0.15
"""How much of the score each of what speaks against a transition makes."""


@dataclass(frozen=True)
class Transition:
    """A soft transition: its frames belong to neither shot.

    Attributes:
        first, last: Its frames.
        kind: What it is.
        score: How badly it fits; of two that overlap the lower one counts.
    """

    first: int
    last: int
    kind: TransitionKind
    score: float = 0.0


def find_soft_transitions(
    rows: Measured, step: float, cuts: IntArray, flashed: BoolArray
) -> list[Transition]:
    """All soft transitions, in order; none overlap.

    Args:
        rows: Measures of the frames.
        step: Usual time between two frames, seconds.
        cuts: First frames behind hard cuts.
        flashed: Which frames a flash lights.
    """
    scene = _TransitionSearch(rows, step, cuts, flashed)
    found: list[Transition] = []
    for lag, numbers in scene.candidates():
        for number in numbers:
            one = scene.find_transition_between(number, lag)
            if one is not None:
                found.append(one)
    chosen: list[Transition] = []
    for one in sorted(found, key=lambda each: each.score):
        if all(one.first > other.last + 2 or one.last < other.first - 2 for other in chosen):
            chosen.append(one)
    return scene.merge_wipes(sorted(chosen, key=lambda each: each.first))


class _TransitionSearch:
    """Measures as they are looked at here."""

    def __init__(self, rows: Measured, step: float, cuts: IntArray, flashed: BoolArray):
        self._rows, self._lags, self._flashed = rows, convert_lags_to_frames(1 / step), flashed
        self._cells = rows["cells"].reshape(len(rows), -1)
        self._bounds = np.concatenate([[0], cuts, [len(rows)]])
        cut = np.zeros(len(rows), np.int64)
        cut[cuts] = 1
        self._cuts_until = np.cumsum(cut)

    def candidates(self) -> list[tuple[int, list[int]]]:
        """For each lag the frames that are most apart from the frame that long before."""
        found = []
        for at, lag in enumerate(self._lags):
            if lag >= len(self._rows):
                continue
            here = np.arange(lag, len(self._rows))
            apart = np.zeros(len(self._rows))
            product = self._rows["apart"][:, at] * self._rows["recoloured"][:, at]
            free = self._cuts_until[here] == self._cuts_until[here - lag]
            free &= ~self._flashed[here] & ~self._flashed[here - lag]
            apart[here] = np.where(free, product[here], 0.0)
            reach = max(lag // 3, 1)
            numbers = [
                int(number)
                for number in np.flatnonzero(apart > LEAST_APART)
                if apart[number] >= apart[max(number - reach, 0) : number + reach + 1].max()
            ]
            found.append((lag, numbers))
        return found

    def merge_wipes(self, found: list[Transition]) -> list[Transition]:
        """Wipes close to each other made one: a logo flew in, stood, and flew out."""
        merged: list[Transition] = []
        for one in found:
            before = merged[-1] if merged else None
            if (
                before is not None
                and one.first - before.last - 1 <= self._lags[0] * 3 // 2
                and not self._cuts_until[one.first] > self._cuts_until[before.last]
            ):
                kind: TransitionKind = "fade" if "fade" in (before.kind, one.kind) else "wipe"
                merged[-1] = Transition(before.first, one.last, kind, before.score)
            else:
                merged.append(one)
        return merged

    def find_transition_between(self, number: int, lag: int) -> Transition | None:
        """What lies between a frame and the one so many frames before; None: no transition."""
        at = int(np.searchsorted(self._bounds, number, "right"))
        low, high = int(self._bounds[at - 1]), int(self._bounds[at])
        found = (
            self._detect_fade(number, lag, low, high)
            or self._detect_logo(number, lag, low, high)
            or self._detect_wipe(number, lag, low, high)
            or self._detect_dissolve(number, lag, low, high)
        )
        if found is None or found.score > WORST_SCORE:
            return None
        lit = self._flashed[max(found.first - 1, 0) : found.last + 2]
        return None if lit.mean() > MOST_LIT else found

    def _detect_fade(self, number: int, lag: int, low: int, high: int) -> Transition | None:
        """Through black."""
        start, stop = max(number - lag, low), min(number + lag, high)
        light = self._cells[start:stop].mean(axis=1)
        darkest = int(light.argmin())
        if light[darkest] > DARK:
            return None
        dark = start + darkest
        ends = []
        for way in (-1, 1):
            limit = low if way < 0 else high - 1
            line = np.arange(dark, limit + way, way)[: self._lags[2] + 1]
            lit = self._cells[line].mean(axis=1)
            if len(line) < 4 or lit.max() < max(DARK, lit[0] / LEAST_LIGHT):
                return None
            ends.append(int(line[0]) + way * _find_brightness_knee(lit))
        first, last = ends[0] + 1, ends[1] - 1
        return Transition(first, last, "fade", 0.0) if first <= last else None

    def _detect_logo(self, number: int, lag: int, low: int, high: int) -> Transition | None:
        """Something that belongs to neither shot covers cells, all of them in the middle."""
        start, stop = max(number - lag, low), min(number, high - 1)
        if lag < self._lags[1]:
            return None
        cells = self._cells[start : stop + 1].astype(np.float64)
        way = cells[-1] - cells[0]
        shares = np.clip((cells - cells[0]) @ way / max(float(way @ way), 1.0), 0.0, 1.0)
        off = np.abs(cells - cells[0] - shares[:, None] * way).mean(axis=1)
        middle = int(off.argmax())
        if off[middle] < LEAST_FOREIGN:
            return None
        reach = self._lags[2] * 4 // 5
        middle += start
        first = self._find_outermost_logo_frame(middle, -1, max(middle - reach, low), low)
        last = self._find_outermost_logo_frame(middle, 1, min(middle + reach, high - 1), high - 1)
        if first is None or last is None or self._is_whip_pan(slice(first, last + 1)):
            return None
        torn = self._rows["torn"][first : last + 2]
        if torn.max() < LEAST_TORN or last - first < 2:
            return None
        return Transition(first, last, "wipe", 0.02)

    def _find_outermost_logo_frame(
        self, middle: int, way: int, beside: int, limit: int
    ) -> int | None:
        """The outermost frame, on one side, that a logo shows in; None: the shot there is not calm."""
        torn = self._rows["torn"].astype(np.int64)
        outside = torn[np.arange(beside, limit + way, way)[: 2 * BESIDE]]
        if not len(outside) or np.percentile(outside, 80) > CALM_CELLS:
            return None
        place = _find_last_torn_frame(torn, middle, way, 1.5 * CALM_CELLS, beside, self._lags[1])
        # A frame is torn from the one before: behind the last one there is no logo any more.
        return place if way < 0 else max(place - 1, middle)

    def _detect_wipe(self, number: int, lag: int, low: int, high: int) -> Transition | None:
        """Cells are torn in each frame, which are not before or after."""
        torn = self._rows["torn"].astype(np.int64)
        before, after = max(number - lag, low + 1), min(number, high - 1)
        if after - before < 1:
            return None
        peak = before + int(torn[before : after + 1].argmax())
        if torn[peak] < LEAST_TORN:
            return None
        calm = [
            self._usual_torn_cells(torn, before - lag - BESIDE, before, low),
            self._usual_torn_cells(torn, after + 1, after + lag + BESIDE, high),
        ]
        if max(calm) > MOST_CALM * torn[peak] and (
            torn[peak] < ALL_TORN or max(calm) > MOST_BUSY * torn[peak]
        ):
            return None
        least = max(LEAST_CELLS, LEAST_SHARE * torn[peak])
        bars = [max(TORN_TIMES * usual + 2, least) for usual in calm]
        gap = max(self._lags[0] // 2, 2)
        first = _find_last_torn_frame(torn, peak, -1, bars[0], low + 1, gap)
        last = _find_last_torn_frame(torn, peak, 1, bars[1], high - 1, gap)
        if last - first < 1 or last - first > self._lags[2] + lag // 2:
            return None
        # The frame that is torn last shows the new picture alone.
        frames = slice(first, last)
        if first - 1 < low or last >= high or self._is_whip_pan(frames):
            return None
        old, new = self._cells[first - 1], self._cells[last]
        kind, off, distance = _classify_transition(self._cells[frames], old, new)
        if distance < LEAST_DISTANCE and off < 1.0:
            return None
        if max(calm) > MOST_CALM * torn[peak] and last - first < 3:
            return None
        return Transition(
            first, last - 1, kind, self._compute_interval_cost(first, last - 1, off, low, high)
        )

    @staticmethod
    def _usual_torn_cells(torn: IntArray, start: int, stop: int, bound: int) -> float:
        start, stop = max(start, bound if start < bound < stop else 0), min(stop, len(torn))
        part = torn[start:stop]
        return float(np.percentile(part, 80)) if len(part) else 0.0

    def _detect_dissolve(self, number: int, lag: int, low: int, high: int) -> Transition | None:
        """All cells go evenly from one picture to the other."""
        beside = max(lag // 2, 8)
        start, stop = max(number - lag - beside, low), min(number + beside + 1, high)
        cells = self._cells[start:stop].astype(np.float64)
        if len(cells) < 9:
            return None
        old, new = cells[number - lag - start], cells[number - start]
        way = new - old
        shares = (cells - old) @ way / max(float(way @ way), 1.0)
        fit = _fit_ramp(shares, lag + 6)
        if fit is None:
            return None
        first, last, jump, slope, rms = fit
        if not RAMP_JUMP[0] <= jump <= RAMP_JUMP[1] or slope > RAMP_SLOPE or rms > RAMP_RMS:
            return None
        frames = slice(start + first + 1, start + last)
        if self._is_whip_pan(frames):
            return None
        old, new = cells[first], cells[last]
        kind, off, distance = _classify_transition(self._cells[frames], old, new)
        length = max(last - first, 4)
        unrest = np.abs(cells[max(first - length, 0)] - old).mean()
        unrest += np.abs(cells[min(last + length, len(cells) - 1)] - new).mean()
        unrest /= 2 * max(distance, 1.0)
        if distance < LEAST_DISTANCE or off > MOST_OFF or unrest > MOST_UNREST:
            return None
        if kind == "wipe" and distance < ALIKE and not self._has_more_torn_cells(frames, low, high):
            return None
        score = self._compute_interval_cost(frames.start, frames.stop - 1, off, low, high)
        return Transition(frames.start, frames.stop - 1, kind, score)

    def _has_more_torn_cells(self, frames: slice, low: int, high: int) -> bool:
        """Whether more cells are torn than on either side: a camera that runs along with somebody tears some all the time."""
        torn = self._rows["torn"].astype(np.int64)
        most = float(np.percentile(torn[frames], 80))
        sides = (
            self._usual_torn_cells(torn, frames.start - self._lags[1], frames.start, low),
            self._usual_torn_cells(torn, frames.stop + 1, frames.stop + self._lags[1], high),
        )
        return most > max(sides)

    def _compute_interval_cost(
        self, first: int, last: int, off: float, low: int, high: int
    ) -> float:
        """How badly an interval parts two shots: it is no mix of them, they change beside it, it is long."""
        near = max(self._lags[0] * 2 // 3, 3)
        beside = (first - 1, last + 1, first - 1 - near, last + 1 + near)
        places = np.clip(beside, low, high - 1)
        old, new, before, after = self._cells[places].astype(np.float64)
        unrest = np.abs(before - old).mean() + np.abs(after - new).mean()
        unrest /= 2 * max(float(np.abs(new - old).mean()), 1.0)
        return float(
            0.1
            + OFF * min(off, MOST_OFF)
            + UNREST * unrest
            + LENGTH * (last - first) / self._lags[2]
        )

    def _is_whip_pan(self, frames: slice) -> bool:
        """Whether a camera turns: everything moves fast one way, in most frames or at both ends."""
        rows = self._rows
        turning = (rows["motion"] > WHIP_MOTION) & (rows["together"] > WHIP_TOGETHER)
        begins = turning[max(frames.start - 4, 0) : frames.start + 3]
        ends = turning[max(frames.stop - 3, 0) : frames.stop + 4]
        inside = turning[frames.start : frames.stop + 1]
        return bool((begins.any() and ends.any()) or inside.mean() > MOST_TURNING)


def _find_last_torn_frame(
    torn: IntArray, peak: int, way: int, bar: float, limit: int, gap: int
) -> int:
    """The last frame of those that are torn, from one on; a few calm ones among them are passed."""
    place = farthest = peak
    while place != limit and abs(place - farthest) < gap:
        place += way
        if torn[place] > bar:
            farthest = place
    return farthest


def _classify_transition(between: Any, old: Any, new: Any) -> tuple[TransitionKind, float, float]:
    """Dissolve or wipe; how far from any mix of both pictures it gets; their distance."""
    old, new = old.astype(np.float64), new.astype(np.float64)
    way = new - old
    distance = float(np.abs(way).mean())
    middle = between.astype(np.float64) - old
    shares = middle @ way / max(float(way @ way), 1.0)
    off = float(np.abs(middle - shares[:, None] * way).mean() / max(distance, 1.0))
    moved = np.abs(way) > max(distance, 12.0)
    each = middle[:, moved] / way[moved] if moved.any() else middle
    # Of a wipe each cell shows either picture, of a dissolve all show as much of both.
    halfway = np.abs(shares - 0.5) < 0.35
    uneven = np.abs(each - shares[:, None])[halfway if halfway.any() else slice(None)]
    even = bool(uneven.size) and float(np.median(uneven)) < MOST_UNEVEN
    return ("dissolve" if even and off < MOST_OFF_MIXED else "wipe"), off, distance


def _find_brightness_knee(light: FloatArray) -> int:
    """Where light that rises from a dark frame stops to rise: index of the first frame with all of it."""
    half = int(np.flatnonzero(light >= 0.5 * light.max())[0])
    rising_part = light[: half + 1]
    dark = int(np.flatnonzero(rising_part <= rising_part.min() + 2.0)[-1])
    upto = min(len(light), 3 * (half - dark) + half + 4)
    places, seen = np.arange(dark, upto, dtype=np.float64), light[dark:upto]
    best, knee = np.inf, half
    for stop in range(half, upto - 2):
        rising = np.clip((places - dark) / (stop - dark), 0.0, 1.0)
        columns = np.stack([np.ones_like(rising), rising, np.maximum(places - stop, 0.0)], axis=1)
        found = np.linalg.lstsq(columns, seen, rcond=None)[0]
        # What happens in the shot behind it counts less.
        miss = float((((columns @ found - seen) ** 2) * np.where(places > stop, 0.3, 1.0)).sum())
        if miss < best:
            best, knee = miss, stop
    return knee


def _fit_ramp(shares: FloatArray, longest: int) -> tuple[int, int, float, float, float] | None:
    """The broken line of three pieces that lies nearest to a curve.

    Returns:
        Its two knees, the rise between them, the steeper of the outer slopes by the slope between,
        and the root of the mean square that is left.
    """
    count = len(shares)
    places = np.arange(count, dtype=np.float64)
    firsts, lasts = np.meshgrid(np.arange(1, count - 3), np.arange(3, count - 1), indexing="ij")
    kept = (lasts - firsts >= 2) & (lasts - firsts <= longest)
    firsts, lasts = firsts[kept][:, None], lasts[kept][:, None]
    if not len(firsts):
        return None
    columns = np.stack(
        [
            np.ones((len(firsts), count)),
            np.minimum(places - firsts, 0.0),
            np.clip(places - firsts, 0.0, lasts - firsts),
            np.maximum(places - lasts, 0.0),
        ],
        axis=2,
    )
    square = np.einsum("pti,ptj->pij", columns, columns) + 1e-9 * np.eye(4)
    right = np.einsum("pti,t->pi", columns, shares)
    found = np.linalg.solve(square, right[..., None])[..., 0]
    left = np.einsum("pti,pi->pt", columns, found) - shares
    misses = (left**2).mean(axis=1)
    best = int(misses.argmin())
    first, last = int(firsts[best, 0]), int(lasts[best, 0])
    slope = found[best, 2]
    beside = max(abs(found[best, 1]), abs(found[best, 3])) / max(abs(slope), 1e-6)
    return first, last, float(slope * (last - first)), float(beside), float(np.sqrt(misses[best]))
