"""Shapes: what paint says of the pixels of a picture and of the size of its pitch.

Square pixels and a pitch of 105 x 68 m are assumed where a camera is sought. Paint beside the
markings of the best camera tells both, once that camera is free to move as well: a stretched
picture moves places in proportion to their distance from the middle, a longer pitch moves its ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import PARAMETERS, ROLL, X, Y, Z, parameters_from_camera
from app.paint.evidence import Evidence, Reading, seek, trace
from app.soccer.frames import ImageSize
from app.soccer.pitch import LENGTH_RANGE, MARKINGS, WIDTH_RANGE, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.main_position import MAIN_MEAN, STADIUM, is_main_position
from app.solving.pitch_size import size_shares
from app.solving.resect import ResectionProblem

ERROR_PX, SHARE = 0.3, 0.5
"""At 960 wide: what lens and painter add to the place of a marking, and what its points share."""
SOFT_SIGMAS = 3.0
STRETCH_SIGMA, SIZE_SIGMA_M = 0.3, 3.0
"""Before the paint is seen: logarithm of the pixels' aspect; length and width, metres."""
CERTAIN = 4.0
"""Standard deviations from which on a number is another one."""


@dataclass(frozen=True)
class Told:
    """A number that paint tells, with its standard deviation."""

    value: float
    sigma: float

    def is_certain(self, least: float) -> bool:
        """Whether it is certainly not zero, and at least so large."""
        return abs(self.value) > max(CERTAIN * self.sigma, least)


def stretch_of(evidence: Evidence, camera: Camera, size: ImageSize) -> Told:
    """Logarithm of the pixels' aspect (width by height) that paint shows.

    Args:
        evidence: Paint beside the markings of the camera, pixels.
        camera: With square pixels.
        size: Of the picture.
    """
    traced = evidence.traced
    beside = traced.pixels[:, 0] - camera.principal_point[0]
    columns = (beside * traced.normals[:, 0])[:, None]
    return _told(evidence, camera, size, columns, np.array([STRETCH_SIGMA]))[0]


def sizes_of(reading: Reading, camera: Camera, pitch: Pitch, window_px: float) -> tuple[Told, Told]:
    """How much longer and wider than a pitch the one is that paint shows, metres.

    Args:
        window_px: How far from the markings paint is sought.
    """
    evidence = seek(reading, trace(reading, camera, pitch), window_px)
    traced = evidence.traced
    shares = size_shares(traced.marking)
    # A marking that moves is a camera that moves the other way.
    columns = -traced.jacobian[:, [X, Y]] * shares
    size = ImageSize(reading.width, reading.height)
    length, width = _told(evidence, camera, size, columns, np.full(2, SIZE_SIGMA_M))
    return length, width


def resized(pitch: Pitch, length: float, width: float) -> Pitch:
    """A pitch longer and wider by so many metres, to a decimetre, within the Laws."""
    return replace(
        pitch,
        length=round(float(np.clip(pitch.length + length, *LENGTH_RANGE)), 1),
        width=round(float(np.clip(pitch.width + width, *WIDTH_RANGE)), 1),
    )


def _told(
    evidence: Evidence, camera: Camera, size: ImageSize, columns: FloatArray, sigma: FloatArray
) -> list[Told]:
    """Numbers beside the camera's, from offsets that are linear in all of them.

    Args:
        columns: Derivative of a marking's place along its normal by each number, shape (N, K).
        sigma: Of the numbers beforehand, shape (K,).
    """
    problem = ResectionProblem.of(size, CalibrationPolicy())
    parameters = parameters_from_camera(camera, size.diagonal / 2)
    prior = problem.prior()
    if is_main_position(parameters[X : Z + 1]):
        prior = problem.main_prior(STADIUM, parameters[ROLL : Z + 1] - MAIN_MEAN)
    known = np.append(prior.sigma**-2.0, sigma**-2.0)
    pull = np.append((prior.mean - parameters) * prior.sigma**-2.0, np.zeros(len(sigma)))
    marking = evidence.traced.marking
    counts = np.bincount(marking, minlength=len(MARKINGS))[marking]
    error = np.hypot(evidence.sigmas, ERROR_PX * max(size.width / 960, 1.0))
    base = 1 / (error**2 * (1 + SHARE * (counts - 1)))
    rows = np.column_stack([evidence.traced.jacobian, columns])
    moved = np.zeros(rows.shape[1])
    for _ in range(4):
        rest = evidence.offsets - rows @ moved
        weight = base / np.sqrt(1 + (rest / (SOFT_SIGMAS * error)) ** 2)
        normal = (rows * weight[:, None]).T @ rows + np.diag(known)
        moved = np.linalg.solve(normal, rows.T @ (weight * evidence.offsets) + pull)
    spread = np.sqrt(np.diag(np.linalg.inv(normal)))
    pairs = zip(moved[PARAMETERS:].tolist(), spread[PARAMETERS:].tolist(), strict=True)
    return [Told(*pair) for pair in pairs]
