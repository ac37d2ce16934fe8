from __future__ import annotations

from dataclasses import replace

import pytest

from app.evaluation.comparison import compare_frames, compare_tables, differing_pins
from app.evaluation.result import FrameResult
from app.evaluation.table import Cell, Column, Row, Table

RESULT = FrameResult(1, 1, "g", "1.png", "m", ball=True, detections=1)


def table(name: str, value: float | None, row: str = "all") -> Table:
    return Table(name, name, (Column("ap", "AP"),), (Row(row, row, (Cell(value),)),))


class TestDifferingPins:
    def test_names_the_pins_that_make_numbers_incomparable(self) -> None:
        pins = {"state": "a", "software_version": "1", "name": "x", "careful": {"digest": "d"}}
        assert differing_pins(pins, {**pins, "name": "y"}) == ()
        other = {**pins, "state": "b", "software_version": "2", "careful": {"digest": "e"}}
        assert differing_pins(pins, other) == ("state", "software_version", "careful")

    def test_careful_boxes_of_one_run_alone_make_no_difference(self) -> None:
        assert differing_pins({"careful": {"digest": "d"}}, {}) == ()


class TestCompareTables:
    def test_tells_the_change_of_every_number(self) -> None:
        (found,) = compare_tables([table("t", 0.5)], [table("t", 0.75)])
        assert (found.row, found.column, found.change) == ("all", "ap", 0.25)

    def test_a_number_that_only_one_run_has_has_no_change(self) -> None:
        found = compare_tables([table("t", 0.5)], [table("t", 0.5, "other"), table("u", 1.0)])
        assert [item.change for item in found] == [None, None, None]
        assert [item.first is None for item in found] == [False, True, True]

    def test_a_missing_number_is_not_taken_for_zero(self) -> None:
        assert compare_tables([table("t", None)], [table("t", 0.5)])[0].change is None


class TestCompareFrames:
    @pytest.fixture
    def runs(self) -> tuple[list[FrameResult], list[FrameResult]]:
        def frames(*errors: float | None) -> list[FrameResult]:
            return [
                replace(RESULT, view=f"{number}.png", error_m=error)
                for number, error in enumerate(errors)
            ]

        return frames(5, 2, 1, None, 4, 3), frames(1, 3, 1, 2, None)

    def test_counts_what_became_better_and_worse(self, runs) -> None:
        found = compare_frames(*runs)
        assert (found.shared, found.better, found.worse) == (5, 1, 1)
        assert (found.gained, found.lost) == (1, 1)
        assert found.mean_change == pytest.approx((-4 + 1 + 0) / 3)

    def test_lists_what_differs_the_largest_change_first(self, runs) -> None:
        found = compare_frames(*runs).frames
        assert [item.second.view for item in found] == ["3.png", "4.png", "0.png", "1.png"]
        assert [item.change for item in found] == [None, None, -4, 1]

    def test_of_overlap_more_is_better(self) -> None:
        first, second = replace(RESULT, iou=0.5), replace(RESULT, iou=0.75)
        found = compare_frames([first], [second], "iou")
        assert (found.better, found.worse) == (1, 0)
