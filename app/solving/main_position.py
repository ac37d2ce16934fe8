"""Main position: where main cameras stand, and what is known of one before its lines are seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray

MAIN_STAND_X_M, MAIN_STAND_Y_M, MAIN_STAND_Z_M = (-20.0, 20.0), (38.0, 110.0), (-30.0, -6.0)
"""A camera that stands within these bounds (pitch frame) is a main camera."""
MAIN_MEAN = np.array([0.0, 0.0, 64.5, -15.5])
MAIN_SIGMA = np.array([np.radians(0.4), 2.0, 11.0, 4.5])
"""Roll (radians) and position (metres) of main cameras in real stadiums."""
MAIN_FREEDOM = 10.0
"""Degrees of freedom of that prior's Student distribution: some stadiums are unlike the others."""
MATCH_FREEDOM, MATCH_CLICKS = 4.0, 9.0
"""The same of what other frames of a match say of the position. Clicks on one marking, and what the
lens differs from its model, err together: against other frames so many of them count as one."""


@dataclass(frozen=True)
class PositionPrior:
    """What is known of a camera's position: a Student distribution for each axis.

    Attributes:
        mean: Pitch frame, metres, shape (3,).
        sigma: Metres, shape (3,).
        freedom: Degrees of freedom: the fewer, the more it gives way.
        clicks: How many clicks of the frame count as one against it.
    """

    mean: FloatArray
    sigma: FloatArray
    freedom: float
    clicks: float = 1.0


STADIUM = PositionPrior(MAIN_MEAN[1:], MAIN_SIGMA[1:], MAIN_FREEDOM)
"""What is known of any main camera."""


def position_prior_of_match(mean: FloatArray, sigma: FloatArray) -> PositionPrior:
    """What the other frames of a match say of a main camera's position, metres, shapes (3,)."""
    return PositionPrior(mean, sigma, MATCH_FREEDOM, MATCH_CLICKS)


def is_main_position(position: FloatArray) -> bool:
    """Whether main cameras stand there (pitch frame, metres, shape (3,))."""
    low, high = np.transpose([MAIN_STAND_X_M, MAIN_STAND_Y_M, MAIN_STAND_Z_M])
    return bool(((low < position) & (position < high)).all())
