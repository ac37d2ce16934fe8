"""One click on a ball follows it through the frames of a shot, forwards and backwards.

Several histories of where it may have gone are kept beside each other, each with a score of how much the places
look like the ball and how smoothly it moves beside the background; what comes later decides between them. A place
that looked the same before the ball came there is clutter, and no history jumps to it for nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.camera import Camera
from app.tracking.ball_picture import (
    BallColour,
    BallSpot,
    Grey,
    Image,
    disc,
    find_ball,
    fit_disc,
    likeness,
)
from app.tracking.ball_run import (
    BallClick,
    BallRun,
    End,
    FollowedBall,
    FollowHints,
    State,
)
from app.tracking.motion import match_background

BALL_M = 0.22
BACKGROUND_WIDTH = 640
"""Pixels of width at which the background is followed."""
BEAM, DEEPEST = 24, 18.0
"""How many histories are kept, and how much worse than the best one they may be."""
CANDIDATES = 14
"""Places of a frame that are looked at."""
REACH, LARGEST_ROI = 5.0, 420
"""How far a ball is kicked from one frame to the next, diameters; and how much of a picture is searched, pixels."""
KICKED = 0.04
"""Probability of a kick or bounce a frame."""
MISSED = -2.0
"""Score of a frame in which the ball is not seen."""
MOST_MISSED = 12
"""Frames in a row without the ball after which it is lost."""
STATIC_LAGS, STATIC_SHARE, STATIC = (3, 6), 0.75, 5.0
"""So many frames before, a place that looked the same to this share is clutter; what that costs."""
LOOK_AHEAD = 8
"""Frames that decide between histories, as far as a frame's confidence goes."""
CERTAIN = 0.5
"""Confidence below which a frame is uncertain."""
SAME = 0.7
"""Diameters within which two places are the same ball."""


def expected_diameter(camera: Camera, x: float, y: float) -> float | None:
    """Of a ball that lies on the grass where a pixel looks, pixels; None where it looks at none.

    One in the air is nearer and larger.
    """
    ground = camera.on_ground(np.array([[x, y]]))[0]
    if not np.isfinite(ground).all() or np.hypot(*ground) > 150:
        return None
    depth = float(camera.pitch_to_camera(np.array([[*ground, -BALL_M / 2]]))[0, 2])
    return BALL_M * camera.focal_length[0] / depth if depth > 0 else None


def follow_ball(
    read: Callable[[int], Image],
    click: BallClick,
    before: Iterable[int],
    after: Iterable[int],
    hints: FollowHints | None = None,
    tell: Callable[[int], None] | None = None,
) -> BallRun | None:
    """Follow a ball from a click.

    Args:
        read: Gives a frame by its number: red green blue, shape (H, W, 3).
        click: Where the ball is.
        before: Numbers of the frames before it, the nearest first.
        after: Numbers of the frames behind it, the nearest first.
        hints: What is known beside the pictures.
        tell: Called with frames done.

    Returns:
        None where nothing near the click looks like a ball.
    """
    hints = hints or FollowHints()
    number, x, y = click.frame, click.x, click.y
    image = read(number)
    camera = hints.cameras.get(number)
    found = find_ball(image, x, y, None if camera is None else expected_diameter(camera, x, y))
    if found is None:
        return None
    spot, colour = found
    first = FollowedBall(number, spot.x, spot.y, spot.diameter, spot.sigma_px, 1.0, "followed")
    ways, ends = [], list[End]()
    done = 0
    for numbers in (before, after):
        way = _Way(_Frame.of(number, image, colour), spot, hints)
        end: End = "limit"
        for each in numbers:
            stopped = way.step(_Frame.of(each, read(each), colour))
            done += 1
            if tell is not None:
                tell(done)
            if stopped is not None:
                end = stopped
                break
        ways.append(way.balls())
        ends.append(end)
    return BallRun((click,), (*reversed(ways[0]), first, *ways[1]), *ends)


class _Peak(NamedTuple):
    """A place of a picture that looks like a ball.

    Attributes:
        x, y: Pixels.
        alike, contrast: As ``ball_picture.likeness`` has them.
        smear, angle: As of ``ball_picture.disc``.
        added: What a detector says, as a logarithm.
    """

    x: float
    y: float
    alike: float
    contrast: float
    smear: float = 0.0
    angle: float = 0.0
    added: float = 0.0


