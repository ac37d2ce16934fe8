"""Dataset noise: lines first, then balls with the cameras that follow from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtri

from app.soccer.policy import PAPER, Policy
from app.solving.ball_noise import RayResidual
from app.solving.dataset_noise import (
    BallSource,
    DatasetNoise,
    GroupNoiseInputs,
    SourceNoise,
    SourceNoiseFactors,
    estimate_noise,
    estimate_source_noise,
)
from app.solving.solve import solve_group
from tests.bench.cases import Case, Made, make_case
from tests.bench.truth import noise_used

GROUPS = 12
FINE = Case("fine clicks", ball_px=0.5, line_px=0.4, views=(3, 3))


@pytest.fixture(scope="module")
def fine() -> list[Made]:
    """Groups whose clicks are better than an image alone is believed."""
    return make_case(FINE, GROUPS, 20261128)


def told(made: list[Made], policy: Policy) -> DatasetNoise:
    seen = [GroupNoiseInputs.of(one.group, solve_group(one.group, policy), policy) for one in made]
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
    seen = [GroupNoiseInputs.of(one.group, solve_group(one.group, PAPER), PAPER) for one in fine]
    found = estimate_noise(seen, PAPER)
    alone = [miss for group in seen for miss in group.ray_residuals(PAPER)]
    asked = [miss for some in found.misses for miss in some]
    assert found.lines is not None and found.lines.sigma.value == pytest.approx(0.2, rel=0.15)
    assert np.mean([miss.known for miss in asked]) < 0.5 * np.mean([miss.known for miss in alone])


def test_the_covariances_are_those_that_solving_makes(fine: list[Made]) -> None:
    calibration = replace(PAPER.calibration, line_sigma_px=0.3, line_share=0.2)
    policy = replace(PAPER, calibration=calibration)
    group = fine[0].group
    quick = GroupNoiseInputs.of(group, solve_group(group, PAPER), PAPER).ray_residuals(policy)
    whole = GroupNoiseInputs.of(group, solve_group(group, policy), policy).ray_residuals(policy)
    for one, other in zip(quick, whole, strict=True):
        assert one.known == pytest.approx(other.known, rel=1e-6)
        assert abs(one.miss) == pytest.approx(abs(other.miss), rel=1e-6)


def test_nothing_solved_leaves_a_policy_as_it_is() -> None:
    found = estimate_noise([], PAPER)
    assert (found.lines, found.ball.click, noise_used(found, PAPER)) == (None, None, PAPER)


TRUE = {"ann": 1.0, "bea": 1.0, "cleo": 3.0, "dora": 0.5}
KNOWN = 0.2
Seen = tuple[RayResidual, Mapping[str, Sequence[BallSource]]]


def person(name: str) -> BallSource:
    return BallSource("person", name)


def camera(name: str) -> BallSource:
    return BallSource("camera", name)


def drawn(
    seed: int,
    true: Mapping[str, float] = TRUE,
    count: int = 400,
    mistakes: float = 0.02,
    known: float = KNOWN,
) -> list[Seen]:
    """Misses of two views each, placed by two people or one; some are mistakes."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(count):
        a, b = rng.choice(list(true), 2)
        part = rng.uniform(0.2, 0.8)
        variance = part * true[a] ** 2 + (1 - part) * true[b] ** 2 + known
        miss = rng.normal(0, np.sqrt(variance)) * (30 if rng.random() < mistakes else 1)
        by_view = (("left", part, 0.0, 0.0), ("right", 1 - part, 0.0, 0.0))
        of = {"left": [person(a)], "right": [person(b)]}
        found.append((RayResidual(miss, 1.0, 0.0, 0.0, known, by_view), of))
    return found


