"""Line noise: how far clicks lie from their markings, and how much those of one marking agree.

Whoever clicks a line beside its middle does so along its whole length, and a pitch that is not
painted as planned moves all points of a marking alike: many points of one marking say less than
as many points of several. Each residual is taken as an offset that it shares with its marking
and a part of its own; the share ``rho`` of the offset in the variance is estimated from the
residuals of the image itself, with what real annotations show as prior. All images of a dataset
together know both numbers far better than one of them: what each says of them adds up.

Source: Patterson & Thompson, "Recovery of inter-block information when block sizes are unequal"
(restricted likelihood); Liang & Zeger, "Longitudinal data analysis using generalized linear
models" (covariance of a fit with a working model of independent residuals).

An estimate of noise is a posterior: of few numbers it is what noise is expected to be, and with
each further one more what they say.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtr, chdtri, gammaln

from app.geometry.arrays import FloatArray, IntArray

BLOCKS = 10
"""Tenths of a dataset, in the order in which it was taken: neighbours in time err alike, so one
after the other is left out (jackknife)."""
STUDENT = 2.26
"""95 % of Student's distribution with one degree of freedom less than blocks: half of an interval in
standard deviations."""

NORMAL_95 = 1.96
SPREAD = 1.0
"""Standard deviation of the logarithm of a dataset's sigma, before its residuals are seen: that of one
in twenty is less than a seventh of what is expected, or more than seven times as much."""
AXES = 3
"""Of the ellipsoid that has to hold the truth."""


def sigma_prior_cost(log_sigmas: FloatArray, expected: float, spread: float = SPREAD) -> FloatArray:
    """Negative logarithm of the prior of a sigma, at each of some logarithms, shape (N,)."""
    cost: FloatArray = 0.5 * ((log_sigmas - math.log(expected)) / spread) ** 2
    return cost


def log_sigma_posterior_variance(scatter: float, numbers: float, spread: float = SPREAD) -> float:
    """Variance of the logarithm of an estimated sigma.

    No sample of independent numbers says more about its sigma than half of one for each.

    Args:
        scatter: Of the estimate, as leaving out parts of a dataset shows it.
        numbers: Independent numbers that it rests on.
        spread: Of the prior.
    """
    return max(scatter, 1 / (2 * numbers + spread**-2))


def log_sigma_with_95_percent_coverage(log_sigmas: FloatArray, cost: FloatArray) -> float:
    """Logarithm of the sigma whose 95 % ellipsoids hold the truth, though nobody knows sigma exactly.

    As Student's quantiles, of few numbers it is larger than the most likely sigma.

    Args:
        log_sigmas: The logarithms that are tried, shape (N,).
        cost: Negative logarithm of the posterior there, shape (N,).
    """
    weight = np.exp(cost.min() - cost)
    scales = np.exp(log_sigmas[:, None] - log_sigmas)
    inside = chdtr(AXES, chdtri(AXES, 0.05) * scales**2) @ (weight / weight.sum())
    return float(np.interp(0.95, inside, log_sigmas))


def interpolate_cost(cost: FloatArray, places: FloatArray) -> FloatArray:
    """Costs between the points of a grid, by the parabola through the three nearest ones, shape (M,).

    Args:
        cost: At each point of the grid, shape (N,).
        places: In steps from the first, shape (M,).
    """
    at = np.clip(places.round(), 1, len(cost) - 2).astype(int)
    off, before, least, after = places - at, cost[at - 1], cost[at], cost[at + 1]
    found: FloatArray = (
        least + off * (after - before) / 2 + off**2 * (before - 2 * least + after) / 2
    )
    return found


def fit_cost_minimum(cost: FloatArray, at: int) -> tuple[float, float]:
    """How far the lowest point lies from the lowest one of the grid, in steps, and its cost.

    By the parabola through three costs; at an end of the grid, that end.

    Args:
        cost: At each point of the grid, shape (N,).
        at: Index of the lowest.
    """
    if not 0 < at < len(cost) - 1:
        return 0.0, float(cost[at])
    before, least, after = cost[at - 1 : at + 2].tolist()
    bend = before - 2 * least + after
    if bend <= 0:
        return 0.0, least
    off = (before - after) / (2 * bend)
    return off, least - bend * off**2 / 2


def jackknife_variance(parts: FloatArray) -> FloatArray:
    """Variance of numbers from what they are without each block, shape (B, K), as shape (K,)."""
    squares: FloatArray = ((parts - parts.mean(axis=0)) ** 2).sum(axis=0)
    return (len(parts) - 1) / len(parts) * squares


SHARES = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
"""Values of rho that are weighed, all alike before the residuals speak."""
SIGMA_FREEDOM = 4.0
"""Degrees of freedom that the prior of the variance is worth."""
EXPECTED_PX = 1.0
"""Noise of a dataset before any of its clicks is seen, pixels at 960 x 540."""
FREEDOMS = np.array([4.0, 8.0, 20.0, 1000.0])
"""How much alike the variances of a dataset's images may be, as degrees of freedom."""
SIGMAS = np.geomspace(0.1, 10.0, 93)
"""Noises of a dataset that are tried, pixels at 960 x 540."""


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


