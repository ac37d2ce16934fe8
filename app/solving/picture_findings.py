"""Picture findings: is it as the camera took it? Pixels that are not square, a centre that was cut off.

A camera with square pixels and its principal point in the middle fits a stretched or cropped
picture badly, and stands in a wrong place. Where the residuals allow it, three numbers more are
fitted (how much too wide the picture is, and where its middle went), with priors; they are
believed where they explain the residuals far better than chance does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray
from app.geometry.resection import KAPPA, PARAMETERS, curve_residuals
from app.soccer.solution import Picture
from app.solving.observations import Observations
from app.solving.picture_camera import undo_warp
from app.solving.resect import MIN_CLICK_SIGMA_PX, ResectionProblem

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
class _Linear:
    """Normal equations of camera and picture together, with correlated errors."""

    normal: FloatArray
    pull: FloatArray
    squares: float
    points: int

    def step(self, prior: FloatArray, offset: FloatArray, width: int) -> FloatArray:
        """Step of the first ``width`` unknowns; ``prior`` is their information, shape (11,)."""
        normal = (self.normal + np.diag(prior))[:width, :width]
        pull = (self.pull + prior * offset)[:width]
        scale = _normal_scale(normal)
        solved = np.linalg.solve(normal / np.outer(scale, scale), pull / scale)
        step: FloatArray = solved / scale
        return step


def find_picture(
    problem: ResectionProblem, parameters: FloatArray, observations: Observations
) -> Picture | None:
    """How the picture was stretched or cropped; None where its lines do not say so.

    Args:
        problem: Of the image.
        parameters: The camera that fits best as if nothing had happened to the picture, (8,).
        observations: What that camera was found from.
    """
    try:
        return _fit_picture(problem, parameters, observations)
    except np.linalg.LinAlgError:
        return None


def _fit_picture(
    problem: ResectionProblem, parameters: FloatArray, observations: Observations
) -> Picture | None:
    warp = np.zeros(3)
    floor = (MIN_CLICK_SIGMA_PX * problem.unit) ** 2
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
    sigma = np.sqrt(variance * np.diag(_invert_normal(linear.normal + np.diag(prior)))[PARAMETERS:])
    if ratio < BELIEVED or not _is_large(warp, sigma).any():
        return None
    stretch, x, y = warp.tolist()
    return Picture(float(np.exp(stretch)) - 1, (x, y), tuple(sigma.tolist()), float(ratio))


def _is_large(warp: FloatArray, sigma: FloatArray) -> BoolArray:
    """Which of the three numbers are too large for chance, and large enough to matter."""
    least = np.array([MIN_STRETCH, MIN_SHIFT, MIN_SHIFT])
    size = np.abs(warp)
    large: BoolArray = (size > MIN_RATIO * sigma) & (size - sigma > least)
    return large


def _linearize(
    problem: ResectionProblem, parameters: FloatArray, observations: Observations, warp: FloatArray
) -> _Linear:
    """The least-squares problem about a camera and a picture; points beyond an end are left out."""

    def at(place: FloatArray) -> tuple[FloatArray, FloatArray]:
        seen = undo_warp(problem, observations, place)
        return curve_residuals(
            parameters, seen.curves, seen.curve_points(), problem.size.diagonal / 2
        )

    offsets, jacobians = at(warp)
    steps = _STEP * np.eye(3)
    by_warp = [(at(warp + step)[0] - at(warp - step)[0])[:, 0] / (2 * _STEP) for step in steps]
    inside = offsets[:, 1] == 0
    scale = 4 * problem.robust_scale_px * problem.unit
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
    return _Linear(
        (rows.T @ rows - (sums.T * common) @ sums) / (1 - share),
        (rows.T @ errors - sums.T @ (common * totals)) / (1 - share),
        float(errors @ errors - common @ totals**2) / (1 - share),
        len(errors),
    )


def _normal_scale(normal: FloatArray) -> FloatArray:
    """Root of the diagonal of a normal matrix; LinAlgError where an unknown is in no equation."""
    scale: FloatArray = np.sqrt(np.diag(normal))
    if not scale.all():
        raise np.linalg.LinAlgError("the lines say nothing of one of the unknowns")
    return scale


def _invert_normal(normal: FloatArray) -> FloatArray:
    scale = _normal_scale(normal)
    inverse: FloatArray = np.linalg.inv(normal / np.outer(scale, scale)) / np.outer(scale, scale)
    return inverse
