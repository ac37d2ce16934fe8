"""Match position: where the main camera of a match stands, from its frames, and which frames are of one match."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import PAN, PARAMETERS, X, Z, parameters_from_camera
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate_near_position
from app.solving.camera_positions import PositionPrior, is_main_position, make_match_position_prior

UNKNOWNS = 6
"""Place at pan 0, metres, and how much it moves with the pan, metres a radian."""
MEAN = np.array([0.0, 64.5, -15.5, 1.7, 0.0, 0.0])
SIGMA = np.array([1.0, 11.0, 4.5, 4.0, 0.7, 0.2])
"""Of the unknowns over real matches."""
FREEDOM = 4.0
"""Degrees of freedom of the places' Student distribution."""
FARTHEST = 8.0
"""No place costs more than this: one odd frame does not end a match, three do."""
_ROUNDS = 6


@dataclass(frozen=True)
class FrameCameraPlace:
    """Where one frame alone puts its camera.

    Attributes:
        position: Pitch frame, metres, shape (3,).
        covariance: Shape (3, 3).
        pan: Radians.
    """

    position: FloatArray
    covariance: FloatArray
    pan: float


@dataclass(frozen=True)
class CameraPlaceModel:
    """The model that explains some places best.

    Attributes:
        unknowns: Shape (6,).
        covariance: Shape (6, 6).
        chi_square: Squared distance of each place from it, in sigmas, three numbers each, (N,).
        cost: Negative logarithm of its evidence, but for what does not depend on the model.
    """

    unknowns: FloatArray
    covariance: FloatArray
    chi_square: FloatArray
    cost: float

    def place_at_pan(self, pan: float) -> tuple[FloatArray, FloatArray]:
        """Place for a pan (radians) and its variance along each axis, shapes (3,)."""
        turned = np.hstack([np.eye(3), pan * np.eye(3)])
        place: FloatArray = turned @ self.unknowns
        return place, np.diag(turned @ self.covariance @ turned.T).copy()


class PlaceEquations:
    """Normal equations of each of some places, to fit one model to many choices of them."""

    def __init__(self, places: Sequence[FrameCameraPlace], wander_m: FloatArray):
        """``wander_m``: what a place differs from the model by itself, each axis, shape (3,)."""
        positions = np.array([place.position for place in places]).reshape(-1, 3)
        covariances = np.array([place.covariance for place in places]).reshape(-1, 3, 3)
        pans = np.array([place.pan for place in places])
        inverses = np.linalg.inv(covariances + np.diag(wander_m**2))
        turned = np.zeros((len(positions), 3, UNKNOWNS))
        turned[:, :, :3] = np.eye(3)
        turned[:, :, 3:] = pans[:, None, None] * np.eye(3)
        # About the prior's mean: the numbers stay small.
        self._offsets = positions - turned @ MEAN
        weighted = inverses @ turned
        self._information = (turned.transpose(0, 2, 1) @ weighted).reshape(-1, UNKNOWNS**2)
        self._pulls = np.einsum("nai,na->ni", weighted, self._offsets)
        self._squares = np.einsum("na,nab,nb->n", self._offsets, inverses, self._offsets)

    def __len__(self) -> int:
        return len(self._squares)

    def fit(self, rows: slice | FloatArray) -> CameraPlaceModel:
        """The model of some of the places, one at least."""
        information, pulls, squares = (
            self._information[rows],
            self._pulls[rows],
            self._squares[rows],
        )
        found = np.zeros(UNKNOWNS)
        found[:3] = np.median(self._offsets[rows], axis=0)
        normal = np.diag(SIGMA**-2)
        for _ in range(_ROUNDS):
            chi = _chi_square(found, information, pulls, squares)
            weight = (FREEDOM + 3) / (FREEDOM + chi)
            normal = (weight @ information).reshape(UNKNOWNS, UNKNOWNS) + np.diag(SIGMA**-2)
            found = np.linalg.solve(normal, weight @ pulls)
        chi = _chi_square(found, information, pulls, squares)
        losses = (FREEDOM + 3) / 2 * np.log1p(chi / FREEDOM)
        # What a model of its own costs: the share of the prior that the places leave of it.
        narrowed = np.linalg.slogdet(normal)[1] + 2 * np.log(SIGMA).sum()
        cost = np.minimum(losses, FARTHEST).sum() + 0.5 * ((found / SIGMA) ** 2).sum()
        return CameraPlaceModel(
            MEAN + found, np.linalg.inv(normal), chi, float(cost + 0.5 * narrowed)
        )


def _chi_square(
    found: FloatArray, information: FloatArray, pulls: FloatArray, squares: FloatArray
) -> FloatArray:
    chi = squares - 2 * (pulls @ found) + information @ np.outer(found, found).ravel()
    return np.maximum(chi, 0.0)


WANDER_M = np.array([0.15, 0.15, 0.1])
"""What a camera's place differs from that of its match by itself, standard deviation of each axis."""
MAX_SIGMA_M = 5.0
"""A frame whose position is known to no better than this says nothing about the others."""
MIN_OTHERS = 3
SCATTER, GIVE_UP = 3.0, 12.0
"""From this median chi-square of the places on the prior widens, and then there is none: the
frames are not of one match."""


