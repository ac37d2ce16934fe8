from dataclasses import replace
from itertools import combinations

import numpy as np

from app.soccer.annotation import BallAnnotation
from app.soccer.policy import PAPER
from app.solving.best_ball import _ViewSubsets
from app.solving.solve import solve
from app.solving.triangulate import ball_observations
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, given_view, group
from tests.unit.solving.random_groups import random_views

BALL = (38.0, 2.0, -1.4)
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
        best = solve(group(*views()), PAPER).best_ball
        assert np.allclose(best.point, BALL, atol=1e-9)
        assert best.views == ("a", "b", "c")

    def test_one_bad_view_does_no_harm_and_is_named(self):
        a, b, c = views()
        best = solve(group(a, b, moved(c, 0.0, 60.0)), PAPER).best_ball
        assert best.contradicting == ("c",)
        assert np.allclose(best.point, BALL, atol=1e-6)

    def test_the_truth_lies_where_the_covariance_says(self):
        # Clicks as noisy as the policy says: a chi-squared with three degrees of freedom.
        policy = replace(PAPER, box_sigma_share=0.0, click_sigma_px=1.5)
        sigma = 1.5 * 1280 / 1920
        inside = 0
        for seed in range(300):
            best = solve(group(*views(sigma, seed)), policy).best_ball
            off = np.array(best.point) - BALL
            inside += off @ np.linalg.solve(np.reshape(best.covariance, (3, 3)), off) < 7.815
        assert 0.92 <= inside / 300 <= 0.98

    def test_two_views_that_contradict_each_other_say_so_by_their_covariance(self):
        a, b, _ = views()
        calm = solve(group(a, b), PAPER).best_ball
        torn = solve(group(a, moved(b, 0.0, 15.0)), PAPER).best_ball
        assert torn.sigma_m > 2 * calm.sigma_m

    def test_influence_is_how_far_the_point_moves_without_a_view(self):
        best = solve(group(*views(1.0, 3)), PAPER).best_ball
        assert [view for view, _ in best.influence_m] == ["a", "b", "c"]
        assert all(0 < metres < 0.5 for _, metres in best.influence_m)

    def test_one_view_gives_none(self):
        assert solve(group(views()[0]), PAPER).best_ball is None

    def test_subsets_of_views_have_together_the_bits_that_each_has_alone(self):
        views = _ViewSubsets(ball_observations(*random_views(11)), PAPER)
        chosen = list(combinations(range(len(views.observations)), 2))
        starts = [np.array([0.0, 0.0, -1.0])] * len(chosen)
        together = views.estimate_subsets(chosen, starts)
        assert len([found for found in together if found is not None]) > 2
        for at, found in enumerate(together):
            (alone,) = views.estimate_subsets([chosen[at]], [starts[at]])
            assert repr(alone) == repr(found)

    def test_a_view_of_which_nothing_can_be_computed_takes_no_other_along(self):
        views = _ViewSubsets(ball_observations(*random_views(11)), PAPER)
        chosen, start = [(0, 1), (0, 2)], np.array([0.0, 0.0, -1.0])
        alone = views.estimate_subsets([chosen[1]], [start])
        # NumPy gives up on all matrices of a call where one has no eigenvalues.
        lost = views.estimate_subsets(chosen, [np.full(3, np.nan), start])
        assert repr(lost) == repr([None, *alone])
