from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from app.formats.export_record import ExportRecord, choose_ball_box
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from app.soccer.group import Group

Solved = Callable[..., ExportRecord]


class TestExportRecord:
    def test_a_view_in_no_valid_pair_has_a_ball_only_when_all_is_asked(
        self, soccer_group: Callable[..., Group], solved: Solved
    ) -> None:
        record = solved(soccer_group(replays=2))
        third = record.group.views[2]
        assert record.ball_fit(third, everything=False) is None
        assert record.ball_fit(third, everything=True) is not None

    def test_a_detector_learns_from_balls_that_hold_and_from_views_without_one(
        self, soccer_group: Callable[..., Group], solved: Solved
    ) -> None:
        group = soccer_group(replays=3)
        gone = replace(group.views[3], balls=(BallAnnotation(out_of_view=True),))
        record = solved(replace(group, views=(*group.views[:3], gone)))
        keys = [view.key for view in record.keep_training_views().group.views]
        assert keys == ["7.png", "7_1.png", "7_3.png"]

    def test_a_view_that_a_person_left_out_teaches_nothing_unless_every_view_is_asked(
        self, soccer_group: Callable[..., Group], solved: Solved
    ) -> None:
        group = soccer_group(replays=2)
        apart = replace(group.views[2], balls=(), included=False)
        record = solved(group.with_view(apart))
        assert not record.is_training_view(apart)
        assert len(record.keep_training_views().group.views) == 2
        assert len(record.keep_training_views(every_view=True).group.views) == 3

    def test_calibrated_means_through_the_gates_on_cameras(
        self, soccer_group: Callable[..., Group], solved: Solved
    ) -> None:
        record = solved(soccer_group(replays=3))
        assert [record.passes_camera_gates(view) for view in record.group.views] == [
            True, True, False, False,
        ]  # fmt: skip
        assert record.camera(record.group.views[2]) is not None

    def test_a_group_without_a_solution_has_nothing_computed(
        self, soccer_group: Callable[..., Group]
    ) -> None:
        record = ExportRecord(soccer_group(), None, "unreviewed")
        view = record.group.views[0]
        assert record.camera(view) is None
        assert record.ball_fit(view, everything=True) is None
        assert record.ball_point is None

    def test_a_reason_stands_beside_the_verdict(self, soccer_group: Callable[..., Group]) -> None:
        record = ExportRecord(soccer_group(), None, "rejected", "bad_field_lines")
        assert record.verdict_text == "rejected: bad_field_lines"


class TestChosenBox:
    @pytest.mark.parametrize(
        ("kind", "box"),
        [
            ("annotated", Box(610.0, 300.0, 12.0, 11.0)),
            ("optimized", Box(610.75, 300.25, 10.5, 10.5)),
            ("exact", Box(610.5, 300.0, 10.6, 10.4)),
        ],
    )
    def test_the_box_that_was_asked_for(
        self, soccer_group: Callable[..., Group], solved: Solved, kind: str, box: Box
    ) -> None:
        record = solved(soccer_group())
        assert choose_ball_box(record, record.group.views[0], kind) == box

    def test_the_annotated_box_where_there_is_no_other(
        self, soccer_group: Callable[..., Group], solved: Solved
    ) -> None:
        record = solved(soccer_group(), ball=False)
        assert choose_ball_box(record, record.group.views[0], "exact") == Box(
            610.0, 300.0, 12.0, 11.0
        )
