from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.geometry.camera import Camera
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import MARKINGS, Pitch, opposite_marking
from app.solving.jaccard import (
    ProjectedMarking,
    _sample_markings,
    camera_jaccard,
    classify_markings,
    jaccard,
    measure_markings,
    project_markings,
)
from tests.cameras import SIZE
from tests.unit.solving.conftest import MAIN, PITCH, click

GAMMA = 0.005 * SIZE.diagonal

# Straight above the centre mark: 10 px a metre, x to the right and y down as on the pitch.
ABOVE = Camera(np.eye(3), np.array([0.0, 0.0, -100.0]), (1000.0, 1000.0), (100.0, 100.0))
SMALL = ImageSize(201, 201)  # shows x and y from -10 to +10 m


class TestProjectMarkings:
    def test_from_above_the_centre_only_circle_and_middle_line_are_seen(self):
        assert set(project_markings(ABOVE, PITCH, SMALL)) == {"Circle central", "Middle line"}

    def test_the_middle_line_runs_from_border_to_border(self):
        line = project_markings(ABOVE, PITCH, SMALL)["Middle line"]
        assert np.allclose(line[:, 0], 100.0)
        assert (line[:, 1].min(), line[:, 1].max()) == pytest.approx((0.0, 200.0))


class TestOutcomes:
    def outcomes(self, lines, gamma=2.0):
        measured = measure_markings(project_markings(ABOVE, PITCH, SMALL), make_lines(lines))
        return classify_markings(measured, make_lines(lines), gamma)

    def test_one_far_point_makes_the_whole_marking_a_false_positive(self):
        near, far = [(100.5, 20.0), (101.0, 150.0)], [(100.5, 20.0), (102.0, 150.0)]
        assert self.outcomes({"Middle line": near})["Middle line"] == "tp"
        assert self.outcomes({"Middle line": far})["Middle line"] == "fp"

    def test_seen_and_not_annotated_is_a_false_positive(self):
        assert self.outcomes({"Middle line": [(100.0, 20.0)]})["Circle central"] == "fp"

    def test_annotated_and_not_seen_is_a_false_negative(self):
        assert self.outcomes({"Side line left": [(5.0, 5.0)]})["Side line left"] == "fn"

    def test_a_point_outside_the_image_is_measured_to_the_clipped_line(self):
        found = self.outcomes({"Middle line": [(100.0, -1.5)]})
        assert found["Middle line"] == "tp"
        assert self.outcomes({"Middle line": [(100.0, -2.5)]})["Middle line"] == "fp"


class TestCameraJaccard:
    def test_counts_by_hand(self):
        lines = make_lines({"Middle line": [(100.0, 10.0)], "Side line left": [(5.0, 5.0)]})
        # One found, the circle not annotated, the side line not visible.
        assert camera_jaccard(ABOVE, lines, PITCH, SMALL, (2.0,)) == (pytest.approx(1 / 3),)

    def test_nothing_seen_and_nothing_annotated_is_zero(self):
        up = Camera(np.diag([1.0, -1.0, -1.0]), ABOVE.position, (1000.0, 1000.0), (100.0, 100.0))
        assert camera_jaccard(up, {}, PITCH, SMALL, (2.0,)) == (0.0,)

    def test_the_true_camera_finds_every_exact_click(self):
        assert camera_jaccard(MAIN, click(MAIN), PITCH, SIZE, (GAMMA,))[0] > 0.9

    def test_turned_labels_count_only_in_benchmark_mode(self):
        turned = make_lines({opposite_marking(name): at for name, at in click(MAIN).items()})
        plain = camera_jaccard(MAIN, turned, PITCH, SIZE, (GAMMA,))
        benchmark = camera_jaccard(MAIN, turned, PITCH, SIZE, (GAMMA,), symmetric=True)
        assert plain[0] < 0.1
        assert benchmark == camera_jaccard(MAIN, click(MAIN), PITCH, SIZE, (GAMMA,))

    def test_another_pitch_gives_another_number(self):
        lines = click(MAIN)
        assert camera_jaccard(MAIN, lines, Pitch(95.0, 60.0), SIZE, (GAMMA,))[0] < 0.5


class TestMeasureMarkings:
    def test_an_annotated_marking_has_distances_and_nearest_places(self):
        projected = {"Middle line": np.array([[100.0, 0.0], [100.0, 200.0]])}
        lines = make_lines({"Middle line": [(103.0, 20.0), (96.0, 50.0)]})
        (found,) = measure_markings(projected, lines).values()
        assert found.polyline is projected["Middle line"]
        assert np.array_equal(found.distances, [3.0, 4.0])
        assert np.array_equal(found.nearest, [[100.0, 20.0], [100.0, 50.0]])

    def test_one_that_nobody_annotated_has_none(self):
        projected = {"Middle line": np.array([[100.0, 0.0], [100.0, 200.0]])}
        for lines in ({}, {"Middle line": ()}):
            (found,) = measure_markings(projected, lines).values()
            assert (found.distances.shape, found.nearest.shape) == ((0,), (0, 2))

    def test_what_is_annotated_and_not_visible_is_not_measured(self):
        assert measure_markings({}, make_lines({"Middle line": [(1.0, 2.0)]})) == {}


