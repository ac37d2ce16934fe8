"""Starts: plausible stands from which a resection sets out."""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import PARAMETERS
from app.geometry.start_kernels import aim_starts
from app.solving.observations import Observations

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


def starts_from_stands(observations: Observations, diagonal: float) -> FloatArray:
    """One start for each stand, aimed and zoomed so that the seen markings lie where they are.

    Args:
        observations: What is seen.
        diagonal: Of the image, pixels.

    Returns:
        Parameters of ``geometry.resection``, shape (S, 8).
    """
    starts = np.empty((len(STANDS), PARAMETERS))
    aim_starts(
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
