"""Camera sigma: how well the lines determine each number of a camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from app.geometry.resection import KAPPA, LOG_FOCAL, PAN, PARAMETERS, ROLL, TILT, X, Y, Z
from app.soccer.solution import Calibration


@dataclass(frozen=True)
class CameraSigma:
    """One standard deviation of each number of a camera.

    Attributes:
        position_meters: Of x, y and z in the pitch frame.
        k1: Of the first radial distortion coefficient.
    """

    pan_degrees: float
    tilt_degrees: float
    roll_degrees: float
    position_meters: tuple[float, float, float]
    focal_px: float
    k1: float


def camera_sigma(calibration: Calibration) -> CameraSigma | None:
    """The standard deviations of a camera that was found from lines.

    The covariance is that of the solver's parameters (``geometry.resection``). The focal length is
    the exponential of one of them, and k1 = kappa (f / half_diagonal)^2 depends on two, which go
    together: both follow to first order.

    Returns:
        None for a given camera of which nothing more is known, and where the lines leave a combination open.

    Example:
        Of a parameter log f with sigma 0.01, a focal length of 2000 px has a sigma of 20 px.
    """
    camera, covariance = calibration.camera, calibration.known_covariance
    if camera is None or covariance is None:
        return None
    spread = np.array(covariance).reshape(PARAMETERS, PARAMETERS)
    sigma = np.sqrt(np.maximum(np.diag(spread), 0.0))
    focal = camera.focal_length[0]
    # Calibration from lines puts the principal point in the middle of the image.
    half_diagonal = math.hypot(camera.principal_point[0] + 0.5, camera.principal_point[1] + 0.5)
    slopes = np.zeros(PARAMETERS)
    slopes[LOG_FOCAL] = 2.0 * camera.distortion[0]
    slopes[KAPPA] = (focal / half_diagonal) ** 2
    return CameraSigma(
        pan_degrees=math.degrees(sigma[PAN]),
        tilt_degrees=math.degrees(sigma[TILT]),
        roll_degrees=math.degrees(sigma[ROLL]),
        position_meters=(float(sigma[X]), float(sigma[Y]), float(sigma[Z])),
        focal_px=float(focal * sigma[LOG_FOCAL]),
        k1=math.sqrt(max(0.0, float(slopes @ spread @ slopes))),
    )
