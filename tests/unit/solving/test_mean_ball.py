from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from app.soccer.policy import PAPER
from app.soccer.solution import Ball3D, BestBall, Calibration
from app.solving.ball_covariance import MeanCovariance
from app.solving.facts import facts_of
from app.solving.judgement import judge_groups
from app.solving.mean_ball import exported_ball, judged_pairs, mean_ball
from app.solving.triangulate import ball_observations, triangulate_observation_pairs
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, given_view
from tests.unit.solving.test_solve import shifted

BALL = (38.0, 2.0, -1.4)
KEYS = ("a", "b", "c")


def solved(*shifts: float, policy=PAPER):
    """Pairs and ball of three given views whose balls are moved down by so many pixels."""
    cameras = (MAIN, BEHIND_GOAL, OPPOSITE)
    views = [
        shifted(given_view(key, camera, BALL), 0.0, shift)
        for key, camera, shift in zip(KEYS, cameras, shifts, strict=True)
    ]
    calibrations = [Calibration("given", camera) for camera in cameras]
    meetings = triangulate_observation_pairs(
        combinations(ball_observations(views, calibrations), 2)
    )
    facts = facts_of(views, calibrations, meetings)
    spread = MeanCovariance(facts)
    judgement = judge_groups(facts, policy, spread)
    return judged_pairs(meetings, judgement), mean_ball(KEYS, facts, judgement, spread, policy)


class TestJudgedPairs:
    def test_each_says_its_views_and_the_gate_that_makes_it_invalid(self):
        pairs, _ = solved(0.0, 0.0, 60.0)
        assert [(pair.a, pair.b, pair.valid, pair.failed) for pair in pairs] == [
            ("a", "b", True, None),
            ("a", "c", False, "reprojection"),
            ("b", "c", False, "reprojection"),
        ]
        assert pairs[0].point == pytest.approx(BALL, abs=1e-6)
        assert all(type(number) is float for number in pairs[0].point)


class TestMeanBall:
    def test_is_the_mean_of_the_valid_pairs(self):
        pairs, ball = solved(0.0, 3.0, -2.0)
        assert [pair.valid for pair in pairs] == [True] * 3
        assert ball.point == pytest.approx(np.mean([pair.point for pair in pairs], axis=0))
        assert ball.views == KEYS

    def test_names_only_the_views_that_it_comes_from(self):
        pairs, ball = solved(0.0, 0.0, 60.0)
        assert (ball.views, ball.point) == (("a", "b"), pairs[0].point)
        assert ball.parallax_degrees == pairs[0].parallax_degrees

    def test_its_sigma_is_that_of_its_covariance(self):
        _, ball = solved(0.0, 0.0, 0.0)
        spread = np.reshape(ball.covariance, (3, 3))
        assert ball.sigma_m == pytest.approx(np.sqrt(np.linalg.eigvalsh(spread)[-1]))
        assert np.allclose(spread, spread.T)

    def test_without_a_valid_pair_there_is_none(self):
        assert solved(0.0, 90.0, -90.0)[1] is None


class TestLeavingBall:
    MEAN = Ball3D((1.0, 2.0, -0.5), (1.0,) * 9, 0.25, 20.0, ("a", "b"))
    BEST = BestBall((1.1, 2.0, -0.4), (0.5,) * 9, 0.2, ("a", "b", "c"))
    POLICY = replace(PAPER, point="best")

    def test_the_mean_leaves_unless_the_policy_asks_for_the_most_likely_point(self):
        assert exported_ball(self.MEAN, self.BEST, PAPER) is self.MEAN
        found = exported_ball(self.MEAN, self.BEST, self.POLICY)
        assert found == Ball3D((1.1, 2.0, -0.4), (0.5,) * 9, 0.2, 20.0, ("a", "b"))

    def test_without_a_valid_pair_none_leaves_and_without_a_best_one_the_mean_does(self):
        assert exported_ball(None, self.BEST, self.POLICY) is None
        assert exported_ball(self.MEAN, None, self.POLICY) is self.MEAN
