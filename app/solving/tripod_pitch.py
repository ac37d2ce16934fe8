"""Tripod pitch: what the frames of one camera on a tripod say together of the pitch that they show.

No pitch is quite the plan, and the paint of one frame cannot tell it: its camera gives way
(``estimate_paint_noise``). Frames that one tripod took have a position in common, and length, width, crown, the place of the paint
and of each line; all are unknowns with what is known of stadiums as prior, beside the camera of each frame.

A camera that is used with the plan stays on the plan's markings. How far it is from the camera that
stands on the tripod is known then, and is its uncertainty: the second moment about it, as for
frames alone (``lone_frame``).

Source: Triggs et al., "Bundle adjustment: a modern synthesis", section 6 (shared unknowns are solved
first, by the Schur complement); Gelman et al., "Bayesian data analysis", sec. 3.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import (
    KAPPA,
    LOG_FOCAL,
    PAN,
    PARAMETERS,
    ROLL,
    CurvePoints,
    X,
    Z,
    camera_from_parameters,
)
from app.soccer.frames import ImageSize
from app.soccer.pitch import LENGTH_RANGE, MARKINGS, WIDTH_RANGE, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.camera_positions import MAIN_MEAN, MAIN_SIGMA, is_main_position
from app.solving.lone_frame import CROWN_SIGMA_M, INWARD_SIGMA_M, PAINT_SIZE_SIGMA_M
from app.solving.observations import principal_point
from app.solving.paint_camera import PaintProblem, measure_offsets
from app.solving.paint_noise import (
    CROWN,
    INWARD,
    LENS,
    SIZES,
    TERMS,
    PaintOffsets,
    cautious_point_weights_by_marking,
    compute_paint_shift,
    paint_derivatives_by_all_terms,
    shift_offsets,
)
from app.solving.pitch_size import CERTAIN_SIGMAS, LEAST_DIFFERENCE_M, UNKNOWN_SIGMA_M
from app.solving.resect import REFERENCE_DIAGONAL, ResectionProblem

LEAST_FRAMES, MOST_FRAMES = 3, 24
"""Two frames tell no tripod; more than so many, evenly over a shot, say little more."""
DEVIATION_M = 0.3
"""Standard deviation of a frame's position from its tripod: a lens turns before the head."""
FARTHEST_M = 4 * DEVIATION_M
"""Frames that lie farther from their tripod stand on none, or show other markings than it was thought."""
BESIDE_PX, BESIDE, TRAVELS = 0.05, 1.5, 0.2
"""A camera left its paint where that is this much farther from it than it was, pixels at 960 x 540, and so many times as
far; and the share of the frames with such cameras from which on they stand on no tripod."""
KAPPA_DEVIATION, KAPPA_SLOPE_SIGMA = 0.002, 0.03
"""Of the distortion from what the zoom says, and of its slope by the logarithm of the focal length."""
TOLD_SHARE = 0.8
"""A size is shown where its standard deviation is this share of what is thought beforehand, or less."""
ALONE_ROUNDS = 6
ROUNDS, SETTLED = 12, 0.01
"""Steps of one frame where the pitch is known; of all of them at most, and the step of a number of the pitch, in its standard deviations, that ends them."""
STEP_M = 0.2
"""Between the points of a marking."""
_END_M = 0.1
_PLACE, _LENS, _PITCH = slice(0, 3), slice(3, 5), slice(5, 5 + TERMS)
SHARED = 5 + TERMS
"""What the frames have in common: the place, the distortion and its slope by zoom, the pitch."""
_OWN = [X, X + 1, Z, KAPPA]


@dataclass(frozen=True)
class FrameWithPaint:
    """A frame with its camera on the plan, and its paint.

    Attributes:
        parameters: Shape (8,).
        sightings: Places of paint by marking, pixels from the principal point.
        sigmas: Standard deviations of these across their markings, pixels, shape (N,).
    """

    parameters: FloatArray
    sightings: CurvePoints
    sigmas: FloatArray


