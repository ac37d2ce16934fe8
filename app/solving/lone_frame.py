"""Lone frame: how far the camera of a frame may be off whose pitch and picture nobody knows.

Length and width of the pitch, the aspect of the pixels and both shifts of the axis are five
unknowns beside the eight of the camera, with what is known of stadiums and pictures as prior.
Where the lines tell them they are estimated, elsewhere the prior stays; either way the camera
remains that of the pitch in use and of the picture as it is, and its covariance becomes the
second moment of how far the true one may be from it: the spread of the thirteen, and the
distance to where they fit best.

Source: Liang & Zeger (1986) for the spread, as in ``line_noise``; Gelman et al., "Bayesian data analysis",
sec. 3.1, for unknowns that are averaged over.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import FloatArray, IntArray
from app.geometry.resection import (
    KAPPA,
    LOG_FOCAL,
    PAN,
    PARAMETERS,
    ROLL,
    TILT,
    X,
    Y,
    curve_residuals,
)
from app.soccer.picture import ASPECTS, MAX_SHIFT
from app.soccer.pitch import LENGTH_RANGE, MARKINGS, WIDTH_RANGE, Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import OtherPitch
from app.solving.labels import GAMMA_SHARE, RELABELLED
from app.solving.line_noise import compute_line_noise
from app.solving.observations import Observations, pitch_curves
from app.solving.picture_camera import undo_warp
from app.solving.pitch_size import nearest_place_shifts_by_pitch_size
from app.solving.resect import CLICK_SIGMA_PX, MIN_CLICK_SIGMA_PX, WIDE, ResectionProblem

SIZE_SIGMA_M = np.array([2.0, 1.0])
"""Standard deviations of length and width of professional pitches about 105 x 68 m, metres: those of the
twenty clubs of the Premier League in 2022/23 (fifteen have 105 m, the others 100 to 103.3)."""
LAWS_SIZE_SIGMA_M = np.array([6.0, 8.0])
"""The same of any pitch that the Laws allow, 90 to 120 by 45 to 90 m."""
AS_TAKEN = np.full(3, 1e-4)
"""Of the logarithm of the pixels' aspect, and of the shift of the axis right and down in half
diagonals, in a picture as it was taken."""
WARP_SIGMA = np.full(3, 0.15)
"""The same in a picture that may have been stretched (4:3 to 16:9: 0.29) or cropped."""
PAINT_SIZE_SIGMA_M = np.array([1.5, 0.5])
"""Standard deviations of length and width of the pitches that main cameras show, metres. Of the twenty of
the Premier League in 2022/23 fifteen are 105 m long and seventeen 68 m wide (from 105 x 68 m: 2.0 and 1.0 m);
UEFA and most other leagues ask for 105 x 68 m."""
CROWN_SIGMA_M = 0.04
"""How far the grass is raised along the middle between the touchlines, metres. Pitches are laid with a slope of
3 to 5 in a thousand at most; five real clips show 0.03 to 0.14 m, 0.04 m about their mean."""
INWARD_SIGMA_M = 0.06
"""How far the middle of the paint lies inside the plan, metres: half its width. The Laws measure
to the outer edges, the coordinates of markings here are those of the middle; real clips show 0.04 to 0.08 m."""
LINE_SIGMA_M = 0.03
"""How far a painted line lies from its place, each for itself, metres: real clips show 0.02 to 0.05 m."""


SIZES, WARP = slice(PARAMETERS, PARAMETERS + 2), slice(PARAMETERS + 2, PARAMETERS + 5)
WIDTH = PARAMETERS + 5
PRIORS = {
    "professional": np.append(SIZE_SIGMA_M, AS_TAKEN),
    "any": np.append(LAWS_SIZE_SIGMA_M, WARP_SIGMA),
}
"""Standard deviations of the five, by what ``CalibrationPolicy.lone_frames`` says."""
ROUNDS, SETTLED = 6, 1e-2
"""Steps of a fit at most, and the share of the cost below which a step ends it."""
LINEAR = np.array([3.0, 3.0, 0.05, 0.1, 0.1])
"""Steps of the five within which the first slopes hold."""
LONGEST = np.array([8.0, 8.0, 0.15, 0.2, 0.2])
"""Steps of the five are no longer."""
HALVINGS = (1.0, 0.5, 0.25, 0.1)
OTHER_SIGMAS, OTHER_M = 4.0, 1.0
"""A frame shows another pitch where a size is so many standard deviations and metres away."""
_PROBE_PX = 0.01
_LENS = [PAN, TILT, ROLL, LOG_FOCAL, KAPPA]


@dataclass(frozen=True)
class LoneFrameUncertainty:
    """What the lines of a frame leave open once nobody says its pitch and picture.

    Attributes:
        covariance: Second moment of how far the true camera is from the one in use, parameters of
            ``geometry.resection``, shape (8, 8).
        pitch: The size that the lines fit best.
        sizes_sigma: Standard deviations of its length and width, metres, shape (2,).
        explains: Markings that were left out as mislabelled and lie where this pitch has them.
    """

    covariance: FloatArray
    pitch: Pitch
    sizes_sigma: FloatArray
    explains: tuple[str, ...] = ()

    def find_other_pitch(self, pitch: Pitch) -> OtherPitch | None:
        """The size that the lines show, to a decimetre, where it certainly is not that of a pitch."""
        found = np.array([self.pitch.length, self.pitch.width])
        used = np.array([pitch.length, pitch.width])
        off, limit = np.abs(found - used), np.maximum(OTHER_SIGMAS * self.sizes_sigma, OTHER_M)
        if not (off > limit).any():
            return None
        size = np.where(off > limit, found, used).round(1)
        axis = int(np.argmax(np.where(off > limit, off / self.sizes_sigma, 0.0)))
        return OtherPitch(
            tuple(size.tolist()),
            (pitch.length, pitch.width),
            float(off[axis]),
            float(limit[axis]),
            self.explains,
        )


def estimate_lone_frame_uncertainty(
    problem: ResectionProblem,
    parameters: FloatArray,
    observations: Observations,
    pitch: Pitch,
    policy: CalibrationPolicy,
    left_out: Collection[str] = (),
) -> LoneFrameUncertainty | None:
    """What nobody knows of a frame's pitch and picture, as its camera's uncertainty.

    Args:
        problem: Of the image.
        parameters: The camera on the pitch in use, shape (8,).
        observations: All its points.
        pitch: In use; nobody said that it is the true one.
        policy: Says what is known of lone frames.
        left_out: Markings that the camera was found without.

    Returns:
        None where the policy takes pitch and picture for known, or the lines do not determine the camera.
    """
    sigma = PRIORS.get(policy.lone_frames)
    if sigma is None:
        return None
    try:
        if left_out:
            # What looks mislabelled on the pitch in use may lie where another pitch has it.
            whole = _UnknownPitchProblem(problem, observations, pitch, sigma).fit(parameters)
            if (
                whole.largest_distance_px(left_out)
                <= RELABELLED * GAMMA_SHARE * problem.size.diagonal
            ):
                return replace(whole.to_uncertainty(), explains=tuple(left_out))
        kept = observations.without(*left_out)
        return _UnknownPitchProblem(problem, kept, pitch, sigma).fit(parameters).to_uncertainty()
    except np.linalg.LinAlgError:
        return None


@dataclass(frozen=True)
class _RobustlyWeightedResiduals:
    """Weighted residuals at some unknowns, their slopes, and the points' distances, pixels."""

    apart: FloatArray
    jacobian: FloatArray
    marking: IntArray
    distance: FloatArray


