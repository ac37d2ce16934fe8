"""Paint noise: how far paint lies from its markings, and the covariance that follows.

Lines are not painted quite where the plan has them, and all points of one marking share that:
each residual is an offset of its marking and a part of its own, as for clicks
(``solving.line_noise``, which estimates both). What a pitch is other than the plan
(the terms below) shows in no residual and is carried into the camera's covariance.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray, IntArray
from app.geometry.least_squares import require_determined_parameters
from app.geometry.resection import ARC, KAPPA, X, Z
from app.soccer.pitch import MARKINGS, Pitch
from app.solving.line_noise import LinePrior, compute_line_noise
from app.solving.lone_frame import (
    CROWN_SIGMA_M,
    INWARD_SIGMA_M,
    LINE_SIGMA_M,
    PAINT_SIZE_SIGMA_M,
)
from app.solving.observations import pitch_curves

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


def point_weights_by_marking(marking: IntArray, sigmas: FloatArray) -> FloatArray:
    """Weight of each point, shape (N,): many points of one marking say less than of several.

    The mean of n points that share rho of their variance is worth n / (1 + rho (n - 1)) of them
    (the design effect of cluster sampling, Kish 1965).

    Args:
        marking: Index into ``MARKINGS`` of each point, shape (N,).
        sigmas: Standard deviation of each, pixels, shape (N,).
    """
    counts = np.bincount(marking)
    weights: FloatArray = 1 / (1 + _common_variance_fractions(sigmas) * (counts[marking] - 1))
    return weights


def cautious_point_weights_by_marking(marking: IntArray, sigmas: FloatArray) -> FloatArray:
    """``point_weights_by_marking`` with at least what the points of a marking share where covariances are told."""
    counts = np.bincount(marking)
    shares = np.maximum(_common_variance_fractions(sigmas), LEAST_SHARE)
    weights: FloatArray = 1 / (1 + shares * (counts[marking] - 1))
    return weights


def _common_variance_fractions(sigmas: FloatArray) -> FloatArray:
    """What each point has in common with its marking, as a share of its variance, shape (N,)."""
    shares: FloatArray = SHARE + THIN_SHARE * np.minimum(sigmas / THIN_SIGMA_PX, 1.0) ** 2
    return shares


def estimate_paint_noise(
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
            (``shift_offsets``), pixels, shape (N, M).
    """
    root = np.sqrt(robust) / seen.sigmas
    rows, rest = seen.jacobian * root[:, None], seen.offsets * root
    known = np.diag(prior) + (0.0 if information is None else information)
    try:
        require_determined_parameters(rows.T @ rows + known)
        noise = compute_line_noise(rest, rows, seen.marking, prior, LinePrior(EXPECTED, LEAST))
    except (DegenerateGeometryError, np.linalg.LinAlgError):
        return None
    weighted = rows * point_weights_by_marking(seen.marking, seen.sigmas)[:, None]
    bread = np.linalg.inv(weighted.T @ rows + known)
    shares = np.maximum(_common_variance_fractions(seen.sigmas), max(noise.share, LEAST_SHARE))[
        :, None
    ]
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


CROWN, INWARD, LINES = 0, 1, slice(2, 2 + len(MARKINGS))
SIZES = slice(2 + len(MARKINGS), 4 + len(MARKINGS))
TERMS = 4 + len(MARKINGS)
"""Columns of ``paint_derivatives_by_all_terms``: crown, inward, each marking, length and width."""


def paint_derivatives_by_all_terms(
    places: FloatArray, marking: IntArray, jacobian: FloatArray, pitch: Pitch
) -> FloatArray:
    """``paint_derivatives_by_pitch`` with a column for each marking, seen or not, shape (N, TERMS)."""
    terms = np.zeros((len(marking), TERMS))
    columns = [CROWN, INWARD, *(LINES.start + np.unique(marking)), SIZES.start, SIZES.stop - 1]
    terms[:, columns] = paint_derivatives_by_pitch(places, marking, jacobian, pitch)
    return terms


def compute_paint_shift(
    places: FloatArray, marking: IntArray, values: FloatArray, pitch: Pitch
) -> FloatArray:
    """How far paint lies off the plan of a pitch of its size, metres, shape (N, 3).

    Args:
        places: Of the paint, pitch frame, metres, shape (N, 2).
        marking: Index into ``MARKINGS``, shape (N,).
        values: Of the columns of ``paint_derivatives_by_all_terms``, in their standard deviations, shape (TERMS,).
        pitch: The pitch, of the size that it has.
    """
    inside = INWARD_SIGMA_M * values[INWARD] * (marking != _MIDDLE)
    inside = inside + LINE_SIGMA_M * values[LINES][marking]
    raised = CROWN_SIGMA_M * values[CROWN] * _relative_grass_height(places, pitch)
    return np.column_stack([inside[:, None] * _inward_directions(places, marking, pitch), -raised])


