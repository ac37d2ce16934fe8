from __future__ import annotations

import math

import pytest

from app.solving.findings import _sides_swapped
from app.solving.sides import Swap


class TestSidesSwapped:
    def test_without_an_error_as_labelled_there_is_no_number(self) -> None:
        finding = _sides_swapped(Swap("7_1.png", math.inf, 2.0, 1.0))
        assert (finding.number, finding.threshold, finding.confidence) == (None, 2.0, 1.0)
        assert "meets no other" in finding.sentence
        assert "inf" not in finding.sentence

    def test_with_one_it_says_how_much_is_gained(self) -> None:
        finding = _sides_swapped(Swap("7_1.png", 80.0, 2.0, 0.9))
        assert finding.number == pytest.approx(80.0)
        assert "misses the others by 80.0 px" in finding.sentence
        assert "within 2.0 px" in finding.sentence
