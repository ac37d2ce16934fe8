from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.formats import fields


class TestNumber:
    @pytest.mark.parametrize(
        ("value", "expected"), [(1, 1.0), (1.5, 1.5), ("2", 2.0), (" -3.5e1 ", -35.0), (".5", 0.5)]
    )
    def test_numbers_and_their_texts_are_read(self, value: Any, expected: float) -> None:
        assert fields.parse_number(value) == expected

    @pytest.mark.parametrize(
        "value",
        [None, True, [], {}, "", " ", "abc", "nan", "inf", "1_0", "0x1", "1e999", 10**400],
    )
    def test_anything_else_is_refused(self, value: Any) -> None:
        with pytest.raises(ValueError, match=r"is (null|a|an|blank|too|\")"):
            fields.parse_number(value)

    @pytest.mark.parametrize("value", [float("nan"), float("inf")])
    def test_numbers_that_are_not_finite_are_refused(self, value: float) -> None:
        with pytest.raises(ValueError, match="not a finite number"):
            fields.parse_number(value)

    @given(st.floats(allow_nan=False, allow_infinity=False))
    def test_the_repr_of_a_float_comes_back_exactly(self, value: float) -> None:
        assert fields.parse_number(repr(value)) == value


class TestWhole:
    @pytest.mark.parametrize("value", [1280, 1280.0, "1280", "1280.0"])
    def test_all_spellings_of_a_whole_number(self, value: Any) -> None:
        assert fields.parse_whole_number(value) == 1280

    def test_a_fraction_is_refused(self) -> None:
        with pytest.raises(ValueError, match="not a whole number"):
            fields.parse_whole_number(1.5)


class TestPixel:
    def test_a_coordinate_outside_the_image_is_kept(self) -> None:
        assert fields.parse_pixel_coordinate(-20.5) == -20.5

    def test_a_coordinate_beyond_any_image_is_refused(self) -> None:
        with pytest.raises(ValueError, match="beyond any image"):
            fields.parse_pixel_coordinate(1e9)


class TestNumbers:
    def test_another_length_is_refused_with_both_numbers(self) -> None:
        with pytest.raises(ValueError, match="has 2 numbers, not 3"):
            fields.parse_numbers([1, 2], 3)

    def test_text_is_no_list(self) -> None:
        with pytest.raises(ValueError, match="is text, not a list"):
            fields.parse_numbers("123", 3)
