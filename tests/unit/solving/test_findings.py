from __future__ import annotations

import pytest

from app.solving.findings import _sides_swapped
from app.solving.sides import Swap


class TestSidesSwapped:
    def test_without_an_error_as_labelled_there_is_no_number(self) -> None:
        finding = _sides_swapped(Swap("7_1.png", None, 2.0, 1.0))
        assert (finding.number, finding.threshold, finding.confidence) == (None, 2.0, 1.0)
        assert "within 2.0 px" in finding.sentence

    def test_with_one_it_is_the_number(self) -> None:
        assert _sides_swapped(Swap("7_1.png", 80.0, 2.0, 0.9)).number == pytest.approx(80.0)

    def test_a_main_camera_on_the_far_side_has_no_numbers_and_says_where_it_stands(self) -> None:
        finding = _sides_swapped(Swap("7.png", None, None, 0.9))
        assert (finding.number, finding.threshold) == (None, None)
        assert "far side" in finding.sentence
