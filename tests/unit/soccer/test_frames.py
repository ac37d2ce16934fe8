from __future__ import annotations

import pytest

from app.soccer.frames import (
    Box,
    ImagePoint,
    ImageSize,
    box_from_corner_origin,
    box_to_corner_origin,
)


class TestImageSize:
    def test_file_coordinates_scale_by_one_less_than_the_size(self):
        size = ImageSize(960, 540)
        assert size.unit_to_pixel(1.0, 1.0) == ImagePoint(959.0, 539.0)
        assert size.unit_to_pixel(0.5, 0.5) == ImagePoint(479.5, 269.5)

    def test_one_per_cent_of_full_hd_is_22_03_px(self):
        assert ImageSize(1920, 1080).diagonal / 100 == pytest.approx(22.03, abs=0.005)


class TestBox:
    def test_d_is_the_mean_of_width_and_height(self):
        assert Box(0.0, 0.0, 10.0, 14.0).diameter == 12.0

    def test_a_square_lies_around_its_centre(self):
        assert Box.square(ImagePoint(10.0, 20.0), 4.0) == Box(8.0, 18.0, 4.0, 4.0)


class TestBoxFromCorner:
    def test_the_box_of_the_first_pixel_begins_half_a_pixel_before_its_centre(self):
        assert box_from_corner_origin(Box(0.0, 0.0, 1.0, 1.0)) == Box(-0.5, -0.5, 1.0, 1.0)

    def test_a_box_comes_back_from_both_directions(self):
        box = Box(635.25, 351.5, 12.5, 11.0)
        assert box_to_corner_origin(box_from_corner_origin(box)) == box
        assert box_from_corner_origin(box_to_corner_origin(box)) == box
