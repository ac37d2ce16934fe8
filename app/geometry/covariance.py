"""Covariance of a camera's parameters: what can be one."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from app.geometry.resection import PARAMETERS

_ROUNDING = 1e-6
"""How far correlations of a covariance may be from what they have to be."""


def camera_covariance(values: Iterable[float]) -> tuple[float, ...]:
    """The covariance of a camera's parameters (``geometry.resection``), row by row, shape (64,).

    Raises:
        ValueError: It is not symmetric with a variance above zero in each parameter, and none
            below zero in any direction.
    """
    covariance = tuple(map(float, values))
    if len(covariance) != PARAMETERS**2 or not all(map(math.isfinite, covariance)):
        raise ValueError("the covariance of a camera is 64 numbers")
    matrix = np.array(covariance).reshape(PARAMETERS, PARAMETERS)
    variances = matrix.diagonal()
    if not (variances > 0).all():
        raise ValueError("the variance of each number of a camera is above zero")
    scale = np.sqrt(variances)
    shares = matrix / np.outer(scale, scale)
    if not (np.abs(shares - shares.T) < _ROUNDING).all():
        raise ValueError("the covariance of a camera is symmetric")
    if np.linalg.eigvalsh(shares)[0] < -_ROUNDING:
        raise ValueError("no variance of a camera is negative")
    return covariance