@dataclass(frozen=True)
class _UnknownPitchFit:
    """Where the thirteen fit best, and how far that is from the camera in use, shapes (13,)."""

    frame: _UnknownPitchProblem
    unknowns: FloatArray
    off: FloatArray
    rows: _RobustlyWeightedResiduals

    def largest_distance_px(self, markings: Collection[str]) -> float:
        """Largest distance of a point of some markings."""
        seen = np.isin(self.frame.observations.marking, [MARKINGS.index(name) for name in markings])
        return float(self.rows.distance[seen].max(initial=0.0))

    def to_uncertainty(self) -> LoneFrameUncertainty:
        """As it is used."""
        carry = _camera_jacobian(self.rows)
        spread, off = self.frame.compute_covariance(self.rows), carry @ self.off
        covariance = carry @ spread @ carry.T + np.outer(off, off)
        variances = np.concatenate([np.diag(spread), np.diag(covariance)])
        if not (np.isfinite(covariance).all() and (variances > 0).all()):
            raise np.linalg.LinAlgError("the lines do not determine the camera")
        return LoneFrameUncertainty(
            covariance,
            self.frame.pitch_with_corrections(self.unknowns),
            np.sqrt(np.diag(spread)[SIZES]),
        )


@dataclass(frozen=True)
class _UnknownPitchProblem:
    problem: ResectionProblem
    observations: Observations
    pitch: Pitch
    sigma: FloatArray

    def pitch_with_corrections(self, unknowns: FloatArray) -> Pitch:
        """The pitch with the length and width corrections (metres) among the unknowns."""
        length, width = unknowns[SIZES].tolist()
        return replace(
            self.pitch, length=self.pitch.length + length, width=self.pitch.width + width
        )

    def fit(self, parameters: FloatArray) -> _UnknownPitchFit:
        """From the camera in use to where the thirteen fit best; linear where that is near."""
        start = np.append(parameters, np.zeros(WIDTH - PARAMETERS))
        rows = self._compute_residuals(start)
        step = self._compute_step(start, rows)
        if (np.abs(step[PARAMETERS:]) > LINEAR).any():
            unknowns, rows = self._minimize_cost(start, rows)
            return _UnknownPitchFit(self, unknowns, unknowns - start, rows)
        # Without what pulls the camera aside besides: priors, and the scale of the loss.
        off = step - self._compute_step(start, rows, PARAMETERS)
        return _UnknownPitchFit(self, _clip_to_plausible(start + step, self.pitch), off, rows)

    def compute_covariance(self, rows: _RobustlyWeightedResiduals) -> FloatArray:
        """Covariance of the thirteen, shape (13, 13)."""
        # Residuals in units of a click, so that the prior weighs what it says.
        freedom = max(len(rows.apart) - PARAMETERS, 1)
        least = MIN_CLICK_SIGMA_PX * self.problem.pixels_per_reference_pixel
        click = max(float(np.sqrt(rows.apart @ rows.apart / freedom)), least)
        known = self.problem.click_noise_prior
        known = replace(known, sigma_px=known.sigma_px / click, floor_px=known.floor_px / click)
        return compute_line_noise(
            rows.apart / click,
            rows.jacobian / click,
            rows.marking,
            self._prior_information(),
            known,
            self._marking_weights_by_row(rows),
        ).parameters

    def _marking_weights_by_row(self, rows: _RobustlyWeightedResiduals) -> FloatArray:
        return self.problem.row_weights(self.observations, rows.marking)

    def _prior_information(self) -> FloatArray:
        prior = np.zeros(WIDTH)
        prior[KAPPA] = self.problem.distortion_sigma**-2
        prior[PARAMETERS:] = self.sigma**-2
        return prior

    def _compute_step(
        self, unknowns: FloatArray, rows: _RobustlyWeightedResiduals, width: int = WIDTH
    ) -> FloatArray:
        """To the minimum about some unknowns, the first ``width`` of them free, shape (13,)."""
        prior = (
            self._prior_information()
            * CLICK_SIGMA_PX**2
            * self.problem.pixels_per_reference_pixel**2
        )
        pull = prior * unknowns
        pull[KAPPA] -= prior[KAPPA] * self.problem.distortion_mean
        free = rows.jacobian[:, :width]
        length = np.sqrt((free**2).sum(axis=0) + prior[:width])
        free = free / length
        weighted = free.T * self._marking_weights_by_row(rows)
        normal = weighted @ free + np.diag(prior[:width] / length**2)
        right = weighted @ rows.apart + pull[:width] / length
        step = np.zeros(WIDTH)
        step[:width] = -np.linalg.solve(normal, right) / length
        return step

    def _minimize_cost(
        self, unknowns: FloatArray, rows: _RobustlyWeightedResiduals
    ) -> tuple[FloatArray, _RobustlyWeightedResiduals]:
        """Where the fit ends, shape (13,), and the rows there."""
        cost = self._cost(unknowns, rows)
        for _ in range(ROUNDS):
            step = self._compute_step(unknowns, rows)
            step /= max(1.0, float((np.abs(step[PARAMETERS:]) / LONGEST).max()))
            for share in HALVINGS:
                to = _clip_to_plausible(unknowns + share * step, self.pitch)
                there = self._compute_residuals(to)
                lower = self._cost(to, there)
                if lower < cost:
                    break
            else:
                break
            gain, cost = 1 - lower / cost, lower
            unknowns, rows = to, there
            if gain < SETTLED:
                break
        return unknowns, rows

    def _cost(self, unknowns: FloatArray, rows: _RobustlyWeightedResiduals) -> float:
        """Robust cost of the points and of the prior, in variances of a click."""
        click, scale = (
            CLICK_SIGMA_PX * self.problem.pixels_per_reference_pixel,
            WIDE * self.problem.robust_scale_px * self.problem.pixels_per_reference_pixel,
        )
        robust = np.sqrt(1 + (rows.distance / scale) ** 2) - 1
        cost = 2 * (scale / click) ** 2 * float(self.problem.weights(self.observations) @ robust)
        off = unknowns - np.append(np.zeros(KAPPA), [self.problem.distortion_mean, *np.zeros(5)])
        cost += (self._prior_information() * off**2).sum()
        return float(cost) if np.isfinite(cost) else np.inf

    def _compute_residuals(self, unknowns: FloatArray) -> _RobustlyWeightedResiduals:
        camera, warp = unknowns[:PARAMETERS], unknowns[WARP]
        seen = undo_warp(self.problem, self.observations, warp)
        seen = Observations(
            pitch_curves(self.pitch_with_corrections(unknowns)), seen.pixels, seen.marking
        )
        half = self.problem.size.diagonal / 2

        def residuals_at(pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
            moved = Observations(seen.curves, pixels, seen.marking)
            return curve_residuals(camera, moved.curves, moved.curve_points(), half)

        offsets, by_camera = residuals_at(seen.pixels)
        slopes = np.stack(
            [
                (residuals_at(seen.pixels + step)[0] - offsets) / _PROBE_PX
                for step in np.eye(2) * _PROBE_PX
            ],
            axis=-1,
        )
        slopes[:, :, 0] /= np.exp(warp[0])
        # A line's normal turns and shrinks when the picture is stretched.
        length = np.maximum(np.hypot(slopes[..., 0], slopes[..., 1]), 0.25)
        moves = nearest_place_shifts_by_pitch_size(self.problem, camera, seen, offsets[:, 1] != 0)
        foot = np.exp(warp[0]) * seen.pixels[:, None, 0]
        jacobian = (
            np.concatenate(
                [
                    by_camera,
                    -by_camera[:, :, X, None] * moves[:, None, :1],
                    -by_camera[:, :, Y, None] * moves[:, None, 1:],
                    -slopes[..., :1] * foot[..., None],
                    -half * slopes,
                ],
                axis=-1,
            )
            / length[..., None]
        )
        offsets = offsets / length
        distance = np.hypot(offsets[:, 0], offsets[:, 1])
        scale = WIDE * self.problem.robust_scale_px * self.problem.pixels_per_reference_pixel
        weight = (1 + (offsets**2).sum(axis=1) / scale**2) ** -0.25
        beyond = np.flatnonzero(offsets[:, 1])
        rows = np.append(np.arange(len(offsets)), beyond)
        jacobian = np.vstack([jacobian[:, 0], jacobian[beyond, 1]]) * weight[rows, None]
        apart = np.append(offsets[:, 0], offsets[beyond, 1]) * weight[rows]
        return _RobustlyWeightedResiduals(
            apart, jacobian, np.append(seen.marking, -1 - beyond), distance
        )


def _camera_jacobian(rows: _RobustlyWeightedResiduals) -> FloatArray:
    """From the thirteen to the camera's eight, shape (8, 13).

    What a picture does is carried by rotation and lens, never by the position, as in
    ``picture_camera``.
    """
    lens = rows.jacobian[:, _LENS]
    scale = np.sqrt((lens**2).sum(axis=0))
    share = np.linalg.lstsq(lens / scale, rows.jacobian[:, WARP], rcond=1e-6)[0]
    carry = np.zeros((PARAMETERS, WIDTH))
    carry[:, :PARAMETERS] = np.eye(PARAMETERS)
    carry[_LENS, WARP] = share / scale[:, None]
    return carry


def _clip_to_plausible(unknowns: FloatArray, pitch: Pitch) -> FloatArray:
    """The same within what a pitch and a picture can be."""
    low = np.array([LENGTH_RANGE[0] - pitch.length, WIDTH_RANGE[0] - pitch.width])
    high = np.array([LENGTH_RANGE[1] - pitch.length, WIDTH_RANGE[1] - pitch.width])
    unknowns[SIZES] = np.clip(unknowns[SIZES], low, high)
    unknowns[WARP] = np.clip(
        unknowns[WARP],
        [np.log(ASPECTS[0]), -MAX_SHIFT, -MAX_SHIFT],
        [np.log(ASPECTS[1]), MAX_SHIFT, MAX_SHIFT],
    )
    return unknowns