class TestOutcomesOfMeasured:
    NEAR = ProjectedMarking(np.zeros((2, 2)), np.array([1.0, 2.0]), np.zeros((2, 2)))

    def test_a_point_at_gamma_is_not_close(self):
        lines = make_lines({"Middle line": [(0.0, 0.0)]})
        assert classify_markings({"Middle line": self.NEAR}, lines, 2.0) == {"Middle line": "fp"}
        assert classify_markings({"Middle line": self.NEAR}, lines, 2.001) == {"Middle line": "tp"}

    def test_an_empty_annotation_is_none(self):
        bare = ProjectedMarking(np.zeros((2, 2)), np.empty(0), np.empty((0, 2)))
        assert classify_markings({"Middle line": bare}, {"Middle line": ()}, 2.0) == {
            "Middle line": "fp"
        }
        assert classify_markings({}, {"Middle line": ()}, 2.0) == {}


class TestJaccard:
    def test_is_the_share_of_what_was_found(self):
        assert jaccard({"a": "tp", "b": "fp", "c": "fn", "d": "tp", "e": "fn"}) == 0.4

    def test_without_markings_it_is_zero(self):
        assert jaccard({}) == 0.0

    @given(st.lists(st.sampled_from(["tp", "fp", "fn"]), min_size=1))
    def test_lies_between_nothing_and_all_and_one_more_found_never_lowers_it(self, found):
        value = jaccard(dict(enumerate(found)))
        assert 0.0 <= value <= 1.0
        assert jaccard(dict(enumerate([*found, "tp"]))) >= value


class TestLaws:
    @given(st.lists(st.floats(0.5, 40.0), min_size=2, max_size=4))
    @settings(max_examples=20, deadline=None)
    def test_a_wider_gamma_never_finds_less(self, gammas):
        lines = click(MAIN, noise_px=3.0)
        values = camera_jaccard(MAIN, lines, PITCH, SIZE, tuple(sorted(gammas)))
        assert list(values) == sorted(values)

    def test_in_benchmark_mode_each_gamma_takes_its_own_better_labels(self):
        lines = {**click(MAIN, 1.0, 3), "Side line left": ((5.0, 5.0),)}
        turned = make_lines({opposite_marking(name): at for name, at in lines.items()})
        gammas = (1.0, 4.0, 16.0)
        plain = camera_jaccard(MAIN, lines, PITCH, SIZE, gammas)
        other = camera_jaccard(MAIN, turned, PITCH, SIZE, gammas)
        both = camera_jaccard(MAIN, lines, PITCH, SIZE, gammas, symmetric=True)
        assert both == tuple(map(max, zip(plain, other, strict=True)))
        assert camera_jaccard(MAIN, turned, PITCH, SIZE, gammas, symmetric=True) == both


class TestSampling:
    def test_lines_are_sampled_at_ninety_centimetres_and_circles_at_twenty(self):
        samples, limits = _sample_markings(PITCH)
        parts = {marking: samples[first:last] for marking, first, last in limits}
        assert tuple(parts) == MARKINGS
        assert limits[0][1] == 0
        assert limits[-1][2] == len(samples)
        for marking, spacing in (("Middle line", 0.9), ("Circle central", 0.2)):
            expected = PITCH.sample(marking, 0.9, 0.2)
            assert np.array_equal(parts[marking], expected)
            apart = np.linalg.norm(np.diff(expected, axis=0), axis=1)
            assert np.median(apart) == pytest.approx(spacing, rel=1e-3)

    def test_a_point_beyond_the_fold_of_the_lens_counts_as_the_public_evaluator_counts_it(self):
        folded = replace(ABOVE, distortion=np.array([-100.0, *np.zeros(11)]))
        # The circle, 9.15 m out, is folded back to 1.5 m from the middle.
        assert "Circle central" in project_markings(folded, PITCH, SMALL)
        assert np.isnan(folded.project(np.array([[0.0, 10.0, 0.0]]))).all()

    def test_a_part_is_clipped_to_the_image(self):
        wide = ImageSize(301, 151)
        line = project_markings(ABOVE, PITCH, wide)["Middle line"]
        assert (line[:, 1].min(), line[:, 1].max()) == pytest.approx((0.0, 150.0))
        circle = project_markings(ABOVE, PITCH, wide)["Circle central"]
        assert circle[:, 0].max() == pytest.approx(191.5, abs=0.1)
