from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.evaluation.frame import iou, size_error_percent
from app.soccer.frames import Box

SIDES = st.floats(1, 100)
BOXES = st.builds(Box, st.floats(-50, 50), st.floats(-50, 50), SIDES, SIDES)


class TestIou:
    def test_of_a_third(self) -> None:
        assert iou(Box(0, 0, 2, 2), Box(1, 0, 2, 2)) == pytest.approx(1 / 3)

    def test_of_boxes_that_touch_is_nothing(self) -> None:
        assert iou(Box(0, 0, 2, 2), Box(2, 0, 2, 2)) == 0

    @given(BOXES, BOXES)
    def test_is_symmetric_and_at_most_one(self, a: Box, b: Box) -> None:
        assert iou(a, b) == pytest.approx(iou(b, a))
        assert 0 <= iou(a, b) <= 1 + 1e-12

    @given(BOXES)
    def test_of_a_box_with_itself_is_one(self, box: Box) -> None:
        assert iou(box, box) == pytest.approx(1)


class TestSizeErrorPercent:
    def test_is_a_share_of_the_careful_diagonal(self) -> None:
        # d: 7 against 3.5; the careful diagonal is 5.
        assert size_error_percent(Box(0, 0, 6, 8), Box(9, 9, 3, 4)) == pytest.approx(70)
