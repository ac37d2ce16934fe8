"""The engine of the gates: laws on random groups, thresholds by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.geometry.resection import parameters_from_camera
from app.soccer.policy import PAPER, Policy
from app.soccer.solution import GATES
from app.solving.ball_covariance import CovarianceOfMeanBall
from app.solving.facts import GroupFacts, collect_facts_of_views, join_facts
from app.solving.judgement import (
    PASSES,
    Judgement,
    compute_view_jac,
    find_first_failed_gates,
    judge_groups,
    judge_with_known_view_failures,
    recompare_thresholds,
)
from tests.unit.solving.conftest import MAIN
from tests.unit.solving.random_groups import random_policy, random_views


def judged(facts: GroupFacts, policy: Policy = PAPER) -> Judgement:
    return judge_groups(facts, policy, CovarianceOfMeanBall(facts))


def facts(views: int = 2, **changes: object) -> GroupFacts:
    """A group whose views all see the ball, with a pair of the first two that is in good order."""
    pairs = 1 if views > 1 else 0
    made = GroupFacts(
        groups=1,
        view_group=np.zeros(views, np.int64),
        view_included=np.ones(views, bool),
        view_camera=np.ones(views, bool),
        view_given=np.zeros(views, bool),
        view_measured=np.ones(views, bool),
        view_ball=np.ones(views, bool),
        view_diagonal=np.full(views, 1000.0),
        view_position=np.array([[10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [-5.0, 0.0, 0.0]])[:views],
        view_parameters=np.zeros((views, 8)),
        view_covariance=np.zeros((views, 8, 8)),
        view_ball_px=np.zeros(views),
        view_slope=np.full((views, 2, 3), np.nan),
        view_axis=np.full((views, 3), np.nan),
        view_agreement=np.full(views, np.nan),
        view_noise=np.ones(views),
        view_picture=np.zeros((views, 3, 11)),
        view_stretch=np.tile([1.0, 0.0], (views, 1)),
        mark_view=np.repeat(np.arange(views), 4),
        mark_px=np.tile([1.0, 2.0, 3.0, 4.0], views),
        pair_group=np.zeros(pairs, np.int64),
        pair_view=np.array([[0, 1]])[:pairs],
        pair_errors=np.array([[3.0, 4.0]])[:pairs],
        pair_front=np.ones(pairs, bool),
        pair_baseline=np.full(pairs, 14.0),
        pair_parallax=np.full(pairs, 90.0),
        pair_point=np.zeros((pairs, 3)),
        pair_moved=np.zeros((pairs, 2, 2, 2, 3)),
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def three(**changes: object) -> GroupFacts:
    """Three views with a pair of each two, in good order."""
    pairs = {
        "pair_group": np.zeros(3, np.int64),
        "pair_view": np.array([[0, 1], [0, 2], [1, 2]]),
        "pair_errors": np.full((3, 2), 3.0),
        "pair_front": np.ones(3, bool),
        "pair_baseline": np.array([14.0, 15.0, 11.0]),
        "pair_parallax": np.full(3, 45.0),
        "pair_point": np.zeros((3, 3)),
        "pair_moved": np.zeros((3, 2, 2, 2, 3)),
    }
    return facts(3, **{**pairs, **changes})


STRICTER: dict[str, Callable[[float | None], float]] = {
    "min_jac": lambda jac: jac + 0.2,
    "min_agreement": lambda agreement: (agreement or 0.0) + 0.2,
    "tau_percent": lambda tau: tau / 3,
    "min_baseline_m": lambda baseline: baseline + 20.0,
    "min_parallax_degrees": lambda parallax: (parallax or 0.0) + 10.0,
    "max_sigma_m": lambda sigma: (sigma or 1.0) / 2,
    "min_p_value": lambda p_value: (p_value or 0.0) + 0.7,
}
"""A stricter value of each threshold."""


def _pairs_of_groups(facts: GroupFacts, judgement: Judgement) -> np.ndarray:
    """How many valid pairs each group has."""
    return np.bincount(facts.pair_group[judgement.valid], minlength=facts.groups)


def failing(judgement: Judgement) -> list[str]:
    return [name for name, fails in zip(GATES, judgement.failed[:, 0], strict=True) if fails]


class TestJudge:
    @given(st.lists(st.integers(0, 10_000), min_size=1, max_size=8), st.integers(0, 1000))
    @settings(max_examples=40, deadline=None)
    def test_a_table_is_judged_as_each_of_its_groups_alone_bit_by_bit(self, seeds, seed):
        policy = random_policy(seed)
        parts = [collect_facts_of_views(*random_views(seed)) for seed in seeds]
        together, alone = (
            judged(join_facts(parts), policy),
            [judged(part, policy) for part in parts],
        )
        for item in fields(Judgement):
            axis = 1 if item.name == "failed" else 0
            pieces = np.concatenate([getattr(one, item.name) for one in alone], axis=axis)
            assert np.array_equal(getattr(together, item.name), pieces, equal_nan=True), item.name

    @given(st.lists(st.integers(0, 10_000), min_size=1, max_size=8), st.integers(0, 1000))
    @settings(max_examples=40, deadline=None)
    def test_where_only_the_first_gate_matters_the_first_is_the_same(self, seeds, seed):
        policy = random_policy(seed)
        found = join_facts([collect_facts_of_views(*random_views(seed)) for seed in seeds])
        jac = compute_view_jac(found, policy.jac_gamma_percent)
        standing, uncertainty = (
            find_first_failed_gates(found, jac, policy),
            CovarianceOfMeanBall(found),
        )
        told = judge_with_known_view_failures(
            found, policy, uncertainty, jac, standing, first_alone=True
        )
        assert told.first_failed_gates.tolist() == judged(found, policy).first_failed_gates.tolist()

    def test_a_view_that_does_not_count_has_no_part_in_sigma_and_residuals(self):
        policy = replace(PAPER, max_sigma_m=0.1, min_p_value=0.05, given_sigma_px=1.0)
        sigma, compared = GATES.index("sigma"), 0
        for seed in range(200):
            views, calibrations = random_views(seed)
            whole = collect_facts_of_views(views, calibrations)
            judgement = judged(whole, policy)
            counted = sorted(set(whole.pair_view[judgement.valid].ravel().tolist()))
            if not counted or len(counted) == len(views):
                continue
            rest = collect_facts_of_views(
                [views[place] for place in counted], [calibrations[place] for place in counted]
            )
            alone = judged(rest, policy)
            assert alone.failed[sigma:, 0].tolist() == judgement.failed[sigma:, 0].tolist(), seed
            compared += 1
        assert compared > 20

    @pytest.mark.parametrize("threshold", STRICTER)
    def test_each_stricter_threshold_stops_some_and_lets_nothing_more_through(self, threshold):
        whole, stopped = (
            join_facts([collect_facts_of_views(*random_views(seed)) for seed in range(150)]),
            0,
        )
        for seed in range(12):
            policy = random_policy(seed)
            stricter = STRICTER[threshold](getattr(policy, threshold))
            before = judged(whole, policy)
            after = judged(whole, replace(policy, **{threshold: stricter}))
            assert not (after.valid & ~before.valid).any()
            alike = _pairs_of_groups(whole, after) == _pairs_of_groups(whole, before)
            assert not (alike & after.passing_groups & ~before.passing_groups).any()
            stopped += int((before.passing_groups & ~after.passing_groups).sum())
        assert stopped

    def test_random_groups_and_policies_reach_every_gate(self):
        whole = join_facts([collect_facts_of_views(*random_views(seed)) for seed in range(150)])
        first = np.concatenate(
            [judged(whole, random_policy(seed)).first_failed_gates for seed in range(12)]
        )
        assert set(first.tolist()) == set(range(PASSES + 1))

    @pytest.mark.parametrize(
        ("policy", "fails"),
        [
            (replace(PAPER, tau_percent=0.4), []),
            (replace(PAPER, min_baseline_m=14.0), []),
            (replace(PAPER, min_parallax_degrees=90.0), []),
            (replace(PAPER, min_jac=1.0), ["jac", "two_views", "ball"]),
        ],
    )
    def test_what_equals_a_threshold_passes_but_jac_must_exceed_it(self, policy, fails):
        right = {"pair_parallax": np.array([90.0]), "pair_point": np.array([[0.0, 0.0, 0.0]])}
        judgement = judged(facts(**right), policy)
        assert failing(judgement)[: len(fails)] == fails
        assert judgement.passing_groups[0] == (not fails)

    def test_a_group_in_good_order_passes(self):
        judgement = judged(facts())
        assert failing(judgement) == []
        assert (judgement.passing_groups.tolist(), judgement.first_failed_gates.tolist()) == (
            [True],
            [PASSES],
        )
        assert judgement.point.tolist() == [[0.0, 0.0, 0.0]]
        assert (judgement.parallax.tolist(), judgement.distance.tolist()) == ([90.0], [10.0])

    def test_the_ball_is_the_mean_of_its_pairs_seen_from_the_first_view(self):
        points = np.array([[1.0, 2.0, -1.0], [3.0, 2.0, -1.0], [2.0, 5.0, -4.0]])
        judgement = judged(three(pair_point=points))
        assert judgement.point.tolist() == [[2.0, 3.0, -2.0]]
        assert judgement.distance.tolist() == pytest.approx([77**0.5])

    def test_the_parallax_of_several_pairs_is_measured_at_their_mean(self):
        point = np.tile([0.0, 0.0, -4.0], (3, 1))
        rays = np.array([[10.0, 0.0, 4.0], [0.0, 10.0, 4.0], [-5.0, 0.0, 4.0]])
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        widest = np.degrees(np.arccos(min(rays[a] @ rays[b] for a, b in ((0, 1), (0, 2), (1, 2)))))
        assert judged(three(pair_point=point)).parallax.tolist() == pytest.approx([widest])

    def test_the_parallax_of_one_pair_is_its_own(self):
        assert judged(facts(pair_parallax=np.array([45.0]))).parallax.tolist() == [45.0]

    def test_one_without_a_camera_is_not_to_blame_where_another_falls(self):
        marks = np.repeat([1.0, 1.0, 9.0], 4)
        judgement = judged(three(view_camera=np.array([True, False, True]), mark_px=marks))
        assert failing(judgement)[:2] == ["jac", "two_views"]

    def test_a_view_without_ball_is_no_second_view_of_it(self):
        none = {name: getattr(facts(1), name) for name in dir(facts()) if name.startswith("pair_")}
        assert np.isnan(judged(facts(view_ball=np.array([True, False]), **none)).baseline).all()

    def test_the_baseline_is_the_widest_between_views_that_are_left(self):
        marks = np.repeat([1.0, 1.0, 9.0], 4)
        assert judged(three(mark_px=marks)).baseline.tolist() == [14.0]

    def test_one_marking_that_is_found_is_all_of_them(self):
        marked = {"mark_view": np.array([0, 1, 1]), "mark_px": np.array([1.0, 1.0, 9.0])}
        assert judged(facts(**marked)).jac.tolist() == [1.0, 0.5]

    def test_two_without_a_camera_are_to_blame(self):
        judgement = judged(facts(3, view_camera=np.array([True, False, False])))
        assert failing(judgement)[:3] == ["calibratable", "two_views", "ball"]
        assert judgement.view_failed.tolist() == [PASSES, 0, 0]

    def test_lines_that_do_not_fit_are_to_blame_where_two_have_a_camera(self):
        judgement = judged(facts(3, mark_px=np.repeat([1.0, 9.0, 9.0], 4)))
        assert failing(judgement)[:2] == ["jac", "two_views"]
        assert judgement.view_failed.tolist() == [PASSES, 1, 1]
        assert judgement.pair_failed.tolist() == [1]

    def test_an_agreement_below_is_to_blame_where_the_lines_of_two_fit(self):
        found = facts(view_agreement=np.array([0.9, 0.3]))
        asked = judged(found, replace(PAPER, min_agreement=0.4))
        assert failing(asked)[:2] == ["agreement", "two_views"]
        assert asked.view_failed.tolist() == [PASSES, GATES.index("agreement")]
        assert failing(judged(found)) == []

    def test_an_agreement_may_be_just_what_is_asked_and_one_that_was_not_read_passes(self):
        found = facts(view_agreement=np.array([0.4, np.nan]))
        assert failing(judged(found, replace(PAPER, min_agreement=0.4))) == []
        assert failing(judged(found, replace(PAPER, min_agreement=1.0)))[0] == "agreement"

    def test_lines_that_do_not_fit_go_before_paint_that_does_not_agree(self):
        low = np.array([1.0, 2.0, 3.0, 4.0, *[6.0] * 4])
        found = facts(mark_px=low, view_agreement=np.array([0.9, 0.3]))
        asked = judged(found, replace(PAPER, min_agreement=0.4))
        assert failing(asked)[0] == "jac" and "agreement" not in failing(asked)

    def test_the_gate_that_leaves_too_few_views_is_to_blame(self):
        policy = replace(PAPER, min_agreement=0.4)
        one_line = np.array([*[1.0] * 4, *[1.0] * 4, *[6.0] * 4])
        paint = three(mark_px=one_line, view_agreement=np.array([0.9, 0.1, np.nan]))
        assert failing(judged(paint, policy))[:2] == ["agreement", "two_views"]
        two_lines = np.array([*[1.0] * 4, *[6.0] * 4, *[6.0] * 4])
        lines = three(mark_px=two_lines, view_agreement=np.array([0.1, 0.9, np.nan]))
        assert failing(judged(lines, policy))[:2] == ["jac", "two_views"]

    def test_what_is_left_after_a_view_that_disagrees_is_judged(self):
        found = three(view_agreement=np.array([0.9, 0.8, 0.1]))
        asked = judged(found, replace(PAPER, min_agreement=0.4))
        assert failing(asked) == []
        assert asked.valid.tolist() == [True, False, False]

    def test_jac_must_lie_above_its_threshold(self):
        """At gamma 0.35 % of 1000 px, three of four markings are found."""
        at = replace(PAPER, jac_gamma_percent=0.35)
        assert judged(facts(), at).jac.tolist() == [0.75, 0.75]
        assert "jac" in failing(judged(facts(), at))
        assert failing(judged(facts(), replace(at, min_jac=0.7499))) == []

    def test_a_camera_that_cannot_be_measured_never_falls(self):
        judgement = judged(facts(view_measured=np.zeros(2, bool)), replace(PAPER, min_jac=1.0))
        assert np.isnan(judgement.jac).all()
        assert failing(judgement) == []

    def test_a_view_that_a_person_left_out_counts_for_nothing(self):
        without = np.array([True, False, True])
        judgement = judged(facts(3, view_included=without, view_camera=np.array([1, 0, 1], bool)))
        assert judgement.view_failed.tolist() == [PASSES] * 3
        assert "calibratable" not in failing(judgement)

    @pytest.mark.parametrize(("widest", "passes"), [(1.0, True), (0.999, False)])
    def test_the_baseline_may_be_just_what_is_asked(self, widest, passes):
        judgement = judged(facts(pair_baseline=np.array([widest])))
        assert judgement.passing_groups.tolist() == [passes]
        assert judgement.pair_failed.tolist() == [PASSES if passes else GATES.index("baseline")]

    def test_one_camera_twice_is_no_metre_apart(self):
        none = {name: getattr(facts(1), name) for name in dir(facts()) if name.startswith("pair_")}
        judgement = judged(facts(**none))
        assert judgement.baseline.tolist() == [0.0]
        assert failing(judgement) == ["baseline", "reprojection"]
        assert failing(judged(facts(**none), replace(PAPER, min_baseline_m=0.0))) == [
            "reprojection"
        ]

    def test_without_two_sights_there_is_no_baseline(self):
        judgement = judged(facts(1))
        assert np.isnan(judgement.baseline).all()
        assert failing(judgement) == ["two_views", "ball", "baseline", "reprojection"]

    @pytest.mark.parametrize("errors", [(10.1, 3.0), (3.0, 10.1)])
    def test_an_error_may_be_as_large_as_tau(self, errors):
        """Of a diagonal of 1000 px, one per cent."""
        assert failing(judged(facts(pair_errors=np.array([errors])))) == ["reprojection"]
        equal = facts(pair_errors=np.minimum([errors], 10.0))
        assert failing(judged(equal)) == []

    def test_a_point_behind_a_camera_is_refused(self):
        assert failing(judged(facts(pair_front=np.array([False])))) == ["reprojection"]

    @pytest.mark.parametrize(("asked", "fails"), [(90.0, []), (90.001, ["parallax"])])
    def test_the_parallax_may_be_just_what_is_asked(self, asked, fails):
        policy = replace(PAPER, min_parallax_degrees=asked)
        assert failing(judged(facts(), policy)) == fails

    def test_the_mean_is_over_valid_pairs_and_takes_its_own_parallax(self):
        judgement = judged(
            facts(
                3,
                pair_group=np.zeros(3, np.int64),
                pair_view=np.array([[0, 1], [0, 2], [1, 2]]),
                pair_errors=np.array([[3.0, 3.0], [3.0, 3.0], [99.0, 3.0]]),
                pair_front=np.ones(3, bool),
                pair_baseline=np.full(3, 14.0),
                pair_parallax=np.full(3, 7.0),
                pair_point=np.array([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0], [50.0, 0.0, 0.0]]),
                pair_moved=np.zeros((3, 2, 2, 2, 3)),
            )
        )
        assert judgement.valid.tolist() == [True, True, False]
        assert judgement.point.tolist() == [[0.0, 0.0, 0.0]]
        assert judgement.parallax == pytest.approx([180.0])
        assert judgement.distance.tolist() == [10.0]

    def test_sigma_is_judged_where_it_is_asked(self):
        # One pixel in either view moves the point by a metre along x; a click is one pixel.
        moved = np.zeros((1, 2, 2, 2, 3))
        moved[0, :, 0, :, 0] = [0.5, -0.5]
        one = facts(
            pair_moved=moved,
            view_diagonal=np.full(2, np.hypot(1920, 1080)),
            view_given=np.ones(2, bool),
        )
        for limit, fails in ((np.sqrt(2) * 1.000001, []), (np.sqrt(2) * 0.999999, ["sigma"])):
            policy = replace(PAPER, max_sigma_m=float(limit), min_jac=0.0)
            assert failing(judged(one, policy)) == fails

    def test_a_camera_that_its_lines_leave_open_fails_every_limit_of_sigma(self):
        camera = {"view_parameters": np.tile(parameters_from_camera(MAIN, 500.0), (2, 1))}
        known = np.tile(1e-6 * np.eye(8), (2, 1, 1))
        unknown = known * np.array([1.0, 0.0])[:, None, None]
        policy = replace(PAPER, max_sigma_m=1e6, min_jac=0.0)
        assert failing(judged(facts(view_covariance=known, **camera), policy)) == []
        assert failing(judged(facts(view_covariance=unknown, **camera), policy)) == ["sigma"]
        given = facts(view_covariance=unknown, view_given=np.array([False, True]), **camera)
        assert failing(judged(given, policy)) == []

    def test_without_a_ball_what_is_asked_of_it_fails(self):
        policy = replace(PAPER, max_sigma_m=9.0, min_parallax_degrees=1.0)
        assert failing(judged(facts(1), policy))[-2:] == ["parallax", "sigma"]


class TestViewJac:
    def test_a_point_at_gamma_is_not_close(self):
        """0.2 % of 1000 px are the 2 px of the second marking."""
        assert compute_view_jac(facts(), 0.2).tolist() == [0.25, 0.25]
        assert compute_view_jac(facts(), 0.2000001).tolist() == [0.5, 0.5]

    def test_measured_with_nothing_to_see_is_zero(self):
        bare = facts(mark_view=np.empty(0, np.int64), mark_px=np.empty(0))
        assert compute_view_jac(bare, 0.5).tolist() == [0.0, 0.0]


FOUR = join_facts([facts()] * 4)
EVERYTHING_ASKED = replace(
    PAPER, min_baseline_m=14.0, min_parallax_degrees=90.0, max_sigma_m=0.5, min_p_value=0.05
)


class TestCompareAgain:
    @pytest.fixture
    def known(self) -> Judgement:
        """Four groups whose numbers are at a threshold, just beyond it, not there, and at the end."""
        return replace(
            judged(FOUR),
            baseline=np.array([14.0, 13.999, np.nan, 0.0]),
            parallax=np.array([90.0, 89.999, np.nan, 0.0]),
            failed=np.ones((PASSES, 4), bool),
        )

    sigma = np.array([0.5, 0.5001, np.nan, np.inf])
    p_value = np.array([0.05, 0.0499, np.inf, 0.0])

    def test_a_threshold_that_is_attained_is_met_and_what_is_not_known_meets_none(self, known):
        failed = recompare_thresholds(known, EVERYTHING_ASKED, self.sigma, self.p_value)
        for gate in ("baseline", "parallax", "sigma"):
            assert failed[GATES.index(gate)].tolist() == [False, True, True, True], gate
        # A group that cannot be tested is not held against its pictures.
        assert failed[GATES.index("chi_square")].tolist() == [False, True, False, True]

    def test_what_the_policy_does_not_ask_fails_nobody(self, known):
        asked = replace(
            EVERYTHING_ASKED, min_parallax_degrees=None, max_sigma_m=None, min_p_value=None
        )
        failed = recompare_thresholds(known, asked, self.sigma, self.p_value)
        assert not failed[GATES.index("parallax") :].any()
        assert failed[GATES.index("baseline")].tolist() == [False, True, True, True]

    def test_what_is_asked_for_and_not_measured_is_no_silent_pass(self, known):
        with pytest.raises(AssertionError):
            recompare_thresholds(known, EVERYTHING_ASKED, None, self.p_value)
        with pytest.raises(AssertionError):
            recompare_thresholds(known, EVERYTHING_ASKED, self.sigma, None)

    def test_gates_of_views_and_pairs_stay_and_the_verdict_that_is_known_stays_whole(self, known):
        failed = recompare_thresholds(known, EVERYTHING_ASKED, self.sigma, self.p_value)
        for gate in ("calibratable", "jac", "agreement", "two_views", "ball", "reprojection"):
            assert failed[GATES.index(gate)].all(), gate
        assert known.failed.all()
