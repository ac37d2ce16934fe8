"""Camera positions: where main cameras stand before their lines are seen, and the starts of a resection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import PARAMETERS
from app.geometry.resection_kernels import aim_starting_cameras
from app.soccer.frames import height_above_grass
from app.solving.observations import Observations

MAX_CAMERA_HEIGHT_M, MAX_CAMERA_DISTANCE_M = 100.0, 250.0
"""Above the grass, and from the centre mark: no camera stands farther off."""
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


def make_match_position_prior(mean: FloatArray, sigma: FloatArray) -> PositionPrior:
    """What the other frames of a match say of a main camera's position, metres, shapes (3,)."""
    return PositionPrior(mean, sigma, MATCH_FREEDOM, MATCH_CLICKS)


def is_main_position(position: FloatArray) -> bool:
    """Whether main cameras stand there (pitch frame, metres, shape (3,))."""
    low, high = np.transpose([MAIN_STAND_X_M, MAIN_STAND_Y_M, MAIN_STAND_Z_M])
    return bool(((low < position) & (position < high)).all())


def is_possible_position(position: FloatArray) -> bool:
    """Whether a camera can stand there (pitch frame, metres, shape (3,))."""
    height, distance = height_above_grass(float(position[2])), float(np.hypot(*position[:2]))
    return 0 < height <= MAX_CAMERA_HEIGHT_M and distance <= MAX_CAMERA_DISTANCE_M


STANDS: FloatArray = np.array(
    [
        # Main side, near to far and low to high.
        *[(x, 60.0, z) for x in (-25.0, 0.0, 25.0) for z in (-8.0, -20.0)],
        *[(x, 85.0, z) for x in (-20.0, 0.0, 20.0) for z in (-20.0,)],
        *[(x, 42.0, z) for x in (-45.0, -15.0, 15.0, 45.0) for z in (-4.0,)],
        # Behind the goals, in the middle and towards the corners.
        *[(x, y, z) for x in (-75.0, 75.0) for y in (-25.0, 0.0, 25.0) for z in (-5.0, -18.0)],
        # The opposite side.
        *[(x, -60.0, z) for x in (-25.0, 25.0) for z in (-5.0, -20.0)],
        # High above an end of the main side.
        *[(x, 55.0, -35.0) for x in (-50.0, 50.0)],
    ]
)
"""Camera positions in the pitch frame, metres, shape (S, 3)."""

FOCAL_RANGE = (0.4, 12.0)
"""Plausible focal lengths as multiples of the image diagonal."""
LEAST_SPREAD = 0.1
"""Markings are taken to be seen at least so far apart, as a share of the diagonal."""


def make_starts_at_typical_positions(observations: Observations, diagonal: float) -> FloatArray:
    """One start for each stand, aimed and zoomed so that the seen markings lie where they are.

    Args:
        observations: What is seen.
        diagonal: Of the image, pixels.

    Returns:
        Parameters of ``geometry.resection``, shape (S, 8).
    """
    starts = np.empty((len(STANDS), PARAMETERS))
    aim_starting_cameras(
        STANDS,
        observations.curves.kinds,
        observations.curves.shapes,
        observations.pixels,
        observations.marking,
        LEAST_SPREAD * diagonal,
        np.array(FOCAL_RANGE) * diagonal,
        starts,
    )
    return starts
