"""The residuals of the most likely ball: zero for exact clicks, chi-square for noisy ones."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.soccer.annotation import BallAnnotation
from app.soccer.policy import PAPER
from app.soccer.solution import Calibration
from app.solving.ball_covariance import CovarianceOfMeanBall
from app.solving.chi_square import (
    ChiSquareResiduals,
    compute_leave_one_out_chi_square,
    fit_balls_and_test_residuals,
    sigma_widening,
)
from app.solving.facts import GroupFacts, collect_facts_of_views, join_facts
from app.solving.judgement import find_views_in_pairs, judge_groups
from app.solving.solve import solve_group
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, given_view, group
from tests.unit.solving.random_groups import random_policy, random_views

BALL = (38.0, 2.0, -1.4)
CAMERAS = {"a": MAIN, "b": BEHIND_GOAL, "c": OPPOSITE}
POLICY = replace(PAPER, box_sigma_share=0.0, click_sigma_px=1.5)
SIGMA = 1.5 * 1280 / 1920
"""Of a click under that policy, pixels of these views."""


def moved(view, x: float, y: float):
    box = view.balls[0].box
    return replace(view, balls=(BallAnnotation(box=replace(box, x=box.x + x, y=box.y + y)),))


def views(keys: str = "abc", noise_px: float = 0.0, seed: int = 0):
    rng = np.random.default_rng(seed)
    return [moved(given_view(key, CAMERAS[key], BALL), *rng.normal(0, noise_px, 2)) for key in keys]


def facts(keys: str = "abc", noise_px: float = 0.0, seed: int = 0) -> GroupFacts:
    calibrations = [Calibration("given", CAMERAS[key]) for key in keys]
    return collect_facts_of_views(views(keys, noise_px, seed), calibrations)


def found(of: GroupFacts, policy=POLICY, off: float = 0.0) -> ChiSquareResiduals:
    start = np.tile(np.array(BALL) + off, (of.groups, 1))
    return fit_balls_and_test_residuals(of, np.ones(len(of.view_group), bool), start, policy)


class TestResidualsOf:
    @pytest.mark.parametrize(("keys", "freedom"), [("ab", 1), ("abc", 3)])
    def test_exact_clicks_leave_nothing(self, keys: str, freedom: int) -> None:
        one = found(facts(keys))
        assert one.freedom.tolist() == [freedom]
        assert one.chi_square == pytest.approx([0.0], abs=1e-9)
        assert one.p_value == pytest.approx([1.0], abs=1e-3)
        assert one.point == pytest.approx(np.array([BALL]), abs=1e-6)

    @pytest.mark.parametrize("off", [3.0, -8.0])
    def test_a_start_far_off_leads_to_the_same_ball(self, off: float) -> None:
        noisy = facts("abc", 2.0, 4)
        assert found(noisy, off=off).chi_square == pytest.approx(found(noisy).chi_square, rel=1e-6)

    def test_the_ball_is_the_most_likely_one(self) -> None:
        for seed in range(3):
            best = solve_group(group(*views("abc", 1.0, seed)), POLICY).best_ball
            assert best is not None
            one = found(facts("abc", 1.0, seed))
            assert one.point[0] == pytest.approx(np.array(best.point), abs=1e-3)

    @pytest.mark.parametrize("keys", ["ab", "abc"])
    def test_chance_alone_makes_every_p_value_alike(self, keys: str) -> None:
        p_values = found(join_facts([facts(keys, SIGMA, seed) for seed in range(300)])).p_value
        for share in (0.05, 0.5, 0.9):
            assert abs((p_values < share).mean() - share) < 3.5 * np.sqrt(share * (1 - share) / 300)

    def test_a_click_beside_the_ball_counts_in_units_of_its_sigma(self) -> None:
        calm = replace(POLICY, click_sigma_px=3.0)
        torn = facts("abc", 6.0, 2)
        assert found(torn).chi_square == pytest.approx(4 * found(torn, calm).chi_square, rel=1e-6)

    def test_the_uncertainty_of_a_calibration_counts(self) -> None:
        torn = facts("abc", 6.0, 2)
        vague = replace(torn, view_covariance=np.tile(1e-4 * np.eye(8), (3, 1, 1)))
        vague = replace(vague, view_parameters=facts_with_parameters())
        assert found(vague).chi_square[0] < 0.5 * found(torn).chi_square[0]

    def test_one_view_alone_says_nothing(self) -> None:
        three = facts("abc")
        for used in ([True, False, False], [False, False, False]):
            one = fit_balls_and_test_residuals(three, np.array(used), np.array([BALL]), POLICY)
            assert np.isnan([one.chi_square[0], one.p_value[0], one.point[0, 0]]).all()

    def test_without_a_start_nothing_is_said(self) -> None:
        one = fit_balls_and_test_residuals(
            facts(), np.ones(3, bool), np.full((1, 3), np.nan), POLICY
        )
        assert np.isnan(one.p_value).all()

    @given(st.lists(st.integers(0, 10_000), min_size=1, max_size=6), st.integers(0, 1000))
    @settings(max_examples=25, deadline=None)
    def test_a_table_has_the_residuals_of_each_of_its_groups_bit_by_bit(self, seeds, seed):
        policy = random_policy(seed)
        parts = [collect_facts_of_views(*random_views(seed)) for seed in seeds]

        def residuals_at_ball(of: GroupFacts) -> ChiSquareResiduals:
            judgement = judge_groups(of, policy, CovarianceOfMeanBall(of))
            return fit_balls_and_test_residuals(
                of, find_views_in_pairs(of, judgement.valid), judgement.point, policy
            )

        together, alone = (
            residuals_at_ball(join_facts(parts)),
            [residuals_at_ball(part) for part in parts],
        )
        for item in fields(ChiSquareResiduals):
            pieces = np.concatenate([getattr(one, item.name) for one in alone])
            assert np.array_equal(getattr(together, item.name), pieces, equal_nan=True), item.name


def facts_with_parameters() -> np.ndarray:
    covariance = tuple((1e-4 * np.eye(8)).ravel().tolist())
    calibrations = [Calibration("lines", CAMERAS[key], covariance=covariance) for key in "abc"]
    return collect_facts_of_views(views(), calibrations).view_parameters


class TestGivenCameras:
    """Of which no known uncertainty they are."""

    ASKED = replace(POLICY, min_p_value=0.001, tau_percent=5.0)

    def judged(self, policy, seed: int, noise_px: float = 5.0):
        return solve_group(group(*views("abc", noise_px * 1280 / 1920, seed)), policy)

    def test_their_sigma_counts_in_the_residuals(self) -> None:
        policy = replace(self.ASKED, click_sigma_px=0.5, given_sigma_px=5.0)
        failed = [
            gate.name
            for seed in range(25)
            for gate in self.judged(policy, seed).gates
            if gate.name == "chi_square" and not gate.passed
        ]
        assert failed == []

    def test_without_a_sigma_they_are_not_judged(self) -> None:
        solution = self.judged(self.ASKED, 1, 15.0)
        gate = next(gate for gate in solution.gates if gate.name == "chi_square")
        assert solution.chi_square is not None and solution.chi_square.p_value < 0.001
        assert (gate.passed, gate.value) == (True, None)
        assert "no known uncertainty" in gate.sentence
        item = next(item for item in solution.findings if item.kind == "views_contradict")
        assert "The accuracy of the given cameras is not known" in item.sentence

    def test_with_a_sigma_gate_and_finding_speak(self) -> None:
        solution = self.judged(replace(self.ASKED, given_sigma_px=1.0), 1, 15.0)
        gate = next(gate for gate in solution.gates if gate.name == "chi_square")
        assert not gate.passed
        assert "views_contradict" in {item.kind for item in solution.findings}

    def test_a_covariance_is_known_by_its_trace(self) -> None:
        unknown_pan = np.diag([0.0, *[1e-6] * 7])
        one = Calibration("given", MAIN, covariance=tuple(unknown_pan.ravel().tolist()))
        none = replace(one, covariance=(0.0,) * 64)
        assert (one.is_given_without_uncertainty, none.is_given_without_uncertainty) == (
            False,
            True,
        )
        of = collect_facts_of_views(views("abc"), [one, none, replace(one, covariance=None)])
        assert of.view_bare.tolist() == [False, True, True]


class TestWideningOf:
    @pytest.mark.parametrize(
        ("chi_square", "freedom", "p_value", "times"),
        [
            (350.0, 1, 4.2e-78, 18.708),
            (3460.0, 3, 0.0, 33.961),
            (9.6, 1, 0.00195, 3.098),
            (9.5, 1, 0.00205, 1.0),
            (0.4, 3, 0.94, 1.0),
            (np.nan, 0, np.nan, 1.0),
        ],
    )
    def test_it_is_the_birge_ratio_of_views_that_contradict_each_other(
        self, chi_square: float, freedom: int, p_value: float, times: float
    ) -> None:
        numbers = (np.array([number]) for number in (chi_square, freedom, p_value))
        assert sigma_widening(*numbers) == pytest.approx([times], abs=1e-3)

    def test_the_sigma_of_a_contradicted_ball_is_wider_and_its_point_stays(self) -> None:
        calm = solve_group(group(*views("ab")), POLICY)
        views_apart = [moved(view, 0.0, 8.0 * place) for place, view in enumerate(views("ab"))]
        torn = solve_group(group(*views_apart), POLICY)
        assert torn.chi_square is not None and torn.ball is not None and calm.ball is not None
        times = np.sqrt(torn.chi_square.value)
        assert torn.chi_square.p_value < 0.002 and times > 3
        assert torn.ball.sigma_m == pytest.approx(times * calm.ball.sigma_m, rel=0.05)
        assert torn.ball.point == torn.pairs[0].point
        assert torn.best_ball is not None
        assert torn.best_ball.sigma_m == pytest.approx(torn.ball.sigma_m, rel=0.05)

    def test_gate_and_ball_have_one_sigma(self) -> None:
        of = [moved(view, 0.0, 8.0 * place) for place, view in enumerate(views("ab"))]
        ball = solve_group(group(*of), POLICY).ball
        assert ball is not None
        for limit, passes in ((ball.sigma_m * 0.999, False), (ball.sigma_m * 1.001, True)):
            gates = solve_group(group(*of), replace(POLICY, max_sigma_m=limit)).gates
            gate = next(gate for gate in gates if gate.name == "sigma")
            assert (gate.passed, gate.value) == (passes, ball.sigma_m)


class TestResidualsWithout:
    @given(st.integers(0, 10_000), st.integers(0, 1000))
    @settings(max_examples=25, deadline=None)
    def test_each_row_has_the_residuals_of_the_other_views_bit_by_bit(self, seed, policy_seed):
        of, policy = collect_facts_of_views(*random_views(seed)), random_policy(policy_seed)
        judgement = judge_groups(of, policy, CovarianceOfMeanBall(of))
        used = find_views_in_pairs(of, judgement.valid)
        rows = compute_leave_one_out_chi_square(of, used, judgement.point, policy)
        assert len(rows.chi_square) == used.sum()
        for row, place in enumerate(np.flatnonzero(used)):
            others = used & (np.arange(len(used)) != place)
            alone = fit_balls_and_test_residuals(of, others, judgement.point, policy)
            for item in fields(ChiSquareResiduals):
                one, other = getattr(rows, item.name)[row], getattr(alone, item.name)[0]
                assert np.array_equal(one, other, equal_nan=True), item.name
