"""Pitch size: length and width of a match's pitch, estimated from many of its frames, and how frames share numbers.

One frame cannot tell a longer pitch from another camera; many frames of the same pitch can. All
cameras and the two sizes are adjusted together.

One frame seldom tells such a number from another camera; many frames do. What a frame says of the
numbers, whatever its camera, is what is left once its camera is eliminated (Schur complement), and
these parts add up. A frame's part is its *pull* (gradient) and its *information*, both divided by
the variance of its clicks.

Source: Hartley & Zisserman, sec. A6.3 (partitioned normal equations); White (1980) for the
covariance, which counts frames and not clicks: the clicks of a frame err together.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray
from app.geometry.resection import PARAMETERS, X, Y, curve_residuals
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import LENGTH_RANGE, MARKINGS, WIDTH_RANGE, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.observations import (
    Observations,
    make_observations,
    pitch_curves,
    principal_point,
)
from app.solving.resect import Resection, ResectionProblem, count_measurements

MAX_FRAMES = 30
"""More frames say little more; those that say most are taken."""
MIN_MEASUREMENTS = 12
"""Frames with fewer say nothing that they do not need for their camera."""
CERTAIN_SIGMAS = 5.0
"""A number is certainly another one when it is so many standard deviations away."""

Share = tuple[FloatArray, FloatArray]
"""Pull, shape (K,), and information, shape (K, K), of one frame about the K shared numbers."""


def find_frames_with_enough_measurements(seen: Iterable[Observations]) -> list[int]:
    """Indices of the frames with enough independent measurements, those with the most first."""
    counts = [count_measurements(observations) for observations in seen]
    rich = sorted((-count, at) for at, count in enumerate(counts) if count >= MIN_MEASUREMENTS)
    return [at for _, at in rich]


def eliminate_camera(gradient: FloatArray, information: FloatArray, variance: float) -> Share:
    """The information of a frame on the shared numbers, with its camera eliminated.

    Args:
        gradient: Of the camera's P parameters and, behind them, of the numbers, shape (P + K,).
        information: J^T W J, shape (P + K, P + K).
        variance: Of a click.
    """
    camera, shared = slice(0, PARAMETERS), slice(PARAMETERS, None)
    carried = np.linalg.solve(information[camera, camera], information[camera, shared])
    pull = (gradient[shared] - carried.T @ gradient[camera]) / variance
    reduced = (information[shared, shared] - information[shared, camera] @ carried) / variance
    return pull, reduced


def eliminate_frame_deviations(share: Share, sigma: FloatArray) -> Share:
    """A frame's share where its numbers are its own, about those of the match (random effects).

    Args:
        share: As if the numbers were those of the match.
        sigma: By which a frame's numbers differ from them, shape (K,).
    """
    pull, information = share
    shrunk = np.linalg.inv(np.eye(len(pull)) + information * sigma**2)
    return shrunk @ pull, shrunk @ information


def estimate_sigmas_of_shared_numbers(
    pulls: FloatArray, information: FloatArray, spent: int
) -> FloatArray:
    """Standard deviations of the shared numbers, shape (K,).

    The larger of two: from the clicks' variance, and from how much the frames disagree.

    Args:
        pulls: Of each frame at the numbers that were found, shape (F, K).
        information: Of all frames and of what is thought beforehand, shape (K, K).
        spent: Frames' worth of freedom that the numbers took.
    """
    count, inverse = len(pulls), np.linalg.inv(information)
    between = inverse @ (pulls.T @ pulls) @ inverse * count / max(count - spent, 1)
    sigmas: FloatArray = np.sqrt(np.maximum(np.diag(inverse), np.diag(between)))
    return sigmas


MIN_FRAMES = 5
FRAME_SIGMA_M = 0.25
"""What lens and annotator of one frame may add to the error of its own sizes: no single frame
is believed to know them better."""
UNKNOWN_SIGMA_M = 1.0
"""A size known to no better than this is unknown."""
MIN_VOICES = 2.0
"""One frame alone may be wrong in ways that its sigma does not know. Fewer voices are enough where
the other frames know the size without the loudest one, and agree with it."""
AGREES = 2.5
"""Standard deviations by which the loudest frame and the others may differ then."""
LEAST_DIFFERENCE_M = 0.3
"""A size differs from another when it certainly does, and by so many metres."""
SEVERAL_P_VALUE = 0.001
"""Frames of one pitch disagree about a size as much as others do in less than so many cases."""
SPEAKS = 1.0
"""Information (of a sigma of 1 m) below which a frame has no say in that."""
_MISFIT_SHARE = 4.0
"""A frame whose cost a point is so many times that of the median frame has a wrong label."""
_ROUNDS, _SETTLED_M, _LONGEST_STEP_M = 12, 0.01, 2.5
_END_M = 0.1
"""A size this close to what the Laws allow has run into it and is unknown."""
_LOOSE_M = 20.0
"""Standard deviation of the step: keeps a size that no frame shows where it is."""


def _marking_motion_by_size(marking: str) -> tuple[float, float]:
    """How far a marking moves along x with each metre of length, along y with each of width."""
    words = marking.split(" ")[1:3]
    length = -0.5 if "left" in words else 0.5 if "right" in words else 0.0
    width = {"Side line top": -0.5, "Side line bottom": 0.5}.get(marking, 0.0)
    return length, width


_SHARES = np.array([_marking_motion_by_size(marking) for marking in MARKINGS])

_CROSSING = np.array([name.startswith(("Side line", "Middle line")) for name in MARKINGS])


@dataclass(frozen=True)
class PitchSizeFrameLines:
    """Annotated points by marking, pixels of ``size``."""

    lines: Lines
    size: ImageSize


@dataclass(frozen=True)
class PitchEstimate:
    """An estimated pitch.

    Attributes:
        length, width: Metres; None where the frames do not show it.
        length_sigma_m: Standard deviation of the length.
        width_sigma_m: Standard deviation of the width.
        frames: Number of frames that it rests on.
    """

    length: float | None
    width: float | None
    length_sigma_m: float | None
    width_sigma_m: float | None
    frames: int

    def proposal(self, pitch: Pitch) -> Pitch | None:
        """The size to use instead of this one, to a tenth of a metre; None where it agrees.

        A length or width that is unknown, or agrees within its uncertainty, stays as it is.
        """
        length = _significantly_different_size(pitch.length, self.length, self.length_sigma_m)
        width = _significantly_different_size(pitch.width, self.width, self.width_sigma_m)
        if length is None and width is None:
            return None
        return Pitch(length or pitch.length, width or pitch.width)


def estimate_pitch(
    frames: Sequence[PitchSizeFrameLines],
    policy: CalibrationPolicy,
    *,
    one_match: bool = True,
    least: int = MIN_FRAMES,
) -> PitchEstimate:
    """The size of the pitch that explains the lines of many frames best.

    Args:
        frames: Of one match.
        policy: How frames are calibrated.
        one_match: Whether the frames are known to be of one match.
        least: Frames below which nothing is estimated.

    Raises:
        DegenerateGeometryError: Too few frames show enough markings, or frames that nobody says
            are of one match show pitches of several sizes.
    """
    pitch = policy.pitch_for_fitted_lines(Pitch())
    seen = [
        _FittedFrame.of(frames[index], pitch, policy) for index in select_informative_frames(frames)
    ]
    if len(seen) < least:
        raise DegenerateGeometryError(
            f"only {len(seen)} frames show enough markings; estimating the pitch size needs {least}"
        )
    pitch, seen, _ = _adjust_size(pitch, seen)
    # Labels are judged on the pitch as it is now: on one of the wrong size the touchlines look
    # mislabelled.
    costs = np.array([item.fit.cost / len(item.observations.pixels) for item in seen])
    fits = costs <= _MISFIT_SHARE * np.median(costs)
    pitch, seen, shares = _adjust_size(
        pitch, [item for item, kept in zip(seen, fits, strict=True) if kept]
    )
    if not one_match and _do_frames_disagree(shares):
        raise DegenerateGeometryError(
            f"{len(seen)} frames show pitches of several sizes; import them with their matches"
        )
    sigma = _compute_size_sigmas(shares)
    heard = (_count_effective_frames(shares) >= MIN_VOICES) | _is_confirmed_by_other_frames(shares)
    known = (sigma <= UNKNOWN_SIGMA_M) & heard & _is_within_laws(pitch)
    return PitchEstimate(
        length=pitch.length if known[0] else None,
        width=pitch.width if known[1] else None,
        length_sigma_m=float(sigma[0]) if known[0] else None,
        width_sigma_m=float(sigma[1]) if known[1] else None,
        frames=len(seen),
    )


def select_informative_frames(frames: Sequence[PitchSizeFrameLines]) -> list[int]:
    """Indices of the ``MAX_FRAMES`` frames that say most of length and width, half of them for each.

    A frame tells the length when it shows something of the middle and something of an end, and
    the width when it shows a touchline and something whose width is fixed.
    """
    order = find_frames_with_enough_measurements(
        make_observations(frame.lines, Pitch(), frame.size) for frame in frames
    )
    length = [index for index in order if _determines_length(frames[index].lines)]
    width = [index for index in order if _determines_width(frames[index].lines)]
    half = MAX_FRAMES // 2
    best = [*length[:half], *width[:half]]
    chosen = dict.fromkeys([*best, *length, *width, *order])
    return sorted(list(chosen)[:MAX_FRAMES])


def _determines_length(lines: Lines) -> bool:
    middle = any(name in lines for name in ("Middle line", "Circle central"))
    left, right = (any(side in name.split(" ") for name in lines) for side in ("left", "right"))
    return (middle and (left or right)) or (left and right)


def _determines_width(lines: Lines) -> bool:
    top, bottom = ("Side line top" in lines), ("Side line bottom" in lines)
    inner = any(name.startswith(("Big", "Small", "Circle", "Goal")) for name in lines)
    return (top and bottom) or ((top or bottom) and inner)


@dataclass(frozen=True)
class _FittedFrame:
    """A frame with its best camera so far."""

    problem: ResectionProblem
    observations: Observations
    fit: Resection

    @staticmethod
    def of(frame: PitchSizeFrameLines, pitch: Pitch, policy: CalibrationPolicy) -> _FittedFrame:
        # What markings have in common is in FRAME_SIGMA_M.
        problem = ResectionProblem.of(frame.size, replace(policy, weighed="points"))
        observations = make_observations(frame.lines, pitch, frame.size)
        return _FittedFrame(problem, observations, problem.resect(observations))

    def refit_on_pitch(self, pitch: Pitch) -> _FittedFrame:
        """The frame on another pitch, its camera refined."""
        moved = replace(self.observations, curves=pitch_curves(pitch))
        return replace(
            self,
            observations=moved,
            fit=self.problem.refine(moved, self.fit.parameters[None]),
        )

    def information_on_size(self) -> Share:
        """The information of the frame on length and width, for any camera."""
        gradient, information = self._normal_equations()
        variance = self.problem.click_variance(self.fit.parameters, self.observations)
        share = eliminate_camera(gradient, information, variance)
        return eliminate_frame_deviations(share, np.full(2, FRAME_SIGMA_M))

    def _normal_equations(self) -> tuple[FloatArray, FloatArray]:
        """Gradient and J^T W J of camera, length and width, shapes (10,) and (10, 10)."""
        offsets, by_camera = curve_residuals(
            self.fit.parameters,
            self.observations.curves,
            self.observations.curve_points(),
            self.problem.size.diagonal / 2,
        )
        # A marking that moves is a camera that moves the other way.
        moves = nearest_place_shifts_by_pitch_size(
            self.problem, self.fit.parameters, self.observations, offsets[:, 1] != 0
        )
        length, width = moves.T
        by_length = -by_camera[:, :, X] * length[:, None]
        by_width = -by_camera[:, :, Y] * width[:, None]
        rows = np.concatenate([by_camera, np.stack([by_length, by_width], axis=-1)], axis=-1)
        scale = self.problem.robust_scale_px * self.problem.pixels_per_reference_pixel
        weight = 1 / np.sqrt(1 + (offsets**2).sum(axis=1) / scale**2)
        weighted = weight[:, None, None] * rows
        gradient = np.einsum("nri,nr->i", weighted, offsets)
        information = np.einsum("nri,nrj->ij", weighted, rows)
        prior = self.problem.prior()
        inverse = 1 / prior.sigma**2
        gradient[:PARAMETERS] += (self.fit.parameters - prior.mean) * inverse
        information[range(PARAMETERS), range(PARAMETERS)] += inverse
        return gradient, information


def nearest_place_shifts_by_pitch_size(
    problem: ResectionProblem,
    parameters: FloatArray,
    observations: Observations,
    past_end: npt.NDArray[np.bool_],
) -> FloatArray:
    """How far each point's nearest place moves with length and width, shape (N, 2).

    ``past_end`` are points past the end of their marking, shape (N,): their place is the end, and ends of the lines
    that cross the pitch are its corners, or the middle line's ends.
    """
    moves: FloatArray = _SHARES[observations.marking].copy()
    rows = np.flatnonzero(past_end & _CROSSING[observations.marking])
    if not len(rows):
        return moves
    center = np.array(principal_point(problem.size))
    ends = observations.curves.shapes[observations.marking[rows]].reshape(-1, 2, 3)
    seen = problem.camera(parameters).project(ends.reshape(-1, 3)).reshape(-1, 2, 2) - center
    apart = seen - observations.pixels[rows, None]
    near = np.nan_to_num(np.hypot(*np.moveaxis(apart, 2, 0)), nan=np.inf).argmin(axis=1)
    moves[rows] = 0.5 * np.sign(ends[np.arange(len(rows)), near, :2])
    return moves


def _adjust_size(
    pitch: Pitch, seen: Sequence[_FittedFrame]
) -> tuple[Pitch, list[_FittedFrame], list[Share]]:
    """Sizes and cameras adjusted together until the sizes settle."""
    for _ in range(_ROUNDS):
        seen = [item.refit_on_pitch(pitch) for item in seen]
        shares = [item.information_on_size() for item in seen]
        gradient, information = (sum(part) for part in zip(*shares, strict=True))
        step = -np.linalg.solve(information + np.eye(2) / _LOOSE_M**2, gradient)
        pitch = _resize_pitch(pitch, np.clip(step, -_LONGEST_STEP_M, _LONGEST_STEP_M))
        if np.abs(step).max() < _SETTLED_M:
            break
    return pitch, list(seen), shares


def _compute_size_sigmas(shares: Sequence[Share]) -> FloatArray:
    """Standard deviations of length and width, metres, shape (2,)."""
    pulls = np.array([pull for pull, _ in shares])
    information = np.sum([part for _, part in shares], axis=0)
    return estimate_sigmas_of_shared_numbers(pulls, information + np.eye(2) / _LOOSE_M**2, spent=2)


def _do_frames_disagree(shares: Sequence[Share]) -> bool:
    """Whether frames differ about length or width by more than chance makes frames of one pitch.

    A frame's gradient is zero but for chance, with its information as variance.
    """
    pulls = np.array([gradient for gradient, _ in shares])
    informations = np.array([np.diag(information) for _, information in shares])
    speaks = informations > SPEAKS
    squares = np.where(speaks, pulls**2 / np.maximum(informations, SPEAKS), 0.0).sum(axis=0)
    freedom = np.maximum(speaks.sum(axis=0) - 1, 1)
    return bool((chdtrc(freedom, squares) < SEVERAL_P_VALUE).any())


def _count_effective_frames(shares: Sequence[Share]) -> FloatArray:
    """How many frames speak of length and of width, as if all of them said as much, shape (2,)."""
    informations = np.array([np.diag(information) for _, information in shares])
    voices: FloatArray = informations.sum(axis=0) ** 2 / np.maximum(
        (informations**2).sum(axis=0), 1e-30
    )
    return voices


def _is_confirmed_by_other_frames(shares: Sequence[Share]) -> npt.NDArray[np.bool_]:
    """Whether all frames but the one that says most know a size as well, and agree, shape (2,).

    A gradient is that of one frame at the size that all agree on: its share of the information
    takes it to the size that the frame alone says.
    """
    pulls = np.array([gradient for gradient, _ in shares])
    informations = np.maximum([np.diag(information) for _, information in shares], 1e-30)
    loudest = informations.argmax(axis=0), range(2)
    others = np.maximum(informations.sum(axis=0) - informations[loudest], 1e-30)
    apart = pulls[loudest] / informations[loudest] - (pulls.sum(axis=0) - pulls[loudest]) / others
    chance = 1 / informations[loudest] + 1 / others
    known: npt.NDArray[np.bool_] = others >= UNKNOWN_SIGMA_M**-2
    alike: npt.NDArray[np.bool_] = apart**2 <= AGREES**2 * chance
    return known & alike


def _is_within_laws(pitch: Pitch) -> npt.NDArray[np.bool_]:
    """Whether length and width lie within the Laws, not at their ends, shape (2,)."""
    ends = np.array([LENGTH_RANGE, WIDTH_RANGE])
    size = np.array([pitch.length, pitch.width])
    inside: npt.NDArray[np.bool_] = (size > ends[:, 0] + _END_M) & (size < ends[:, 1] - _END_M)
    return inside


def _resize_pitch(pitch: Pitch, by: FloatArray) -> Pitch:
    """The pitch with another length and width, within the Laws of the Game."""
    ends = np.array([LENGTH_RANGE, WIDTH_RANGE])
    low, high = ends[:, 0] + _END_M / 2, ends[:, 1] - _END_M / 2
    length, width = np.clip(np.array([pitch.length, pitch.width]) + by, low, high).tolist()
    return replace(pitch, length=length, width=width)


def _significantly_different_size(
    now: float, found: float | None, sigma: float | None
) -> float | None:
    """What was found, to a tenth of a metre, where it certainly is another size."""
    if found is None or sigma is None:
        return None
    limit = max(LEAST_DIFFERENCE_M, CERTAIN_SIGMAS * sigma)
    return round(found, 1) if abs(found - now) > limit else None
