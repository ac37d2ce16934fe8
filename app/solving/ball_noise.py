"""Ball noise: how far annotated balls lie from where they belong, from rays that should meet.

Rays that see one ball miss each other by what clicks and cameras are off. The part of that miss
which no 3D point explains (one number for two views, two more for each further one) has a variance
that is linear in the squared noise. What many groups say of it, with what is expected before any is
seen, is the noise of a dataset: few groups move it little.

Source: Hartley & Zisserman, sec. 12.5-12.6 (what a triangulation leaves of the measurements).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from app.geometry.arrays import BoolArray, FloatArray
from app.soccer.policy import PAPER, Policy
from app.soccer.solution import Ball3D
from app.solving.ball_covariance import CLICK_DIAGONAL, calibration_pixel_covariance
from app.solving.line_noise import (
    BLOCKS,
    NORMAL_95,
    SPREAD,
    STUDENT,
    fit_cost_minimum,
    jackknife_variance,
    log_sigma_posterior_variance,
    log_sigma_with_95_percent_coverage,
    sigma_prior_cost,
)
from app.solving.triangulate import BallObservation

MIN_NUMBERS = 20
"""Of one camera or person: fewer say too little."""
LIMIT = 10.8
"""Squared, of one number: one honest pair in a thousand lies beyond. Farther ones are mistakes."""


def _trimmed_variance(limit: float) -> float:
    """Variance of a standard normal number whose square is within a limit."""
    end = math.sqrt(limit)
    density = math.exp(-limit / 2) / math.sqrt(2 * math.pi)
    return 1 - 2 * end * density / math.erf(end / math.sqrt(2))


TRIMMED = _trimmed_variance(LIMIT)
"""Variance of a standard normal number within that limit."""
HALF = _trimmed_variance(float(chdtri(1, 0.5)))
"""The same of the half that is nearest to zero."""
SIGMAS = np.geomspace(0.1, 30.0, 191)
"""Noises that are tried, pixels at 1920 x 1080."""
ENDS = float(np.log(SIGMAS[0])), float(np.log(SIGMAS[-1]))
"""An estimate there is none: what cannot be told from nothing, and what is no noise."""
SHARES = np.linspace(0.0, 0.15, 16)
"""What the diameter of a ball adds, as a share of it."""
SHARE_SIGMA = 0.02
"""How far that share is expected to lie from that of the policy ``paper``, as sigma is about its."""
GIVEN_PX, GIVEN_SPREAD = 1.0, 1.5
"""What a given camera is expected to add, at 1920 x 1080, and how far its logarithm may differ: some
are exact, those of some rigs are ten pixels off."""
_ROUNDS = 30
_LOGS: FloatArray = np.log(SIGMAS)
_STEP = float(_LOGS[1] - _LOGS[0])
_SHARE_STEP = float(SHARES[1] - SHARES[0])


@dataclass(frozen=True)
class RayResidual:
    """One residual of the rays to a ball; the variance of ``miss`` is linear in the squared noise.

    Attributes:
        miss: Pixels, along a direction in the images together that no 3D point moves in.
        click: How much a squared click sigma (at 1920 x 1080) counts in the variance.
        diameter: The same for the squared share of the ball's diameter.
        given: The same for the squared sigma of given cameras without a covariance.
        known: Variance by the covariance of cameras from lines, square pixels.
        by_view: Of each view its key, and what it adds to ``click``, ``diameter`` and ``given``.
    """

    miss: float
    click: float
    diameter: float
    given: float
    known: float
    by_view: tuple[tuple[str, float, float, float], ...] = ()


@dataclass(frozen=True)
class SigmaEstimate:
    """An estimated standard deviation with its 95 % interval, and what it rests on.

    ``value`` is the one with which 95 % ellipsoids hold the truth: of few numbers it is above the
    most likely one.

    Attributes:
        low: End of the 95 % interval.
        numbers: Independent numbers that rays leave unexplained.
        left_out: Those among them that noise does not explain.
    """

    value: float
    low: float
    high: float
    numbers: int
    left_out: int


@dataclass(frozen=True)
class BallNoise:
    """Noise of annotated balls; None where too few groups say anything.

    Attributes:
        click: Of a coordinate of a click, pixels at 1920 x 1080; None where every camera is
            given, as it cannot be told from that of the cameras then.
        share: Of the ball's diameter, which adds to it; with an estimated click.
        given: Of the ball's pixel by a given camera without covariance, at 1920 x 1080.
        share_interval: Of the share, 95 %; None where no ball has a diameter.
    """

    click: SigmaEstimate | None
    share: float | None
    given: SigmaEstimate | None
    share_interval: tuple[float, float] | None = None


def compute_ray_residuals(
    ball: Ball3D, observations: Sequence[BallObservation]
) -> tuple[RayResidual, ...]:
    """What the rays to the ball of one group leave unexplained: 2 V - 3 numbers of V views.

    Given cameras with a covariance are left aside: those of one rig err together, and a
    covariance of each alone would explain away what the clicks are off. So are cameras that their
    lines leave open: nobody knows how much of a miss is theirs.

    Args:
        ball: Where the group's valid pairs put it.
        observations: Of the group; those in no valid pair are left aside.
    """
    seen = [
        observation
        for observation in observations
        if observation.view in ball.views
        and (observation.calibration.source != "given" or observation.is_given_without_uncertainty)
        and not observation.calibration.is_left_open
    ]
    if len(seen) < 2:
        return ()
    point = np.array(ball.point)
    pixels = np.array([observation.camera.project(point[None])[0] for observation in seen])
    if not np.isfinite(pixels).all():
        return ()
    offsets = (np.array([observation.center for observation in seen]) - pixels).ravel()
    jacobian = np.vstack([observation.camera.jacobian(point) for observation in seen])
    # Directions of all pixels together in which no 3D point moves ...
    normals = np.linalg.svd(jacobian)[0][:, 3:]
    known = np.zeros((len(offsets), len(offsets)))
    for at, observation in enumerate(seen):
        part = slice(2 * at, 2 * at + 2)
        known[part, part] = calibration_pixel_covariance(
            observation.calibration, observation.size, point
        )
    # ... turned until the cameras' errors are independent in them, as equal clicks are anyway.
    _, turn = np.linalg.eigh(normals.T @ known @ normals)
    normals = normals @ turn
    squared = (normals**2).reshape(len(seen), 2, -1).sum(axis=1).T
    units = np.array([(observation.size.diagonal / CLICK_DIAGONAL) ** 2 for observation in seen])
    diameters = np.array([observation.diameter_px**2 for observation in seen])
    bare = np.array([observation.is_given_without_uncertainty for observation in seen])
    columns = (
        offsets @ normals,
        squared @ units,
        squared @ diameters,
        squared @ (units * bare),
        np.einsum("im,ij,jm->m", normals, known, normals),
    )
    own = squared[:, :, None] * np.column_stack([units, diameters, units * bare])
    names = [observation.view for observation in seen]
    found = []
    for row, parts in zip(np.transpose(columns).tolist(), own.tolist(), strict=True):
        by_view = tuple((name, *part) for name, part in zip(names, parts, strict=True))
        found.append(RayResidual(row[0], row[1], row[2], row[3], row[4], by_view))
    return tuple(found)


@dataclass(frozen=True)
class _NoisePrior:
    """What is known of a sigma before its misses: its median and spread, and the diameter's share."""

    sigma: float
    spread: float
    share: float

    @property
    def prior_costs(self) -> FloatArray:
        """Of each of ``SIGMAS``."""
        return sigma_prior_cost(_LOGS, self.sigma, self.spread)