@dataclass(frozen=True)
class LinePrior:
    """What is known of the noise of an image's clicks before any is seen.

    Attributes:
        sigma_px: What a click's standard deviation is expected to be, pixels.
        floor_px: What it is never below.
        share: What the points of a marking have in common of the variance, where that is known.
    """

    sigma_px: float
    floor_px: float
    share: float | None = None


@dataclass(frozen=True)
class LineEvidence:
    """What the residuals of one image say of its noise, for each of some shares (R).

    Attributes:
        rest: Sum of squares that the fit leaves, square pixels, shape (R,).
        log_determinant: Of the errors' correlation and of the fit, shape (R,).
        freedom: Of the sum of squares.
    """

    rest: FloatArray
    log_determinant: FloatArray
    freedom: int

    def log_likelihood(
        self, sigma: FloatArray | float, freedom: FloatArray | float = SIGMA_FREEDOM
    ) -> FloatArray:
        """Logarithm of the restricted likelihood of a prior of the variance, but for a constant.

        Args:
            sigma: Of the prior, pixels, a number or shape (S, 1).
            freedom: Degrees of freedom that it is worth, a number or shape (F, 1, 1).
        """
        total, known = self.freedom + freedom, freedom * np.square(sigma)
        # With the sum of squares as a share of what is known no large numbers cancel.
        excess = np.log1p(np.maximum(self.rest, 0.0) / known)
        inside: FloatArray = (
            -self.freedom * np.log(known) - total * excess - self.log_determinant
        ) / 2
        return inside + (gammaln(total / 2) - gammaln(freedom / 2))

    def rescaled_to_reference_pixels(self, pixels: float) -> LineEvidence:
        """The same with so many pixels for one."""
        return LineEvidence(self.rest / pixels**2, self.log_determinant, self.freedom)


