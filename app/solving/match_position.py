"""Match position: where a match's main camera stands, from its other frames.

A main camera turns on its tripod for the whole match, so the frames of one match say together
what a frame with few markings cannot say alone. Each frame is calibrated by itself first; the
others' positions then become its prior, for the way that it looks (``match_model``). Neither a
wrong match nor a single bad frame carries through: Student weights, and ``calibrate`` drops a prior
that the frame's own lines contradict.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property

import numpy as np

from app.geometry.resection import PAN, PARAMETERS, X, Z, parameters_from_camera
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate_near
from app.solving.main_position import PositionPrior, is_main_position, position_prior_of_match
from app.solving.match_model import FramePlace, MatchModel, PlaceEquations

WANDER_M = np.array([0.15, 0.15, 0.1])
"""What a camera's place differs from that of its match by itself, standard deviation of each axis."""
MAX_SIGMA_M = 5.0
"""A frame whose position is known to no better than this says nothing about the others."""
MIN_OTHERS = 3
SCATTER, GIVE_UP = 3.0, 12.0
"""From this median chi-square of the places on the prior widens, and then there is none: the
frames are not of one match."""


def place_of(calibration: Calibration, size: ImageSize) -> FramePlace | None:
    """The place of a main camera; None for other cameras, and where the lines leave it open."""
    if calibration.camera is None or calibration.covariance is None:
        return None
    parameters = parameters_from_camera(calibration.camera, size.diagonal / 2)
    position = parameters[X : Z + 1]
    covariance = np.array(calibration.covariance).reshape(PARAMETERS, PARAMETERS)
    covariance = covariance[X : Z + 1, X : Z + 1]
    if not is_main_position(position) or not np.trace(covariance) <= MAX_SIGMA_M**2:
        return None
    return FramePlace(position, covariance, float(parameters[PAN]))


def pan_of(calibration: Calibration) -> float | None:
    """Where a main camera looks, radians; None for other cameras."""
    if calibration.camera is None or not is_main_position(calibration.camera.position):
        return None
    # The pan of a row of parameters does not depend on the size of the image.
    return float(parameters_from_camera(calibration.camera, 1.0)[PAN])


class Places:
    """Places of some frames, side by side, to take one out and look at the others."""

    def __init__(self, places: Sequence[FramePlace]):
        self._equations = PlaceEquations(places, WANDER_M)
        self._left_out: int | None = None

    def without(self, index: int) -> Places:
        """The same but for one of them; what they hold is shared, so a match costs it once."""
        rest = copy(self)
        rest._left_out = index
        rest.__dict__.pop("_model", None)
        return rest

    def prior(self, pan: float) -> PositionPrior | None:
        """Prior of a frame of the same match that looks that way; None where too few are known."""
        model = self._model
        if model is None:
            return None
        scatter = float(np.median(model.chi_square))
        if scatter > GIVE_UP:
            return None
        mean, variance = model.at(pan)
        return position_prior_of_match(
            mean, np.sqrt((variance + WANDER_M**2) * max(1.0, scatter / SCATTER))
        )

    @cached_property
    def _model(self) -> MatchModel | None:
        rest = np.arange(len(self._equations)) != self._left_out
        return self._equations.fit(rest) if rest.sum() >= MIN_OTHERS else None


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
