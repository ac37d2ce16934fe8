import math

import pytest

from app.soccer.solution import compute_margin


class TestMarginOf:
    def test_a_value_above_what_is_asked_at_least_has_a_positive_share(self):
        assert compute_margin(0.9, 0.75) == pytest.approx(0.2)
        assert compute_margin(0.6, 0.75) == pytest.approx(-0.2)

    def test_a_value_below_what_is_asked_at_most_has_a_positive_share(self):
        assert compute_margin(5.5, 22.0, at_most=True) == pytest.approx(0.75)
        assert compute_margin(33.0, 22.0, at_most=True) == pytest.approx(-0.5)

    def test_half_of_the_views_that_are_asked_is_half_too_few(self):
        assert compute_margin(1, 2) == -0.5
        assert compute_margin(4, 2) == 1.0

    def test_the_same_share_whatever_the_unit(self):
        assert compute_margin(12.0, 10.0) == pytest.approx(compute_margin(0.9, 0.75))

    def test_at_the_threshold_nothing_is_left(self):
        assert compute_margin(0.75, 0.75) == 0.0
        assert compute_margin(22.0, 22.0, at_most=True) == 0.0

    def test_a_threshold_of_zero_or_none_has_no_margin(self):
        assert compute_margin(3.0, 0.0) is None
        assert compute_margin(3.0, None) is None

    def test_a_value_that_is_not_finite_has_no_margin(self):
        assert compute_margin(math.inf, 22.0, at_most=True) is None
        assert compute_margin(math.nan, 0.75) is None
