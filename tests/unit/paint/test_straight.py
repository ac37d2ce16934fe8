from __future__ import annotations

import cv2
import numpy as np

from app.paint.straight import straight_pieces


def _mask(*lines: tuple[int, int, int, int]) -> np.ndarray:
    mask = np.zeros((540, 960), np.uint8)
    for x0, y0, x1, y1 in lines:
        cv2.line(mask, (x0, y0), (x1, y1), 1, 1)
    return mask.astype(np.bool_)


class TestStraightPieces:
    def test_two_lines_are_two_pieces_the_longer_one_first(self):
        pieces = straight_pieces(_mask((100, 100, 300, 140), (50, 400, 900, 300)), 8)
        assert len(pieces) == 2
        ends = pieces[0][np.argsort(pieces[0][[0, 2]])[0] * 2 :][:2]
        np.testing.assert_allclose(ends, (50, 400), atol=3)

    def test_a_line_that_people_hide_in_part_is_one_piece(self):
        mask = _mask((50, 400, 900, 300))
        mask[:, 300:320] = mask[:, 600:615] = False
        pieces = straight_pieces(mask, 8)
        assert len(pieces) == 1
        assert np.hypot(*(pieces[0][2:] - pieces[0][:2])) > 840

    def test_grass_without_lines_has_none(self):
        assert straight_pieces(_mask(), 8).shape == (0, 4)
