"""Places of a frame that may be a followed ball: what looks like it, what detectors say, and what was there before."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from app.geometry.arrays import FloatArray
from app.tracking.ball_frames import BallFrame, apply_homography, invert_homography
from app.tracking.ball_picture import Grey, make_ball_template, match_template
from app.tracking.ball_run import DetectedBall, ExpectedPlace

CANDIDATES = 14
"""Places of a frame that are looked at."""
CLICKED = 3.0
"""How much likelier a place where a person clicked is the ball than anything else, as a logarithm."""
OTHERS_ERR, OTHERS_GAIN = 0.1, 2.0
"""How often what other views say is wrong, and how much likelier places are where they say, as a logarithm."""
STATIC_LAGS = (3, 6)
"""So many frames before it is looked whether a place looked the same."""


class Peak(NamedTuple):
    """A place of a picture that looks like a ball.

    Attributes:
        x, y: Pixels.
        alike, contrast: As ``ball_picture.match_template`` has them.
        smear, angle: As of ``ball_picture.make_ball_template``.
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
class BallCandidates:
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


def find_candidates(
    frame: BallFrame,
    size: float,
    area: tuple[FloatArray, FloatArray],
    smears: Sequence[tuple[float, float]],
    detected: Iterable[DetectedBall],
    earlier: Sequence[tuple[BallFrame, FloatArray]],
) -> BallCandidates:
    """The places of a frame that look most like the ball.

    Args:
        frame: Where it is sought.
        size: Diameter, pixels.
        area: Lowest and highest pixel where it is sought, shape (2,) each.
        smears: How it may be smeared by its motion, pixels and direction.
        detected: What a detector says of the frame.
        earlier: Frames before, the latest first, with how their background moved since.
    """
    longest = max((smear for smear, _ in smears), default=0.0)
    border = int(np.ceil(2.2 * size + longest / 2)) + 8
    (width, height), (low, high) = frame.size, area
    left, right = np.clip([low[0], high[0]], 0, width - 1).astype(int)
    top, bottom = np.clip([low[1], high[1]], 0, height - 1).astype(int)
    found: list[Peak] = []
    if right > left and bottom > top:
        wide = frame.crop_grey(left - border, top - border, right + border + 1, bottom + border + 1)
        for smear, angle in smears:
            found += _find_peaks(wide, (left, top), border, size, smear, angle)
    found += [
        Peak(one.x, one.y, 0.62, 1.0, added=4.0 * (one.score - 0.25))
        for one in detected
        if 0.4 < one.diameter / size < 2.5
    ]
    found = _suppress_nearby_peaks(sorted(found, key=lambda one: -one.alike), 0.4 * size)[
        :CANDIDATES
    ]
    values = np.array(found, float).reshape(-1, 7)
    places, alike, contrast = values[:, :2], values[:, 2], values[:, 3]
    parts = [
        _crop_around(frame, place, size + smear / 2)
        for place, smear in zip(places, values[:, 4], strict=True)
    ]
    looks = _appearance_log_likelihood(alike, contrast) + values[:, 6]
    static = _measure_static_fraction(places, alike * np.maximum(contrast, 0.05), size, earlier)
    return BallCandidates(places, looks, static, parts, values[:, 4:6])


def reweight_by_other_views(
    found: BallCandidates, expected: Iterable[ExpectedPlace]
) -> BallCandidates:
    """The same places, each as much likelier or less as other views say."""
    looks = found.looks
    for one in expected:
        there = OTHERS_GAIN - 0.5 * (one.distance_to(found.places) / one.sigma_px) ** 2
        looks = looks + np.logaddexp(np.log(OTHERS_ERR), np.log(1 - OTHERS_ERR) + there)
    return replace(found, looks=looks)


def make_empty_candidates() -> BallCandidates:
    """Of a frame that nobody can read."""
    empty = np.zeros((0, 2))
    return BallCandidates(empty, np.zeros(0), np.zeros((0, len(STATIC_LAGS))), [], empty)


def make_clicked_candidate(frame: BallFrame, size: float, x: float, y: float) -> BallCandidates:
    """The place at which a person says that the ball is, and no other."""
    place = np.array([x, y])
    return BallCandidates(
        place[None],
        np.array([CLICKED]),
        np.full((1, len(STATIC_LAGS)), np.nan),
        [_crop_around(frame, place, size)],
        np.zeros((1, 2)),
    )


def _find_peaks(
    wide: Grey,
    corner: tuple[int, int],
    border: int,
    size: float,
    smear: float,
    angle: float,
) -> list[Peak]:
    """Local maxima."""
    template = make_ball_template(round(size * 4) / 4, smear, angle)
    side = template.shape[0] // 2
    cut = border - side
    inner = wide[cut : wide.shape[0] - cut, cut : wide.shape[1] - cut]
    alike, contrast = match_template(inner, template)
    worth = alike * np.clip(contrast / 0.5, 0, 1)
    around = np.ones((2 * max(round(size / 3), 1) + 1,) * 2, np.uint8)
    peaks = (worth >= cv2.dilate(worth, around)) & (worth > 0.25)
    rows, columns = np.nonzero(peaks)
    order = np.argsort(-worth[rows, columns])[:CANDIDATES]
    found = []
    for row, column in zip(rows[order], columns[order], strict=True):
        x, y = _refine_peak_position(worth, int(row), int(column))
        values = float(alike[row, column]), float(contrast[row, column])
        found.append(Peak(corner[0] + x, corner[1] + y, *values, smear, angle))
    return found


def _measure_static_fraction(
    places: FloatArray,
    worth: FloatArray,
    size: float,
    earlier: Sequence[tuple[BallFrame, FloatArray]],
) -> FloatArray:
    """How much of each place was there before, as a share of what is there now, shape (C, lags)."""
    shares = np.full((len(places), len(STATIC_LAGS)), np.nan)
    template = make_ball_template(round(size * 4) / 4)
    reach = template.shape[0] // 2 + 2
    for column, lag in enumerate(STATIC_LAGS):
        if lag > len(earlier) or not len(places):
            continue
        frame, way = earlier[lag - 1]
        there = apply_homography(invert_homography(way), places)
        for row, (x, y) in enumerate(there.round().astype(int)):
            if not (0 <= x < frame.size[0] and 0 <= y < frame.size[1]):
                continue
            part = frame.crop_grey(x - reach, y - reach, x + reach + 1, y + reach + 1)
            alike, contrast = match_template(part, template)
            shares[row, column] = float((alike * np.maximum(contrast, 0)).max()) / worth[row]
    return shares


def _appearance_log_likelihood(alike: FloatArray, contrast: FloatArray) -> FloatArray:
    """How much likelier a look is of the ball than of anything else, as a logarithm."""
    against = np.log(np.clip(contrast, 0.1, 4.0))
    return np.asarray(7.0 * (alike - 0.62) - 1.2 * against**2)


def _crop_around(frame: BallFrame, place: FloatArray, reach: float) -> tuple[Grey, FloatArray]:
    """The picture around a place, with the pixel of its corner."""
    around = round(1.8 * reach) + 6
    x, y = place.round().astype(int)
    left, top = x - around, y - around
    return frame.crop_grey(left, top, x + around + 1, y + around + 1), np.array([left, top], float)


def _refine_peak_position(values: FloatArray, row: int, column: int) -> tuple[float, float]:
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


def _suppress_nearby_peaks(found: Sequence[Peak], least: float) -> list[Peak]:
    """Those that no better one is near; what a detector adds to a place goes to that."""
    kept: list[Peak] = []
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
