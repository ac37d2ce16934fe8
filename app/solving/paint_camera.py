"""Paint camera: a camera solved from the paint that was read in its picture.

The clicks' camera starts it and says which line is which; the stored places of paint decide where
it lies. No picture is needed here: what was read of one is a value (``soccer.paint_evidence``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.geometry.arrays import FloatArray
from app.geometry.resection import (
    PARAMETERS,
    ROLL,
    CurvePoints,
    GaussianPrior,
    X,
    Z,
    curve_residuals,
)
from app.soccer.frames import ImageSize
from app.soccer.paint_evidence import PaintEvidence
from app.soccer.pitch import MARKINGS, Pitch
from app.solving.camera_positions import MAIN_MEAN, STADIUM, is_main_position
from app.solving.observations import pitch_curves, principal_point
from app.solving.paint_noise import (
    PaintNoise,
    PaintOffsets,
    estimate_paint_noise,
    paint_derivatives_by_pitch,
    point_weights_by_marking,
)
from app.solving.resect import ResectionProblem

ROBUST_PX = 1.0
"""Scale of the soft-L1 loss of the first rounds, at 960 x 540."""
STRICT_SIGMAS, STRICT_PX = 4.0, 0.3
"""In the last rounds what lies farther off than so many sigmas, or pixels, counts little."""
SOFT_ROUNDS, ROUNDS, SETTLED = 3, 40, 1e-4
"""Rounds of the first kind, of both at most, and the move (in sigmas) that ends them."""
WORST_PX, MOST_SURPRISING = 0.6, 60.0
"""Paint disagrees where it does not lie on the markings in the end (median, at 960 x 540), or where
the camera moved beyond what its clicks allow (squared sigmas of eight parameters: by chance 26
once in a thousand)."""
INNER_STEPS = 4
DAMPING = 1e-4
LEAST_UNIT = 0.6
"""Pixels do not shrink below this share of theirs in small pictures: blur is in pixels."""


@dataclass(frozen=True)
class PaintProblem:
    """What is known of a camera before its paint.

    Attributes:
        resection: Of its picture.
        first: Parameters of the start, shape (8,).
        information: What the start knows of them, shape (8, 8); None: nothing.
    """

    resection: ResectionProblem
    first: FloatArray
    information: FloatArray | None

    @staticmethod
    def of(
        resection: ResectionProblem, first: FloatArray, covariance: FloatArray | None
    ) -> PaintProblem:
        """The problem of a start and its covariance."""
        return PaintProblem(
            resection, first, None if covariance is None else _invert_covariance(covariance)
        )

    @property
    def pixels_per_reference_pixel(self) -> float:
        """Pixels of this picture for a pixel at 960 x 540."""
        return max(self.resection.pixels_per_reference_pixel, LEAST_UNIT)

    def compute_step(self, parameters: FloatArray, seen: PaintOffsets, strict: bool) -> FloatArray:
        """The step towards the paint, shape (8,): iteratively reweighted least squares.

        The offsets o are taken as linear in the step d, o - J d; each solve is that of
        (J' W J + P) d = J' W o + P (mean - parameters), damped, with W the weights by residual
        and marking over sigma squared, and P the information of prior and start.

        Args:
            parameters: Where the offsets were measured, shape (8,).
            seen: The paint beside its markings there, pixels.
            strict: Whether what lies far off counts little (redescending weights), or by soft-L1.

        Raises:
            numpy.linalg.LinAlgError: Nothing determines the step.
        """
        prior = self.prior(parameters)
        information = np.diag(prior.sigma**-2.0)
        pull = (prior.mean - parameters) * prior.sigma**-2.0
        if self.information is not None:
            information = information + self.information
            pull = pull + self.information @ (self.first - parameters)
        base = np.ascontiguousarray(
            point_weights_by_marking(seen.marking, seen.sigmas) / seen.sigmas**2
        )
        moved: FloatArray = np.empty(PARAMETERS)
        # In one layout: the kernel would be compiled for each, which takes ten seconds.
        offsets, sigmas = np.ascontiguousarray(seen.offsets), np.ascontiguousarray(seen.sigmas)
        write_paint_step(
            offsets, sigmas, base, np.ascontiguousarray(seen.jacobian), information, pull, INNER_STEPS,
            DAMPING, strict, ROBUST_PX * self.pixels_per_reference_pixel, STRICT_SIGMAS, STRICT_PX * self.pixels_per_reference_pixel, moved,
        )  # fmt: skip
        return moved

    def robust_weights(self, rest: FloatArray, sigmas: FloatArray) -> FloatArray:
        """Strict weight of each place by how far off it lies, pixels, both shape (N,)."""
        scale = np.maximum(STRICT_SIGMAS * sigmas, STRICT_PX * self.pixels_per_reference_pixel)
        return np.asarray((1 + (rest / scale) ** 2) ** -2.0)

    def mahalanobis_squared(self, parameters: FloatArray) -> float:
        """Squared distance from the start in its own sigmas; 0 where nothing is known of it."""
        if self.information is None:
            return 0.0
        moved = parameters - self.first
        return float(moved @ self.information @ moved)

    def noise(
        self, parameters: FloatArray, seen: PaintOffsets, places: FloatArray, pitch: Pitch
    ) -> PaintNoise | None:
        """Noise of the paint and covariance at a minimum; None where it leaves the camera open.

        Args:
            parameters: At the minimum, shape (8,).
            seen: The paint there.
            places: Where on the pitch each of it lies, metres, shape (N, 2).
            pitch: The pitch.
        """
        robust = self.robust_weights(seen.offsets, seen.sigmas)
        prior = self.prior(parameters).sigma ** -2.0
        terms = paint_derivatives_by_pitch(places, seen.marking, seen.jacobian, pitch)
        return estimate_paint_noise(seen, robust, prior, self.information, terms)

    def prior(self, parameters: FloatArray) -> GaussianPrior:
        """The calibrator's: main cameras stand where main cameras stand, others anywhere."""
        if not is_main_position(parameters[X : Z + 1]):
            return self.resection.prior()
        return self.resection.main_camera_prior(STADIUM, parameters[ROLL : Z + 1] - MAIN_MEAN)


@dataclass(frozen=True)
class PaintCamera:
    """A camera on its paint.

    Attributes:
        parameters: Shape (8,).
        covariance: Of them, shape (8, 8).
        pitch: What comes to it because no pitch is quite the plan, shape (8, 8).
        error_px: Median distance of the paint from its markings, pixels.
    """

    parameters: FloatArray
    covariance: FloatArray
    pitch: FloatArray
    error_px: float


def solve_paint(problem: PaintProblem, evidence: PaintEvidence, pitch: Pitch) -> PaintCamera | None:
    """The camera that stored paint determines, near a start.

    Args:
        problem: What is known before.
        evidence: Places of paint, pixels of the problem's size.
        pitch: The pitch.

    Returns:
        None where the paint does not determine it, does not lie on the markings in the end, or
        moves the camera farther than its start allows.
    """
    curve_points, sigmas = collect_curve_points(evidence, problem.resection.size)
    if not len(sigmas):
        return None
    parameters = problem.first
    for index in range(ROUNDS):
        seen = measure_offsets(problem, parameters, curve_points, sigmas, pitch)
        strict = index >= SOFT_ROUNDS
        try:
            moved = problem.compute_step(parameters, seen, strict)
        except np.linalg.LinAlgError:
            return None
        parameters = parameters + moved
        if not np.isfinite(parameters).all():
            return None
        # The information of one exact place of paint is far above any start's.
        if strict and float(np.abs(seen.jacobian @ moved).max()) < SETTLED * sigmas.min():
            break
    seen = measure_offsets(problem, parameters, curve_points, sigmas, pitch)
    camera = problem.resection.camera(parameters)
    places = camera.project_to_ground(curve_points.pixels + np.array(camera.principal_point))
    noise = problem.noise(parameters, seen, np.nan_to_num(places), pitch)
    error = float(np.median(np.abs(seen.offsets)))
    if (
        noise is None
        or error > problem.pixels_per_reference_pixel * WORST_PX
        or problem.mahalanobis_squared(parameters) > MOST_SURPRISING
    ):
        return None
    return PaintCamera(parameters, noise.parameters, noise.pitch, error)


def measure_offsets(
    problem: PaintProblem,
    parameters: FloatArray,
    curve_points: CurvePoints,
    sigmas: FloatArray,
    pitch: Pitch,
) -> PaintOffsets:
    """Stored paint as a camera sees it; what lies beyond the end of its marking, across it."""
    half = problem.resection.size.diagonal / 2
    offsets, jacobians = curve_residuals(parameters, pitch_curves(pitch), curve_points, half)
    radii = np.hypot(*curve_points.pixels.T) / half
    return PaintOffsets(offsets[:, 0], sigmas, curve_points.curve, -jacobians[:, 0], radii)


def collect_curve_points(
    evidence: PaintEvidence, size: ImageSize
) -> tuple[CurvePoints, FloatArray]:
    """Places of paint by marking, pixels from the principal point, and their sigmas."""
    rows = [
        (index, *point)
        for index, name in enumerate(MARKINGS)
        for point in evidence.points.get(name, ())
    ]
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    pixels = np.ascontiguousarray(table[:, 1:3] - np.array(principal_point(size)))
    return CurvePoints(pixels, table[:, 0].astype(np.int64), np.ones(len(table))), table[:, 3]


def _invert_covariance(covariance: FloatArray) -> FloatArray:
    scale = np.sqrt(np.diag(covariance))
    inverse = np.linalg.pinv(covariance / np.outer(scale, scale), hermitian=True)
    return np.asarray(inverse / np.outer(scale, scale))


compiled = njit(cache=True, error_model="numpy", nogil=True)


@compiled
def robust_weight(rest, sigma, strict, soft_px, strict_sigmas, strict_px):
    """Weight of a place of paint by how far off it lies, pixels.

    Args:
        strict: Whether what lies far off counts little (redescending), or by soft-L1.
        soft_px: Scale of the soft-L1 loss; ``strict_sigmas`` and ``strict_px`` those of the other.
    """
    if not strict:
        off = rest / soft_px
        return 1.0 / np.sqrt(1.0 + off * off)
    off = rest / max(strict_sigmas * sigma, strict_px)
    root = 1.0 / (1.0 + off * off)
    return root * root


@compiled
def write_paint_step(
    offsets, sigmas, base, jacobian, information, pull, rounds, damping,
    strict, soft_px, strict_sigmas, strict_px, moved,
):  # fmt: skip
    """Writes the step of iteratively reweighted least squares.

    Args:
        offsets: Of the paint from its markings, pixels, shape (N,), as ``sigmas``.
        base: Weight of each place but for its residual, shape (N,).
        jacobian: Shape (N, 8).
        information: What is known beforehand, shape (8, 8), and its ``pull``, shape (8,).
        rounds: How often the weights are taken anew.
        damping: Relative to the diagonal.
        moved: Result, shape (8,).

    Raises:
        numpy.linalg.LinAlgError: Nothing determines the step.
    """
    width = jacobian.shape[1]
    normal, right = np.empty((width, width)), np.empty(width)
    moved[:] = 0.0
    for _ in range(rounds):
        normal[:], right[:] = information, pull
        for n in range(len(offsets)):
            rest = offsets[n]
            for i in range(width):
                rest -= jacobian[n, i] * moved[i]
            weight = base[n] * robust_weight(
                rest, sigmas[n], strict, soft_px, strict_sigmas, strict_px
            )
            for i in range(width):
                share = weight * jacobian[n, i]
                right[i] += share * offsets[n]
                for k in range(width):
                    normal[i, k] += share * jacobian[n, k]
        for i in range(width):
            normal[i, i] *= 1.0 + damping
        moved[:] = np.linalg.solve(normal, right)
