"""Figures follow what children do and how they end."""

from __future__ import annotations

from typing import get_args

import pytest

from app.child import Allowance, ChildEnded, EndReason
from app.child_figures import ChildFigures

ALLOWANCE = Allowance(memory=2**20, processor=1.0, silence=1.0)


@pytest.fixture
def figures() -> ChildFigures:
    return ChildFigures()


class TestWorking:
    def test_a_task_is_busy_until_it_is_done(self, figures: ChildFigures) -> None:
        with figures.working(), figures.working():
            assert figures.busy == 2
        assert figures.busy == 0
        assert set(figures.ended.values()) == {0}

    @pytest.mark.parametrize("reason", get_args(EndReason))
    def test_a_child_that_ends_is_counted_under_its_reason_alone(
        self, figures: ChildFigures, reason: EndReason
    ) -> None:
        for _ in range(2):
            with pytest.raises(ChildEnded), figures.working():
                raise ChildEnded(reason, ALLOWANCE)
        assert figures.ended == {**dict.fromkeys(get_args(EndReason), 0), reason: 2}
        assert figures.busy == 0

    def test_a_task_that_refuses_ended_no_child(self, figures: ChildFigures) -> None:
        with pytest.raises(ValueError, match="a word"), figures.working():
            raise ValueError("a word")
        assert set(figures.ended.values()) == {0}
        assert figures.busy == 0
