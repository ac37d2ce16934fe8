"""Dataset noise: lines first, then balls with the cameras that follow from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.soccer.policy import PAPER, Policy
from app.solving.dataset_noise import DatasetNoise, NoiseGroup, estimate_noise
from app.solving.solve import solve
from tests.bench.cases import Case, Made, make_case
from tests.bench.truth import noise_used

GROUPS = 12
FINE = Case("fine clicks", ball_px=0.5, line_px=0.4, views=(3, 3))


@pytest.fixture(scope="module")
def fine() -> list[Made]:
    """Groups whose clicks are better than an image alone is believed."""
    return make_case(FINE, GROUPS, 20261128)


def told(made: list[Made], policy: Policy) -> DatasetNoise:
    seen = [NoiseGroup.of(one.group, solve(one.group, policy), policy) for one in made]
    return estimate_noise(seen, policy)


def test_what_is_estimated_once_it_is_used_is_the_same(fine: list[Made]) -> None:
    first = told(fine, PAPER)
    again = told(fine, noise_used(first, PAPER))
    assert first.lines is not None and again.lines is not None
    assert first.ball.click is not None and again.ball.click is not None
    assert again.lines.sigma.value == pytest.approx(first.lines.sigma.value, rel=1e-6)
    assert again.lines.share.value == pytest.approx(first.lines.share.value, abs=1e-6)
    assert again.ball.click.value == pytest.approx(first.ball.click.value, rel=1e-4)
    assert again.ball.share == pytest.approx(first.ball.share, abs=1e-4)


def test_balls_are_asked_with_the_cameras_that_the_lines_make(fine: list[Made]) -> None:
    """Believed to be worse than they are, cameras would explain what the clicks are off."""
    seen = [NoiseGroup.of(one.group, solve(one.group, PAPER), PAPER) for one in fine]
    found = estimate_noise(seen, PAPER)
    alone = [miss for group in seen for miss in group.misses(PAPER)]
    asked = [miss for some in found.misses for miss in some]
    assert found.lines is not None and found.lines.sigma.value == pytest.approx(0.2, rel=0.15)
    assert np.mean([miss.known for miss in asked]) < 0.5 * np.mean([miss.known for miss in alone])


def test_the_covariances_are_those_that_solving_makes(fine: list[Made]) -> None:
    calibration = replace(PAPER.calibration, line_sigma_px=0.3, line_share=0.2)
    policy = replace(PAPER, calibration=calibration)
    group = fine[0].group
    quick = NoiseGroup.of(group, solve(group, PAPER), PAPER).misses(policy)
    whole = NoiseGroup.of(group, solve(group, policy), policy).misses(policy)
    for one, other in zip(quick, whole, strict=True):
        assert one.known == pytest.approx(other.known, rel=1e-6)
        assert abs(one.miss) == pytest.approx(abs(other.miss), rel=1e-6)


def test_nothing_solved_leaves_a_policy_as_it_is() -> None:
    found = estimate_noise([], PAPER)
    assert (found.lines, found.ball.click, noise_used(found, PAPER)) == (None, None, PAPER)
