"""Ridges: line-like paint of a whole picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from app.paint.ridges import find_line_like_pixels, find_straight_pieces, measure_line_strength
from tests.unit.paint.test_grass import CROWD, GRASS, picture


def noisy(image: np.ndarray) -> np.ndarray:
    noise = np.random.default_rng(5).normal(0, 2, image.shape[:2])[..., None]
    return np.clip(image + noise, 0, 255).astype(np.uint8)


class TestLineLike:
    def test_a_painted_line_becomes_its_thin_crest(self):
        image = picture(GRASS, 300, 960)
        image[149:152, 100:700] = 225
        found = find_line_like_pixels(noisy(image), np.ones((300, 960), np.bool_))
        assert found[150, 110:690].mean() > 0.95
        assert found[:, 200:600].sum(axis=0).max() <= 2

    def test_the_edge_of_a_board_and_a_shirt_are_no_lines(self):
        image = picture(GRASS, 300, 960)
        image[:100] = CROWD
        image[96:100] = 235
        image[180:200, 300:312] = 235
        found = find_line_like_pixels(noisy(image), np.ones((300, 960), np.bool_))
        assert not found[:110].any()
        assert not found[170:210, 290:322].any()

    def test_bright_paint_is_stronger_than_a_faint_stripe(self):
        image = picture(GRASS, 300, 960)
        image[149:152, 100:700] = 225
        image[220:223, 100:700] += 12
        image, field = noisy(image), np.ones((300, 960), np.bool_)
        found = measure_line_strength(image, field)
        assert np.median(found[150, 110:690]) > 5 * np.max(found[221, 110:690]) > 0
        assert ((found > 0) == find_line_like_pixels(image, field)).all()
        large = np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)
        seen = measure_line_strength(large, np.ones((600, 1920), np.bool_))
        assert np.median(seen[seen > 0]) == pytest.approx(np.median(found[found > 0]), rel=0.2)

    def test_nothing_is_found_where_no_field_is(self):
        image = noisy(picture(GRASS, 90, 160))
        assert not find_line_like_pixels(image, np.zeros((90, 160), np.bool_)).any()

    def test_pixels_of_a_large_picture_lie_on_its_line(self):
        image = picture(GRASS, 1080, 1920)
        image[600:606] = 225
        rows = np.nonzero(find_line_like_pixels(noisy(image), np.ones((1080, 1920), np.bool_)))[0]
        assert len(rows) > 800
        assert np.percentile(np.abs(rows - 602.5), 95) <= 2.5


def _mask(*lines: tuple[int, int, int, int]) -> np.ndarray:
    mask = np.zeros((540, 960), np.uint8)
    for x0, y0, x1, y1 in lines:
        cv2.line(mask, (x0, y0), (x1, y1), 1, 1)
    return mask.astype(np.bool_)


class TestStraightPieces:
    def test_two_lines_are_two_pieces_the_longer_one_first(self):
        pieces = find_straight_pieces(_mask((100, 100, 300, 140), (50, 400, 900, 300)), 8)
        assert len(pieces) == 2
        ends = pieces[0][np.argsort(pieces[0][[0, 2]])[0] * 2 :][:2]
        np.testing.assert_allclose(ends, (50, 400), atol=3)

    def test_a_line_that_people_hide_in_part_is_one_piece(self):
        mask = _mask((50, 400, 900, 300))
        mask[:, 300:320] = mask[:, 600:615] = False
        pieces = find_straight_pieces(mask, 8)
        assert len(pieces) == 1
        assert np.hypot(*(pieces[0][2:] - pieces[0][:2])) > 840

    def test_grass_without_lines_has_none(self):
        assert find_straight_pieces(_mask(), 8).shape == (0, 4)
