"""Match model: where the main camera of a match stands, and how its place moves as it turns.

The centre of a lens lies before the head of its tripod and turns with it, and what pitch and lens
differ from their models moves with the direction of view as well. So the place of a frame's camera
is one place of the match and a part in proportion to the pan, chiefly along the touchline: six
unknowns, with what real matches show as prior. Frames that lie elsewhere count less (Student
weights). How well a run of frames is explained by one such model says whether it is one match.

Source: Lange, Little and Taylor (1989) for the weights; MacKay (1992) for the evidence of a model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray

UNKNOWNS = 6
"""Place at pan 0, metres, and how much it moves with the pan, metres a radian."""
MEAN = np.array([0.0, 64.5, -15.5, 1.7, 0.0, 0.0])
SIGMA = np.array([1.0, 11.0, 4.5, 4.0, 0.7, 0.2])
"""Of the unknowns over real matches."""
FREEDOM = 4.0
"""Degrees of freedom of the places' Student distribution."""
FARTHEST = 8.0
"""No place costs more than this: one odd frame does not end a match, three do."""
_ROUNDS = 6


@dataclass(frozen=True)
class FramePlace:
    """Where one frame alone puts its camera.

    Attributes:
        position: Pitch frame, metres, shape (3,).
        covariance: Shape (3, 3).
        pan: Radians.
    """

    position: FloatArray
    covariance: FloatArray
    pan: float


@dataclass(frozen=True)
class MatchModel:
    """The model that explains some places best.

    Attributes:
        unknowns: Shape (6,).
        covariance: Shape (6, 6).
        chi_square: Squared distance of each place from it, in sigmas, three numbers each, (N,).
        cost: Negative logarithm of its evidence, but for what does not depend on the model.
    """

    unknowns: FloatArray
    covariance: FloatArray
    chi_square: FloatArray
    cost: float

    def at(self, pan: float) -> tuple[FloatArray, FloatArray]:
        """Place for a pan (radians) and its variance along each axis, shapes (3,)."""
        turned = np.hstack([np.eye(3), pan * np.eye(3)])
        place: FloatArray = turned @ self.unknowns
        return place, np.diag(turned @ self.covariance @ turned.T).copy()


class PlaceEquations:
    """Normal equations of each of some places, to fit one model to many choices of them."""

    def __init__(self, places: Sequence[FramePlace], wander_m: FloatArray):
        """``wander_m``: what a place differs from the model by itself, each axis, shape (3,)."""
        positions = np.array([place.position for place in places]).reshape(-1, 3)
        covariances = np.array([place.covariance for place in places]).reshape(-1, 3, 3)
        pans = np.array([place.pan for place in places])
        inverses = np.linalg.inv(covariances + np.diag(wander_m**2))
        turned = np.zeros((len(positions), 3, UNKNOWNS))
        turned[:, :, :3] = np.eye(3)
        turned[:, :, 3:] = pans[:, None, None] * np.eye(3)
        # About the prior's mean: the numbers stay small.
        self._offsets = positions - turned @ MEAN
        weighted = inverses @ turned
        self._information = (turned.transpose(0, 2, 1) @ weighted).reshape(-1, UNKNOWNS**2)
        self._pulls = np.einsum("nai,na->ni", weighted, self._offsets)
        self._squares = np.einsum("na,nab,nb->n", self._offsets, inverses, self._offsets)

    def __len__(self) -> int:
        return len(self._squares)

    def fit(self, rows: slice | FloatArray) -> MatchModel:
        """The model of some of the places, one at least."""
        information, pulls, squares = (
            self._information[rows],
            self._pulls[rows],
            self._squares[rows],
        )
        found = np.zeros(UNKNOWNS)
        found[:3] = np.median(self._offsets[rows], axis=0)
        normal = np.diag(SIGMA**-2)
        for _ in range(_ROUNDS):
            chi = _chi_square(found, information, pulls, squares)
            weight = (FREEDOM + 3) / (FREEDOM + chi)
            normal = (weight @ information).reshape(UNKNOWNS, UNKNOWNS) + np.diag(SIGMA**-2)
            found = np.linalg.solve(normal, weight @ pulls)
        chi = _chi_square(found, information, pulls, squares)
        losses = (FREEDOM + 3) / 2 * np.log1p(chi / FREEDOM)
        # What a model of its own costs: the share of the prior that the places leave of it.
        narrowed = np.linalg.slogdet(normal)[1] + 2 * np.log(SIGMA).sum()
        cost = np.minimum(losses, FARTHEST).sum() + 0.5 * ((found / SIGMA) ** 2).sum()
        return MatchModel(MEAN + found, np.linalg.inv(normal), chi, float(cost + 0.5 * narrowed))


def _chi_square(
    found: FloatArray, information: FloatArray, pulls: FloatArray, squares: FloatArray
) -> FloatArray:
    chi = squares - 2 * (pulls @ found) + information @ np.outer(found, found).ravel()
    return np.maximum(chi, 0.0)
