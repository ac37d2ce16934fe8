"""Annotate: the clicks and boxes that a person would leave on a view, with their noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.sample.instant import PLAYER_RADIUS, TEAM, Instant
from app.sample.views import FINE, HEIGHT, WIDTH, Indices, is_inside_image
from app.soccer.annotation import BallAnnotation, Lines, make_lines
from app.soccer.frames import Box
from app.soccer.pitch import CIRCLES, MARKINGS

CLICK_SIGMA = (0.6, 1.1)
"""Standard deviation of a click per axis, pixels at 1280 x 720; from careful to hasty views."""
CENTER_SIGMA_PX, CENTER_SIGMA_SHARE = 0.667, 0.04
"""Standard deviation of a ball box's centre per axis: pixels, and a share of the diameter."""
FORGOTTEN = 0.02
SHORTEST_PX = 0.5
FEWEST_KEPT = 6
BOX_EXCESS = (0.10, 0.40)
DECIMALS = 2
_IS_CIRCLE = np.array([name in CIRCLES for name in MARKINGS])
TAGS = "abcdefghijklmnopqrstuvwxyz"


def click_lines(rng: np.random.Generator, camera: Camera) -> Lines:
    """Clicks on every marking in view, clipped at the image border.

    Straight markings get 2 to 8 points, circles 5 to 12, in any order now and then. A marking is
    forgotten rarely, and never one of the last six.
    """
    paths = visible_paths(camera)
    markings = _drop_some_markings(rng, np.flatnonzero(paths.lengths >= SHORTEST_PX))
    owner, share = _draw_click_places(rng, markings, paths.lengths)
    clicks = paths.pixels_at(owner, share)
    clicks += rng.normal(0, rng.uniform(*CLICK_SIGMA), clicks.shape)
    points = clicks.round(DECIMALS).tolist()
    ends = np.searchsorted(owner, markings, side="right").tolist()
    starts = [0, *ends[:-1]]
    names = [MARKINGS[number] for number in markings]
    return make_lines({n: points[i:j] for n, i, j in zip(names, starts, ends, strict=True)})


@dataclass(frozen=True)
class VisiblePaths:
    """The parts of all markings that lie in the image, as short straight steps, in order.

    Attributes:
        starts: Pixels where each step begins, shape (N, 2); ``steps``: to its end, (N, 2).
        along: Length of all steps before each one, shape (N + 1,).
        lengths: Visible length of each of the 26 markings, pixels, shape (26,).
        before: Length of all markings before each one, shape (26,).
    """

    starts: FloatArray
    steps: FloatArray
    along: FloatArray
    lengths: FloatArray
    before: FloatArray

    def pixels_at(self, marking: Indices, share: FloatArray) -> FloatArray:
        """Pixels at a share (0 to 1) of the visible length of markings, shape (M, 2)."""
        place = self.before[marking] + share * self.lengths[marking]
        step = self._step_at_length(place)
        # At share 1 rounding may fall on the next marking's first step.
        step = np.clip(step, self._first_step(marking), self._last_step(marking))
        size = np.maximum(self.along[step + 1] - self.along[step], 1e-12)
        part = np.clip((place - self.along[step]) / size, 0.0, 1.0)
        places: FloatArray = self.starts[step] + part[:, None] * self.steps[step]
        return places

    def _first_step(self, marking: Indices) -> Indices:
        return self._step_at_length(self.before[marking] + 1e-9)

    def _last_step(self, marking: Indices) -> Indices:
        return self._step_at_length(self.before[marking] + self.lengths[marking] - 1e-9)

    def _step_at_length(self, place: FloatArray) -> Indices:
        return np.asarray(np.searchsorted(self.along, place, side="right") - 1, np.int64)


def visible_paths(camera: Camera) -> VisiblePaths:
    """What each marking shows of itself, with its ends on the image border where it is cut."""
    pixels = camera.project(FINE.points)
    seen = is_inside_image(pixels)
    finite = ~np.isnan(pixels[:, 0])
    together = FINE.marking[1:] == FINE.marking[:-1]
    shown = together & (seen[1:] | seen[:-1]) & finite[1:] & finite[:-1]
    first = np.flatnonzero(shown)
    a, b = pixels[first], pixels[first + 1]
    enters, leaves = ~seen[first], ~seen[first + 1]
    a[enters] = _clip_to_border(b[enters], a[enters])
    b[leaves] = _clip_to_border(a[leaves], b[leaves])
    steps = b - a
    sizes = np.sqrt((steps**2).sum(axis=1))
    lengths = np.zeros(len(MARKINGS))
    np.add.at(lengths, FINE.marking[first], sizes)
    along = np.concatenate([[0.0], np.cumsum(sizes)])
    before = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    return VisiblePaths(a, steps, along, lengths, before)


