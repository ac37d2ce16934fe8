"""Grass: the field of play, and why there is none."""

from __future__ import annotations

import numpy as np
import pytest

from app.paint.grass import explain_missing_field, find_field_of_play

GRASS, CROWD = (70, 130, 50), (120, 90, 110)


def picture(colour: tuple[int, int, int], height: int = 270, width: int = 480) -> np.ndarray:
    return np.full((height, width, 3), colour, np.uint8)


class TestFieldOfPlay:
    def test_lines_and_people_on_the_grass_are_part_of_it_and_the_crowd_is_not(self):
        image = picture(CROWD)
        image[90:] = GRASS
        image[150:155] = 230
        image[180:220, 100:112] = (240, 240, 240)
        field = find_field_of_play(image)
        assert field[152, 240] and field[200, 106]
        assert not field[:85].any()

    def test_a_green_speck_in_the_stands_is_none_of_it(self):
        image = picture(CROWD)
        image[120:] = GRASS
        image[20:32, 30:48] = GRASS
        assert not find_field_of_play(image)[:100].any()

    def test_the_mask_of_a_large_picture_has_its_size(self):
        image = picture(GRASS, 1080, 1920)
        assert find_field_of_play(image).shape == (1080, 1920)
        assert find_field_of_play(image).all()

    def test_grass_in_the_shadow_of_a_stand_is_grass(self):
        image = picture(GRASS)
        image[:, :200] = np.array(GRASS) // 3
        assert find_field_of_play(image).mean() > 0.95


class TestWhyNoField:
    @pytest.mark.parametrize(
        ("colour", "word"),
        [((128, 128, 128), "colours"), ((250, 250, 250), "white"), ((20, 2, 6), "dark"), (CROWD, "grass")],
    )  # fmt: skip
    def test_a_picture_without_grass_says_what_is_wrong(self, colour, word):
        image = picture(colour)
        sentence = explain_missing_field(image, find_field_of_play(image))
        assert sentence is not None and word in sentence

    def test_a_field_needs_no_reason(self):
        image = picture(GRASS)
        assert explain_missing_field(image, find_field_of_play(image)) is None

    def test_a_picture_of_a_few_pixels_is_no_error(self):
        image = picture(GRASS, 3, 5)
        assert find_field_of_play(image).shape == (3, 5)
