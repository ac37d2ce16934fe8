from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.formats.fields import find_exact_inverse

COORDINATES = st.floats(-5000, 5000)


class TestExactInverse:
    @given(st.floats(-0.5, 1.5), st.sampled_from([539, 719, 959, 1079, 1279, 1919]))
    def test_a_normalised_coordinate_comes_back_as_the_same_pixel(
        self, unit: float, scale: int
    ) -> None:
        pixel = unit * scale
        written = find_exact_inverse(pixel / scale, pixel, lambda value: value * scale)
        assert written * scale == pixel

    @given(COORDINATES, COORDINATES)
    def test_a_width_from_two_corners_comes_back(self, x1: float, x2: float) -> None:
        width = x2 - x1
        written = find_exact_inverse(x1 + width, width, lambda value: value - x1)
        assert written - x1 == width

    @pytest.mark.parametrize("towards", [-math.inf, math.inf])
    def test_neighbours_on_both_sides_are_tried(self, towards: float) -> None:
        target = math.nextafter(math.nextafter(1.0, towards), towards)
        assert find_exact_inverse(1.0, target, lambda value: value) == target

    def test_without_an_exact_neighbour_the_guess_stays(self) -> None:
        assert find_exact_inverse(1.0, 5.0, lambda value: value) == 1.0