@dataclass(frozen=True)
class TripodPitch:
    """A pitch as the frames of one tripod show it.

    Attributes:
        plan: The pitch in use.
        size: Of their pictures, pixels.
        frames: How many frames it rests on.
        shared: What the frames have in common, shape (SHARED,).
        covariance: Of it, shape (SHARED, SHARED).
        zoom: Logarithm of the focal length about which the distortion's slope is told.
        noise: Variance of the paint in units of its sigma squared.
        spread: Second moment of how far the frames lie from their tripod, metres squared, shape (3, 3): a tripod
            stands still, so that is an error that each frame has besides.
        policy: Prior of the distortion.
    """

    plan: Pitch
    size: ImageSize
    frames: int
    shared: FloatArray
    covariance: FloatArray
    zoom: float
    noise: float
    spread: FloatArray
    policy: CalibrationPolicy

    @property
    def pitch(self) -> Pitch:
        """The plan with the length and width that are shown."""
        length, width = (PAINT_SIZE_SIGMA_M * self.terms[SIZES]).tolist()
        return replace(
            self.plan,
            length=float(np.clip(self.plan.length + length, *LENGTH_RANGE)),
            width=float(np.clip(self.plan.width + width, *WIDTH_RANGE)),
        )

    @property
    def terms(self) -> FloatArray:
        """Numbers of the pitch in their standard deviations (``estimate_paint_noise``), shape (TERMS,)."""
        return self.shared[_PITCH]

    @property
    def tripod_position(self) -> FloatArray:
        """Of the tripod, metres, shape (3,)."""
        return self.shared[_PLACE]

    @property
    def tripod_position_covariance(self) -> FloatArray:
        """Shape (3, 3)."""
        return self.covariance[_PLACE, _PLACE]

    @property
    def size_sigmas(self) -> FloatArray:
        """Standard deviations of length and width, metres, shape (2,); nothing of a size that was measured."""
        return np.asarray(PAINT_SIZE_SIGMA_M * np.sqrt(np.diag(self.covariance)[_PITCH][SIZES]))

    @property
    def crown(self) -> tuple[float, float]:
        """How far the grass is raised along the middle, and its standard deviation, metres."""
        return self._term_with_sigma(CROWN, CROWN_SIGMA_M)

    @property
    def inward_paint_shift(self) -> tuple[float, float]:
        """How far the paint lies inside the plan, and its standard deviation, metres."""
        return self._term_with_sigma(INWARD, INWARD_SIGMA_M)

    def _term_with_sigma(self, term: int, unit: float) -> tuple[float, float]:
        sigma = np.sqrt(np.diag(self.covariance)[_PITCH][term])
        return float(unit * self.terms[term]), float(unit * sigma)

    @property
    def are_sizes_known(self) -> tuple[bool, bool]:
        """Whether length and width are shown."""
        limit = np.minimum(TOLD_SHARE * PAINT_SIZE_SIGMA_M, UNKNOWN_SIGMA_M)
        length, width = (self.size_sigmas <= limit).tolist()
        return length, width

    def clearly_different_pitch(self) -> Pitch | None:
        """The size that is shown, to a tenth of a metre, where it certainly is not the plan's."""
        found, used = (np.array([each.length, each.width]) for each in (self.pitch, self.plan))
        limit = np.maximum(CERTAIN_SIGMAS * self.size_sigmas, LEAST_DIFFERENCE_M)
        off = (np.abs(found - used) > limit) & self.are_sizes_known
        if not off.any():
            return None
        length, width = np.where(off, found.round(1), used).tolist()
        return replace(self.plan, length=length, width=width)

    def sample_marking(self, marking: str) -> FloatArray:
        """Points along a marking as it is shown, pitch frame, metres, shape (N, 3)."""
        points = self.pitch.sample(marking, STEP_M, STEP_M)
        which = np.full(len(points), MARKINGS.index(marking))
        return points + compute_paint_shift(points[:, :2], which, self.terms, self.pitch)

    def compute_paint_shift_of_frame(self, frame: FrameWithPaint) -> FloatArray:
        """How far each place of paint lies off the plan of the size that is shown, metres, shape (N, 3)."""
        grass = project_paint_to_grass(frame, self.size)
        return compute_paint_shift(grass, frame.sightings.curve, self.terms, self.pitch)

    def fit_camera(self, frame: FrameWithPaint) -> tuple[FloatArray, FloatArray]:
        """The camera of a frame on the pitch that is shown, shape (8,), and its covariance, shape (8, 8)."""
        frames = _TripodProblem([frame], self.size, self.plan, self.policy, self)
        for _ in range(ALONE_ROUNDS):
            parts = frames.build_normal_equations()
            frames.parameters = (
                frames.parameters + np.linalg.solve(parts.own, parts.own_right[..., None])[..., 0]
            )
        return frames.parameters[0], self.covariance_of(frame, frames.parameters[0])

    def error_px(self, frame: FrameWithPaint, parameters: FloatArray) -> float:
        """Median distance of a frame's paint from the pitch that is shown, by its camera there, pixels."""
        at = replace(frame, parameters=parameters)
        seen = _TripodProblem([at], self.size, self.plan, self.policy, self).measure_frame_offsets(
            0
        )
        return float(np.median(np.abs(seen.offsets)))

    def covariance_of(self, frame: FrameWithPaint, parameters: FloatArray) -> FloatArray:
        """The same of parameters that are known already, shape (8, 8)."""
        at = replace(frame, parameters=parameters)
        parts = _TripodProblem(
            [at], self.size, self.plan, self.policy, self
        ).build_normal_equations()
        own = np.linalg.inv(parts.own[0])
        carried = own @ parts.between[0]
        covariance = own + carried @ self.covariance @ carried.T
        lens = LENS * own @ parts.lens[0]
        covariance += np.outer(lens, lens)
        covariance[X : Z + 1, X : Z + 1] += self.spread
        return np.asarray(0.5 * (covariance + covariance.T))


