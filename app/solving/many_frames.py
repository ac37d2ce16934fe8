"""Many frames: what all frames of a match say of a few numbers that they share.

One frame seldom tells such a number from another camera; many frames do. What a frame says of the
numbers, whatever its camera, is what is left once its camera is eliminated (Schur complement), and
these parts add up. A frame's part is its *pull* (gradient) and its *information*, both divided by
the variance of its clicks.

Source: Hartley & Zisserman, sec. A6.3 (partitioned normal equations); White (1980) for the
covariance, which counts frames and not clicks: the clicks of a frame err together.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import PARAMETERS
from app.solving.observations import Observations
from app.solving.resect import measurement_count

MAX_FRAMES = 30
"""More frames say little more; those that say most are taken."""
MIN_MEASUREMENTS = 12
"""Frames with fewer say nothing that they do not need for their camera."""
CERTAIN_SIGMAS = 5.0
"""A number is certainly another one when it is so many standard deviations away."""

Share = tuple[FloatArray, FloatArray]
"""Pull, shape (K,), and information, shape (K, K), of one frame about the K shared numbers."""


def frames_with_enough_measurements(seen: Iterable[Observations]) -> list[int]:
    """Indices of the frames with enough independent measurements, those with the most first."""
    counts = [measurement_count(observations) for observations in seen]
    rich = sorted((-count, at) for at, count in enumerate(counts) if count >= MIN_MEASUREMENTS)
    return [at for _, at in rich]


def eliminate_camera(gradient: FloatArray, information: FloatArray, variance: float) -> Share:
    """What a frame says of the shared numbers once its camera is eliminated.

    Args:
        gradient: Of the camera's P parameters and, behind them, of the numbers, shape (P + K,).
        information: J^T W J, shape (P + K, P + K).
        variance: Of a click.
    """
    camera, shared = slice(0, PARAMETERS), slice(PARAMETERS, None)
    carried = np.linalg.solve(information[camera, camera], information[camera, shared])
    pull = (gradient[shared] - carried.T @ gradient[camera]) / variance
    reduced = (information[shared, shared] - information[shared, camera] @ carried) / variance
    return pull, reduced


def eliminate_own_numbers(share: Share, sigma: FloatArray) -> Share:
    """A frame's share where its numbers are its own, about those of the match (random effects).

    Args:
        share: As if the numbers were those of the match.
        sigma: By which a frame's numbers differ from them, shape (K,).
    """
    pull, information = share
    shrunk = np.linalg.inv(np.eye(len(pull)) + information * sigma**2)
    return shrunk @ pull, shrunk @ information


def sigmas_of_shared_numbers(pulls: FloatArray, information: FloatArray, spent: int) -> FloatArray:
    """Standard deviations of the shared numbers, shape (K,).

    The larger of two: from the clicks' variance, and from how much the frames disagree.

    Args:
        pulls: Of each frame at the numbers that were found, shape (F, K).
        information: Of all frames and of what is thought beforehand, shape (K, K).
        spent: Frames' worth of freedom that the numbers took.
    """
    count, inverse = len(pulls), np.linalg.inv(information)
    between = inverse @ (pulls.T @ pulls) @ inverse * count / max(count - spent, 1)
    sigmas: FloatArray = np.sqrt(np.maximum(np.diag(inverse), np.diag(between)))
    return sigmas
