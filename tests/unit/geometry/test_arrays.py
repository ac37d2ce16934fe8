"""Arrays: what every computation with vectors rests on."""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import cross


class TestCross:
    def test_gives_the_bits_of_numpy(self) -> None:
        a, b = np.random.default_rng(1).normal(size=(2, 50, 3))
        assert cross(a, b).tobytes() == np.cross(a, b).tobytes()
        assert cross(a[0], b[0]).tobytes() == np.cross(a[0], b[0]).tobytes()