def estimate_ball_noise(misses: Sequence[RayResidual], policy: Policy = PAPER) -> BallNoise:
    """The noise that explains the misses of a dataset best, mistakes left aside.

    What is expected of it is what the policy ``paper`` assumes, whatever judges the dataset: so a
    second estimate, after the first is used, is the same.

    Args:
        misses: Of many groups, in the order in which they were taken: neighbours in time err
            alike, so the interval comes from leaving out one tenth after the other.
        policy: Its click is taken where every camera is given, which cannot be told from it.
    """
    rows = np.array(
        [(one.miss, one.click, one.diameter, one.given, one.known) for one in misses], float
    ).reshape(-1, 5)
    free = rows[:, 3] == 0
    clicked, rest = rows[free], rows[~free]
    click = share = given = interval = None
    if len(clicked):
        known = _NoisePrior(PAPER.click_sigma_px, SPREAD, PAPER.box_sigma_share)
        found = _jackknife_sigma(clicked, known)
        if found is not None:
            click, share, interval = found
    if len(rest):
        # What clicks explain is known by now, or thought to be; the cameras explain what is left.
        noise = policy.click_sigma_px if click is None else click.value
        thought = policy.box_sigma_share if share is None else share
        variance = rest[:, 4] + noise**2 * rest[:, 1] + thought**2 * rest[:, 2]
        nothing = np.zeros(len(rest))
        columns = np.column_stack([rest[:, 0], rest[:, 3], nothing, nothing, variance])
        found = _jackknife_sigma(columns, _NoisePrior(GIVEN_PX, GIVEN_SPREAD, 0.0))
        given = None if found is None else found[0]
    return BallNoise(click, share, given, interval if clicked[:, 2].any() else None)