def second_moment_about_plan(
    parameters: FloatArray, found: FloatArray, covariance: FloatArray
) -> FloatArray:
    """Second moment of how far the true camera is from one on the plan, shape (8, 8).

    Args:
        parameters: On the plan, shape (8,).
        found: On the pitch that is shown, shape (8,).
        covariance: Of it, shape (8, 8).
    """
    off = parameters - found
    off[PAN] = (off[PAN] + np.pi) % (2 * np.pi) - np.pi
    return np.asarray(covariance + np.outer(off, off))


def find_tripod_pitch(
    frames: Sequence[FrameWithPaint], size: ImageSize, pitch: Pitch, policy: CalibrationPolicy
) -> TripodPitch | None:
    """The pitch that frames of one camera on a tripod show together.

    Args:
        frames: With cameras on the pitch in use, in their order.
        size: Of their pictures, pixels.
        pitch: In use.
        policy: Prior of the distortion.

    Returns:
        None where they are too few, leave it open, or stand on no tripod.
    """
    if len(frames) < LEAST_FRAMES:
        return None
    places = np.linspace(0, len(frames) - 1, min(len(frames), MOST_FRAMES)).round().astype(int)
    together = _TripodProblem([frames[place] for place in places], size, pitch, policy)
    alone = together.measure_errors_px()
    try:
        found = together.minimize_cost()
    except np.linalg.LinAlgError:
        return None
    if do_cameras_travel(together.measure_errors_px(), alone, size):
        return None
    away = np.linalg.norm(together.parameters[:, X : Z + 1] - found.tripod_position, axis=1)
    sizes = np.array([found.pitch.length, found.pitch.width])
    ends = np.array([LENGTH_RANGE, WIDTH_RANGE])
    inside = (sizes > ends[:, 0] + _END_M) & (sizes < ends[:, 1] - _END_M)
    if not (np.isfinite(found.covariance).all() and away.max() < FARTHEST_M and inside.all()):
        return None
    return found


def do_cameras_travel(errors_px: FloatArray, alone_px: FloatArray, size: ImageSize) -> bool:
    """Whether frames stand on no tripod: on one, too many of their cameras leave the paint on which they lay.

    Args:
        errors_px: Median distance of the paint of each frame from its markings, by cameras on one tripod, shape (N,).
        alone_px: The same by its camera alone, shape (N,).
        size: Of the pictures, pixels.
    """
    farther = alone_px + BESIDE_PX * size.diagonal / REFERENCE_DIAGONAL
    beside = errors_px > np.maximum(BESIDE * alone_px, farther)
    return bool(beside.sum() > TRAVELS * len(beside))


