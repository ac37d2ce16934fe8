import numpy as np
import pytest

from app.geometry.resection import X, Z
from app.soccer.annotation import make_lines
from app.soccer.policy import CalibrationPolicy
from app.solving.observations import observe
from app.solving.resect import ResectionProblem
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEHIND_GOAL, BEND, OPPOSITE, PITCH, click

PROBLEM = ResectionProblem.of(SIZE, CalibrationPolicy())
FEW = ("Side line top", "Big rect. right top", "Big rect. right main", "Circle right")


def position(fit):
    return fit.parameters[X : Z + 1]


class TestRefineMain:
    @pytest.mark.parametrize("camera", [BEHIND_GOAL, OPPOSITE], ids=["behind goal", "opposite"])
    def test_a_replay_is_left_alone(self, camera):
        observations = observe(click(camera, 1.0), PITCH, SIZE)
        fit = PROBLEM.resect(observations)
        assert PROBLEM.refine_main(fit, observations) is fit

    def test_a_camera_that_its_lines_determine_hardly_moves_even_in_an_unusual_stadium(self):
        unusual = looking((9.0, 95.0, -27.0), (34.0, -4.0, 0.0), 3200.0, bend=BEND)
        observations = observe(click(unusual, 0.5, seed=2), PITCH, SIZE)
        fit = PROBLEM.resect(observations)
        refined = PROBLEM.refine_main(fit, observations)
        spread = PROBLEM.line_noise(fit.parameters, observations).parameters
        spread = spread[X : Z + 1, X : Z + 1]
        moved = position(refined) - position(fit)
        assert moved @ np.linalg.solve(spread, moved) < 1.0

    def test_where_few_lines_leave_a_direction_open_the_camera_comes_nearer_to_the_truth(self):
        usual = looking((0.5, 70.0, -14.0), (34.0, -4.0, 0.0), 2400.0, bend=BEND)
        before, after = [], []
        for seed in range(20):
            clicks = click(usual, 1.5, seed)
            observations = observe(make_lines({name: clicks[name] for name in FEW}), PITCH, SIZE)
            fit = PROBLEM.resect(observations)
            refined = PROBLEM.refine_main(fit, observations)
            before.append(np.linalg.norm(position(fit) - usual.position))
            after.append(np.linalg.norm(position(refined) - usual.position))
        assert np.mean(after) < 0.8 * np.mean(before)