def _jackknife_sigma(
    rows: FloatArray, known: _NoisePrior
) -> tuple[SigmaEstimate, float, tuple[float, float]] | None:
    """Sigma and share and its interval; intervals are from leaving out one block after the other.

    None where no sigma that is tried explains the rows better than the first or the last one.

    Args:
        rows: Of ``RayResidual``, the click's slope in the second column, shape (N, 5).
        known: Before them.
    """
    whole, found, wide = _fit_sigma(rows, known)
    if not ENDS[0] < whole < ENDS[1]:
        return None
    block = np.arange(len(rows)) * BLOCKS // len(rows)
    # One number alone has nothing to be left out of.
    rests = [rest for at in np.unique(block) if len(rest := rows[block != at])] or [rows]
    parts = np.array([_fit_sigma(rest, known)[:2] for rest in rests])
    scatter, of_share = jackknife_variance(parts).tolist()
    kept = _find_inliers(rows, known)
    numbers = int(kept.sum())
    variance = log_sigma_posterior_variance(scatter, numbers, known.spread)
    half = STUDENT * math.sqrt(variance)
    # Where neighbours err alike, there are fewer independent numbers than there seem to be.
    weight = log_sigma_posterior_variance(0.0, numbers, known.spread) / variance
    sigma = math.exp(
        log_sigma_with_95_percent_coverage(
            _LOGS, weight * _sigma_costs(rows[kept], found) + known.prior_costs
        )
    )
    wide = max(STUDENT * math.sqrt(of_share), wide)
    low, high = math.exp(whole - half), math.exp(whole + half)
    interval = max(found - wide, 0.0), found + wide
    return SigmaEstimate(sigma, low, high, len(rows), len(rows) - numbers), found, interval


def _fit_sigma(rows: FloatArray, known: _NoisePrior) -> tuple[float, float, float]:
    """Logarithm of the most likely sigma, the share of the diameter, and half of the interval of the
    share by the likelihood."""
    kept = rows[_find_inliers(rows, known)]
    if not kept[:, 2].any():
        return (
            _find_lowest_cost(_sigma_costs(kept, known.share) + known.prior_costs)[1],
            known.share,
            0.0,
        )
    fits = [_find_lowest_cost(_sigma_costs(kept, share) + known.prior_costs) for share in SHARES]
    prior = ((SHARES - known.share) / SHARE_SIGMA) ** 2 / 2
    costs = prior + [least for least, _ in fits]
    at = int(np.argmin(costs))
    off = fit_cost_minimum(costs, at)[0]
    share = float(SHARES[at]) + _SHARE_STEP * off
    log = float(np.interp(share, SHARES, [log for _, log in fits]))
    inside = np.clip(at, 1, len(SHARES) - 2)
    bend = float(np.diff(costs[inside - 1 : inside + 2], 2)[0]) / _SHARE_STEP**2
    return log, share, NORMAL_95 / math.sqrt(max(bend, SHARE_SIGMA**-2))


def _find_lowest_cost(costs: FloatArray) -> tuple[float, float]:
    """The lowest cost and the logarithm of its sigma, between the points of the grid."""
    place = int(np.argmin(costs))
    off, least = fit_cost_minimum(costs, place)
    return least, float(_LOGS[place]) + off * _STEP


def _find_inliers(rows: FloatArray, known: _NoisePrior) -> BoolArray:
    """Numbers that are no mistakes, from the median outwards until no other one joins."""
    squared = rows[:, 0] ** 2
    kept: BoolArray = squared <= np.median(squared)
    trimmed = HALF
    for _ in range(_ROUNDS):
        place = int(np.argmin(_sigma_costs(rows[kept], known.share, trimmed) + known.prior_costs))
        variance = SIGMAS[place] ** 2 * rows[:, 1] + known.share**2 * rows[:, 2] + rows[:, 4]
        wider = squared <= LIMIT * variance
        trimmed = TRIMMED
        if (wider == kept).all():
            break
        kept = wider
    return kept


def _sigma_costs(rows: FloatArray, share: float, trimmed: float = TRIMMED) -> FloatArray:
    """Negative log-likelihood for each of ``SIGMAS``; ``trimmed`` makes up for missing tails."""
    explained = rows[:, 4] + share**2 * rows[:, 2]
    variance = SIGMAS[:, None] ** 2 * rows[:, 1] + explained
    costs: FloatArray = 0.5 * (np.log(variance) + rows[:, 0] ** 2 / trimmed / variance).sum(axis=1)
    return costs