@dataclass(frozen=True)
class _ScaledFit:
    """A least-squares fit with columns of one length; errors of a marking are correlated."""

    residuals: FloatArray
    jacobian: FloatArray
    prior: FloatArray
    lengths: FloatArray
    sums: FloatArray
    totals: FloatArray
    size: IntArray
    place: IntArray

    @staticmethod
    def of(
        residuals: FloatArray, jacobian: FloatArray, marking: IntArray, prior: FloatArray
    ) -> _ScaledFit:
        # Angles and metres: columns of one length invert better.
        lengths = np.sqrt((jacobian**2).sum(axis=0) + prior)
        jacobian = jacobian / lengths
        _, place, size = np.unique(marking, return_inverse=True, return_counts=True)
        sums = np.zeros((len(size), jacobian.shape[1]))
        np.add.at(sums, place, jacobian)
        totals = np.asarray(np.bincount(place, residuals), float)
        return _ScaledFit(
            residuals, jacobian, prior / lengths**2, lengths, sums, totals, size, place
        )

    def evidence(self, shares: FloatArray) -> LineEvidence:
        """For each of the shares, shape (R,)."""
        n, width = self.jacobian.shape
        square = self.jacobian.T @ self.jacobian
        # Inverse of (1 - rho) I + rho 11^T, marking by marking (Woodbury).
        own = 1 - shares[:, None]
        mixed = own + shares[:, None] * self.size
        common = shares[:, None] / mixed
        normal = square - np.einsum("rm,mi,mj->rij", common, self.sums, self.sums)
        normal = normal / own[:, :, None] + np.diag(self.prior)
        pull = (self.jacobian.T @ self.residuals - (common * self.totals) @ self.sums) / own
        spent = np.einsum("ri,ri->r", pull, np.linalg.solve(normal, pull[:, :, None])[:, :, 0])
        squares = self.residuals @ self.residuals - (common * self.totals**2).sum(1)
        log_size = ((self.size - 1) * np.log(own) + np.log(mixed)).sum(1)
        return LineEvidence(
            squares / own[:, 0] - spent,
            log_size + np.linalg.slogdet(normal)[1],
            max(n - width + int((self.prior > 0).sum()), 1),
        )


def collect_line_evidence(
    residuals: FloatArray, jacobian: FloatArray, marking: IntArray, prior: FloatArray
) -> LineEvidence:
    """What a least-squares fit leaves says of the noise, for each of ``SHARES``.

    The arguments are those of ``compute_line_noise``.
    """
    return _ScaledFit.of(residuals, jacobian, marking, prior).evidence(SHARES)


def compute_line_noise(
    residuals: FloatArray,
    jacobian: FloatArray,
    marking: IntArray,
    prior: FloatArray,
    known: LinePrior,
    weights: FloatArray | None = None,
) -> LineNoise:
    """Noise of the clicks, and the covariance of a least-squares fit to them.

    Args:
        residuals: At the minimum, each times the root of its robust weight, pixels, shape (N,).
        jacobian: Of the residuals, weighted alike, shape (N, n).
        marking: Of each residual, shape (N,).
        prior: Information of the parameters' own prior, shape (n,), a diagonal.
        known: Of the noise, in the pixels of the residuals.
        weights: Of the residuals' squares in the fit, but for the robust ones, shape (N,); None: alike.

    Raises:
        LinAlgError: A combination of parameters is not determined.
    """
    fit = _ScaledFit.of(residuals, jacobian, marking, prior)
    values = SHARES if known.share is None else np.array([known.share])
    found = fit.evidence(values)
    n, freedom = len(residuals), found.freedom
    weight = np.exp((at := found.log_likelihood(known.sigma_px)) - at.max())
    weight /= weight.sum()
    # Markings are few, so their common offsets are known badly: the covariance is that of
    # Student's distribution, with as many degrees of freedom as there are independent points.
    independent = (fit.size / (1 + values[:, None] * (fit.size - 1))).sum(1)
    student = SIGMA_FREEDOM + np.maximum(independent - n + freedom, 1.0)
    scatter = np.maximum(found.rest, 0.0) + SIGMA_FREEDOM * known.sigma_px**2
    variance = scatter / (freedom + SIGMA_FREEDOM) * student / (student - 2)
    variance = np.maximum(variance, known.floor_px**2)
    weighted = fit.jacobian if weights is None else fit.jacobian * weights[:, None]
    sums = np.zeros_like(fit.sums)
    np.add.at(sums, fit.place, weighted)
    shares = values[:, None, None]
    inner = (1 - shares) * (weighted.T @ weighted) + shares * (sums.T @ sums)
    middle = np.tensordot(weight * variance, inner, 1) + np.diag(fit.prior)
    outer = np.linalg.inv(weighted.T @ fit.jacobian + np.diag(fit.prior))
    return LineNoise(
        variance=float(weight @ variance),
        share=float(weight @ values),
        parameters=outer @ middle @ outer / np.outer(fit.lengths, fit.lengths),
    )