@dataclass(frozen=True)
class _NormalEquations:
    """Normal equations: of each frame, of what they share, and between both.

    Attributes:
        own: Shape (F, 8, 8).
        between: Shape (F, 8, SHARED).
        common: Shape (SHARED, SHARED).
        own_right, right: Shapes (F, 8) and (SHARED,).
        lens: Of what a lens does beyond its one radial term, shape (F, 8).
    """

    own: FloatArray
    between: FloatArray
    common: FloatArray
    own_right: FloatArray
    right: FloatArray
    lens: FloatArray


class _TripodProblem:
    """Frames of one tripod, or one of them where the rest is known."""

    def __init__(
        self,
        frames: Sequence[FrameWithPaint],
        size: ImageSize,
        plan: Pitch,
        policy: CalibrationPolicy,
        known: TripodPitch | None = None,
    ):
        self._frames, self._size, self._plan, self._policy = frames, size, plan, policy
        self.parameters = np.array([frame.parameters for frame in frames])
        self.parameters[:, PAN] = np.unwrap(self.parameters[:, PAN])
        self._problem = PaintProblem.of(ResectionProblem.of(size, policy), self.parameters[0], None)
        self._grass = [project_paint_to_grass(frame, size) for frame in frames]
        if known is None:
            shared = np.zeros(SHARED)
            shared[_PLACE] = np.median(self.parameters[:, X : Z + 1], axis=0)
            shared[_LENS.start] = np.median(self.parameters[:, KAPPA])
            zoom, nothing = float(self.parameters[:, LOG_FOCAL].mean()), np.zeros((SHARED, SHARED))
            known = TripodPitch(
                plan, size, len(frames), shared, nothing, zoom, 1.0, nothing[_PLACE, _PLACE], policy
            )
        self._known = known

    def measure_frame_offsets(self, at: int) -> PaintOffsets:
        frame, known = self._frames[at], self._known
        seen = measure_offsets(
            self._problem, self.parameters[at], frame.sightings, frame.sigmas, known.pitch
        )
        shift = compute_paint_shift(self._grass[at], seen.marking, known.terms, known.pitch)
        return replace(seen, offsets=shift_offsets(seen.offsets, seen.jacobian, shift))

    def measure_errors_px(self) -> FloatArray:
        """Median distance of the paint of each frame from its markings, pixels, shape (N,)."""
        offsets = [self.measure_frame_offsets(at).offsets for at in range(len(self._frames))]
        return np.array([np.median(np.abs(each)) for each in offsets])

    def build_normal_equations(self) -> _NormalEquations:
        """The equations where frames and what they share are now."""
        count, known = len(self.parameters), self._known
        own, between = (
            np.zeros((count, PARAMETERS, PARAMETERS)),
            np.zeros((count, PARAMETERS, SHARED)),
        )
        common, own_right, right = (
            self._prior_information(),
            np.zeros((count, PARAMETERS)),
            self._prior_gradient(),
        )
        lens = np.zeros((count, PARAMETERS))
        weight = np.array([DEVIATION_M, DEVIATION_M, DEVIATION_M, KAPPA_DEVIATION]) ** -2.0
        level = MAIN_SIGMA[0] ** -2.0
        for at in range(count):
            seen = self.measure_frame_offsets(at)
            terms = paint_derivatives_by_all_terms(
                self._grass[at], seen.marking, seen.jacobian, self._plan
            )
            robust = self._problem.robust_weights(seen.offsets, seen.sigmas)
            each = (
                robust
                * cautious_point_weights_by_marking(seen.marking, seen.sigmas)
                / seen.sigmas**2
            )
            weighted = seen.jacobian * (each / known.noise)[:, None]
            weighted_terms = terms * (each / known.noise)[:, None]
            own[at] += weighted.T @ seen.jacobian
            own_right[at] += weighted.T @ seen.offsets
            between[at][:, _PITCH] += weighted.T @ terms
            common[_PITCH, _PITCH] += weighted_terms.T @ terms
            right[_PITCH] += weighted_terms.T @ seen.offsets
            lens[at] = weighted.T @ (seen.radii**2 * seen.jacobian[:, KAPPA])
            basis = self._shared_parameter_basis(at)
            rest = weight * (self.parameters[at][_OWN] - basis @ known.shared)
            own[at][_OWN, _OWN] += weight
            own_right[at][_OWN] -= rest
            between[at][_OWN] -= weight[:, None] * basis
            common += basis.T @ (weight[:, None] * basis)
            right += basis.T @ rest
            own[at][ROLL, ROLL] += level
            own_right[at][ROLL] -= level * self.parameters[at][ROLL]
        return _NormalEquations(own, between, common, own_right, right, lens)

    def _shared_parameter_basis(self, at: int) -> FloatArray:
        """What the frames share, to the position and distortion of one, shape (4, SHARED)."""
        basis = np.zeros((4, SHARED))
        basis[_PLACE, _PLACE] = np.eye(3)
        basis[3, _LENS] = 1.0, self.parameters[at][LOG_FOCAL] - self._known.zoom
        return basis

    def _prior_sigmas(self) -> FloatArray:
        """Of what is thought of the shared numbers beforehand, shape (SHARED,)."""
        lens = [self._policy.distortion_sigma, KAPPA_SLOPE_SIGMA]
        is_main = is_main_position(self._known.tripod_position)
        place = MAIN_SIGMA[1:] if is_main else np.full(3, np.inf)
        return np.concatenate([place, lens, np.ones(TERMS)])

    def _prior_information(self) -> FloatArray:
        return np.diag(self._prior_sigmas() ** -2.0)

    def _prior_gradient(self) -> FloatArray:
        """Of the prior, shape (SHARED,)."""
        mean = np.zeros(SHARED)
        mean[_PLACE], mean[_LENS.start] = MAIN_MEAN[1:], self._policy.distortion_mean
        return np.asarray(self._prior_sigmas() ** -2.0 * (mean - self._known.shared))

    def minimize_cost(self) -> TripodPitch:
        """Gauss-Newton steps until the pitch stays as it is.

        Raises:
            numpy.linalg.LinAlgError: Nothing determines it.
        """
        for _ in range(ROUNDS):
            parts = self.build_normal_equations()
            alone = np.linalg.solve(parts.own, parts.own_right[..., None])[..., 0]
            carried = _parameter_derivatives(parts)
            below = parts.right - np.einsum("nis,ni->s", parts.between, alone)
            step = np.linalg.solve(_eliminate_frames(parts, carried), below)
            self.parameters = self.parameters + alone - carried @ step
            self._known = replace(self._known, shared=self._known.shared + step)
            if not np.isfinite(self.parameters).all():
                raise np.linalg.LinAlgError("the frames do not determine the size of the pitch")
            rest = [
                np.abs(self.measure_frame_offsets(at).offsets) for at in range(len(self._frames))
            ]
            sigmas = np.concatenate([frame.sigmas for frame in self._frames])
            # Of a normal distribution the median distance is 0.6745 standard deviations.
            noise = max(1.0, float(np.median(np.concatenate(rest) / sigmas) / 0.6745) ** 2)
            self._known = replace(self._known, noise=noise)
            if np.abs(step[_PITCH]).max() < SETTLED:
                break
        parts = self.build_normal_equations()
        covariance = np.linalg.inv(_eliminate_frames(parts, _parameter_derivatives(parts)))
        away = self.parameters[:, X : Z + 1] - self._known.tripod_position
        return replace(
            self._known,
            covariance=0.5 * (covariance + covariance.T),
            spread=away.T @ away / len(away),
        )


def _parameter_derivatives(parts: _NormalEquations) -> FloatArray:
    """How far each frame's parameters move with what is shared, shape (F, 8, SHARED)."""
    return np.asarray(np.linalg.solve(parts.own, parts.between))


def _eliminate_frames(parts: _NormalEquations, carried: FloatArray) -> FloatArray:
    """What is left of the shared part once the frames are eliminated (Schur complement)."""
    return np.asarray(parts.common - np.einsum("nis,nit->st", parts.between, carried))


def project_paint_to_grass(frame: FrameWithPaint, size: ImageSize) -> FloatArray:
    """Where on the grass each place of paint lies by the frame's camera, metres, shape (N, 2)."""
    center = principal_point(size)
    camera = camera_from_parameters(frame.parameters, center, size.diagonal / 2)
    return np.nan_to_num(camera.project_to_ground(frame.sightings.pixels + np.array(center)))
