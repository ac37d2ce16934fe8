from __future__ import annotations

import numpy as np
import pytest

from app.errors import InputError
from app.features.predictions.detect import (
    Letterbox,
    decode_output,
    find_ball_category,
    suppress_overlapping,
)
from app.soccer.frames import ImageSize

PICTURE, NETWORK = ImageSize(1280, 720), ImageSize(640, 640)
BOX = Letterbox.fit(PICTURE, NETWORK)


def output(*columns: list[float]) -> np.ndarray:
    """(1, 4 + classes, N), padded with boxes that nobody is sure of."""
    empty = [[10.0, 10.0, 5.0, 5.0] + [0.0] * (len(columns[0]) - 4)] * 10
    return np.array([*columns, *empty], dtype=np.float32).T[None]


class TestLetterbox:
    def test_the_picture_lies_in_the_middle_of_the_input(self) -> None:
        assert (BOX.scale, BOX.left, BOX.top) == (0.5, 0, 140)

    def test_of_an_odd_border_the_smaller_half_comes_first(self) -> None:
        # 20 x 15 at half the size is 10 x 8 (7.5 is rounded to even); a row of 1 is left.
        box = Letterbox.fit(ImageSize(20, 15), ImageSize(10, 9))
        assert (box.left, box.top) == (0, 0)

    def test_prepares_rgb_shares_on_grey(self) -> None:
        picture = np.zeros((720, 1280, 3), np.uint8)
        picture[:] = (0, 0, 255)
        planes = BOX.prepare(picture)
        assert planes.shape == (1, 3, 640, 640)
        assert planes.dtype == np.float32
        assert planes[0, :, 320, 320].tolist() == [1, 0, 0]
        assert planes[0, :, 10, 320] == pytest.approx(114 / 255)

    def test_restores_what_it_moved(self) -> None:
        corners = np.array([[100.0, 200.0, 110.0, 212.0]])
        placed = corners * BOX.scale + np.array([0, 140, 0, 140])
        assert BOX.restore(placed) == pytest.approx(corners)

    def test_restores_nothing_outside_the_picture(self) -> None:
        assert BOX.restore(np.array([[-9.0, 0.0, 700.0, 640.0]])).tolist() == [[0, 0, 1280, 720]]


class TestDecode:
    def test_reads_centres_sizes_and_the_scores_of_the_ball(self) -> None:
        found = decode_output(
            output([320, 320, 6, 8, 0.1, 0.9], [100, 300, 6, 6, 0.9, 0.3]), BOX, 1, 0.25, 20
        )
        assert [round(item.score, 3) for item in found] == [0.9, 0.3]
        assert found[0].box.center == (640, 360)
        assert (found[0].box.width, found[0].box.height) == (12, 16)

    def test_leaves_out_what_is_not_sure_and_what_overlaps(self) -> None:
        same = [[320, 320, 8, 8, 0.9], [320, 320.5, 8, 8, 0.8], [320, 340, 8, 8, 0.7]]
        found = decode_output(output(*same, [100, 300, 6, 6, 0.2]), BOX, 0, 0.25, 20)
        assert [round(item.score, 3) for item in found] == [0.9, 0.7]

    def test_keeps_no_more_than_asked_for(self) -> None:
        many = [[50.0 * place, 320, 6, 6, 0.5 + place / 100] for place in range(1, 9)]
        found = decode_output(output(*many), BOX, 0, 0.1, 3)
        assert [round(item.score, 2) for item in found] == [0.58, 0.57, 0.56]

    @pytest.mark.parametrize("most", [300, 5, 2])
    def test_reads_an_export_that_suppresses_itself(self, most: int) -> None:
        rows = np.zeros((1, most, 6), np.float32)
        rows[0, 0] = [317, 316, 323, 324, 0.8, 0]
        rows[0, 1] = [100, 300, 106, 306, 0.7, 2]
        (found,) = decode_output(rows, BOX, 0, 0.25, 20)
        assert found.box.center == (640, 360)

    def test_refuses_another_shape_and_a_class_that_is_not_there(self) -> None:
        with pytest.raises(InputError, match="shape"):
            decode_output(np.zeros((3, 4)), BOX, 0, 0.25, 20)
        with pytest.raises(InputError, match="has 1 classes"):
            decode_output(output([1, 1, 1, 1, 0.5]), BOX, 3, 0.25, 20)


class TestSuppress:
    def test_keeps_the_surer_of_two_that_overlap(self) -> None:
        corners = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [0, 5, 10, 15]], dtype=float)
        # IoU 0.82 with the second, a third with the last.
        assert suppress_overlapping(corners, 0.7, 9) == [0, 2]
        assert suppress_overlapping(corners, 0.9, 9) == [0, 1, 2]


class TestBallCategory:
    def test_is_the_only_class_called_a_ball_or_the_only_class_at_all(self) -> None:
        assert find_ball_category(["person", "sports ball"]) == 1
        assert find_ball_category(["anything"]) == 0
        assert find_ball_category(["ball", "sports ball"]) is None
        assert find_ball_category(["tennis ball", "player", "Football", "ball boy"]) == 2
        assert find_ball_category(["person", "balloon"]) is None
        assert find_ball_category([]) is None