@dataclass(frozen=True)
class ConfidenceInterval:
    """A number with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class LineEstimate:
    """Noise of the clicks on lines of a dataset.

    Attributes:
        sigma: Of a point, pixels at 960 x 540: about this the images differ.
        share: Of the variance, what the points of a marking have in common.
        views: Images that it rests on.
    """

    sigma: ConfidenceInterval
    share: ConfidenceInterval
    views: int


def estimate_line_noise(found: Sequence[LineEvidence]) -> LineEstimate | None:
    """The noise under which the residuals of all images are likeliest; None where there are none,
    and where no noise that is tried explains them better than the first or the last one.

    Each image has its own variance, about that of the dataset: few images with wrong points
    change little. Of few images it is drawn towards what is expected of any.

    Args:
        found: Of each image for ``SHARES``, pixels at 960 x 540, in the order in which they were
            taken: neighbours err alike, so intervals are from leaving out one block after another.
    """
    if not found:
        return None
    blocks = np.zeros((BLOCKS, len(FREEDOMS), len(SIGMAS), len(SHARES)))
    for at, item in enumerate(found):
        likelihoods = item.log_likelihood(SIGMAS[:, None], FREEDOMS[:, None, None])
        blocks[at * BLOCKS // len(found)] -= likelihoods
    # How alike the images are decides little: the likeliest holds for all blocks.
    blocks = blocks[:, blocks.sum(axis=0).min(axis=(1, 2)).argmin()]
    whole = blocks.sum(axis=0)
    log_sigma, share, known = _compute_sigma_posterior(whole)
    if not _LOGS[0] < log_sigma < _LOGS[-1]:
        return None
    parts = np.array([_compute_sigma_posterior(whole - part)[:2] for part in blocks])
    scatter, of_share = jackknife_variance(parts).tolist()
    numbers = sum(item.freedom for item in found)
    half = STUDENT * np.sqrt(log_sigma_posterior_variance(scatter, numbers))
    wide = max(STUDENT * np.sqrt(of_share), NORMAL_95 * known, _SHARE_STEP / 4)
    sigma = ConfidenceInterval(*np.exp([log_sigma, log_sigma - half, log_sigma + half]).tolist())
    ends = max(share - wide, 0.0), min(share + wide, 1.0)
    return LineEstimate(sigma, ConfidenceInterval(share, *ends), len(found))


_FINE = 20
"""Shares between two of the grid at which the posterior is summed."""
_LOGS: FloatArray = np.log(SIGMAS)
_SHARE_STEP = float(SHARES[1] - SHARES[0])
_SIGMA_STEP = float(_LOGS[1] - _LOGS[0])


def _compute_sigma_posterior(cost: FloatArray) -> tuple[float, float, float]:
    """Logarithm of sigma, share and its standard deviation from costs, shape (S, R)."""
    cost = cost + sigma_prior_cost(_LOGS, EXPECTED_PX)[:, None]
    places = cost.argmin(axis=0).tolist()
    vertices = [fit_cost_minimum(cost[:, share], at) for share, at in enumerate(places)]
    off, least = np.transpose(vertices)
    # Few images leave the share open: its mean, not the likeliest one, is at no end by chance.
    steps = np.linspace(0, len(SHARES) - 1, _FINE * (len(SHARES) - 1) + 1)
    fine, smooth = SHARES[0] + _SHARE_STEP * steps, interpolate_cost(least, steps)
    weight = np.exp(smooth.min() - smooth)
    weight /= weight.sum()
    share = float(weight @ fine)
    # Sigma goes with the share: the more a marking has in common, the noisier its points.
    sigma = np.interp(share, SHARES, _LOGS[places] + _SIGMA_STEP * off)
    return float(sigma), share, float(np.sqrt(weight @ (fine - share) ** 2))
