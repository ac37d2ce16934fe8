"""Margins of the gates: shares of their thresholds."""

from dataclasses import replace

import pytest

from app.features.solutions.codec import summarize_solution
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, group, view

BALL = (38.0, 2.0, -1.4)
ASKED = replace(PAPER, min_parallax_degrees=20.0, max_sigma_m=0.5)


@pytest.fixture(scope="module")
def clean():
    return group(
        view("7.png", MAIN, BALL),
        view("7_1.png", BEHIND_GOAL, BALL),
        view("7_2.png", OPPOSITE, BALL),
    )


def gate(solution, name):
    return next(gate for gate in solution.gates if gate.name == name)


@pytest.mark.parametrize("name", ["calibratable", "jac", "two_views", "ball", "baseline"])
def test_a_gate_that_asks_for_at_least_says_what_is_left_as_a_share(clean, name):
    found = gate(solve_group(clean, ASKED), name)
    assert found.margin == pytest.approx((found.value - found.threshold) / found.threshold)
    assert found.passed and found.margin >= 0


@pytest.mark.parametrize("name", ["reprojection", "sigma"])
def test_a_gate_that_asks_for_at_most_says_what_is_left_as_a_share(clean, name):
    found = gate(solve_group(clean, ASKED), name)
    assert found.margin == pytest.approx((found.threshold - found.value) / found.threshold)
    assert found.passed and 0 < found.margin <= 1


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"min_jac": 1.5}, "jac"),
        ({"min_baseline_m": 500.0}, "baseline"),
        ({"tau_percent": 1e-9}, "reprojection"),
        ({"min_parallax_degrees": 179.0}, "parallax"),
        ({"max_sigma_m": 1e-6}, "sigma"),
    ],
)
def test_the_gate_that_fails_misses_its_threshold_by_a_negative_share(clean, change, name):
    policy = replace(ASKED, **change)
    solution = solve_group(clean, policy)
    failing = solution.first_failing
    assert failing is not None and failing.name == name
    assert failing.margin is not None and failing.margin < 0
    assert summarize_solution(clean, solution).margin == failing.margin


def test_a_threshold_of_zero_leaves_no_share_and_judges_as_before(clean):
    policy = replace(ASKED, min_jac=0.0, min_baseline_m=0.0, max_sigma_m=0.0)
    solution = solve_group(clean, policy)
    assert gate(solution, "jac").margin is None and gate(solution, "jac").passed
    assert gate(solution, "baseline").margin is None and gate(solution, "baseline").passed
    assert gate(solution, "sigma").margin is None and not gate(solution, "sigma").passed


def test_the_margin_of_a_group_that_passes_is_the_smallest_share(clean):
    solution = solve_group(clean, ASKED)
    judged = ("jac", "baseline", "reprojection", "parallax", "sigma")
    smallest = min(gate(solution, name).margin for name in judged)
    found = summarize_solution(clean, solution)
    assert found.margin == found.value == smallest
