"""Dataset noise: of the clicks on lines and on balls of many groups, each known with the other's help.

What lines are off makes cameras uncertain, and what those are off is no fault of the balls: first
the lines of all images are asked, then every camera has the covariance that follows, and what
rays leave unexplained beyond that is the balls'. No number of the policy's that is estimated takes
part, so the estimate is the same before it is used and after.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray, row_by_row
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group, View
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy, Policy
from app.soccer.solution import Ball3D, Calibration, Solution
from app.solving.ball_noise import BallNoise, RayResidual, estimate_ball_noise, ray_residuals
from app.solving.line_noise import (
    LineEstimate,
    LineEvidence,
    LineNoise,
    estimate_line_noise,
    line_evidence,
)
from app.solving.observations import observations_of_lines
from app.solving.resect import ResectionProblem
from app.solving.triangulate import BallObservation, ball_observations


def view_line_noise(
    calibration: Calibration, lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> LineNoise:
    """Noise of the clicks of a view that is calibrated from them.

    Raises:
        DegenerateGeometryError: It has no camera, or its lines leave that open.
    """
    problem, parameters = _resection_at_calibration(calibration, size, policy)
    return problem.line_noise(parameters, observations_of_lines(lines, policy.fitted(pitch), size))


def view_line_evidence(
    calibration: Calibration, lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> LineEvidence:
    """What the clicks of a view say of the noise of its dataset, pixels at 960 x 540.

    Raises:
        DegenerateGeometryError: It has no camera, or its lines leave that open.
    """
    problem, parameters = _resection_at_calibration(calibration, size, policy)
    rows = problem.noise_rows(parameters, observations_of_lines(lines, policy.fitted(pitch), size))
    return line_evidence(*rows).rescaled_to_pixels(problem.unit)


def view_line_covariance(
    calibration: Calibration, lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> tuple[float, ...]:
    """Covariance of the parameters of a view's camera under a policy's noise of lines, row by row, (64,).

    Noise moves no camera: the calibration may be that of a policy with another one.
    """
    noise = view_line_noise(calibration, lines, pitch, size, policy)
    return row_by_row(noise.parameters)


def _resection_at_calibration(
    calibration: Calibration, size: ImageSize, policy: CalibrationPolicy
) -> tuple[ResectionProblem, FloatArray]:
    if calibration.camera is None:
        raise DegenerateGeometryError("the view has no camera, so its lines have no residuals")
    problem = ResectionProblem.of(size, policy)
    return problem, problem.parameters(calibration.camera)


@dataclass(frozen=True)
class NoiseView:
    """A view of a solved group as far as noise asks.

    Attributes:
        key: Of its calibration: a static camera speaks of its lines once.
        lines: Those that its camera is made from.
        evidence: What these say; None where they make no camera, or leave it open.
    """

    key: str
    view: View
    calibration: Calibration
    lines: Lines
    evidence: LineEvidence | None


@dataclass(frozen=True)
class NoiseGroup:
    """A solved group as far as noise asks."""

    group: Group
    ball: Ball3D | None
    views: tuple[NoiseView, ...]

    @staticmethod
    def of(group: Group, solution: Solution, policy: Policy) -> NoiseGroup:
        """What a group and its solution under a policy say."""
        views = (
            _noise_view(group, view, solved.calibration_key, solved.calibration, policy)
            for view, solved in zip(group.views, solution.views, strict=True)
        )
        return NoiseGroup(group, solution.ball, tuple(views))

    def misses(self, policy: Policy) -> tuple[RayResidual, ...]:
        """What the rays leave unexplained, with cameras as certain as a policy's lines make them."""
        return () if self.ball is None else ray_residuals(self.ball, self._observations(policy))

    def _observations(self, policy: Policy) -> list[BallObservation]:
        found = [self._calibration(view, policy) for view in self.views]
        return ball_observations(self.group.views, found)

    def _calibration(self, seen: NoiseView, policy: Policy) -> Calibration:
        # What paint says of a camera, and what is not known of a picture, hardly depends on clicks.
        if seen.evidence is None or seen.calibration.source != "lines":
            return seen.calibration
        covariance = view_line_covariance(
            seen.calibration, seen.lines, self.group.pitch, seen.view.size, policy.calibration
        )
        return replace(seen.calibration, covariance=covariance)


@dataclass(frozen=True)
class DatasetNoise:
    """Noise of a dataset.

    Attributes:
        lines: Of clicks on lines; None where none makes a camera.
        ball: Of annotated balls.
        misses: What rays leave unexplained beyond the cameras, group by group.
    """

    lines: LineEstimate | None
    ball: BallNoise
    misses: tuple[tuple[RayResidual, ...], ...]


def estimate_noise(groups: Sequence[NoiseGroup], policy: Policy) -> DatasetNoise:
    """The noise that many groups show.

    Args:
        groups: In the order in which they were taken.
        policy: They are judged by; of its noise nothing is used that they say something of.
    """
    evidence = {
        view.key: view.evidence
        for group in groups
        for view in group.views
        if view.evidence is not None
    }
    lines = estimate_line_noise([*evidence.values()])
    if lines is not None:
        policy = _policy_with_line_noise(policy, lines)
    misses = tuple(group.misses(policy) for group in groups)
    ball = estimate_ball_noise([miss for some in misses for miss in some], policy)
    return DatasetNoise(lines, ball, misses)


def _policy_with_line_noise(policy: Policy, lines: LineEstimate) -> Policy:
    sigma, share = lines.sigma.value, lines.share.value
    known = replace(policy.calibration, line_sigma_px=sigma, line_share=share)
    return replace(policy, calibration=known)


def _noise_view(
    group: Group, view: View, key: str, calibration: Calibration, policy: Policy
) -> NoiseView:
    left_out = {suspect.marking for suspect in calibration.suspects}
    lines = make_lines({k: at for k, at in view.station.lines.items() if k not in left_out})
    evidence = None
    made = calibration.source != "given" and calibration.covariance is not None
    if made and view.station.picture is None:
        arguments = calibration, lines, group.pitch, view.size, policy.calibration
        # Lines that leave the camera open say nothing of their noise.
        with suppress(DegenerateGeometryError, np.linalg.LinAlgError):
            evidence = view_line_evidence(*arguments)
    return NoiseView(key, view, replace(calibration, markings=()), lines, evidence)