def find_main_camera_place(calibration: Calibration, size: ImageSize) -> FrameCameraPlace | None:
    """The place of a main camera; None for other cameras, and where the lines leave it open."""
    if calibration.camera is None or calibration.covariance is None:
        return None
    parameters = parameters_from_camera(calibration.camera, size.diagonal / 2)
    position = parameters[X : Z + 1]
    covariance = np.array(calibration.covariance).reshape(PARAMETERS, PARAMETERS)
    covariance = covariance[X : Z + 1, X : Z + 1]
    if not is_main_position(position) or not np.trace(covariance) <= MAX_SIGMA_M**2:
        return None
    return FrameCameraPlace(position, covariance, float(parameters[PAN]))


def find_main_camera_pan(calibration: Calibration) -> float | None:
    """Where a main camera looks, radians; None for other cameras."""
    if calibration.camera is None or not is_main_position(calibration.camera.position):
        return None
    # The pan of a row of parameters does not depend on the size of the image.
    return float(parameters_from_camera(calibration.camera, 1.0)[PAN])


class FrameCameraPlaces:
    """Places of some frames, side by side, to take one out and look at the others."""

    def __init__(self, places: Sequence[FrameCameraPlace]):
        self._equations = PlaceEquations(places, WANDER_M)
        self._left_out: int | None = None

    def without_frame(self, index: int) -> FrameCameraPlaces:
        """The same but for one of them; what they hold is shared, so a match costs it once."""
        rest = copy(self)
        rest._left_out = index
        rest.__dict__.pop("_fitted_model", None)
        return rest

    def position_prior(self, pan: float) -> PositionPrior | None:
        """Prior of a frame of the same match that looks that way; None where too few are known."""
        model = self._fitted_model
        if model is None:
            return None
        scatter = float(np.median(model.chi_square))
        if scatter > GIVE_UP:
            return None
        mean, variance = model.place_at_pan(pan)
        return make_match_position_prior(
            mean, np.sqrt((variance + WANDER_M**2) * max(1.0, scatter / SCATTER))
        )

    @cached_property
    def _fitted_model(self) -> CameraPlaceModel | None:
        rest = np.arange(len(self._equations)) != self._left_out
        return self._equations.fit(rest) if rest.sum() >= MIN_OTHERS else None


NO_PLACES = FrameCameraPlaces(())


def calibrate_with_match_position(
    alone: Calibration,
    others: FrameCameraPlaces,
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
    near = others.position_prior(float(pan))
    return (
        alone if near is None else calibrate_near_position(alone, near, lines, pitch, size, policy)
    )


WANDER_IN_RUN_M = np.array([0.3, 0.3, 0.18])
"""What frames of one match are allowed to differ by, each axis, beyond their own sigmas."""


def guess_match_of_each_frame(places: Sequence[FrameCameraPlace | None]) -> list[int]:
    """A match for each frame, from 0, where nobody names them: runs whose places agree.

    Args:
        places: Of all frames by name; None where a frame says nothing, it goes with the one
            before.
    """
    known = [(index, place) for index, place in enumerate(places) if place is not None]
    runs = _MatchRuns([place for _, place in known])
    runs.join_neighbours()
    run = {known[at][0]: number for number, at in enumerate(runs.first_places)}
    return _fill_runs(run, len(places))


class _MatchRuns:
    """Runs of places side by side, each known by its first place."""

    def __init__(self, places: Sequence[FrameCameraPlace]):
        self._equations = PlaceEquations(places, WANDER_IN_RUN_M)
        self._end = {at: at + 1 for at in range(len(places))}
        self._begin = {at + 1: at for at in range(len(places))}
        self._cost = {at: self._compute_run_cost(at, at + 1) for at in range(len(places))}
        self._gains: list[tuple[float, int, int, int, float]] = []

    @property
    def first_places(self) -> list[int]:
        """The first place of each run."""
        return sorted(self._end)

    def join_neighbours(self) -> None:
        """Join neighbours until none gains by it."""
        for first in self.first_places:
            self._queue_join(first)
        while self._gains:
            _, first, second, end, cost = heappop(self._gains)
            if self._end.get(first) != second or self._end.get(second) != end:
                continue
            del self._end[second]
            self._end[first], self._begin[end], self._cost[first] = end, first, cost
            self._queue_join(first)
            if first in self._begin:
                self._queue_join(self._begin[first])

    def _queue_join(self, first: int) -> None:
        """Note what a run and the one behind it gain when they are joined."""
        second = self._end[first]
        if second not in self._end:
            return
        end = self._end[second]
        cost = self._compute_run_cost(first, end)
        gain = self._cost[first] + self._cost[second] - cost
        if gain > 0:
            heappush(self._gains, (-gain, first, second, end, cost))

    def _compute_run_cost(self, first: int, end: int) -> float:
        return self._equations.fit(slice(first, end)).cost


def _fill_runs(run: dict[int, int], count: int) -> list[int]:
    """Runs of all frames from those of first frames; without any, each frame is its own."""
    if not run:
        return list(range(count))
    matches, present = [], 0
    for index in range(count):
        present = run.get(index, present)
        matches.append(present)
    return matches
