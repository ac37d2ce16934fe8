"""Camera numbers: a calibration's camera as numbers, with how exactly they are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import PARAMETERS, parameters_from_camera
from app.soccer.picture import camera_as_taken
from app.soccer.solution import Calibration

WHOLE = PARAMETERS + 3
"""The camera's numbers, and those of its picture."""


@dataclass(frozen=True)
class CameraNumbers:
    """The numbers of a camera, those of the picture as it was taken where it has been changed.

    Attributes:
        parameters: Shape (8,).
        covariance: Of the parameters, shape (8, 8).
        picture: Covariances of aspect and shifts with all eleven numbers, shape (3, 11); None
            where the picture is as it was taken.
    """

    parameters: FloatArray
    covariance: FloatArray
    picture: FloatArray | None = None

    @staticmethod
    def of(calibration: Calibration, diagonal: float) -> CameraNumbers | None:
        """None without a camera, and where nobody says how exact it is.

        Args:
            calibration: Of a view.
            diagonal: Of its image, pixels.
        """
        camera = calibration.camera
        if camera is None or calibration.covariance is None:
            return None
        if calibration.picture_covariance is None:
            covariance = np.reshape(calibration.covariance, (PARAMETERS, PARAMETERS))
            return CameraNumbers(parameters_from_camera(camera, diagonal / 2), covariance)
        whole = np.reshape(calibration.picture_covariance, (WHOLE, WHOLE))
        parameters = parameters_from_camera(camera_as_taken(camera), diagonal / 2)
        return CameraNumbers(parameters, whole[:PARAMETERS, :PARAMETERS], whole[PARAMETERS:])
