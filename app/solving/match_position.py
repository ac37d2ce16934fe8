"""Match position: where a match's main camera stands, from its other frames.

A main camera turns on its tripod for the whole match, so the frames of one match say together
what a frame with few markings cannot say alone. Each frame is calibrated by itself first; the
others' positions then become its prior. Real positions wander: the lens moves about the tripod's
head, and what lens and pitch differ from their models moves with the direction of view. So frames
that look the same way count more. Neither a wrong match nor a single bad frame carries through:
Student weights, and ``calibrate`` drops a prior that the frame's own lines contradict.

Source: Lange, Little and Taylor (1989) for the weights of the Student distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import PAN, PARAMETERS, X, Z, parameters_from_camera
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate_near
from app.solving.resect import MATCH_FREEDOM, PositionPrior, is_main_position, match_prior

WANDER_M = 0.1
"""Standard deviation of a camera's position, each axis, among frames that look the same way."""
DRIFT_M, DRIFT_PAN = 0.7, 0.3
"""What frames that look elsewhere add to it, and from how far apart on (radians)."""
MAX_SIGMA_M = 5.0
"""A frame whose position is known to no better than this says nothing about the others."""
MIN_OTHERS = 3
SURE_SIGMA_M = 1.5
"""Frames whose positions are known this well tell one match from the next."""
NEAR_CHI_SQUARE = 11.3
"""Without names of matches, frames are of one match where their positions agree (99 %)."""
SCATTER, GIVE_UP = 3.0, 12.0
"""From this median chi-square of the places on the prior widens, and then there is none: the
frames are not of one match."""
LOOK_AHEAD = 3
"""So many frames on, one that agrees holds a run of frames together."""
_ROUNDS = 6


@dataclass(frozen=True)
class Place:
    """Where one frame alone puts its camera.

    Attributes:
        position: Pitch frame, metres, shape (3,).
        covariance: Shape (3, 3).
        pan: Radians.
    """

    position: FloatArray
    covariance: FloatArray
    pan: float


def place_of(calibration: Calibration, size: ImageSize) -> Place | None:
    """The place of a main camera; None for other cameras, and where the lines leave it open."""
    if calibration.camera is None or calibration.covariance is None:
        return None
    parameters = parameters_from_camera(calibration.camera, size.diagonal / 2)
    position = parameters[X : Z + 1]
    spread = np.array(calibration.covariance).reshape(PARAMETERS, PARAMETERS)
    spread = spread[X : Z + 1, X : Z + 1]
    if not is_main_position(position) or not np.trace(spread) <= MAX_SIGMA_M**2:
        return None
    return Place(position, spread, float(parameters[PAN]))


def pan_of(calibration: Calibration) -> float | None:
    """Where a main camera looks, radians; None for other cameras."""
    if calibration.camera is None or not is_main_position(calibration.camera.position):
        return None
    # The pan of a row of parameters does not depend on the size of the image.
    return float(parameters_from_camera(calibration.camera, 1.0)[PAN])


class Places:
    """Places of some frames, side by side, to take one out and look at the others."""

    def __init__(self, places: Sequence[Place]):
        self._positions = np.array([place.position for place in places]).reshape(-1, 3)
        self._covariances = np.array([place.covariance for place in places]).reshape(-1, 3, 3)
        self._pans = np.array([place.pan for place in places])
        self._left_out: int | None = None

    def without(self, index: int) -> Places:
        """The same but for one of them; what they hold is shared, so a match costs it once."""
        rest = copy(self)
        rest._left_out = index
        return rest

    def prior(self, pan: float) -> PositionPrior | None:
        """Prior of a frame of the same match that looks that way; None where too few are known."""
        rest = np.arange(len(self._pans)) != self._left_out
        if rest.sum() < MIN_OTHERS:
            return None
        positions, turned = self._positions[rest], self._pans[rest] - pan
        drift = DRIFT_M**2 * (1 - np.exp(-0.5 * (turned / DRIFT_PAN) ** 2))
        spreads = self._covariances[rest] + (WANDER_M**2 + drift)[:, None, None] * np.eye(3)
        inverses = np.linalg.inv(spreads)
        mean = np.median(positions, axis=0)
        for _ in range(_ROUNDS):
            apart = positions - mean
            chi = np.einsum("ni,nij,nj->n", apart, inverses, apart)
            weighted = ((MATCH_FREEDOM + 3) / (MATCH_FREEDOM + chi))[:, None, None] * inverses
            information = weighted.sum(axis=0)
            mean = np.linalg.solve(information, np.einsum("nij,nj->i", weighted, positions))
        scatter = float(np.median(chi))
        if scatter > GIVE_UP:
            return None
        # Frames that look the same way drift together: more of them do not say more of another way.
        variance = np.maximum(np.diag(np.linalg.inv(information)), drift.min()) + WANDER_M**2
        variance *= max(1.0, scatter / SCATTER)
        return match_prior(mean, np.sqrt(variance))


NO_PLACES = Places(())


def share_position(
    alone: Calibration,
    others: Places,
    lines: Lines,
    pitch: Pitch,
    size: ImageSize,
    policy: CalibrationPolicy,
) -> Calibration:
    """A frame's calibration with its match's other frames; alone where they say nothing of it.

    Args:
        alone: What ``calibrate`` makes of the same lines.
        others: Places of the match's other frames.
    """
    if alone.camera is None:
        return alone
    pan = parameters_from_camera(alone.camera, size.diagonal / 2)[PAN]
    near = others.prior(float(pan))
    return alone if near is None else calibrate_near(alone, near, lines, pitch, size, policy)


def guess_matches(places: Sequence[Place | None]) -> list[int]:
    """A match for each frame, from 0, where nobody names them: runs whose positions agree.

    Frames of a match follow each other by name in the files that there are. Where they do not,
    runs are short and nothing is shared; nor is it where no frame is sure.

    Args:
        places: Of all frames by name; None where a frame says nothing.
    """
    sure = [
        index
        for index, place in enumerate(places)
        if place is not None and np.trace(place.covariance) <= SURE_SIGMA_M**2
    ]
    # Run of each sure frame: the one before that it agrees with most recently, or a new one.
    run: dict[int, int] = {}
    for at, index in enumerate(sure):
        for before in reversed(sure[max(0, at - LOOK_AHEAD) : at]):
            if _agree(places[before], places[index]):
                run[index] = run[before]
                break
        else:
            run[index] = len(set(run.values()))
    return _between(run, len(places))


def _agree(one: Place | None, other: Place | None) -> bool:
    assert one is not None and other is not None
    wander = 2 * (WANDER_M**2 + DRIFT_M**2) * np.eye(3)
    apart = one.position - other.position
    chi = apart @ np.linalg.solve(one.covariance + other.covariance + wander, apart)
    return float(chi) < NEAR_CHI_SQUARE


def _between(run: dict[int, int], count: int) -> list[int]:
    """Runs of all frames: those that say nothing go with the sure one before, else after."""
    if not run:
        return list(range(count))
    matches: list[int] = []
    known = -1
    for index in range(count):
        known = run.get(index, known)
        matches.append(known)
    first = next((number for number in matches if number >= 0), 0)
    return [first if number < 0 else number for number in matches]
