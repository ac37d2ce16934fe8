"""Dataset noise: of the clicks on lines and on balls of many groups, each known with the other's help; and of one camera
or person beside their dataset.

What lines are off makes cameras uncertain, and what those are off is no fault of the balls: first
the lines of all images are asked, then every camera has the covariance that follows, and what
rays leave unexplained beyond that is the balls'. No number of the policy's that is estimated takes
part, so the estimate is the same before it is used and after.

Each miss of rays (``ball_noise``) has a variance to which every view adds its own part: that of the
dataset, times the squared factors of its camera and of who placed its ball. All factors are sought
together, each drawn towards one by what few numbers say, so that who placed little is not called
good or bad, and who works at a bad camera is not blamed for it.

Source: Osborne, "Fisher's method of scoring" (1992); Efron & Morris, "Stein's paradox in statistics"
(shrinkage).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import BoolArray, FloatArray, IntArray, flatten_covariance
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group, View
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy, Policy
from app.soccer.solution import Ball3D, Calibration, Solution
from app.solving.ball_noise import (
    LIMIT,
    MIN_NUMBERS,
    TRIMMED,
    BallNoise,
    RayResidual,
    compute_ray_residuals,
    estimate_ball_noise,
)
from app.solving.line_noise import (
    NORMAL_95,
    LineEstimate,
    LineEvidence,
    LineNoise,
    collect_line_evidence,
    estimate_line_noise,
)
from app.solving.observations import make_observations
from app.solving.resect import ResectionProblem
from app.solving.triangulate import BallObservation, collect_ball_observations


def estimate_view_line_noise(
    calibration: Calibration, lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> LineNoise:
    """Noise of the clicks of a view that is calibrated from them.

    Raises:
        DegenerateGeometryError: It has no camera, or its lines leave that open.
    """
    problem, parameters = _make_resection_problem(calibration, size, policy)
    return problem.line_noise(
        parameters, make_observations(lines, policy.pitch_for_fitted_lines(pitch), size)
    )


def collect_view_line_evidence(
    calibration: Calibration, lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> LineEvidence:
    """What the clicks of a view say of the noise of its dataset, pixels at 960 x 540.

    Raises:
        DegenerateGeometryError: It has no camera, or its lines leave that open.
    """
    problem, parameters = _make_resection_problem(calibration, size, policy)
    rows = problem.compute_line_noise_inputs(
        parameters, make_observations(lines, policy.pitch_for_fitted_lines(pitch), size)
    )
    return collect_line_evidence(*rows).rescaled_to_reference_pixels(
        problem.pixels_per_reference_pixel
    )


def compute_view_line_covariance(
    calibration: Calibration, lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> tuple[float, ...]:
    """Covariance of the parameters of a view's camera under a policy's noise of lines, row by row, (64,).

    Noise moves no camera: the calibration may be that of a policy with another one.
    """
    noise = estimate_view_line_noise(calibration, lines, pitch, size, policy)
    return flatten_covariance(noise.parameters)


def _make_resection_problem(
    calibration: Calibration, size: ImageSize, policy: CalibrationPolicy
) -> tuple[ResectionProblem, FloatArray]:
    if calibration.camera is None:
        raise DegenerateGeometryError("the view has no camera, so its lines have no residuals")
    problem = ResectionProblem.of(size, policy)
    return problem, problem.parameters(calibration.camera)


@dataclass(frozen=True)
class ViewNoiseInputs:
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
class GroupNoiseInputs:
    """A solved group as far as noise asks."""

    group: Group
    ball: Ball3D | None
    views: tuple[ViewNoiseInputs, ...]

    @staticmethod
    def of(group: Group, solution: Solution, policy: Policy) -> GroupNoiseInputs:
        """What a group and its solution under a policy say."""
        views = (
            _make_view_noise_inputs(group, view, solved.calibration_key, solved.calibration, policy)
            for view, solved in zip(group.views, solution.views, strict=True)
        )
        return GroupNoiseInputs(group, solution.ball, tuple(views))

    def ray_residuals(self, policy: Policy) -> tuple[RayResidual, ...]:
        """What the rays leave unexplained, with cameras as certain as a policy's lines make them."""
        return (
            ()
            if self.ball is None
            else compute_ray_residuals(self.ball, self._make_observations(policy))
        )

    def _make_observations(self, policy: Policy) -> list[BallObservation]:
        found = [self._recompute_calibration(view, policy) for view in self.views]
        return collect_ball_observations(self.group.views, found)

    def _recompute_calibration(self, seen: ViewNoiseInputs, policy: Policy) -> Calibration:
        # What paint says of a camera, and what is not known of a picture, hardly depends on clicks.
        if seen.evidence is None or seen.calibration.source != "lines":
            return seen.calibration
        covariance = compute_view_line_covariance(
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


def estimate_noise(groups: Sequence[GroupNoiseInputs], policy: Policy) -> DatasetNoise:
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
        policy = _replace_line_noise(policy, lines)
    misses = tuple(group.ray_residuals(policy) for group in groups)
    ball = estimate_ball_noise([miss for some in misses for miss in some], policy)
    return DatasetNoise(lines, ball, misses)


def _replace_line_noise(policy: Policy, lines: LineEstimate) -> Policy:
    sigma, share = lines.sigma.value, lines.share.value
    known = replace(policy.calibration, line_sigma_px=sigma, line_share=share)
    return replace(policy, calibration=known)


def _make_view_noise_inputs(
    group: Group, view: View, key: str, calibration: Calibration, policy: Policy
) -> ViewNoiseInputs:
    left_out = {suspect.marking for suspect in calibration.suspects}
    lines = make_lines({k: at for k, at in view.station.lines.items() if k not in left_out})
    evidence = None
    made = calibration.source != "given" and calibration.covariance is not None
    if made and view.station.picture is None:
        arguments = calibration, lines, group.pitch, view.size, policy.calibration
        # Lines that leave the camera open say nothing of their noise.
        with suppress(DegenerateGeometryError, np.linalg.LinAlgError):
            evidence = collect_view_line_evidence(*arguments)
    return ViewNoiseInputs(key, view, replace(calibration, markings=()), lines, evidence)


SPREAD = 0.5
"""Of the logarithm of a factor: sources differ by so much."""
DECIMALS = 2
"""Of a factor that is used: what lies below is no difference."""
_ROUNDS, _LONGEST, _SETTLED = 30, 0.5, 1e-4


class BallSource(NamedTuple):
    """Where a ball comes from: a static camera by its key, or a person by their name."""

    kind: Literal["camera", "person"]
    name: str


@dataclass(frozen=True)
class SourceNoise:
    """Noise of the balls of one source, with its 95 % interval.

    Attributes:
        source: A station's key or a person's name.
        sigma_px: Of a coordinate of a ball, without the part that grows with the ball, pixels at
            1920 x 1080.
        ratio: Of that to the dataset's.
        numbers: Independent numbers that speak of this source alone.
    """

    source: str
    sigma_px: float
    low: float
    high: float
    ratio: float
    numbers: float

    @property
    def differs(self) -> bool:
        """Whether the interval leaves out the dataset's sigma."""
        return not self.low <= self.sigma_px / self.ratio <= self.high


@dataclass(frozen=True)
class SourceNoiseFactors:
    """The factors of the sources of which enough is seen.

    Attributes:
        sigma_px: Of the dataset, pixels at 1920 x 1080.
        sources: In the order of the rows.
        logs: Logarithms of their factors, shape (S,).
        covariance: Of these, shape (S, S).
        numbers: Independent numbers that speak of each, shape (S,).
    """

    sigma_px: float
    sources: tuple[BallSource, ...]
    logs: FloatArray
    covariance: FloatArray
    numbers: FloatArray

    def noise_of_kind(self, kind: str) -> tuple[SourceNoise, ...]:
        """The sources of one kind, the noisiest first."""
        found = []
        for at, source in enumerate(self.sources):
            if source.kind == kind:
                log, half = float(self.logs[at]), NORMAL_95 * math.sqrt(self.covariance[at, at])
                low, middle, high = (
                    self.sigma_px * math.exp(end) for end in (log - half, log, log + half)
                )
                numbers = float(self.numbers[at])
                found.append(SourceNoise(source.name, middle, low, high, math.exp(log), numbers))
        return tuple(sorted(found, key=lambda item: -item.sigma_px))

    def noise_factor(self, sources: Sequence[BallSource]) -> float:
        """How noisy a ball of these sources is beside the dataset's; one where it may be alike.

        What is asked is whether all of them together differ: of a camera whose balls one person
        places that may be known though nobody knows which of the two it is.
        """
        row = np.array([source in sources for source in self.sources], float)
        log, variance = float(row @ self.logs), float(row @ self.covariance @ row)
        if abs(log) <= NORMAL_95 * math.sqrt(variance):
            return 1.0
        return round(math.exp(log), DECIMALS)


NOBODY = SourceNoiseFactors(1.0, (), np.zeros(0), np.zeros((0, 0)), np.zeros(0))
"""Nothing is known of any source."""


@dataclass(frozen=True)
class _SourceVariances:
    """What views add to the variance of misses.

    Attributes:
        squares: Of the misses, shape (M,).
        known: The variance to which no source adds, shape (M,).
        added: By each view that has a source, at the dataset's noise, shape (C,).
        row: Of its miss, shape (C,).
        of: Which sources it has, shape (C, S).
    """

    squares: FloatArray
    known: FloatArray
    added: FloatArray
    row: IntArray
    of: FloatArray

    def view_variances(self, logs: FloatArray) -> FloatArray:
        """The variance that the views add under some factors, shape (C,)."""
        own: FloatArray = self.added * np.exp(2 * self.of @ logs)
        return own

    def residual_variances(self, own: FloatArray) -> FloatArray:
        """Of the misses, shape (M,)."""
        variance: FloatArray = self.known + np.bincount(self.row, own, len(self.known))
        return variance

    def variances_by_source(self, own: FloatArray) -> FloatArray:
        """The variance that the views of each source add to each miss, shape (M, S)."""
        total = np.zeros((len(self.known), self.of.shape[1]))
        np.add.at(total, self.row, own[:, None] * self.of)
        return total

    def find_inliers(self, logs: FloatArray) -> BoolArray:
        """Misses that are no mistakes, shape (M,)."""
        kept: BoolArray = self.squares <= LIMIT * self.residual_variances(self.view_variances(logs))
        return kept

    def log_variance_derivatives(self, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Of the variances' logarithms by those of the factors, (M, S), and the variances, (M,)."""
        own = self.view_variances(logs)
        variance = self.residual_variances(own)
        return 2 * self.variances_by_source(own) / variance[:, None], variance


def estimate_source_noise(
    misses: Sequence[tuple[RayResidual, Mapping[str, Sequence[BallSource]]]],
    click: float,
    share: float,
    given: float,
) -> SourceNoiseFactors:
    """The noise of each source of which enough is seen, cameras and people together.

    Args:
        misses: Of many groups, each with the sources of each of its views.
        click: The dataset's sigma of a clicked ball, pixels at 1920 x 1080.
        share: What the ball's diameter adds to it.
        given: What a given camera adds to it, pixels at 1920 x 1080.
    """
    sources = _list_distinct_sources(
        [of.get(view[0], ()) for miss, of in misses for view in miss.by_view]
    )
    if not sources:
        return NOBODY
    parts = _make_source_variances(misses, sources, np.array([click**2, share**2, given**2]))
    logs, covariance, numbers = _fit_factors(parts)
    seen = np.flatnonzero(numbers >= MIN_NUMBERS)
    return SourceNoiseFactors(
        math.hypot(click, given) if given and not click else click,
        tuple(sources[at] for at in seen.tolist()),
        logs[seen],
        covariance[np.ix_(seen, seen)],
        numbers[seen],
    )


def _list_distinct_sources(seen: Sequence[Sequence[BallSource]]) -> list[BallSource]:
    """The sources, without those that all views have: one alone is the dataset."""
    every = sorted({source for sources in seen for source in sources})
    return [one for one in every if not all(one in sources for sources in seen)]


def _make_source_variances(
    misses: Sequence[tuple[RayResidual, Mapping[str, Sequence[BallSource]]]],
    sources: Sequence[BallSource],
    squared: FloatArray,
) -> _SourceVariances:
    place = {source: at for at, source in enumerate(sources)}
    known = np.array([miss.known for miss, _ in misses])
    added, rows, which = [], [], []
    for row, (miss, of) in enumerate(misses):
        for view, *columns in miss.by_view:
            own = [place[source] for source in of.get(view, ()) if source in place]
            if own:
                added.append(float(np.dot(columns, squared)))
                rows.append(row)
                which.append(np.isin(np.arange(len(sources)), own))
            else:
                known[row] += np.dot(columns, squared)
    squares = np.array([miss.miss**2 for miss, _ in misses])
    of_each = np.array(which, float).reshape(-1, len(sources))
    return _SourceVariances(squares, known, np.array(added), np.array(rows, np.int64), of_each)


def _fit_factors(parts: _SourceVariances) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Logarithms of the factors, their covariance, and how much speaks of each."""
    logs = np.zeros(parts.of.shape[1])
    for _ in range(_ROUNDS):
        kept = parts.find_inliers(logs)
        slopes, variance = (array[kept] for array in parts.log_variance_derivatives(logs))
        pull = 0.5 * slopes.T @ (parts.squares[kept] / TRIMMED / variance - 1) - logs / SPREAD**2
        step = np.linalg.solve(_fisher_information(slopes), pull)
        logs = logs + np.clip(step, -_LONGEST, _LONGEST)
        if np.abs(step).max() < _SETTLED:
            break
    kept = parts.find_inliers(logs)
    slopes = parts.log_variance_derivatives(logs)[0][kept]
    covariance = np.linalg.inv(_fisher_information(slopes)).astype(np.float64)
    return logs, covariance, slopes.sum(axis=0) / 2


def _fisher_information(slopes: FloatArray) -> FloatArray:
    """Fisher's, with that of the prior, shape (S, S)."""
    total: FloatArray = 0.5 * slopes.T @ slopes + np.eye(slopes.shape[1]) / SPREAD**2
    return total
