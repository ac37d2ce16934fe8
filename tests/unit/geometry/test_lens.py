import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.geometry.lens import distort, distort_jacobian, fold_radius, undistort

FULL = np.array([0.12, -0.03, 0.002, -0.001, 0.01, 0.05, 0.01, 0.002, 1e-3, -2e-3, 3e-3, 1e-3])
POINTS = np.array([[0.0, 0.0], [0.3, -0.2], [-0.4, 0.25], [0.1, 0.45]])


class TestDistort:
    def test_equals_opencv_with_all_twelve_coefficients(self):
        homogeneous = np.column_stack([POINTS, np.ones(len(POINTS))])
        expected, _ = cv2.projectPoints(homogeneous, np.zeros(3), np.zeros(3), np.eye(3), FULL)
        assert np.allclose(distort(POINTS, FULL), expected[:, 0], atol=1e-12)

    def test_nothing_happens_without_coefficients(self):
        assert np.array_equal(distort(POINTS, np.zeros(12)), POINTS)


class TestATermThatIsNextToNothing:
    def test_counts_as_none_where_the_picture_folds(self):
        lens, tiny = np.zeros(12), np.zeros(12)
        lens[:2] = tiny[:2] = (-0.3, 0.01)
        tiny[4] = 1e-320
        assert np.isclose(fold_radius(tiny), fold_radius(lens), rtol=1e-12)


class TestDistortJacobian:
    def test_equals_its_finite_difference(self):
        step = 1e-6
        for axis in (0, 1):
            move = np.zeros(2)
            move[axis] = step
            numeric = (distort(POINTS + move, FULL) - distort(POINTS - move, FULL)) / (2 * step)
            assert np.allclose(distort_jacobian(POINTS, FULL)[:, :, axis], numeric, atol=1e-8)


class TestUndistort:
    @settings(deadline=None)
    @given(st.floats(-0.4, 0.4), st.floats(-0.3, 0.3), st.floats(-0.3, 0.5))
    def test_undoes_distortion(self, x, y, k1):
        coefficients = np.zeros(12)
        coefficients[0] = k1
        ideal = np.array([[x, y]])
        assert np.allclose(undistort(distort(ideal, coefficients), coefficients), ideal, atol=1e-9)

    def test_undoes_the_full_model(self):
        assert np.allclose(undistort(distort(POINTS, FULL), FULL), POINTS, atol=1e-10)

    @pytest.mark.parametrize("terms", [(0.444, -0.121, 0.001), (0.274, 0.128, -0.044)])
    def test_finds_what_is_seen_beyond_the_fold_and_lies_within_it(self, terms):
        lens = np.zeros(12)
        lens[[0, 1, 4]] = terms
        ideal = np.column_stack([np.linspace(0.0, 0.97 * fold_radius(lens), 50), np.zeros(50)])
        seen = distort(ideal, lens)
        assert (seen[:, 0] > fold_radius(lens)).any()
        assert np.allclose(undistort(seen, lens), ideal, atol=1e-6)

    def test_what_no_ideal_point_maps_to_is_nan(self):
        barrel = np.zeros(12)
        barrel[0] = -0.5
        largest = fold_radius(barrel) * 2 / 3
        assert np.isnan(undistort(np.array([[1.1 * largest, 0.0]]), barrel)).all()


class TestFoldRadius:
    def test_a_barrel_folds_where_its_radius_stops_growing(self):
        barrel = np.zeros(12)
        barrel[0] = -0.12
        assert np.isclose(fold_radius(barrel), np.sqrt(1 / 0.36))

    def test_a_pincushion_never_folds(self):
        assert fold_radius(np.array([0.2, *np.zeros(11)])) == np.inf

    def test_half_the_square_as_second_term_keeps_a_barrel_from_folding(self):
        assert fold_radius(np.array([-0.3, 0.045, *np.zeros(10)])) == np.inf

    @settings(deadline=None)
    @given(st.floats(-2, 2), st.floats(-2, 2))
    def test_two_terms_fold_where_the_slope_of_the_radius_is_zero_first(self, k1, k2):
        fold = fold_radius(np.array([k1, k2, *np.zeros(10)]))
        squared = np.linspace(0, min(fold, 100.0) ** 2, 1000, endpoint=False)
        assert (1 + 3 * k1 * squared + 5 * k2 * squared**2 > 0).all()
        if fold < 1e50:
            terms = np.array([1, 3 * k1 * fold**2, 5 * k2 * fold**4])
            assert abs(terms.sum()) < 1e-9 * np.abs(terms).max()


class TestOnePoint:
    """One point is worked out in plain numbers; it must be what arrays give, bit for bit."""

    LENSES = (
        np.array([-0.21, 0.07, 1e-3, -2e-3, 0.01, 0.02, -0.01, 0.003, 1e-4, 2e-4, -1e-4, 3e-4]),
        np.array([0.11, *np.zeros(11)]),
        # The denominator is 0 at radius 1.
        np.array([0.1, 0, 0, 0, 0, -1.0, *np.zeros(6)]),
    )
    POINTS = np.array(
        [[0.0, 0.0], [0.31, -0.17], [1.0, 0.0], [-0.6, 0.8], [40.0, 3.0], [np.nan, 0.1]]
    )

    @pytest.mark.parametrize("lens", LENSES)
    @pytest.mark.parametrize("function", [distort, distort_jacobian])
    def test_is_the_same_bits_alone_and_among_others(self, function, lens) -> None:
        with np.errstate(all="ignore"):
            together = function(self.POINTS, lens)
            alone = np.concatenate([function(point[None], lens) for point in self.POINTS])
        np.testing.assert_array_equal(alone, together)

    @pytest.mark.parametrize("lens", LENSES)
    def test_is_undistorted_to_the_same_bits_among_its_copies(self, lens) -> None:
        for point in self.POINTS:
            alone = undistort(point[None], lens)
            many = undistort(np.repeat(point[None], 9, axis=0), lens)
            np.testing.assert_array_equal(np.repeat(alone, 9, axis=0), many)
