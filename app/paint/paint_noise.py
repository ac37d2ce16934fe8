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
from app.paint.evidence import Evidence
from app.solving.line_noise import line_noise

SHARE = 0.05
"""Of a point's variance, what the points of a marking are expected to have in common."""
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


def marking_weights(marking: IntArray) -> FloatArray:
    """Weight of each point, shape (N,): many points of one marking say less than of several.

    The mean of n points that share ``SHARE`` of their variance is worth n / (1 + SHARE (n - 1))
    of them.
    """
    counts = np.bincount(marking)
    weights: FloatArray = 1 / (1 + SHARE * (counts[marking] - 1))
    return weights


def paint_noise(
    evidence: Evidence,
    robust: FloatArray,
    prior: FloatArray,
    information: FloatArray | None = None,
) -> PaintNoise | None:
    """Noise of the paint and covariance of the camera; None where the paint leaves it open.

    Args:
        evidence: At the minimum.
        robust: Weight of each point by its residual, shape (N,).
        prior: Information of the parameters' own prior, a diagonal, shape (8,).
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
    weights = marking_weights(traced.marking)
    bread = np.linalg.inv((rows * weights[:, None]).T @ rows + known)
    weighted = rows * weights[:, None]
    sums = np.zeros((int(traced.marking.max()) + 1, rows.shape[1]))
    np.add.at(sums, traced.marking, weighted)
    share = max(noise.share, SHARE)
    meat = (1 - share) * (weighted.T @ weighted) + share * (sums.T @ sums)
    covariance = bread @ (noise.variance * meat + known) @ bread
    return PaintNoise(noise.variance, share, 0.5 * (covariance + covariance.T))