@dataclass(frozen=True)
class _Frame:
    """A frame as the search sees it.

    Attributes:
        image: Red green blue, shape (H, W, 3).
        colour: Makes it the grey picture in which a ball stands out.
        small: For the motion of the background, where cameras do not say it.
    """

    number: int
    image: Image
    colour: BallColour
    small: Grey

    @staticmethod
    def of(number: int, image: Image, colour: BallColour) -> _Frame:
        scale = min(1.0, BACKGROUND_WIDTH / image.shape[1])
        small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), np.uint8)
        return _Frame(number, image, colour, grey)

    @property
    def size(self) -> FloatArray:
        """Width and height."""
        return np.array(self.image.shape[1::-1], float)

    def part(self, left: int, top: int, right: int, bottom: int) -> Grey:
        """The grey picture from a corner to before another one; beyond the rim it goes on as it ends."""
        height, width = self.image.shape[:2]
        rows = np.clip(np.arange(top, bottom), 0, height - 1)
        columns = np.clip(np.arange(left, right), 0, width - 1)
        return self.colour.grey(self.image[rows[0] : rows[-1] + 1][rows - rows[0]][:, columns])


def _turn(here: _Frame, there: _Frame, cameras: Mapping[int, Camera]) -> FloatArray:
    """How the background moves from a frame to another one, a homography of pixels, shape (3, 3)."""
    one, other = cameras.get(here.number), cameras.get(there.number)
    width, height = here.size
    if one is not None and other is not None:
        grid = np.stack(np.meshgrid(np.linspace(0, width, 5), np.linspace(0, height, 5)), -1)
        pixels = grid.reshape(-1, 2)
        moved = other.project(other.position + 60.0 * one.rays(pixels))
        seen = np.isfinite(moved).all(axis=1)
        if seen.sum() >= 8:
            found, _ = cv2.findHomography(pixels[seen], moved[seen], 0)
            if found is not None:
                return np.asarray(found, float)
    match = match_background(here.small, there.small)
    if match is None:
        return np.eye(3)
    found, _ = cv2.findHomography(match.here, match.there, 0)
    scale = width / here.small.shape[1]
    half = (scale - 1) / 2
    enlarge = np.array([[scale, 0, half], [0, scale, half], [0, 0, 1.0]])
    return np.asarray(enlarge @ found @ np.linalg.inv(enlarge)) if found is not None else np.eye(3)


def _moved(turn: FloatArray, points: FloatArray) -> FloatArray:
    """Points (N, 2) after a homography."""
    whole = points @ turn[:, :2].T + turn[:, 2]
    return np.asarray(whole[:, :2] / whole[:, 2:])


def _inverse(turn: FloatArray) -> FloatArray:
    """The homography back."""
    return np.asarray(np.linalg.inv(turn), float)


@dataclass(frozen=True)
class _Candidates:
    """Places of a frame that may be the ball.

    Attributes:
        places: Pixels, shape (C, 2).
        looks: Logarithm of how much likelier each look is of the ball than of anything else, shape (C,).
        static: How much of it was there so many frames before, shape (C, lags); NaN where nobody knows.
        parts: The picture around each, with the pixel of its corner.
        smears: How far it is smeared by its motion, pixels, and the direction, shape (C, 2).
    """

    places: FloatArray
    looks: FloatArray
    static: FloatArray
    parts: list[tuple[Grey, FloatArray]]
    smears: FloatArray


@dataclass(frozen=True)
class _Step:
    """The histories that are kept at a frame, H of them.

    Attributes:
        places: Where each has the ball, shape (H, 2).
        parents: Which one of the frame before each continues, shape (H,).
        chosen: Which candidate each took, -1: none, shape (H,).
        scores: Of the whole histories, shape (H,).
    """

    number: int
    diameter: float
    places: FloatArray
    parents: IntArray
    chosen: IntArray
    scores: FloatArray
    candidates: _Candidates


