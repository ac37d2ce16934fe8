from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.geometry.resection_kernels import select_farthest_points


def kept(pixels, curve, limits):
    keep = np.empty(len(pixels), dtype=np.bool_)
    select_farthest_points(
        np.array(pixels, float).reshape(-1, 2), np.array(curve), np.array(limits), keep
    )
    return np.flatnonzero(keep).tolist()


class TestKeepFarthest:
    def test_keeps_the_ends_of_a_line_and_what_lies_between_them(self):
        line = [(x, 0.0) for x in (0, 1, 4, 5, 6, 10)]
        assert kept(line, [0] * 6, [2]) == [0, 5]
        assert kept(line, [0] * 6, [3]) == [0, 3, 5]

    def test_keeps_all_points_of_a_curve_that_has_few(self):
        assert kept([(0, 0), (1, 0), (9, 9)], [0, 0, 2], [2, 0, 1]) == [0, 1, 2]

    def test_each_curve_is_thinned_by_itself(self):
        pixels = [(0, 0), (5, 0), (10, 0), (100, 0), (100, 1), (100, 2), (100, 3)]
        assert kept(pixels, [1, 1, 1, 4, 4, 4, 4], [9, 2, 9, 9, 3]) == [0, 2, 3, 4, 6]

    def test_of_equal_points_the_first_are_kept(self):
        assert kept([(1, 1)] * 5, [0] * 5, [2]) == [0]

    @given(
        st.lists(st.tuples(st.integers(-50, 50), st.integers(-50, 50)), min_size=4, unique=True),
        st.integers(2, 6),
    )
    def test_no_point_that_is_left_out_lies_farther_from_the_kept_than_they_from_each_other(
        self, pixels, limit
    ):
        places = np.array(pixels, float)
        chosen = kept(pixels, [0] * len(pixels), [limit])
        assert len(chosen) == min(limit, len(pixels))
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        left = np.setdiff1d(np.arange(len(pixels)), chosen)
        if len(left):
            among = apart[np.ix_(chosen, chosen)] + np.diag(np.full(len(chosen), np.inf))
            assert apart[np.ix_(left, chosen)].min(axis=1).max() <= among.min() + 1e-9
