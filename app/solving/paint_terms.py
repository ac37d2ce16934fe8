"""Paint terms: what all paint of a marking, or of a picture, may have in common.

No pitch is quite the plan: it is longer or wider, raised in the middle, its lines are measured
to their outer edges, and each is painted by hand. A camera takes such a pitch for another place
of its own, by a metre and more, and no residual shows it. Each such number has a prior
(priors of ``lone_frame``), and what it does to the paint is carried into the camera's covariance.

Source: Hartley & Zisserman, section 5.2 (propagation of covariance); JCGM 100:2008, annex F.2.4
(errors that measurements have in common).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from app.geometry.arrays import FloatArray, IntArray
from app.geometry.resection import ARC, X, Z
from app.soccer.pitch import MARKINGS, Pitch
from app.solving.lone_frame import (
    CROWN_SIGMA_M,
    INWARD_SIGMA_M,
    LINE_SIGMA_M,
    PAINT_SIZE_SIGMA_M,
)
from app.solving.observations import pitch_curves

CROWN, INWARD, LINES = 0, 1, slice(2, 2 + len(MARKINGS))
SIZES = slice(2 + len(MARKINGS), 4 + len(MARKINGS))
TERMS = 4 + len(MARKINGS)
"""Columns of ``all_terms``: crown, inward, each marking, length and width."""


def all_terms(
    places: FloatArray, marking: IntArray, jacobian: FloatArray, pitch: Pitch
) -> FloatArray:
    """``pitch_terms`` with a column for each marking, seen or not, shape (N, TERMS)."""
    terms = np.zeros((len(marking), TERMS))
    columns = [CROWN, INWARD, *(LINES.start + np.unique(marking)), SIZES.start, SIZES.stop - 1]
    terms[:, columns] = pitch_terms(places, marking, jacobian, pitch)
    return terms


def painted_shift(
    places: FloatArray, marking: IntArray, values: FloatArray, pitch: Pitch
) -> FloatArray:
    """How far paint lies off the plan of a pitch of its size, metres, shape (N, 3).

    Args:
        places: Of the paint, pitch frame, metres, shape (N, 2).
        marking: Index into ``MARKINGS``, shape (N,).
        values: Of the columns of ``all_terms``, in their standard deviations, shape (TERMS,).
        pitch: The pitch, of the size that it has.
    """
    inside = INWARD_SIGMA_M * values[INWARD] * (marking != _MIDDLE)
    inside = inside + LINE_SIGMA_M * values[LINES][marking]
    raised = CROWN_SIGMA_M * values[CROWN] * _raised(places, pitch)
    return np.column_stack([inside[:, None] * _inward(places, marking, pitch), -raised])


def shifted_offsets(offsets: FloatArray, jacobian: FloatArray, shift: FloatArray) -> FloatArray:
    """Offsets of paint from markings that lie off their plan, pixels, shape (N,).

    Args:
        offsets: From the markings of the plan, along their normals, shape (N,).
        jacobian: Derivative of the marking's place along the normal, shape (N, 8).
        shift: ``painted_shift``, shape (N, 3).
    """
    return np.asarray(offsets - (_by_place(jacobian) * shift).sum(axis=1))


def pitch_terms(
    places: FloatArray, marking: IntArray, jacobian: FloatArray, pitch: Pitch
) -> FloatArray:
    """``painted_terms`` and ``size_terms`` side by side, shape (N, K + 2)."""
    painted = painted_terms(places, marking, jacobian, pitch)
    return np.column_stack([painted, size_terms(marking, jacobian, pitch)])


def painted_terms(
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
    by_place = _by_place(jacobian)
    raised = _raised(places, pitch)
    across = (by_place[:, :2] * _inward(places, marking, pitch)).sum(axis=1)
    seen = np.unique(marking)
    return np.column_stack(
        [
            -CROWN_SIGMA_M * raised * by_place[:, 2],
            INWARD_SIGMA_M * across * (marking != _MIDDLE),
            LINE_SIGMA_M * across[:, None] * (marking[:, None] == seen),
        ]
    )


def size_terms(marking: IntArray, jacobian: FloatArray, pitch: Pitch) -> FloatArray:
    """How far paint moves with length and width of the pitch, as ``painted_terms``, shape (N, 2).

    A pitch that is not the usual one is one that somebody measured: zeros.
    """
    usual = Pitch()
    if (pitch.length, pitch.width) != (usual.length, usual.width):
        return np.zeros((len(marking), 2))
    return PAINT_SIZE_SIGMA_M * _by_place(jacobian)[:, :2] * _size_moves()[marking]


def _by_place(jacobian: FloatArray) -> FloatArray:
    """By the place on the pitch, shape (N, 3): a pitch that moves is a camera that moves back."""
    return -jacobian[:, X : Z + 1]


def _raised(places: FloatArray, pitch: Pitch) -> FloatArray:
    """Height of the grass as a share of its crown, which runs along the middle, shape (N,)."""
    return np.asarray(np.maximum(1 - (2 * places[:, 1] / pitch.width) ** 2, 0.0))


_MIDDLE = MARKINGS.index("Middle line")


@lru_cache(maxsize=1)
def _size_moves() -> FloatArray:
    """How far each marking moves along x with a metre of length, along y with one of width, (M, 2)."""
    usual = Pitch()
    curves, other = pitch_curves(usual), pitch_curves(Pitch(usual.length + 1, usual.width + 1))
    moves = other.shapes - curves.shapes
    ends = np.where((curves.kinds == ARC)[:, None], moves[:, :2], moves[:, 3:5])
    return np.asarray((moves[:, :2] + ends) / 2)


def _inward(places: FloatArray, marking: IntArray, pitch: Pitch) -> FloatArray:
    """Unit directions across the markings, into the area that each bounds, shape (N, 2)."""
    curves = pitch_curves(pitch)
    found = _STRAIGHT[marking]
    round_ = curves.kinds[marking] == ARC
    spokes = curves.shapes[marking[round_], :2] - places[round_]
    found[round_] = spokes / np.maximum(np.hypot(*spokes.T), 1e-9)[:, None]
    return found


def _direction(name: str) -> tuple[float, float]:
    """Into the area that a straight marking bounds; along x for the middle line."""
    words = name.split(" ")
    if words[-1] in ("top", "bottom"):
        return 0.0, 1.0 if words[-1] == "top" else -1.0
    right = 1.0 if "left" in words else -1.0
    # The front of an area bounds it from the other side.
    return (-right if words[-1] == "main" else right), 0.0


_STRAIGHT = np.array([_direction(name) for name in MARKINGS])
