"""Paint noise: how far paint lies from its markings, and the covariance that follows.

Lines are not painted quite where the plan has them, and all points of one marking share that:
each residual is an offset of its marking and a part of its own, as for clicks
(``solving.line_noise``, which estimates both).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray, IntArray
from app.geometry.least_squares import require_determined
from app.paint.evidence import Evidence, Traced
from app.solving.line_noise import line_noise

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
class PaintNoise:
    """What the residuals at the minimum say.

    Attributes:
        variance: Of a residual in units of its sigma squared.
        share: Of it, what the points of a marking have in common.
        parameters: Covariance of the camera's parameters, shape (8, 8).
    """

    variance: float
    share: float
    parameters: FloatArray


def marking_weights(marking: IntArray, sigmas: FloatArray) -> FloatArray:
    """Weight of each point, shape (N,): many points of one marking say less than of several.

    The mean of n points that share rho of their variance is worth n / (1 + rho (n - 1)) of them.
    """
    counts = np.bincount(marking)
    weights: FloatArray = 1 / (1 + _shares(sigmas) * (counts[marking] - 1))
    return weights


def _shares(sigmas: FloatArray) -> FloatArray:
    """What each point has in common with its marking, as a share of its variance, shape (N,)."""
    shares: FloatArray = SHARE + THIN_SHARE * np.minimum(sigmas / THIN_SIGMA_PX, 1.0) ** 2
    return shares


def paint_noise(
    evidence: Evidence,
    robust: FloatArray,
    prior: FloatArray,
    principal: FloatArray,
    half_diagonal: float,
    information: FloatArray | None = None,
) -> PaintNoise | None:
    """Noise of the paint and covariance of the camera; None where the paint leaves it open.

    Args:
        evidence: At the minimum.
        robust: Weight of each point by its residual, shape (N,).
        prior: Information of the parameters' own prior, a diagonal, shape (8,).
        principal: Principal point, pixels, shape (2,).
        half_diagonal: Half the diagonal of the picture, pixels.
        information: What the start knew of the parameters, shape (8, 8).
    """
    traced = evidence.traced
    root = np.sqrt(robust) / evidence.sigmas
    rows, rest = traced.jacobian * root[:, None], evidence.offsets * root
    known = np.diag(prior) + (0.0 if information is None else information)
    try:
        require_determined(rows.T @ rows + known)
        noise = line_noise(rest, rows, traced.marking, prior, EXPECTED, LEAST)
    except (DegenerateGeometryError, np.linalg.LinAlgError):
        return None
    weighted = rows * marking_weights(traced.marking, evidence.sigmas)[:, None]
    bread = np.linalg.inv(weighted.T @ rows + known)
    shares = np.maximum(_shares(evidence.sigmas), max(noise.share, LEAST_SHARE))[:, None]
    sums = np.zeros((int(traced.marking.max()) + 1, rows.shape[1]))
    np.add.at(sums, traced.marking, np.sqrt(shares) * weighted)
    meat = ((1 - shares) * weighted).T @ weighted + sums.T @ sums
    lens = weighted.T @ (_further_distortion(traced, principal, half_diagonal) * root)
    meat = noise.variance * meat + LENS**2 * np.outer(lens, lens)
    covariance = bread @ (meat + known) @ bread
    return PaintNoise(noise.variance, float(shares.mean()), 0.5 * (covariance + covariance.T))


def _further_distortion(traced: Traced, principal: FloatArray, half: float) -> FloatArray:
    """What a fifth-power distortion of one half diagonal moves each place along its normal."""
    radius = (traced.pixels - principal) / half
    outwards: FloatArray = (radius * traced.normals).sum(axis=1)
    moved: FloatArray = half * (radius**2).sum(axis=1) ** 2 * outwards
    return moved
