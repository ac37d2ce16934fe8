"""Stacks of what can be undone and redone follow from the log alone."""

from __future__ import annotations

from functools import reduce

from hypothesis import given, settings
from hypothesis import strategies as st

from app.features.groups.undo_stacks import (
    UndoStacks,
    _build_stacks,
    _build_stacks_from_newest_steps,
)


def possible(kinds: list[str]) -> list[tuple[str, int]]:
    """The steps of some kinds that can follow each other, under the ids of their entries."""
    stacks, steps = UndoStacks(), []
    for number, kind in enumerate(kinds, start=1):
        if (kind == "undo" and not stacks.can_undo) or (kind == "redo" and not stacks.can_redo):
            continue
        stacks = stacks.push_entry(kind, number)
        steps.append((kind, number))
    return steps


class TestStacksOf:
    @settings(deadline=None, derandomize=True)
    @given(st.lists(st.sampled_from(["edit", "undo", "redo"])).map(possible))
    def test_is_one_step_after_the_other(self, steps: list[tuple[str, int]]) -> None:
        one_by_one = reduce(lambda stacks, step: stacks.push_entry(*step), steps, UndoStacks())
        assert _build_stacks(steps) == one_by_one

    def test_a_fresh_edit_clears_what_was_undone(self) -> None:
        assert _build_stacks([("edit", 1), ("edit", 2), ("undo", 3), ("edit", 4)]) == UndoStacks(
            (1, 4)
        )


class TestUpperPart:
    @settings(deadline=None, derandomize=True)
    @given(
        st.lists(st.sampled_from(["edit", "undo", "redo"]), min_size=1).map(possible),
        st.integers(1, 12),
    )
    def test_the_newest_steps_tell_the_same_as_all_or_nothing(
        self, steps: list[tuple[str, int]], count: int
    ) -> None:
        whole, upper = _build_stacks(steps), _build_stacks_from_newest_steps(steps[-count:])
        if upper is not None:
            assert upper.undone == whole.undone
            assert upper.done == whole.done[-len(upper.done) :]
            assert len(upper.done) > 1

    def test_two_edits_suffice(self) -> None:
        assert _build_stacks_from_newest_steps(
            [("redo", 7), ("edit", 8), ("edit", 9)]
        ) == UndoStacks((8, 9))

    def test_what_an_undo_reached_below_is_not_guessed(self) -> None:
        assert _build_stacks_from_newest_steps([("edit", 8), ("undo", 9), ("undo", 10)]) is None
        assert _build_stacks_from_newest_steps([("undo", 9), ("undo", 10)]) is None
