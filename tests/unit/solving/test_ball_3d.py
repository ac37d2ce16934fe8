"""Where a ball can be: the ends of the pitch, of the sky, and both together."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from app.soccer.annotation import BallAnnotation
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.soccer.solution import Ball3D, BestBall, Calibration
from app.solving.ball_3d import (
    MAX_EXHAUSTIVE_VIEWS,
    _find_most_consistent_estimate,
    _grow_most_consistent_estimate,
    _ViewSubsets,
    choose_exported_ball,
    compute_mean_ball,
    explain_implausible_position,
    find_implausible_positions,
    is_plausible_position,
    judge_pairs,
)
from app.solving.ball_covariance import CovarianceOfMeanBall
from app.solving.facts import collect_facts
from app.solving.judgement import judge_groups
from app.solving.solve import solve_group
from app.solving.triangulate import collect_ball_observations, triangulate_observation_pairs
from tests.cameras import looking
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, given_view, group
from tests.unit.solving.random_groups import random_views
from tests.unit.solving.test_solve import shifted

PITCH = Pitch(105.0, 68.0)


class TestImplausible:
    @pytest.mark.parametrize(
        ("outside", "height"),
        [(10.0, 0.1), (8.0, 7.9), (5.0, 19.9), (0.0, 40.0), (-3.0, 39.0), (9.9, 0.0), (10.0, 2.0)],
    )
    def test_beside_the_pitch_a_ball_may_be_low_and_over_it_high(self, outside, height) -> None:
        assert is_plausible_position((0.0, 34.0 + outside, -height), PITCH, PAPER)

    @pytest.mark.parametrize(
        ("outside", "height", "reach"), [(8.0, 14.0, 6.5), (5.0, 20.5, 4.875), (1.0, 38.0, 0.5)]
    )
    def test_the_higher_a_ball_the_less_far_outside_it_may_be(self, outside, height, reach) -> None:
        ((number, limit, words),) = explain_implausible_position(
            (52.5 + outside, 0.0, -height), PITCH, PAPER
        )
        assert (number, limit) == (pytest.approx(outside), pytest.approx(reach))
        assert words == f"is {outside:.0f} m outside the pitch at a height of {height:.2f} m"

    def test_each_end_alone_has_its_own_words(self) -> None:
        found = explain_implausible_position((0.0, 62.0, 10.2), PITCH, PAPER)
        assert [words for _, _, words in found] == [
            "lies 10.20 m below the grass",
            "is 28 m outside the pitch",
        ]
        ((number, limit, words),) = explain_implausible_position((0.0, 0.0, -41.0), PITCH, PAPER)
        assert (number, limit, words) == (41.0, 40.0, "flies 41.00 m above the grass")

    def test_many_places_are_judged_as_each_alone(self) -> None:
        generator = np.random.default_rng(5)
        points = generator.uniform((-75, -55, -50), (75, 55, 3), (2000, 3))
        points[:4] = [(0, 34 + 8, -8), (52.5 + 8, 0, -14), (0, 44, -2), (0, 0, -40)]
        wrong = find_implausible_positions(points, np.tile((105.0, 68.0), (2000, 1)), PAPER)
        told = [bool(explain_implausible_position((x, y, z), PITCH, PAPER)) for x, y, z in points]
        alone = [not is_plausible_position((x, y, z), PITCH, PAPER) for x, y, z in points]
        assert wrong.tolist() == told == alone
        assert 0 < sum(told) < 2000


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
    sights = collect_ball_observations(views, calibrations)
    meetings = triangulate_observation_pairs(combinations(sights, 2))
    facts = collect_facts(views, calibrations, sights, meetings)
    spread = CovarianceOfMeanBall(facts)
    judgement = judge_groups(facts, policy, spread)
    return judge_pairs(meetings, judgement), compute_mean_ball(
        KEYS, facts, judgement, spread, policy
    )


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
        assert choose_exported_ball(self.MEAN, self.BEST, PAPER) is self.MEAN
        found = choose_exported_ball(self.MEAN, self.BEST, self.POLICY)
        assert found == Ball3D((1.1, 2.0, -0.4), (0.5,) * 9, 0.2, 20.0, ("a", "b"))

    def test_without_a_valid_pair_none_leaves_and_without_a_best_one_the_mean_does(self):
        assert choose_exported_ball(None, self.BEST, self.POLICY) is None
        assert choose_exported_ball(self.MEAN, None, self.POLICY) is self.MEAN


CAMERAS = {"a": MAIN, "b": BEHIND_GOAL, "c": OPPOSITE}


def moved(view, x, y):
    box = view.balls[0].box
    return replace(view, balls=(BallAnnotation(box=replace(box, x=box.x + x, y=box.y + y)),))


def views(sigma_px=0.0, seed=0):
    generator = np.random.default_rng(seed)
    return [
        moved(given_view(key, camera, BALL), *generator.normal(0, sigma_px, 2))
        for key, camera in CAMERAS.items()
    ]


class TestBestBall:
    def test_exact_clicks_give_the_exact_point(self):
        best = solve_group(group(*views()), PAPER).best_ball
        assert np.allclose(best.point, BALL, atol=1e-9)
        assert best.views == ("a", "b", "c")

    def test_one_bad_view_does_no_harm_and_is_named(self):
        a, b, c = views()
        best = solve_group(group(a, b, moved(c, 0.0, 60.0)), PAPER).best_ball
        assert best.contradicting == ("c",)
        assert np.allclose(best.point, BALL, atol=1e-6)

    def test_the_truth_lies_where_the_covariance_says(self):
        # Clicks as noisy as the policy says: a chi-squared with three degrees of freedom.
        policy = replace(PAPER, box_sigma_share=0.0, click_sigma_px=1.5)
        sigma = 1.5 * 1280 / 1920
        inside = 0
        for seed in range(300):
            best = solve_group(group(*views(sigma, seed)), policy).best_ball
            off = np.array(best.point) - BALL
            inside += off @ np.linalg.solve(np.reshape(best.covariance, (3, 3)), off) < 7.815
        assert 0.92 <= inside / 300 <= 0.98

    def test_two_views_that_contradict_each_other_say_so_by_their_covariance(self):
        a, b, _ = views()
        calm = solve_group(group(a, b), PAPER).best_ball
        torn = solve_group(group(a, moved(b, 0.0, 15.0)), PAPER).best_ball
        assert torn.sigma_m > 2 * calm.sigma_m

    def test_influence_is_how_far_the_point_moves_without_a_view(self):
        best = solve_group(group(*views(1.0, 3)), PAPER).best_ball
        assert [view for view, _ in best.influence_m] == ["a", "b", "c"]
        assert all(0 < metres < 0.5 for _, metres in best.influence_m)

    def test_one_view_gives_none(self):
        assert solve_group(group(views()[0]), PAPER).best_ball is None

    def test_subsets_of_views_have_together_the_bits_that_each_has_alone(self):
        views = _ViewSubsets(collect_ball_observations(*random_views(11)), PAPER)
        chosen = list(combinations(range(len(views.observations)), 2))
        starts = [np.array([0.0, 0.0, -1.0])] * len(chosen)
        together = views.estimate_subsets(chosen, starts)
        assert len([found for found in together if found is not None]) > 2
        for at, found in enumerate(together):
            (alone,) = views.estimate_subsets([chosen[at]], [starts[at]])
            assert repr(alone) == repr(found)

    def test_a_view_of_which_nothing_can_be_computed_takes_no_other_along(self):
        views = _ViewSubsets(collect_ball_observations(*random_views(11)), PAPER)
        chosen, start = [(0, 1), (0, 2)], np.array([0.0, 0.0, -1.0])
        alone = views.estimate_subsets([chosen[1]], [start])
        # NumPy gives up on all matrices of a call where one has no eigenvalues.
        lost = views.estimate_subsets(chosen, [np.full(3, np.nan), start])
        assert repr(lost) == repr([None, *alone])


class CountingSubsets(_ViewSubsets):
    """Says how many estimates were asked for."""

    asked = 0

    def estimate_subsets(self, chosen, starts):
        self.asked += len(chosen)
        return super().estimate_subsets(chosen, starts)


def around(count, bad, seed):
    """Views and pairs of cameras around the pitch; the balls of ``bad`` are somewhere else."""
    generator = np.random.default_rng(seed)
    angles = 2 * np.pi * (np.arange(count) + generator.uniform(0, 0.8, count)) / count
    seen = []
    for number, angle in enumerate(angles.tolist()):
        place = (75 * np.cos(angle), 60 * np.sin(angle), -generator.uniform(5, 25))
        camera = looking(place, (38.0, 2.0, 0.0), 1800.0)
        off = generator.normal(0, 0.6, 2)
        if number in bad:
            turn = generator.uniform(0, 2 * np.pi)
            off = generator.uniform(15, 90) * np.array([np.cos(turn), np.sin(turn)])
        seen.append(moved(given_view(f"{number:02}", camera, BALL), *off))
    calibrations = [Calibration("given", view.station.given) for view in seen]
    observations = collect_ball_observations(seen, calibrations)
    points = triangulate_observation_pairs(combinations(observations, 2))
    starts = {frozenset((pair.a.view, pair.b.view)): pair.point for pair in points if pair.in_front}
    return CountingSubsets(observations, PAPER), starts


class TestManyViews:
    @pytest.mark.parametrize("seed", range(6))
    @pytest.mark.parametrize(
        ("count", "bad"), [(26, {3, 8, 9, 20}), (40, set(range(0, 40, 3))), (30, set(range(18)))]
    )
    def test_the_views_that_agree_are_found_with_few_estimates(self, count, bad, seed) -> None:
        views, starts = around(count, bad, seed)
        found = _find_most_consistent_estimate(views, starts)
        assert set(found.numbers) >= set(range(count)) - bad
        assert len(set(found.numbers) & bad) <= 1
        assert np.linalg.norm(found.point - BALL) < 0.1
        assert views.asked <= count * (count - 1) / 2 + 5 * count

    @pytest.mark.parametrize("seed", range(12))
    def test_they_are_those_that_trying_each_set_finds(self, seed) -> None:
        views, starts = around(MAX_EXHAUSTIVE_VIEWS, {1, 4, 7}, seed)
        every = _find_most_consistent_estimate(views, starts)
        grown = _grow_most_consistent_estimate(views, starts)
        assert every.numbers == grown.numbers
        assert grown.point == pytest.approx(every.point, abs=1e-5)

    def test_a_group_of_many_views_has_a_best_ball(self) -> None:
        generator = np.random.default_rng(3)
        seen = []
        for number, angle in enumerate(np.linspace(0, 6, 25).tolist()):
            camera = looking((75 * np.cos(angle), 60 * np.sin(angle), -15.0), (38, 2, 0), 1800.0)
            view = given_view(f"{number:02}", camera, BALL)
            seen.append(moved(view, *generator.normal(0, 0.6, 2)))
        seen[5] = moved(seen[5], 0.0, 40.0)
        best = solve_group(group(*seen), PAPER).best_ball
        assert best.contradicting == ("05",)
        assert np.linalg.norm(np.array(best.point) - BALL) < 0.1
