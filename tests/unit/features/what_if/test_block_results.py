"""Leakage: which matches lie in several splits."""

from __future__ import annotations

from collections import Counter

from app.features.what_if.block_results import SplitLeak, find_split_leaks


def test_matches_in_several_splits_are_told_by_name_with_their_groups():
    places = Counter(
        {
            ("b", "train"): 3,
            ("b", "test"): 1,
            ("a", "valid"): 2,
            ("a", "train"): 5,
            ("c", "test"): 4,
        }
    )
    assert find_split_leaks(places) == (
        SplitLeak("a", (("train", 5), ("valid", 2))),
        SplitLeak("b", (("test", 1), ("train", 3))),
    )


def test_groups_without_a_split_make_no_leak():
    assert find_split_leaks(Counter({("a", ""): 3, ("a", "train"): 1})) == ()
