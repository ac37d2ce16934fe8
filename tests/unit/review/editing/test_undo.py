"""Undo: stacks that follow from the log alone."""

from __future__ import annotations

from functools import reduce

from hypothesis import given, settings
from hypothesis import strategies as st

from app.review.editing.undo import Stacks, _stacks_of


def possible(kinds: list[str]) -> list[tuple[str, int]]:
    """The steps of some kinds that can follow each other, under the ids of their entries."""
    stacks, steps = Stacks(), []
    for number, kind in enumerate(kinds, start=1):
        if (kind == "undo" and not stacks.can_undo) or (kind == "redo" and not stacks.can_redo):
            continue
        stacks = stacks.then(kind, number)
        steps.append((kind, number))
    return steps


class TestStacksOf:
    @settings(deadline=None, derandomize=True)
    @given(st.lists(st.sampled_from(["edit", "undo", "redo"])).map(possible))
    def test_is_one_step_after_the_other(self, steps: list[tuple[str, int]]) -> None:
        one_by_one = reduce(lambda stacks, step: stacks.then(*step), steps, Stacks())
        assert _stacks_of(steps) == one_by_one

    def test_a_fresh_edit_clears_what_was_undone(self) -> None:
        assert _stacks_of([("edit", 1), ("edit", 2), ("undo", 3), ("edit", 4)]) == Stacks((1, 4))
