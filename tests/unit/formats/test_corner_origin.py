"""Tests of the pixel frame of COCO and YOLO."""

from __future__ import annotations

from app.formats.corner_origin import box_from_corner, box_to_corner
from app.soccer.frames import Box


class TestBoxFromCorner:
    def test_the_box_of_the_first_pixel_begins_half_a_pixel_before_its_centre(self):
        assert box_from_corner(Box(0.0, 0.0, 1.0, 1.0)) == Box(-0.5, -0.5, 1.0, 1.0)

    def test_a_box_comes_back_from_both_directions(self):
        box = Box(635.25, 351.5, 12.5, 11.0)
        assert box_to_corner(box_from_corner(box)) == box
        assert box_from_corner(box_to_corner(box)) == box