def filmed(seed: int, placed: Mapping[str, Sequence[str]], true: Mapping[str, float]) -> list[Seen]:
    """Misses of cameras two by two, each placed by one of its people; ``true`` of both multiply."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(600):
        cameras = rng.choice(list(placed), 2, replace=False)
        people = [rng.choice(placed[name]) for name in cameras]
        sigmas = [
            true.get(at, 1.0) * true.get(who, 1.0) for at, who in zip(cameras, people, strict=True)
        ]
        miss = rng.normal(0, np.hypot(*sigmas) / np.sqrt(2))
        by_view = (("left", 0.5, 0.0, 0.0), ("right", 0.5, 0.0, 0.0))
        of = {
            view: [camera(at), person(who)]
            for view, at, who in zip(("left", "right"), cameras, people, strict=True)
        }
        found.append((RayResidual(miss, 1.0, 0.0, 0.0, 0.0, by_view), of))
    return found


def factors(seen: Sequence[Seen], click: float = 1.2) -> SourceNoiseFactors:
    return estimate_source_noise(seen, click, 0.0, 0.0)


def estimated(*seen: Seen) -> dict[str, SourceNoise]:
    return {one.source: one for one in factors(seen).noise_of_kind("person")}


class TestEstimateSources:
    def test_each_is_as_noisy_as_it_is_and_the_noisiest_comes_first(self) -> None:
        inside = []
        for seed in range(20):
            found = estimated(*drawn(seed))
            assert next(iter(found)) == "cleo" and found["cleo"].differs
            inside += [found[name].low < true < found[name].high for name, true in TRUE.items()]
        assert np.mean(inside) > 0.88

    def test_mistakes_make_nobody_noisy(self) -> None:
        """They are a fifth of all, and thirty times too far off."""
        found = [estimated(*drawn(seed, mistakes=0.2))["cleo"].sigma_px for seed in range(10)]
        assert np.median(found) == pytest.approx(3.0, rel=0.2)

    def test_who_is_ten_times_as_noisy_is_not_taken_for_a_row_of_mistakes(self) -> None:
        """Seen from the dataset's noise nearly all of their misses are mistakes."""
        found = [estimated(*drawn(seed, {"ann": 1.0, "bea": 1.0, "cleo": 12.0})) for seed in (1, 2)]
        assert [one["cleo"].ratio for one in found] == pytest.approx([10, 10], rel=0.25)

    def test_honest_misses_that_are_taken_for_mistakes_are_made_up_for(self) -> None:
        """Two people whose misses are normal without chance: the noise is theirs to a thousandth."""
        misses = 1.2 * ndtri((np.arange(3000) + 0.5) / 3000)
        seen: list[Seen] = [
            (
                RayResidual(miss, 1.0, 0.0, 0.0, 0.0, (("left", 1.0, 0.0, 0.0),)),
                {"left": [person(name)]},
            )
            for name in ("ann", "bea")
            for miss in misses.tolist()
        ]
        assert [one.ratio for one in estimated(*seen).values()] == pytest.approx([1, 1], abs=0.002)

    def test_what_cameras_add_by_themselves_is_not_laid_on_people(self) -> None:
        """Ann's balls are as noisy as Bea's, seen by cameras that are known to be off by more."""
        misses = ndtri((np.arange(1000) + 0.5) / 1000)
        seen: list[Seen] = [
            (
                RayResidual(
                    miss * np.hypot(1.2, off), 1.0, 0.0, 0.0, off**2, (("a", 1.0, 0.0, 0.0),)
                ),
                {"a": [person(name)]},
            )
            for name, off in (("ann", 2.0), ("bea", 0.0))
            for miss in misses.tolist()
        ]
        assert [one.ratio for one in estimated(*seen).values()] == pytest.approx([1, 1], abs=0.02)

    def test_people_who_are_alike_are_not_said_to_differ(self) -> None:
        alike = dict.fromkeys(TRUE, 1.2)
        found = [one for seed in range(20) for one in estimated(*drawn(seed, alike)).values()]
        assert np.mean([one.differs for one in found]) < 0.1

    def test_who_placed_little_is_not_told(self) -> None:
        seen = drawn(1, {"ann": 1.0, "bea": 1.0})
        few = drawn(2, {"newcomer": 9.0, "ann": 1.0}, count=12)
        assert set(estimated(*seen, *few)) == {"ann", "bea"}

    def test_the_less_is_known_the_nearer_to_the_dataset(self) -> None:
        true = {"ann": 1.2, "cleo": 3.6}
        ratios = [estimated(*drawn(3, true, count))["cleo"].ratio for count in (60, 600)]
        assert 1.5 < ratios[0] < 3.2
        assert ratios[1] == pytest.approx(3.0, rel=0.15)

    def test_a_single_person_gets_no_estimate_beside_that_of_the_dataset(self) -> None:
        assert estimated(*drawn(1, {"ann": 1.0})) == {}
        assert estimated() == {}

    def test_one_among_balls_that_nobody_placed_is_told(self) -> None:
        seen = drawn(1, {"ann": 3.6, "": 1.2})
        bare = [
            (miss, {view: who for view, who in of.items() if who != [person("")]})
            for miss, of in seen
        ]
        (found,) = estimated(*bare).values()
        assert found.source == "ann" and found.low < 3.6 < found.high

    def test_given_cameras_are_told_by_what_they_add(self) -> None:
        rng, seen = np.random.default_rng(4), []
        for _ in range(200):
            a, b = rng.choice([1, 2, 3], 2, replace=False)
            noise = [4.0 if place == 3 else 2.0 for place in (a, b)]
            miss = rng.normal(0, np.hypot(*noise) / np.sqrt(2))
            by_view = (("left", 0.0, 0.0, 0.5), ("right", 0.0, 0.0, 0.5))
            of = {"left": [camera(str(a))], "right": [camera(str(b))]}
            seen.append((RayResidual(miss, 0.0, 0.0, 1.0, 0.0, by_view), of))
        worst, *_ = estimate_source_noise(seen, 0.0, 0.0, 2.6).noise_of_kind("camera")
        assert worst.source == "3" and worst.low < 4.0 < worst.high

    def test_balls_that_nobody_placed_add_their_own(self) -> None:
        """Ann is as noisy as they are, so what she and they miss by together is not hers."""
        seen = drawn(1, {"ann": 1.2, "": 1.2}, 1500)
        bare = [
            (miss, {view: who for view, who in of.items() if who != [person("")]})
            for miss, of in seen
        ]
        assert estimated(*bare)["ann"].ratio == pytest.approx(1.0, abs=0.1)


