"""Paint noise: how far paint lies from its markings, and the covariance that follows.

Lines are not painted quite where the plan has them, and all points of one marking share that:
each residual is an offset of its marking and a part of its own, as for clicks
(``solving.line_noise``, which estimates both). What a pitch is other than the plan
(``solving.paint_terms``) shows in no residual and is carried into the camera's covariance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray, IntArray
from app.geometry.least_squares import require_determined
from app.geometry.resection import KAPPA
from app.solving.line_noise import LinePrior, line_noise

SHARE = 0.05
"""Of a point's variance, what the points of a marking have in common when they are weighed."""
THIN_SHARE, THIN_SIGMA_PX = 0.5, 0.4
"""Of a line so thin that its sigma is this large, so much more: what is beside it moves all of it."""
LEAST_SHARE = 0.25
"""What they have in common at least when the covariance is told: worn edges, blades and the
picture's compression move paint by pieces, which the residuals of one picture hide."""
LENS = 0.0006
"""Standard deviation of what a lens does beyond its one radial term: displacement at the corner
that grows with the fifth power of the radius, as a share of half the diagonal."""
EXPECTED, LEAST = 1.0, 0.5
"""Standard deviation of a residual in units of its sigma: expected, and never below."""


@dataclass(frozen=True)
class PaintOffsets:
    """Paint as one camera sees it beside its markings.

    Attributes:
        offsets: From the marking along its normal, pixels, shape (N,).
        sigmas: Standard deviations of the offsets, pixels, shape (N,).
        marking: Index into ``MARKINGS``, shape (N,).
        jacobian: Derivative of the marking's place along the normal by the parameters,
            shape (N, 8).
        radii: Distance from the principal point, half diagonals, shape (N,).
    """

    offsets: FloatArray
    sigmas: FloatArray
    marking: IntArray
    jacobian: FloatArray
    radii: FloatArray


@dataclass(frozen=True)
class PaintNoise:
    """What the residuals at the minimum say.

    Attributes:
        variance: Of a residual in units of its sigma squared.
        share: Of it, what the points of a marking have in common.
        parameters: Covariance of the camera's parameters if the pitch is the plan, shape (8, 8).
        pitch: What comes to it because no pitch is, shape (8, 8).
    """

    variance: float
    share: float
    parameters: FloatArray
    pitch: FloatArray


def marking_weights(marking: IntArray, sigmas: FloatArray) -> FloatArray:
    """Weight of each point, shape (N,): many points of one marking say less than of several.

    The mean of n points that share rho of their variance is worth n / (1 + rho (n - 1)) of them
    (the design effect of cluster sampling, Kish 1965).

    Args:
        marking: Index into ``MARKINGS`` of each point, shape (N,).
        sigmas: Standard deviation of each, pixels, shape (N,).
    """
    counts = np.bincount(marking)
    weights: FloatArray = 1 / (1 + _shares(sigmas) * (counts[marking] - 1))
    return weights


def cautious_weights(marking: IntArray, sigmas: FloatArray) -> FloatArray:
    """``marking_weights`` with at least what the points of a marking share where covariances are told."""
    counts = np.bincount(marking)
    shares = np.maximum(_shares(sigmas), LEAST_SHARE)
    weights: FloatArray = 1 / (1 + shares * (counts[marking] - 1))
    return weights


def _shares(sigmas: FloatArray) -> FloatArray:
    """What each point has in common with its marking, as a share of its variance, shape (N,)."""
    shares: FloatArray = SHARE + THIN_SHARE * np.minimum(sigmas / THIN_SIGMA_PX, 1.0) ** 2
    return shares


def paint_noise(
    seen: PaintOffsets,
    robust: FloatArray,
    prior: FloatArray,
    information: FloatArray | None,
    terms: FloatArray,
) -> PaintNoise | None:
    """Noise of the paint and covariance of the camera; None where the paint leaves it open.

    Args:
        seen: At the minimum.
        robust: Weight of each point by its residual, shape (N,).
        prior: Information of the parameters' own prior, a diagonal, shape (8,).
        information: What the start knew of the parameters, shape (8, 8).
        terms: How far one standard deviation of each number of the pitch moves the paint
            (``paint_terms``), pixels, shape (N, M).
    """
    root = np.sqrt(robust) / seen.sigmas
    rows, rest = seen.jacobian * root[:, None], seen.offsets * root
    known = np.diag(prior) + (0.0 if information is None else information)
    try:
        require_determined(rows.T @ rows + known)
        noise = line_noise(rest, rows, seen.marking, prior, LinePrior(EXPECTED, LEAST))
    except (DegenerateGeometryError, np.linalg.LinAlgError):
        return None
    weighted = rows * marking_weights(seen.marking, seen.sigmas)[:, None]
    bread = np.linalg.inv(weighted.T @ rows + known)
    shares = np.maximum(_shares(seen.sigmas), max(noise.share, LEAST_SHARE))[:, None]
    sums = np.zeros((int(seen.marking.max()) + 1, rows.shape[1]))
    np.add.at(sums, seen.marking, np.sqrt(shares) * weighted)
    meat = ((1 - shares) * weighted).T @ weighted + sums.T @ sums
    # Kappa moves a place by the third power of its radius, a further term by the fifth.
    lens = weighted.T @ (seen.radii**2 * seen.jacobian[:, KAPPA] * root)
    meat = noise.variance * meat + LENS**2 * np.outer(lens, lens)
    covariance = bread @ (meat + known) @ bread
    covariance = 0.5 * (covariance + covariance.T)
    moved = bread @ (weighted.T @ (terms * root[:, None]))
    return PaintNoise(noise.variance, float(shares.mean()), covariance, moved @ moved.T)
