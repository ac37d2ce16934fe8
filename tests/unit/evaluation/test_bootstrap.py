from __future__ import annotations

import numpy as np
import pytest

from app.evaluation.bootstrap import MatchResamples, percentile_interval


class TestInterval:
    def test_holds_the_central_95_percent_of_what_is_finite(self) -> None:
        values = np.append(np.linspace(0, 1, 1001), [np.nan, np.inf])
        assert percentile_interval(values) == pytest.approx((0.025, 0.975))


class TestResamples:
    def test_the_same_seed_draws_the_same(self) -> None:
        first = MatchResamples.draw(["a", "b", "c"], 50, seed=1)
        assert np.array_equal(
            first.counts, MatchResamples.draw(["c", "b", "a", "a"], 50, seed=1).counts
        )
        assert not np.array_equal(
            first.counts, MatchResamples.draw(["a", "b", "c"], 50, seed=2).counts
        )

    def test_each_draws_as_many_matches_as_there_are(self) -> None:
        assert (MatchResamples.draw(["a", "b", "c"], 50).counts.sum(axis=1) == 3).all()

    def test_one_match_gives_no_interval(self) -> None:
        cell = MatchResamples.draw(["a", "a"]).mean_with_interval([1.0, 3.0], ["a", "a"])
        assert (cell.value, cell.low, cell.high, cell.count, cell.of) == (2, None, None, 2, 2)

    def test_of_matches_that_agree_the_interval_is_a_point(self) -> None:
        cell = MatchResamples.draw(["a", "b"]).mean_with_interval(
            [1.0, 3.0, 1.0, 3.0], ["a", "a", "b", "b"]
        )
        assert (cell.value, cell.low, cell.high) == (2, 2, 2)

    def test_resamples_matches_and_not_frames(self) -> None:
        # Two matches of a thousand frames each: whole matches are drawn, so the ends are theirs.
        values, matches = [0.0] * 1000 + [1.0] * 1000, ["a"] * 1000 + ["b"] * 1000
        cell = MatchResamples.draw(matches).mean_with_interval(values, matches)
        assert (cell.low, cell.value, cell.high) == (0, 0.5, 1)

    def test_covers_the_mean_of_many_matches(self) -> None:
        rng = np.random.default_rng(3)
        matches = [str(number) for number in range(100)]
        cell = MatchResamples.draw(matches).mean_with_interval(
            rng.normal(5, 1, 100).tolist(), matches
        )
        assert cell.low is not None and cell.high is not None
        # Standard error 0.1: the interval is about four of them wide.
        assert cell.high - cell.low == pytest.approx(0.4, abs=0.08)
        assert cell.low < 5 < cell.high

    def test_without_values_there_is_no_mean_but_a_denominator(self) -> None:
        cell = MatchResamples.draw(["a", "b"]).mean_with_interval([], [], of=7)
        assert (cell.value, cell.count, cell.of) == (None, 0, 7)