def shift_offsets(offsets: FloatArray, jacobian: FloatArray, shift: FloatArray) -> FloatArray:
    """Offsets of paint from markings that lie off their plan, pixels, shape (N,).

    Args:
        offsets: From the markings of the plan, along their normals, shape (N,).
        jacobian: Derivative of the marking's place along the normal, shape (N, 8).
        shift: ``compute_paint_shift``, shape (N, 3).
    """
    return np.asarray(offsets - (_derivatives_by_place(jacobian) * shift).sum(axis=1))


def paint_derivatives_by_pitch(
    places: FloatArray, marking: IntArray, jacobian: FloatArray, pitch: Pitch
) -> FloatArray:
    """``paint_derivatives_by_layout`` and ``paint_derivatives_by_size`` side by side, shape (N, K + 2)."""
    painted = paint_derivatives_by_layout(places, marking, jacobian, pitch)
    return np.column_stack([painted, paint_derivatives_by_size(marking, jacobian, pitch)])


def paint_derivatives_by_layout(
    places: FloatArray, marking: IntArray, jacobian: FloatArray, pitch: Pitch
) -> FloatArray:
    """How far paint moves with each number of how a pitch is laid and painted, shape (N, K).

    The crown of the grass, the width of the paint, and a place for each marking that is seen; each
    in units of its prior's standard deviation, pixels along the normal.

    Args:
        places: Of the paint, pitch frame, metres, shape (N, 2).
        marking: Index into ``MARKINGS``, shape (N,).
        jacobian: Derivative of the marking's place along the normal by the camera's parameters,
            shape (N, 8).
        pitch: The pitch.
    """
    by_place = _derivatives_by_place(jacobian)
    raised = _relative_grass_height(places, pitch)
    across = (by_place[:, :2] * _inward_directions(places, marking, pitch)).sum(axis=1)
    seen = np.unique(marking)
    return np.column_stack(
        [
            -CROWN_SIGMA_M * raised * by_place[:, 2],
            INWARD_SIGMA_M * across * (marking != _MIDDLE),
            LINE_SIGMA_M * across[:, None] * (marking[:, None] == seen),
        ]
    )


def paint_derivatives_by_size(marking: IntArray, jacobian: FloatArray, pitch: Pitch) -> FloatArray:
    """How far paint moves with length and width of the pitch, as ``paint_derivatives_by_layout``, shape (N, 2).

    A pitch that is not the usual one is one that somebody measured: zeros.
    """
    usual = Pitch()
    if (pitch.length, pitch.width) != (usual.length, usual.width):
        return np.zeros((len(marking), 2))
    return (
        PAINT_SIZE_SIGMA_M
        * _derivatives_by_place(jacobian)[:, :2]
        * _marking_derivatives_by_size()[marking]
    )


def _derivatives_by_place(jacobian: FloatArray) -> FloatArray:
    """By the place on the pitch, shape (N, 3): a pitch that moves is a camera that moves back."""
    return -jacobian[:, X : Z + 1]


def _relative_grass_height(places: FloatArray, pitch: Pitch) -> FloatArray:
    """Height of the grass as a share of its crown, which runs along the middle, shape (N,)."""
    return np.asarray(np.maximum(1 - (2 * places[:, 1] / pitch.width) ** 2, 0.0))


_MIDDLE = MARKINGS.index("Middle line")


@lru_cache(maxsize=1)
def _marking_derivatives_by_size() -> FloatArray:
    """How far each marking moves along x with a metre of length, along y with one of width, (M, 2)."""
    usual = Pitch()
    curves, other = pitch_curves(usual), pitch_curves(Pitch(usual.length + 1, usual.width + 1))
    moves = other.shapes - curves.shapes
    ends = np.where((curves.kinds == ARC)[:, None], moves[:, :2], moves[:, 3:5])
    return np.asarray((moves[:, :2] + ends) / 2)


def _inward_directions(places: FloatArray, marking: IntArray, pitch: Pitch) -> FloatArray:
    """Unit directions across the markings, into the area that each bounds, shape (N, 2)."""
    curves = pitch_curves(pitch)
    found = _STRAIGHT[marking]
    round_ = curves.kinds[marking] == ARC
    spokes = curves.shapes[marking[round_], :2] - places[round_]
    found[round_] = spokes / np.maximum(np.hypot(*spokes.T), 1e-9)[:, None]
    return found


def _inward_direction(name: str) -> tuple[float, float]:
    """Into the area that a straight marking bounds; along x for the middle line."""
    words = name.split(" ")
    if words[-1] in ("top", "bottom"):
        return 0.0, 1.0 if words[-1] == "top" else -1.0
    right = 1.0 if "left" in words else -1.0
    # The front of an area bounds it from the other side.
    return (-right if words[-1] == "main" else right), 0.0


_STRAIGHT = np.array([_inward_direction(name) for name in MARKINGS])
