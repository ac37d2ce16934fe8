"""Picture fit: camera and picture together, eleven unknowns instead of eight, and whether a picture is as the camera
took it.

The first eight are those of ``geometry.resection`` for the picture as it was taken; then come the
logarithm of the aspect and the shift of the axis (half diagonals, right and down). Residuals are
those of the picture as it is: taken in the other one, a wider aspect would shrink them.

A camera with square pixels and its principal point in the middle fits a stretched or cropped
picture badly, and stands in a wrong place. Where the residuals allow it, three numbers more are
fitted (how much too wide the picture is, and where its middle went), with priors; they are
believed where they explain the residuals far better than chance does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import BoolArray, FloatArray
from app.geometry.least_squares import levenberg_marquardt, require_determined_parameters
from app.geometry.resection import (
    KAPPA,
    LOG_FOCAL,
    PAN,
    PARAMETERS,
    ROLL,
    TILT,
    curve_residuals,
)
from app.soccer.picture import ASPECTS, MAX_SHIFT, PictureGeometry
from app.soccer.solution import PictureDistortion
from app.solving.line_noise import compute_line_noise
from app.solving.observations import Observations
from app.solving.resect import CLICK_SIGMA_PX, MIN_CLICK_SIGMA_PX, WIDE, ResectionProblem

WIDTH = PARAMETERS + 3
KNOWN_SIGMA = np.array([0.02, 0.1, 0.1])
"""Numbers of a picture that are known to no better than this are asked of the view's own lines."""
STARTS = np.array([[0, 0, 0], [0.25, 0, 0], [-0.25, 0, 0], [0, 0.35, 0], [0, -0.35, 0]])
"""Pictures from which the fit begins: the logarithm of the aspect, and the shift."""
_ROUNDS, _STEPS = 2, 30
_PROBE_PX = 0.01
_ROTATION_AND_LENS = [PAN, TILT, ROLL, LOG_FOCAL, KAPPA]


def picture_to_warp(picture: PictureGeometry) -> FloatArray:
    """The three unknowns of a picture, shape (3,)."""
    return np.array([np.log(picture.aspect), *picture.shift])


def warp_to_picture(warp: FloatArray, sigma: tuple[float, float, float]) -> PictureGeometry:
    """Back from ``picture_to_warp``; what no picture can be is cut off."""
    stretch = float(np.clip(warp[0], *np.log(ASPECTS) * 0.999))
    right, down = np.clip(warp[1:], -MAX_SHIFT, MAX_SHIFT).tolist()
    return PictureGeometry(float(np.exp(stretch)), (right, down), sigma)


def needs_picture_estimate(picture: PictureGeometry) -> bool:
    """Whether the lines of the view are asked what the picture is."""
    return bool((np.array(picture.sigma) > KNOWN_SIGMA).any())


def undo_warp(
    problem: ResectionProblem, observations: Observations, warp: FloatArray
) -> Observations:
    """The points where the picture as it was taken shows them.

    Args:
        problem: Whose picture it is.
        observations: Points in the picture as it is, pixels from its middle, shape (N, 2).
        warp: Logarithm of the aspect, and shift of the axis right and down in half diagonals,
            shape (3,).
    """
    half = problem.size.diagonal / 2
    pixels = observations.pixels - warp[1:] * half
    pixels[:, 0] /= np.exp(warp[0])
    return Observations(observations.curves, pixels, observations.marking)


_ABSURD_IS_INFINITE = np.errstate(over="ignore", invalid="ignore")
"""A step that leads nowhere costs infinitely much and is not taken."""


