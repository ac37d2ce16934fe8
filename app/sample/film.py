"""Film: what lens and sensor add to every frame."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def develop(image: np.ndarray, grain: np.ndarray, row_shift: int, column_shift: int) -> None:
    """A darker border and the sensor's noise, in place.

    Args:
        image: uint8, shape (H, W, 3).
        grain: Grey levels to add, float32, shape (H, W), wraps.
        row_shift: Where in the grain to begin; column_shift likewise.
    """
    rows, columns = image.shape[0], image.shape[1]
    for row in range(rows):
        y = 2.0 * row / (rows - 1) - 1.0
        for column in range(columns):
            x = 2.0 * column / (columns - 1) - 1.0
            gain = 1.03 - 0.09 * (x * x + y * y)
            noise = grain[(row + row_shift) % rows, (column + column_shift) % columns]
            for c in range(3):
                value = image[row, column, c] * gain + noise + 0.5
                image[row, column, c] = np.uint8(min(max(value, 0.0), 255.0))
