from __future__ import annotations

from dataclasses import replace

import pytest

from app.soccer.annotation import BallAnnotation
from app.soccer.group import Group
from app.soccer.policy import PAPER, STRICT, Policy
from app.soccer.solution import Solution
from app.solving.facts import GroupFacts
from app.solving.solve import (
    differs_only_in_smaller_tau,
    has_unchanged_pairs,
    rethreshold_solution,
    solve_and_collect_facts,
    solve_group,
)
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, given_view, group, view

BALL = (38.0, 2.0, -1.4)
TAU_PX = 0.01 * SIZE.diagonal


def shifted(one, down: float):
    """The view with its ball moved by so many pixels."""
    box = one.balls[0].box
    return replace(one, balls=(BallAnnotation(box=replace(box, y=box.y + down)),))


def with_tau(percent: float, policy: Policy = PAPER) -> Policy:
    return replace(policy, name="mine", tau_percent=percent)


def apart(*pixels: float, given: bool = True) -> Group:
    """Views of one ball, each with its annotation moved by so many pixels."""
    make = given_view if given else view
    cameras = (MAIN, BEHIND_GOAL, OPPOSITE)
    return group(
        *(
            shifted(make(f"{place}.png", cameras[place], BALL), down)
            for place, down in enumerate(pixels)
        )
    )


def again(found: Group, before: Policy, policy: Policy) -> tuple[Solution | None, Solution]:
    """Retold under a policy, and solved."""
    then, facts = solve_and_collect_facts(found, before, {})
    now = solve_group(found, policy)
    if not has_unchanged_pairs(facts, before, policy)[0]:
        return None, now
    return rethreshold_solution(then, facts.view_diagonal.tolist(), policy), now


class TestHasSmallerTau:
    def test_nothing_else_may_differ_but_the_name(self):
        assert differs_only_in_smaller_tau(with_tau(0.9), PAPER)
        assert not differs_only_in_smaller_tau(PAPER, PAPER)
        assert not differs_only_in_smaller_tau(with_tau(1.1), PAPER)
        assert not differs_only_in_smaller_tau(replace(with_tau(0.9), min_jac=0.8), PAPER)


class TestUndecided:
    def test_a_pair_between_the_two_taus_is_decided_anew(self):
        facts: GroupFacts = solve_and_collect_facts(apart(0.0, 0.8 * TAU_PX), PAPER, {})[1]
        error = facts.pair_errors.max() / SIZE.diagonal * 100
        assert not has_unchanged_pairs(facts, PAPER, with_tau(0.99 * error))[0]
        assert has_unchanged_pairs(facts, PAPER, with_tau(1.01 * error))[0]


class TestRetold:
    @pytest.mark.parametrize(
        ("pixels", "kind"),
        [
            ((0.0, 0.0, 0.0), None),
            ((0.0, 0.2 * TAU_PX), None),
            ((0.0, 0.1 * TAU_PX, 6 * TAU_PX), "view_disagrees"),
            ((0.0, 8 * TAU_PX), "not_synchronous"),
        ],
    )
    @pytest.mark.parametrize("given", [True, False])
    def test_is_what_solving_says(self, pixels, kind, given):
        told, solved = again(apart(*pixels, given=given), PAPER, with_tau(0.9))
        assert told == solved
        assert kind is None or kind in [item.kind for item in solved.findings]

    def test_holds_under_a_policy_that_asks_for_more(self):
        told, solved = again(apart(0.0, 0.1 * TAU_PX, 0.0), STRICT, with_tau(0.45, STRICT))
        assert told == solved
        assert told is not None

    def test_a_view_that_counts_and_is_missed_is_told_or_left_to_the_solver(self):
        """A and C disagree by more than tau, and each of them agrees with B."""
        of = apart(0.9 * TAU_PX, 0.0, -0.9 * TAU_PX)
        solution = solve_group(of, PAPER)
        errors = [seen.ball.error_px / TAU_PX for seen in solution.views if seen.ball is not None]
        told, solved = again(of, PAPER, with_tau(0.99 * max(errors)))
        assert told is None or told == solved
        then, facts = solve_and_collect_facts(of, PAPER, {})
        least = with_tau(0.99 * max(errors))
        assert rethreshold_solution(then, facts.view_diagonal.tolist(), least) is None

    def test_leaves_turned_views_to_the_solver(self):
        then, facts = solve_and_collect_facts(apart(0.0, 0.0), PAPER, {})
        turned = replace(then, findings=(replace(PLAIN, kind="sides_swapped"), *then.findings))
        assert rethreshold_solution(turned, facts.view_diagonal.tolist(), with_tau(0.9)) is None


PLAIN = solve_group(apart(0.0, 8 * TAU_PX), PAPER).findings[0]
