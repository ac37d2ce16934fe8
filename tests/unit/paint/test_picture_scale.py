"""From the pixels of a picture to those that its annotations are in, and back."""

from __future__ import annotations

import numpy as np
import pytest

from app.paint.picture_scale import PictureScale, why_unreadable
from app.soccer.frames import Box, ImageSize

HALF = PictureScale.of(np.zeros((360, 640, 3), np.uint8), ImageSize(1280, 720))


class TestPictureScale:
    def test_the_corner_of_a_picture_is_the_corner_of_its_annotations(self) -> None:
        # The centre of the first pixel is 0, so its outer corner is -0.5 in both.
        assert HALF.sentence(-0.5, -0.5) == (-0.5, -0.5)
        assert HALF.sentence(639.5, 359.5) == (1279.5, 719.5)
        assert HALF.sentence(0.0, 0.0) == (0.5, 0.5)

    def test_a_box_covers_the_same_part_of_the_picture(self) -> None:
        box = HALF.box(Box(99.5, 199.5, 40.0, 20.0))
        assert (box.x, box.y, box.width, box.height) == (49.5, 99.5, 20.0, 10.0)
        assert HALF.sentence(box.x, box.y) == (99.5, 199.5)

    def test_few_of_many_line_like_pixels_are_told_and_all_of_few(self) -> None:
        mask = np.zeros((360, 640), np.bool_)
        mask[10, 20] = mask[30, 40] = True
        assert HALF.line_like(mask) == (HALF.sentence(20, 10), HALF.sentence(40, 30))
        assert 0 < len(HALF.line_like(~mask)) < 10_000
        assert HALF.line_like(np.zeros_like(mask)) == ()


class TestWhyUnreadable:
    @pytest.mark.parametrize(("height", "readable"), [(360, True), (361, True), (362, False)])
    def test_a_rounded_side_is_no_other_shape(self, height: int, readable: bool) -> None:
        found = why_unreadable(np.zeros((height, 640, 3), np.uint8), ImageSize(1280, 720))
        assert (found is None) is readable

    def test_a_small_picture_is_told_with_its_width_first(self) -> None:
        found = why_unreadable(np.zeros((90, 160, 3), np.uint8), ImageSize(1280, 720))
        assert found is not None and "(160 x 90 pixels)" in found