class _Way:
    """Follows a ball one way, frame by frame."""

    def __init__(self, frame: _Frame, spot: BallSpot, hints: FollowHints):
        self._last, self._hints = frame, hints
        self._diameter = spot.diameter
        self._clicked = spot
        self._places = spot.center[None]
        self._speeds = np.zeros((1, 2))
        self._missed = np.zeros(1, np.int64)
        self._ages = np.zeros(1, np.int64)
        self._scores = np.zeros(1)
        longest = max(STATIC_LAGS)
        self._trail: FloatArray = np.full((1, longest, 2), np.nan)
        self._earlier: deque[tuple[_Frame, FloatArray]] = deque(maxlen=longest)
        self._steps: list[_Step] = []

    def step(self, frame: _Frame) -> End | None:
        """Look at the next frame; returns why the way ends there."""
        turn = _turn(self._last, frame, self._hints.cameras)
        self._carry(frame, turn)
        candidates = self._look(frame)
        self._choose(frame, candidates)
        self._last = frame
        best = self._places[0]
        margin = self._diameter / 2
        if self._missed[0] and ((best < margin).any() or (best > frame.size - margin).any()):
            return "left"
        return "lost" if self._missed[0] > MOST_MISSED else None

    def _carry(self, frame: _Frame, turn: FloatArray) -> None:
        """Everything in pixels of the next frame."""
        self._earlier = deque(
            ((one, turn @ way) for one, way in [(self._last, np.eye(3)), *self._earlier]),
            maxlen=self._earlier.maxlen,
        )
        places = _moved(turn, self._places)
        ahead = _moved(turn, self._places + self._speeds)
        trail: FloatArray = np.concatenate([self._places[:, None], self._trail[:, :-1]], axis=1)
        self._trail = _moved(turn, trail.reshape(-1, 2)).reshape(trail.shape)
        one = np.array([[1.0, 0.0], [0.0, 1.0]])
        edge = _moved(turn, self._places[:1] + one) - places[:1]
        scale = float(np.sqrt(abs(np.linalg.det(edge))))
        self._diameter *= float(np.clip(scale, 0.9, 1.1))
        self._places, self._speeds = places, ahead - places
        camera = self._hints.cameras.get(frame.number)
        if camera is not None and (lies := expected_diameter(camera, *places[0])) is not None:
            self._diameter = float(np.clip(self._diameter, 0.85 * lies, 1.8 * lies))

    def _look(self, frame: _Frame) -> _Candidates:
        """The places that look most like the ball where histories may have gone."""
        size = self._diameter
        speed = np.hypot(*self._speeds.T)
        reach = size * REACH * (1 + 0.15 * self._missed) + 0.5 * speed * (1 + self._missed)
        ahead = self._ahead()
        worth = self._scores > self._scores.max() - DEEPEST / 2
        centers = [*ahead[worth], *self._places[worth]]
        reaches = [*reach[worth], *np.full(int(worth.sum()), size * REACH)]
        hint = self._hints.places.get(frame.number)
        if hint is not None:
            centers.append(np.array([hint.x, hint.y]))
            reaches.append(2.5 * float(np.sqrt(np.linalg.eigvalsh(hint.covariance)[-1])) + size)
        both = np.array(centers), np.array(reaches)[:, None]
        low, high = (both[0] - both[1]).min(axis=0), (both[0] + both[1]).max(axis=0)
        middle = ahead[0]
        low = np.maximum(low, middle - LARGEST_ROI / 2).round()
        high = np.minimum(high, middle + LARGEST_ROI / 2).round()
        return self._peaks(frame, low, high)

    def _ahead(self) -> FloatArray:
        return np.asarray(self._places + self._speeds)

    def _peaks(self, frame: _Frame, low: FloatArray, high: FloatArray) -> _Candidates:
        size = self._diameter
        border = int(np.ceil(2.2 * size)) + 8
        width, height = frame.size
        left, right = np.clip([low[0], high[0]], 0, width - 1).astype(int)
        top, bottom = np.clip([low[1], high[1]], 0, height - 1).astype(int)
        found: list[_Peak] = []
        if right > left and bottom > top:
            wide = frame.part(left - border, top - border, right + border + 1, bottom + border + 1)
            for smear, angle in self._smears():
                found += self._peaks_of(wide, (left, top), border, smear, angle)
        found += self._peaks_of_detector(frame)
        found = _apart(sorted(found, key=lambda one: -one.alike), 0.4 * size)[:CANDIDATES]
        values = np.array(found, float).reshape(-1, 7)
        places, alike, contrast = values[:, :2], values[:, 2], values[:, 3]
        parts = [
            _part(frame, place, size + smear / 2)
            for place, smear in zip(places, values[:, 4], strict=True)
        ]
        looks = _looks(alike, contrast) + values[:, 6]
        static = self._static(places, alike * np.maximum(contrast, 0.05))
        return _Candidates(places, looks, static, parts, values[:, 4:6])

    def _smears(self) -> list[tuple[float, float]]:
        """How the ball may be smeared: not at all, or by its motion in the picture while the shutter is open."""
        best = self._places[0] + self._speeds[0]
        earlier = self._trail[0, 0]
        if not np.isfinite(earlier).all():
            return [(0.0, 0.0)]
        # In the picture, not beside the background.
        _, way = self._earlier[0]
        before = _moved(_inverse(way), earlier[None])[0]
        moved = best - before
        far = float(np.hypot(*moved))
        if far < 0.8 * self._diameter:
            return [(0.0, 0.0)]
        angle = float(np.arctan2(moved[1], moved[0]) % np.pi)
        return [(0.0, 0.0), (round(min(0.4 * far, 3 * self._diameter)), round(angle / 0.2) * 0.2)]

    def _peaks_of(
        self, wide: Grey, corner: tuple[int, int], border: int, smear: float, angle: float
    ) -> list[_Peak]:
        """Local maxima."""
        size = self._diameter
        template = disc(round(size * 4) / 4, smear, angle)
        side = template.shape[0] // 2
        cut = border - side
        inner = wide[cut : wide.shape[0] - cut, cut : wide.shape[1] - cut]
        alike, contrast = likeness(inner, template)
        worth = alike * np.clip(contrast / 0.5, 0, 1)
        around = np.ones((2 * max(round(size / 3), 1) + 1,) * 2, np.uint8)
        peaks = (worth >= cv2.dilate(worth, around)) & (worth > 0.25)
        rows, columns = np.nonzero(peaks)
        order = np.argsort(-worth[rows, columns])[:CANDIDATES]
        found = []
        for row, column in zip(rows[order], columns[order], strict=True):
            x, y = _top_of(worth, int(row), int(column))
            values = float(alike[row, column]), float(contrast[row, column])
            found.append(_Peak(corner[0] + x, corner[1] + y, *values, smear, angle))
        return found

    def _peaks_of_detector(self, frame: _Frame) -> list[_Peak]:
        return [
            _Peak(one.x, one.y, 0.62, 1.0, added=4.0 * (one.score - 0.25))
            for one in self._hints.detected.get(frame.number, ())
            if 0.4 < one.diameter / self._diameter < 2.5
        ]

    def _static(self, places: FloatArray, worth: FloatArray) -> FloatArray:
        """How much of each place was there before, as a share of what is there now, shape (C, lags)."""
        shares = np.full((len(places), len(STATIC_LAGS)), np.nan)
        template = disc(round(self._diameter * 4) / 4)
        reach = template.shape[0] // 2 + 2
        for column, lag in enumerate(STATIC_LAGS):
            if lag > len(self._earlier) or not len(places):
                continue
            frame, way = self._earlier[lag - 1]
            there = _moved(_inverse(way), places)
            for row, (x, y) in enumerate(there.round().astype(int)):
                if not (0 <= x < frame.size[0] and 0 <= y < frame.size[1]):
                    continue
                part = frame.part(x - reach, y - reach, x + reach + 1, y + reach + 1)
                alike, contrast = likeness(part, template)
                shares[row, column] = float((alike * np.maximum(contrast, 0)).max()) / worth[row]
        return shares

    def _choose(self, frame: _Frame, found: _Candidates) -> None:
        """Extend every history by every candidate and by none, and keep the best."""
        size, count = self._diameter, len(found.places)
        ahead, speed = self._ahead(), np.hypot(*self._speeds.T)
        wait = 1.0 + self._missed
        spread = (0.15 * size + 0.4 + 0.12 * speed) * (1 + 0.6 * self._missed)
        spread = np.where(self._ages == 0, 2.0 * size, spread)
        off = found.places[None] - ahead[:, None]
        smooth = -0.5 * (off**2).sum(axis=2) / spread[:, None] ** 2
        smooth -= np.log(2 * np.pi * (spread / size) ** 2)[:, None]
        from_here = np.hypot(*(found.places[None] - self._places[:, None]).transpose(2, 0, 1))
        far = REACH * np.sqrt(wait)[:, None] + (speed * wait / size)[:, None]
        kicked = np.log(KICKED) - np.log(np.pi * far**2)
        kicked = kicked - 4.0 * np.maximum(from_here / size / far - 1, 0)
        moves = np.logaddexp(smooth, kicked)
        was_kicked = kicked > smooth
        # Where it looked the same before the history came there, it is not what the history follows.
        came = np.stack([self._trail[:, lag - 1] for lag in STATIC_LAGS], axis=1)
        away = np.hypot(*(found.places[None, :, None] - came[:, None]).transpose(3, 0, 1, 2))
        with np.errstate(invalid="ignore"):
            clutter = ((away > 1.5 * size) & (found.static[None] > STATIC_SHARE)).any(axis=2)
        total = self._scores[:, None] + moves + found.looks[None] - STATIC * clutter
        total += self._hinted(frame, found.places)
        unseen = self._scores + MISSED
        every = np.concatenate([total.ravel(), unseen])
        order = np.argsort(-every)[: 8 * BEAM]
        parents = np.where(order < total.size, order // max(count, 1), order - total.size)
        chosen = np.where(order < total.size, order % max(count, 1), -1)
        places = np.where(
            (chosen >= 0)[:, None],
            found.places[chosen] if count else ahead[parents],
            ahead[parents],
        )
        fresh = (places - self._places[parents]) / wait[parents, None]
        kick = np.array([c >= 0 and was_kicked[p, c] for p, c in zip(parents, chosen, strict=True)])
        kick |= self._ages[parents] == 0
        smoothed = self._speeds[parents] + 0.5 * (places - ahead[parents]) / wait[parents, None]
        speeds = np.where((kick & (chosen >= 0))[:, None], fresh, smoothed)
        kept = _unlike(places, speeds, every[order], size)
        self._places, self._speeds = places[kept], speeds[kept]
        self._missed = np.where(chosen[kept] >= 0, 0, self._missed[parents[kept]] + 1)
        self._ages = self._ages[parents[kept]] + (chosen[kept] >= 0)
        self._trail = self._trail[parents[kept]]
        self._scores = every[order][kept]
        step = _Step(
            frame.number, size, self._places, parents[kept], chosen[kept], self._scores, found
        )
        self._steps.append(step)
        if (place := chosen[kept][0]) >= 0:
            self._resize(found, int(place))

    def _hinted(self, frame: _Frame, places: FloatArray) -> FloatArray:
        """What a predicted place says of each place, against its being anywhere near, shape (C,)."""
        hint = self._hints.places.get(frame.number)
        if hint is None or not len(places):
            return np.zeros(len(places))
        spread = hint.covariance + np.eye(2) * (0.5 * self._diameter) ** 2
        off = places - (hint.x, hint.y)
        near = np.exp(-0.5 * np.einsum("ni,ij,nj->n", off, np.linalg.inv(spread), off))
        return np.asarray(np.log(0.05 + near) + 1.0)

    def _resize(self, found: _Candidates, place: int) -> None:
        """The size follows what is seen, slowly."""
        spot = self._fitted(found, place, self._diameter)
        if spot is not None and spot.likeness > 0.6:
            share = np.clip(spot.diameter / self._diameter, 0.8, 1.25)
            self._diameter *= float(share**0.1)

    def _fitted(self, found: _Candidates, place: int, size: float) -> BallSpot | None:
        part, corner = found.parts[place]
        x, y = found.places[place] - corner
        smear, angle = found.smears[place]
        return fit_disc(part, float(x), float(y), size, float(smear), float(angle))

    def balls(self) -> list[FollowedBall]:
        """The frames of the best history, the nearest to the click first, as far as the ball was seen."""
        steps, rows = self._steps, list[int]()
        row = 0
        for step in reversed(steps):
            rows.append(row)
            row = int(step.parents[row])
        rows.reverse()
        seen = [step.chosen[row] >= 0 for step, row in zip(steps, rows, strict=True)]
        last = max((at for at, one in enumerate(seen) if one), default=-1)
        return [self._ball(at, rows) for at in range(last + 1)]

    def _ball(self, at: int, rows: Sequence[int]) -> FollowedBall:
        step, row = self._steps[at], rows[at]
        margin = self._margin(at, rows)
        choice = int(step.chosen[row])
        spot = None if choice < 0 else self._fitted(step.candidates, choice, step.diameter)
        if choice < 0:
            x, y = step.places[row]
            size = step.diameter
            return FollowedBall(step.number, float(x), float(y), size, size, 0.1, "uncertain")
        looks = float(step.candidates.looks[choice])
        confidence = float(1 / (1 + np.exp(-(0.9 * looks + 0.5 * min(margin, 8.0) - 2.0))))
        state: State = "followed" if confidence >= CERTAIN else "uncertain"
        if spot is None:
            x, y = step.places[row]
            size = step.diameter
            return FollowedBall(
                step.number, float(x), float(y), size, 0.3 * size, confidence, state
            )
        corner = step.candidates.parts[choice][1]
        return FollowedBall(
            step.number, spot.x + float(corner[0]), spot.y + float(corner[1]), spot.diameter,
            spot.sigma_px, confidence, state,
        )  # fmt: skip

    def _margin(self, at: int, rows: Sequence[int]) -> float:
        """How much better the best history is than those that have the ball elsewhere in a frame."""
        end = min(at + LOOK_AHEAD, len(self._steps) - 1)
        back = np.arange(len(self._steps[end].scores))
        scores = self._steps[end].scores
        for number in range(end, at, -1):
            back = self._steps[number].parents[back]
        step = self._steps[at]
        off = np.hypot(*(step.places[back] - step.places[rows[at]]).T)
        other = off > SAME * step.diameter
        mine = scores[~other]
        if not other.any() or not len(mine):
            return DEEPEST
        return float(mine.max() - scores[other].max())


def _looks(alike: FloatArray, contrast: FloatArray) -> FloatArray:
    """How much likelier a look is of the ball than of anything else, as a logarithm."""
    against = np.log(np.clip(contrast, 0.1, 4.0))
    return np.asarray(7.0 * (alike - 0.62) - 1.2 * against**2)


def _part(frame: _Frame, place: FloatArray, reach: float) -> tuple[Grey, FloatArray]:
    """The picture around a place, with the pixel of its corner."""
    around = round(1.8 * reach) + 6
    x, y = place.round().astype(int)
    left, top = x - around, y - around
    return frame.part(left, top, x + around + 1, y + around + 1), np.array([left, top], float)


def _top_of(values: FloatArray, row: int, column: int) -> tuple[float, float]:
    """Column and row of a maximum between its pixels."""
    place = []
    for at, line in ((column, values[row]), (row, values[:, column])):
        shift = 0.0
        if 0 < at < len(line) - 1:
            low, here, high = (float(one) for one in line[at - 1 : at + 2])
            bend = low - 2 * here + high
            shift = float(np.clip(0.5 * (low - high) / bend, -0.5, 0.5)) if bend < -1e-6 else 0.0
        place.append(at + shift)
    return place[0], place[1]


def _apart(found: Sequence[_Peak], least: float) -> list[_Peak]:
    """Those that no better one is near; what a detector adds to a place goes to that."""
    kept: list[_Peak] = []
    for one in found:
        near = next(
            (at for at, old in enumerate(kept) if np.hypot(one.x - old.x, one.y - old.y) < least),
            -1,
        )
        if near < 0:
            kept.append(one)
        elif one.added:
            kept[near] = kept[near]._replace(added=max(kept[near].added, one.added))
    return kept


def _unlike(places: FloatArray, speeds: FloatArray, scores: FloatArray, size: float) -> BoolArray:
    """Which histories are kept, the best first: those whose future is not that of a better one."""
    kept = np.zeros(len(places), bool)
    mine: list[int] = []
    for at in range(len(places)):
        if scores[at] < scores[0] - DEEPEST or len(mine) >= BEAM:
            break
        if mine:
            close = np.hypot(*(places[mine] - places[at]).T) < 0.3 * size
            alike = np.hypot(*(speeds[mine] - speeds[at]).T) < 0.4 * size + 0.5
            if (close & alike).any():
                continue
        kept[at] = True
        mine.append(at)
    return kept