@dataclass(frozen=True)
class PictureProblem:
    """What fits of camera and picture to one view share.

    Attributes:
        problem: Of the image.
        observations: Its points in the picture as it is.
        mean: Of the prior of the picture's three numbers, shape (3,).
        sigma: Their standard deviations, shape (3,).
    """

    problem: ResectionProblem
    observations: Observations
    mean: FloatArray
    sigma: FloatArray

    @staticmethod
    def of(
        problem: ResectionProblem, observations: Observations, picture: PictureGeometry
    ) -> PictureProblem:
        """With what is known of the picture as prior."""
        sigma = np.maximum(np.array(picture.sigma), 1e-6)
        return PictureProblem(problem, observations, picture_to_warp(picture), sigma)

    def rows(self, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distance of each point to its marking in the picture as it is, and its derivatives.

        Args:
            unknowns: Shape (11,).

        Returns:
            Pixels, shapes (N,) and (N, 11).
        """
        camera, warp = unknowns[:PARAMETERS], unknowns[PARAMETERS:]
        seen = undo_warp(self.problem, self.observations, warp)
        half = self.problem.size.diagonal / 2
        apart, by_camera = self._cross_marking_distances(
            camera, seen, np.zeros(2), with_slopes=True
        )
        aspect = np.exp(warp[0])
        normal = np.empty((len(apart), 2))
        for axis, unit in enumerate(np.eye(2) * _PROBE_PX):
            ahead = self._cross_marking_distances(camera, seen, unit)[0]
            behind = self._cross_marking_distances(camera, seen, -unit)[0]
            normal[:, axis] = (ahead - behind) / (2 * _PROBE_PX)
        # A line's normal turns and shrinks when the picture is stretched.
        normal[:, 0] /= aspect
        length = np.maximum(np.hypot(normal[:, 0], normal[:, 1]), 0.25)
        normal /= length[:, None]
        apart = apart / length
        foot = self.observations.pixels[:, 0] - warp[1] * half - apart * normal[:, 0]
        jacobian = np.column_stack(
            [by_camera / length[:, None], -normal[:, 0] * foot, -half * normal]
        )
        return apart, jacobian

    @_ABSURD_IS_INFINITE
    def fit_camera_and_picture(self, camera: FloatArray) -> FloatArray:
        """The camera and picture that fit best, shape (11,).

        Args:
            camera: From which the search begins, shape (8,).
        """
        starts = []
        for warp in STARTS if (self.sigma > KNOWN_SIGMA).any() else STARTS[:1]:
            start = self.mean + warp * (self.sigma > KNOWN_SIGMA)
            seen = undo_warp(self.problem, self.observations, start)
            starts.append(np.append(self.problem.refine(seen, camera[None]).parameters, start))
        best, variance = (
            np.array(starts),
            (CLICK_SIGMA_PX * self.problem.pixels_per_reference_pixel) ** 2,
        )
        for _ in range(_ROUNDS):
            found = levenberg_marquardt(self._make_normal_equations(variance), best, _STEPS)
            best = found.parameters[np.argmin(found.cost)][None]
            variance = self.click_variance(best[0])
        unknowns: FloatArray = best[0]
        return unknowns

    def click_variance(self, unknowns: FloatArray) -> float:
        """Variance of the clicks' distances, robustly, pixels squared."""
        apart, _ = self.rows(unknowns)
        scale = self._robust_scale
        robust = 2 * scale**2 * (np.sqrt(1 + (apart / scale) ** 2) - 1)
        freedom = max(len(apart) - WIDTH + 2, 1)
        return max(
            float(robust.sum()) / freedom,
            (MIN_CLICK_SIGMA_PX * self.problem.pixels_per_reference_pixel) ** 2,
        )

    @_ABSURD_IS_INFINITE
    def covariance(self, unknowns: FloatArray) -> FloatArray:
        """Covariance of the unknowns, shape (11, 11); the camera's prior counts for nothing.

        Raises:
            DegenerateGeometryError: The lines leave a combination open.
        """
        apart, jacobian = self.rows(unknowns)
        weight = (1 + (apart / (WIDE * self._robust_scale)) ** 2) ** -0.25
        click_px = np.sqrt(self.click_variance(unknowns))
        prior = np.zeros(WIDTH)
        prior[KAPPA] = self.problem.distortion_sigma**-2
        prior[PARAMETERS:] = self.sigma**-2
        rows = jacobian * (weight / click_px)[:, None]
        require_determined_parameters(rows.T @ rows + np.diag(prior))
        known = self.problem.click_noise_prior
        noise = compute_line_noise(
            apart * weight / click_px,
            rows,
            self.observations.marking,
            prior,
            replace(known, sigma_px=known.sigma_px / click_px, floor_px=known.floor_px / click_px),
            self.problem.weights(self.observations),
        )
        return noise.parameters

    @_ABSURD_IS_INFINITE
    def fold_picture_into_camera_covariance(
        self, unknowns: FloatArray, covariance: FloatArray
    ) -> FloatArray:
        """Covariance of a camera's parameters that says for picture and camera where pixels lie.

        What an uncertain axis does to pixels, another direction of view does as well: the
        picture's part is carried by the rotation and the lens, never by the position, so that
        both the position and the pixels get their own uncertainty.

        Args:
            unknowns: Shape (11,).
            covariance: Theirs, shape (11, 11).

        Returns:
            Shape (8, 8).
        """
        _, jacobian = self.rows(unknowns)
        lens = jacobian[:, _ROTATION_AND_LENS]
        scale = np.sqrt((lens**2).sum(axis=0))
        share = np.linalg.lstsq(lens / scale, jacobian[:, PARAMETERS:], rcond=1e-6)[0]
        carry = np.zeros((PARAMETERS, WIDTH))
        carry[:, :PARAMETERS] = np.eye(PARAMETERS)
        carry[_ROTATION_AND_LENS, PARAMETERS:] = share / scale[:, None]
        return carry @ covariance @ carry.T

    @property
    def _robust_scale(self) -> float:
        return self.problem.robust_scale_px * self.problem.pixels_per_reference_pixel

    def _cross_marking_distances(
        self, camera: FloatArray, seen: Observations, moved: FloatArray, with_slopes: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Distances of moved points across their markings, and derivatives by the camera."""
        points = Observations(seen.curves, seen.pixels + moved, seen.marking)
        offsets, jacobians = curve_residuals(
            camera, points.curves, points.curve_points(), self.problem.size.diagonal / 2
        )
        return offsets[:, 0], jacobians[:, 0] if with_slopes else jacobians[:0, 0]

    def _make_normal_equations(self, variance: float):  # type: ignore[no-untyped-def]
        camera = self.problem.prior()
        mean = np.append(camera.mean, self.mean)
        # The cost counts pixels, so a prior weighs as much as its clicks are noisy.
        information = np.append(camera.sigma, self.sigma / np.sqrt(variance)) ** -2
        information[KAPPA] *= variance
        weights = self.problem.weights(self.observations)

        def equations_of_row(unknowns: FloatArray) -> tuple[float, FloatArray, FloatArray]:
            apart, jacobian = self.rows(unknowns)
            scale = self._robust_scale
            root = np.sqrt(1 + (apart / scale) ** 2)
            off = unknowns - mean
            cost = float(scale**2 * (weights @ (root - 1)) + 0.5 * (information * off**2).sum())
            weighted = jacobian * (weights / root)[:, None]
            return (
                cost,
                weighted.T @ apart + information * off,
                weighted.T @ jacobian + np.diag(information),
            )

        def equations_of_batch(batch: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            costs, gradients, normals = zip(*map(equations_of_row, batch), strict=True)
            return np.array(costs), np.array(gradients), np.array(normals)

        return equations_of_batch


def estimate_picture(
    problem: ResectionProblem, observations: Observations, picture: PictureGeometry
) -> PictureGeometry:
    """What the lines of one view say of its picture, with what is known of it as prior.

    Args:
        problem: Of the image.
        observations: Its points in the picture as it is.
        picture: What is known; where that is exact enough it is the answer.

    Raises:
        DegenerateGeometryError: The lines do not determine the camera.
    """
    if not needs_picture_estimate(picture):
        return picture
    seen = undo_warp(problem, observations, picture_to_warp(picture))
    search = PictureProblem.of(problem, observations, picture)
    unknowns = search.fit_camera_and_picture(problem.resect(seen).parameters)
    covariance = search.covariance(unknowns)
    if not np.isfinite(covariance).all():
        raise DegenerateGeometryError("the lines do not determine the camera")
    sigma = np.sqrt(np.diag(covariance))[PARAMETERS:]
    return warp_to_picture(unknowns[PARAMETERS:], tuple(sigma.tolist()))


PRIOR = np.array([0.12, 0.2, 0.2])
"""Standard deviations of stretch (its logarithm) and of the middle (in half diagonals)."""
BOUND = 0.45
SHARE, MOST_SHARE = 0.4, 0.9
"""Of the residuals' variance, what points of a marking have in common, where nobody has measured
it (see ``line_noise``), and the most that is believed of a measured one."""
SUSPICIOUS, BELIEVED = 3.0, 5.0
"""F ratios of what the three numbers explain: worth a fit, and worth a word."""
MIN_RATIO = 3.0
"""Of a number to its standard deviation ..."""
MIN_STRETCH, MIN_SHIFT = 0.03, 0.1
"""... and the least that it must be, beyond one standard deviation."""
ROUNDS = 4
_STEP = 1e-4
_WIDTH = PARAMETERS + 3


@dataclass(frozen=True)
class _LinearizedProblem:
    """Normal equations of camera and picture together, with correlated errors."""

    normal: FloatArray
    pull: FloatArray
    squares: float
    points: int

    def step(self, prior: FloatArray, offset: FloatArray, width: int) -> FloatArray:
        """Step of the first ``width`` unknowns; ``prior`` is their information, shape (11,)."""
        normal = (self.normal + np.diag(prior))[:width, :width]
        pull = (self.pull + prior * offset)[:width]
        scale = _normal_matrix_scale(normal)
        solved = np.linalg.solve(normal / np.outer(scale, scale), pull / scale)
        step: FloatArray = solved / scale
        return step


def find_picture_distortion(
    problem: ResectionProblem, parameters: FloatArray, observations: Observations
) -> PictureDistortion | None:
    """How the picture was stretched or cropped; None where its lines do not say so.

    Args:
        problem: Of the image.
        parameters: The camera that fits best as if nothing had happened to the picture, (8,).
        observations: What that camera was found from.
    """
    try:
        return _fit_picture_distortion(problem, parameters, observations)
    except np.linalg.LinAlgError:
        return None


def _fit_picture_distortion(
    problem: ResectionProblem, parameters: FloatArray, observations: Observations
) -> PictureDistortion | None:
    warp = np.zeros(3)
    floor = (MIN_CLICK_SIGMA_PX * problem.pixels_per_reference_pixel) ** 2
    first = _linearize(problem, parameters, observations, warp)
    freedom = first.points - _WIDTH
    if freedom < 1:
        return None
    camera_prior = np.zeros(_WIDTH)
    camera_prior[KAPPA] = problem.distortion_sigma**-2
    offset = np.zeros(_WIDTH)
    offset[KAPPA] = parameters[KAPPA] - problem.distortion_mean
    narrow = first.step(camera_prior, offset, PARAMETERS)
    before = first.squares - float(first.pull[:PARAMETERS] @ narrow)
    variance = max(before / (freedom + 3), floor)
    linear = first
    for count in range(ROUNDS):
        prior = camera_prior.copy()
        prior[PARAMETERS:] = variance / PRIOR**2
        offset = np.append(np.zeros(PARAMETERS), warp)
        offset[KAPPA] = parameters[KAPPA] - problem.distortion_mean
        step = linear.step(prior, offset, _WIDTH)
        if count == 0:
            left = max(first.squares - float(first.pull @ step), floor * freedom)
            if (before - left) / left * freedom / 3 < SUSPICIOUS:
                return None
        warp = np.clip(warp - step[PARAMETERS:], -BOUND, BOUND)
        moved = parameters - step[:PARAMETERS]
        if not np.isfinite(moved).all():
            return None
        parameters = problem.refine(undo_warp(problem, observations, warp), moved[None]).parameters
        linear = _linearize(problem, parameters, observations, warp)
        variance = max(linear.squares / (freedom + 1), floor)
    left = max(linear.squares, floor * freedom)
    ratio = (before - left) / left * freedom / 3
    prior[PARAMETERS:] = variance / PRIOR**2
    sigma = np.sqrt(
        variance * np.diag(_invert_normal_matrix(linear.normal + np.diag(prior)))[PARAMETERS:]
    )
    if ratio < BELIEVED or not _is_significant(warp, sigma).any():
        return None
    stretch, x, y = warp.tolist()
    return PictureDistortion(
        float(np.exp(stretch)) - 1, (x, y), tuple(sigma.tolist()), float(ratio)
    )


def _is_significant(warp: FloatArray, sigma: FloatArray) -> BoolArray:
    """Which of the three numbers are too large for chance, and large enough to matter."""
    least = np.array([MIN_STRETCH, MIN_SHIFT, MIN_SHIFT])
    size = np.abs(warp)
    large: BoolArray = (size > MIN_RATIO * sigma) & (size - sigma > least)
    return large


def _linearize(
    problem: ResectionProblem, parameters: FloatArray, observations: Observations, warp: FloatArray
) -> _LinearizedProblem:
    """The least-squares problem about a camera and a picture; points beyond an end are left out."""

    def residuals_at(place: FloatArray) -> tuple[FloatArray, FloatArray]:
        seen = undo_warp(problem, observations, place)
        return curve_residuals(
            parameters, seen.curves, seen.curve_points(), problem.size.diagonal / 2
        )

    offsets, jacobians = residuals_at(warp)
    steps = _STEP * np.eye(3)
    by_warp = [
        (residuals_at(warp + step)[0] - residuals_at(warp - step)[0])[:, 0] / (2 * _STEP)
        for step in steps
    ]
    inside = offsets[:, 1] == 0
    scale = 4 * problem.robust_scale_px * problem.pixels_per_reference_pixel
    weight = (1 + (offsets[:, 0] / scale) ** 2) ** -0.25
    rows = (np.column_stack([jacobians[:, 0], *by_warp]) * weight[:, None])[inside]
    errors = (offsets[:, 0] * weight)[inside]
    _, place, size = np.unique(
        observations.marking[inside], return_inverse=True, return_counts=True
    )
    sums = np.zeros((len(size), _WIDTH))
    np.add.at(sums, place, rows)
    totals = np.bincount(place, errors, len(size))
    share = SHARE if problem.line_share is None else min(problem.line_share, MOST_SHARE)
    common = share / (1 - share + share * size)
    return _LinearizedProblem(
        (rows.T @ rows - (sums.T * common) @ sums) / (1 - share),
        (rows.T @ errors - sums.T @ (common * totals)) / (1 - share),
        float(errors @ errors - common @ totals**2) / (1 - share),
        len(errors),
    )


def _normal_matrix_scale(normal: FloatArray) -> FloatArray:
    """Root of the diagonal of a normal matrix; LinAlgError where an unknown is in no equation."""
    scale: FloatArray = np.sqrt(np.diag(normal))
    if not scale.all():
        raise np.linalg.LinAlgError("the lines do not determine one of the parameters")
    return scale


def _invert_normal_matrix(normal: FloatArray) -> FloatArray:
    scale = _normal_matrix_scale(normal)
    inverse: FloatArray = np.linalg.inv(normal / np.outer(scale, scale)) / np.outer(scale, scale)
    return inverse