class TestFactor:
    def test_who_works_at_a_bad_camera_is_not_blamed_for_it(self) -> None:
        """Bea has camera b alone, at which ann works too."""
        placed = {"a": ["ann"], "b": ["ann", "bea"], "c": ["ann"]}
        found = factors(filmed(1, placed, {"b": 3.0}), 1.0)
        assert (
            found.noise_factor([camera("b")]) > 2.0 and found.noise_factor([person("bea")]) == 1.0
        )
        assert found.noise_factor([camera("b"), person("bea")]) == pytest.approx(3.0, rel=0.15)

    def test_both_together_are_known_where_nobody_knows_which(self) -> None:
        placed = {"a": ["ann", "cleo"], "b": ["bea"], "c": ["ann", "cleo"]}
        found = factors(filmed(2, placed, {"b": 3.0}), 1.0)
        (bea, *_), (b, *_) = found.noise_of_kind("person"), found.noise_of_kind("camera")
        assert (bea.source, b.source) == ("bea", "b")
        assert max(bea.ratio, b.ratio) < 2.2
        assert found.noise_factor([camera("b"), person("bea")]) == pytest.approx(3.0, rel=0.2)

    def test_who_may_be_like_the_dataset_and_who_is_unknown_counts_as_it(self) -> None:
        found = factors(drawn(0, dict.fromkeys(TRUE, 1.2)))
        names = [one.source for one in found.noise_of_kind("person") if not one.differs]
        assert names and {found.noise_factor([person(name)]) for name in (*names, "eve")} == {1.0}

    def test_it_is_used_where_the_interval_leaves_out_the_dataset(self) -> None:
        found = factors(drawn(0))
        for one in found.noise_of_kind("person"):
            used = found.noise_factor([person(one.source)])
            assert used == (round(one.ratio, 2) if one.differs else 1.0)
