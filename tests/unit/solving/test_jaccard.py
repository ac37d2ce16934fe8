import numpy as np
import pytest

from app.geometry.camera import Camera
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch, twin_marking
from app.solving.jaccard import (
    camera_jaccard,
    measure_markings,
    outcomes,
    project_markings,
)
from tests.unit.solving.conftest import MAIN, PITCH, SIZE, click

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
        return outcomes(measured, make_lines(lines), gamma)

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
        turned = make_lines({twin_marking(name): at for name, at in click(MAIN).items()})
        plain = camera_jaccard(MAIN, turned, PITCH, SIZE, (GAMMA,))
        benchmark = camera_jaccard(MAIN, turned, PITCH, SIZE, (GAMMA,), symmetric=True)
        assert plain[0] < 0.1
        assert benchmark == camera_jaccard(MAIN, click(MAIN), PITCH, SIZE, (GAMMA,))

    def test_another_pitch_gives_another_number(self):
        lines = click(MAIN)
        assert camera_jaccard(MAIN, lines, Pitch(95.0, 60.0), SIZE, (GAMMA,))[0] < 0.5
