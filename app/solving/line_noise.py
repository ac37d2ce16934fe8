"""Line noise: how far clicks lie from their markings, and how much those of one marking agree.

Whoever clicks a line beside its middle does so along its whole length, and a pitch that is not
painted as planned moves all points of a marking alike: many points of one marking say less than
as many points of several. Each residual is taken as an offset that it shares with its marking
and a part of its own; the share ``rho`` of the offset in the variance is estimated from the
residuals of the image itself, with what real annotations show as prior.

Source: Patterson & Thompson, "Recovery of inter-block information when block sizes are unequal"
(restricted likelihood); Liang & Zeger, "Longitudinal data analysis using generalized linear
models" (covariance of a fit with a working model of independent residuals).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray, IntArray

SHARES = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
"""Values of rho that are weighed, all alike before the residuals speak."""
SIGMA_FREEDOM = 4.0
"""Degrees of freedom that the prior of the variance is worth."""


@dataclass(frozen=True)
class LineNoise:
    """Noise of the clicks of one image.

    Attributes:
        variance: Of a residual, square pixels.
        share: Of the variance, what the points of a marking have in common.
        parameters: Covariance of the parameters of the least-squares fit, shape (n, n).
    """

    variance: float
    share: float
    parameters: FloatArray


def line_noise(
    residuals: FloatArray,
    jacobian: FloatArray,
    marking: IntArray,
    prior: FloatArray,
    sigma_px: float,
    floor_px: float,
) -> LineNoise:
    """Noise of the clicks, and the covariance of a least-squares fit to them.

    Args:
        residuals: At the minimum, each times the root of its robust weight, pixels, shape (N,).
        jacobian: Of the residuals, weighted alike, shape (N, n).
        marking: Of each residual, shape (N,).
        prior: Information of the parameters' own prior, shape (n,), a diagonal.
        sigma_px: What a click's standard deviation is expected to be.
        floor_px: What it is never below.

    Raises:
        LinAlgError: A combination of parameters is not determined.
    """
    # Angles and metres: columns of one length invert better.
    lengths = np.sqrt((jacobian**2).sum(axis=0) + prior)
    jacobian, prior = jacobian / lengths, prior / lengths**2
    n, width = jacobian.shape
    shares = SHARES[:, None, None]
    _, place, size = np.unique(marking, return_inverse=True, return_counts=True)
    sums = np.zeros((len(size), width))
    np.add.at(sums, place, jacobian)
    totals = np.bincount(place, residuals)
    square = jacobian.T @ jacobian
    # Inverse of (1 - rho) I + rho 11^T, marking by marking (Woodbury).
    own = 1 - SHARES[:, None]
    mixed = own + SHARES[:, None] * size
    common = SHARES[:, None] / mixed
    normal = (square - np.einsum("rm,mi,mj->rij", common, sums, sums)) / own[:, :, None]
    normal += np.diag(prior)
    pull = (jacobian.T @ residuals - (common * totals) @ sums) / own
    spent = np.einsum("ri,ri->r", pull, np.linalg.solve(normal, pull[:, :, None])[:, :, 0])
    rest = (residuals @ residuals - (common * totals**2).sum(1)) / own[:, 0] - spent
    freedom = max(n - width + int((prior > 0).sum()), 1)
    scatter = np.maximum(rest, 0.0) + SIGMA_FREEDOM * sigma_px**2
    log_size = ((size - 1) * np.log(own) + np.log(mixed)).sum(1)
    likelihood = -0.5 * (
        log_size + np.linalg.slogdet(normal)[1] + (freedom + SIGMA_FREEDOM) * np.log(scatter)
    )
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    # Markings are few, so their common offsets are known badly: the covariance is that of
    # Student's distribution, with as many degrees of freedom as there are independent points.
    independent = (size / (1 + SHARES[:, None] * (size - 1))).sum(1)
    student = SIGMA_FREEDOM + np.maximum(independent - n + freedom, 1.0)
    variance = scatter / (freedom + SIGMA_FREEDOM) * student / (student - 2)
    variance = np.maximum(variance, floor_px**2)
    inner = (1 - shares) * square + shares * (sums.T @ sums)
    middle = np.tensordot(weight * variance, inner, 1) + np.diag(prior)
    outer = np.linalg.inv(square + np.diag(prior))
    return LineNoise(
        variance=float(weight @ variance),
        share=float(weight @ SHARES),
        parameters=outer @ middle @ outer / np.outer(lengths, lengths),
    )