def _clip_to_border(inner: FloatArray, outer: FloatArray) -> FloatArray:
    """Where the ways from pixels in the image to pixels outside leave it, shape (N, 2)."""
    limit = np.array([WIDTH - 1.0, HEIGHT - 1.0])
    step = outer - inner
    edge = np.where(outer < 0, 0.0, limit)
    beyond = (outer < 0) | (outer > limit)
    share = np.where(beyond, (edge - inner) / np.where(beyond, step, 1.0), 1.0).min(axis=1)
    border: FloatArray = inner + share[:, None] * step
    return border


def _drop_some_markings(rng: np.random.Generator, markings: Indices) -> Indices:
    kept = rng.random(len(markings)) >= FORGOTTEN
    # A reader of the labels counts what is missing: no view shall lose more than a tenth.
    enough = kept.sum() >= max(FEWEST_KEPT, 0.9 * len(markings))
    return markings[kept] if enough else markings


def _draw_click_places(
    rng: np.random.Generator, markings: Indices, lengths: FloatArray
) -> tuple[Indices, FloatArray]:
    """Where people click: the marking of each click, and the share of its visible length."""
    circle = _IS_CIRCLE[markings]
    least, most = np.where(circle, 5, 2), np.where(circle, 12, 8)
    extra = rng.poisson(lengths[markings] / np.where(circle, 200.0, 260.0))
    counts = np.minimum(least + extra, most)
    total = int(counts.sum())
    index = np.arange(total) - np.repeat(np.cumsum(counts) - counts, counts)
    gaps = np.repeat(counts - 1, counts)
    jitter = rng.uniform(-0.3, 0.3, total) * ((index > 0) & (index < gaps))
    shuffled = np.repeat(rng.random(len(markings)) < np.where(circle, 0.4, 0.12), counts)
    key = np.where(shuffled, rng.random(total) * gaps, index)
    owner = np.repeat(markings, counts)
    return owner, ((index + jitter) / gaps)[np.lexsort((key, owner))]


def loose_box(rng: np.random.Generator, tight: Box) -> BallAnnotation:
    """A ball box as people draw it: 10 to 40 per cent too large and a little off centre."""
    grow = 1.0 + rng.uniform(*BOX_EXCESS)
    sides = np.array([tight.width, tight.height]) * grow * (1.0 + rng.uniform(-0.04, 0.04, 2))
    sigma = np.hypot(CENTER_SIGMA_PX, CENTER_SIGMA_SHARE * tight.diameter)
    center = np.array(tight.center) + rng.normal(0, sigma, 2)
    # The file holds both corners, so those are what is rounded.
    low, high = (center - sides / 2).round(DECIMALS), (center + sides / 2).round(DECIMALS)
    return BallAnnotation(box=Box(*map(float, (*low, *(high - low)))))


def person_tags(rng: np.random.Generator, instant: Instant) -> tuple[str, ...]:
    """The ID of each person in all views of a group: the shirt number, or a letter."""
    known = rng.random(len(instant.numbers)) < 0.7
    return tuple(
        str(number) if legible and number else TAGS[index]
        for index, (number, legible) in enumerate(zip(instant.numbers, known, strict=True))
    )


def person_boxes(
    rng: np.random.Generator, camera: Camera, instant: Instant, tags: tuple[str, ...]
) -> tuple[dict[str, Any], ...]:
    """Boxes of the people in view as SoccerNet-v3 keeps them, with class and ID."""
    corners = camera.project(_person_corners(instant)).reshape(len(tags), -1, 2)
    low, high = corners.min(axis=1), corners.max(axis=1)
    limit = np.array([WIDTH - 1.0, HEIGHT - 1.0])
    low, high = np.clip(low, 0, limit), np.clip(high, 0, limit)
    with np.errstate(invalid="ignore"):
        seen = ((high - low) >= (4.0, 10.0)).all(axis=1)
    values = np.column_stack([low, high]) + rng.normal(0, 0.8, (len(tags), 4))
    return tuple(
        {
            "class": _person_class(index),
            "ID": tags[index],
            "points": dict(zip(("x1", "y1", "x2", "y2"), row, strict=True)),
        }
        for index, row in enumerate(values.round(DECIMALS).tolist())
        if seen[index]
    )


def _person_corners(instant: Instant) -> FloatArray:
    """Eight corners of an upright box around each person, shape (8 * people, 3)."""
    signs = np.array([(sx, sy) for sx in (-1, 1) for sy in (-1, 1)]) * PLAYER_RADIUS
    ground = instant.feet[:, None] + signs
    low = np.concatenate([ground, np.zeros((*ground.shape[:2], 1))], axis=2)
    top = np.broadcast_to(-instant.height[:, None, None], (*ground.shape[:2], 1))
    return np.concatenate([low, np.concatenate([ground, top], axis=2)], axis=1).reshape(-1, 3)


def _person_class(index: int) -> str:
    # The home team defends the left goal, so SoccerNet calls it the left team.
    if index == 2 * TEAM:
        return "Main referee"
    side = "left" if index < TEAM else "right"
    return f"Goalkeeper team {side}" if index % TEAM == 0 else f"Player team {side}"
