"""Comparison: which way is better, what is counted once, and in which order it stands."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.evaluation.comparison import (
    FIELDS,
    compare_frames,
    compare_tables,
    list_differing_settings,
)
from app.evaluation.result import Cell, Column, FrameResult, Row, Table

RESULT = FrameResult(1, 1, "g", "1.png", "m", ball=True, detections=1)
PINS = {
    "state": "a",
    "policy_hash": "p",
    "solver_version": "5",
    "split": "test",
    "boxes": "optimized",
    "min_score": 0.2,
    "software_version": "1",
}


def frames(field: str, *values: float | None) -> list[FrameResult]:
    return [
        replace(RESULT, view=f"{number}.png", **{field: value})
        for number, value in enumerate(values)
    ]


def table(name: str, *, row: str = "all", **values: float | None) -> Table:
    columns = tuple(Column(column, column.upper()) for column in values)
    return Table(name, name, columns, (Row(row, row.title(), tuple(map(Cell, values.values()))),))


class TestDifferingPins:
    def test_names_the_pins_that_make_numbers_incomparable(self) -> None:
        pins = {"state": "a", "software_version": "1", "name": "x", "careful": {"digest": "d"}}
        assert list_differing_settings(pins, {**pins, "name": "y"}) == ()
        other = {**pins, "state": "b", "software_version": "2", "careful": {"digest": "e"}}
        assert list_differing_settings(pins, other) == ("state", "software_version", "careful")

    def test_careful_boxes_of_one_run_alone_make_no_difference(self) -> None:
        assert list_differing_settings({"careful": {"digest": "d"}}, {}) == ()

    @pytest.mark.parametrize("name", PINS)
    def test_a_run_that_was_measured_otherwise_says_in_what(self, name: str) -> None:
        assert list_differing_settings(PINS, {**PINS, name: "another"}) == (name,)

    def test_the_same_careful_boxes_sent_again_are_the_same(self) -> None:
        first, again = ({"careful": {"digest": "d", "name": name}} for name in ("a", "b"))
        assert list_differing_settings(first, again) == ()


class TestCompareTables:
    def test_tells_the_change_of_every_number(self) -> None:
        (found,) = compare_tables([table("t", ap=0.5)], [table("t", ap=0.75)])
        assert (found.row, found.column, found.change) == ("all", "ap", 0.25)

    def test_a_number_that_only_one_run_has_has_no_change(self) -> None:
        found = compare_tables(
            [table("t", ap=0.5)], [table("t", ap=0.5, row="other"), table("u", ap=1.0)]
        )
        assert [item.change for item in found] == [None, None, None]
        assert [item.first is None for item in found] == [False, True, True]

    def test_a_missing_number_is_not_taken_for_zero(self) -> None:
        assert compare_tables([table("t", ap=None)], [table("t", ap=0.5)])[0].change is None

    def test_tables_stand_as_in_the_first_run_and_new_ones_after_them(self) -> None:
        first = [table("t", ap=0.5), table("u", ap=0.5)]
        second = [table("v", ap=0.5), table("u", ap=0.5), table("t", ap=0.5)]
        assert [item.table for item in compare_tables(first, second)] == ["t", "u", "v"]

    def test_a_number_is_called_by_the_words_of_its_row_and_its_column(self) -> None:
        (found,) = compare_tables([table("t", ap=0.5)], [table("t", ap=0.5)])
        assert found.label == "All: AP"

    def test_a_number_says_its_unit_and_which_way_is_better(self) -> None:
        column = Column("error", "Error", "m", "lower")
        runs = [Table("t", "t", (column,), (Row("all", "All", (Cell(0.5),)),))]
        for found in (compare_tables(runs, []), compare_tables([], runs)):
            assert [(one.unit, one.better) for one in found] == [("m", "lower")]

    @pytest.mark.parametrize(("before", "after"), [(0.0, 0.25), (0.25, 0.0), (0.0, 0.0)])
    def test_zero_is_a_number_that_changes(self, before: float, after: float) -> None:
        (found,) = compare_tables([table("t", ap=before)], [table("t", ap=after)])
        assert found.change == after - before

    def test_a_column_that_only_the_newer_run_has_hides_no_other(self) -> None:
        found = compare_tables([table("t", ap=0.5)], [table("t", recall=0.9, ap=0.75)])
        assert [(item.column, item.change) for item in found] == [("ap", 0.25), ("recall", None)]

    def test_what_stands_in_neither_run_is_told_of_none(self) -> None:
        found = compare_tables([table("t", ap=0.5)], [table("t", row="new", recall=0.9)])
        assert [(item.row, item.column) for item in found] == [("all", "ap"), ("new", "recall")]

    def test_a_column_that_only_the_older_run_has_is_told_of_it(self) -> None:
        (recall, ap) = compare_tables([table("t", recall=0.9, ap=0.5)], [table("t", ap=0.75)])
        assert (recall.first, recall.second, ap.change) == (Cell(0.9), None, 0.25)


class TestCompareFrames:
    @pytest.fixture
    def runs(self) -> tuple[list[FrameResult], list[FrameResult]]:
        return frames("error_m", 5, 2, 1, None, 4, 3), frames("error_m", 1, 3, 1, 2, None)

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

    @pytest.mark.parametrize(
        ("field", "improved"),
        [
            ("error_m", -1),
            ("predicted_error_m", -1),
            ("iou", 1),
            ("hit_iou", 1),
            ("predicted_jac", 1),
        ],
    )
    def test_errors_become_better_by_shrinking_and_shares_by_growing(
        self, field: str, improved: int
    ) -> None:
        assert field in FIELDS
        before, grown = frames(field, 0.25, 0.25, 0.25), frames(field, 0.75, 0.75, 0.125)
        found = compare_frames(before, grown, field)
        assert (found.better, found.worse) == ((2, 1) if improved > 0 else (1, 2))

    def test_what_came_and_what_went_are_told_apart(self) -> None:
        found = compare_frames(
            frames("error_m", None, None, 4, None), frames("error_m", 2, 3, None, None)
        )
        assert (found.gained, found.lost, found.mean_change) == (2, 1, None)
        # Of the last one neither run knows anything: nothing changed.
        assert [item.second.view for item in found.frames] == ["0.png", "1.png", "2.png"]

    def test_frames_of_one_run_alone_are_not_shared(self) -> None:
        found = compare_frames(frames("error_m", 1), frames("error_m", 2, 3, 4))
        assert (found.shared, found.worse) == (1, 1)

    def test_a_view_of_the_same_name_in_another_group_is_another_frame(self) -> None:
        one, other = (replace(RESULT, group=group, error_m=1.0) for group in ("g", "h"))
        assert compare_frames([one], [replace(other, error_m=5.0)]).shared == 0
        found = compare_frames([one, other], [one, replace(other, error_m=1.5)])
        assert (found.shared, found.worse, found.mean_change) == (2, 1, 0.25)

    def test_a_frame_that_got_another_id_is_the_same_frame(self) -> None:
        assert compare_frames([RESULT], [replace(RESULT, frame_id=9, group_id=9)]).shared == 1

    def test_a_frame_says_what_it_was_before_and_what_it_is(self) -> None:
        (found,) = compare_frames(frames("iou", 0.0), frames("iou", 0.5), "iou").frames
        assert (found.first.iou, found.second.iou, found.change) == (0.0, 0.5, 0.5)
