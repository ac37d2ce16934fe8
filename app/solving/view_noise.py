"""View noise: what the clicks of a view say of their noise, once its camera is solved."""

from __future__ import annotations

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.line_noise import LineEvidence, LineNoise, line_evidence
from app.solving.observations import observe
from app.solving.resect import ResectionProblem


def view_line_noise(
    calibration: Calibration, lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> LineNoise:
    """Noise of the clicks of a view that is calibrated from them.

    Raises:
        DegenerateGeometryError: It has no camera, or its lines leave that open.
    """
    problem, parameters = _at(calibration, size, policy)
    return problem.line_noise(parameters, observe(lines, policy.fitted(pitch), size))


def view_line_evidence(
    calibration: Calibration, lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> LineEvidence:
    """What the clicks of a view say of the noise of its dataset, pixels at 960 x 540.

    Raises:
        DegenerateGeometryError: It has no camera, or its lines leave that open.
    """
    problem, parameters = _at(calibration, size, policy)
    rows = problem.noise_rows(parameters, observe(lines, policy.fitted(pitch), size))
    return line_evidence(*rows).in_units(problem.unit)


def _at(
    calibration: Calibration, size: ImageSize, policy: CalibrationPolicy
) -> tuple[ResectionProblem, FloatArray]:
    if calibration.camera is None:
        raise DegenerateGeometryError("without a camera there are no residuals")
    problem = ResectionProblem.of(size, policy)
    return problem, problem.parameters(calibration.camera)
