from dataclasses import replace

import numpy as np
import pytest

from app.geometry.resection import X, Z
from app.soccer.annotation import make_lines
from app.soccer.policy import CalibrationPolicy
from app.solving.observations import make_observations
from app.solving.resect import POOR_PX, QUICK, THOROUGH, ResectionProblem
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEHIND_GOAL, BEND, OPPOSITE, PITCH, click

PROBLEM = ResectionProblem.of(SIZE, CalibrationPolicy())
FEW = ("Side line top", "Big rect. right top", "Big rect. right main", "Circle right")


def position(fit):
    return fit.parameters[X : Z + 1]


class TestResect:
    def test_what_is_nearly_undetermined_is_sought_thoroughly(self, monkeypatch):
        camera = looking((0.5, 70.0, -14.0), (34.0, -4.0, 0.0), 2400.0, bend=BEND)
        lines = click(camera, 0.5)
        plans = []
        search = ResectionProblem._search_all_stages

        def note(problem, observations, plan):
            plans.append(plan)
            return search(problem, observations, plan)

        monkeypatch.setattr(ResectionProblem, "_search_all_stages", note)
        few = make_lines({name: lines[name] for name in FEW[:3]} | {FEW[3]: lines[FEW[3]][:2]})
        PROBLEM.resect(make_observations(few, PITCH, SIZE))
        PROBLEM.resect(make_observations(lines, PITCH, SIZE))
        assert plans == [THOROUGH, QUICK]

    def test_a_poor_fit_is_never_worse_than_the_thorough_search_finds(self):
        camera = looking((0.5, 70.0, -14.0), (34.0, -4.0, 0.0), 2400.0, bend=BEND)
        lines = dict(click(camera, 0.5))
        lines["Side line left"] = lines.pop("Side line right")
        observations = make_observations(make_lines(lines), PITCH, SIZE)
        fit = PROBLEM.resect(observations)
        assert (
            PROBLEM.distances(fit.parameters, observations).max()
            > POOR_PX * PROBLEM.pixels_per_reference_pixel
        )
        assert fit.cost <= PROBLEM._search_all_stages(observations, THOROUGH).cost


class TestRefineMain:
    @pytest.mark.parametrize("camera", [BEHIND_GOAL, OPPOSITE], ids=["behind goal", "opposite"])
    def test_a_replay_is_left_alone(self, camera):
        observations = make_observations(click(camera, 1.0), PITCH, SIZE)
        fit = PROBLEM.resect(observations)
        assert PROBLEM.refine_with_main_prior(fit, observations) is fit

    @pytest.mark.parametrize("degrees", [-25.0, 4.0, 12.0])
    def test_a_camera_that_its_lines_show_rolled_is_left_alone(self, degrees):
        level = looking((12.0, 55.0, -14.0), (20.0, -4.0, 0.0), 1200.0)
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        rolled = replace(level, rotation=turn @ level.rotation)
        observations = make_observations(click(rolled, 1.0), PITCH, SIZE)
        fit = PROBLEM.resect(observations)
        assert PROBLEM.refine_with_main_prior(fit, observations) is fit

    def test_a_camera_that_its_lines_determine_hardly_moves_even_in_an_unusual_stadium(self):
        unusual = looking((9.0, 95.0, -27.0), (34.0, -4.0, 0.0), 3200.0, bend=BEND)
        observations = make_observations(click(unusual, 0.5, seed=2), PITCH, SIZE)
        fit = PROBLEM.resect(observations)
        refined = PROBLEM.refine_with_main_prior(fit, observations)
        spread = PROBLEM.line_noise(fit.parameters, observations).parameters
        spread = spread[X : Z + 1, X : Z + 1]
        moved = position(refined) - position(fit)
        assert moved @ np.linalg.solve(spread, moved) < 1.0

    def test_where_few_lines_leave_a_direction_open_the_camera_comes_nearer_to_the_truth(self):
        usual = looking((0.5, 70.0, -14.0), (34.0, -4.0, 0.0), 2400.0, bend=BEND)
        before, after = [], []
        for seed in range(20):
            clicks = click(usual, 1.5, seed)
            observations = make_observations(
                make_lines({name: clicks[name] for name in FEW}), PITCH, SIZE
            )
            fit = PROBLEM.resect(observations)
            refined = PROBLEM.refine_with_main_prior(fit, observations)
            before.append(np.linalg.norm(position(fit) - usual.position))
            after.append(np.linalg.norm(position(refined) - usual.position))
        assert np.mean(after) < 0.8 * np.mean(before)
