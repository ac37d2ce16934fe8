from __future__ import annotations

from dataclasses import replace

import pytest

from app.evaluation.bootstrap import MatchResamples
from app.evaluation.evaluate import (
    EvaluationInputs,
    EvaluationOptions,
    evaluate,
    make_boxes_figure,
    make_boxes_table,
)
from app.evaluation.frame import Detection
from app.evaluation.result import FrameFieldRange
from app.soccer.frames import Box
from tests.unit.evaluation.conftest import camera_at


@pytest.fixture
def frames(make_frame):
    """Eight frames with a ball in two matches, one without a ball, one that nobody can judge."""
    made = [
        make_frame(number, distance=30.0 + 8 * number, match=f"m{number % 2}")
        for number in range(1, 9)
    ]
    absent = replace(make_frame(9, match="m1"), boxes={}, absent=True, point=None)
    return [*made, absent, replace(make_frame(10, match="m1"), boxes={}, point=None)]


def found_in(frames, kind: str) -> dict[int, list[Detection]]:
    return {frame.id: [Detection(frame.boxes[kind], 0.9)] for frame in frames if frame.boxes}


class TestEvaluate:
    def test_the_truth_itself_is_perfect(self, frames) -> None:
        result = evaluate(
            frames, EvaluationInputs(found_in(frames, "optimized")), EvaluationOptions(resamples=50)
        )
        assert result.table("detection").cell("all", "ap_50").value == 1
        assert result.table("localization").cell("oracle", "mae_m").value == pytest.approx(0)
        assert result.table("localization").cell("oracle_all", "p_2m").value == 1

    def test_loose_boxes_are_found_and_misplaced(self, frames) -> None:
        result = evaluate(
            frames, EvaluationInputs(found_in(frames, "annotated")), EvaluationOptions(resamples=50)
        )
        assert result.table("detection").cell("all", "ap_50").value == 1
        assert result.table("detection").cell("all", "ap").value < 0.5
        assert result.table("localization").cell("oracle", "mae_percent").value == pytest.approx(20)
        assert result.table("localization").cell("oracle", "p_2m").value == 0

    def test_every_denominator_is_told(self, frames) -> None:
        found = found_in(frames, "optimized")
        found[9] = [Detection(Box(5, 5, 9, 9), 0.99)]
        found[10] = [Detection(Box(5, 5, 9, 9), 0.99)] * 2
        del found[1]
        counts = evaluate(frames, EvaluationInputs(found), EvaluationOptions(resamples=50)).counts
        assert {name: counts[name] for name in ("frames", "judged", "balls", "without_ball")} == {
            "frames": 10, "judged": 9, "balls": 8, "without_ball": 1,
        }  # fmt: skip
        assert (counts["detections"], counts["detections_not_judged"]) == (8, 2)
        assert (counts["frames_with_detections"], counts["matches"]) == (8, 2)

    def test_what_is_found_without_a_ball_costs_precision(self, frames) -> None:
        found = found_in(frames, "optimized")
        found[9] = [Detection(Box(5, 5, 9, 9), 0.99)]
        result = evaluate(frames, EvaluationInputs(found), EvaluationOptions(resamples=50))
        assert result.table("detection").cell("all", "ap_50").value == pytest.approx(8 / 9)

    def test_the_same_seed_gives_the_same_intervals(self, frames) -> None:
        found = EvaluationInputs(found_in(frames, "annotated"))
        first, again = (
            evaluate(frames, found, EvaluationOptions(resamples=50, seed=7)) for _ in range(2)
        )
        assert first == again

    def test_only_what_the_inputs_allow_is_there(self, frames) -> None:
        reference = {frame.id: frame.boxes["exact"] for frame in frames if frame.boxes}
        result = evaluate(
            frames, EvaluationInputs(reference=reference), EvaluationOptions(resamples=50)
        )
        assert [table.name for table in result.tables] == ["boxes", "sensitivity"]
        assert [figure.name for figure in result.figures] == ["box_overlap", "sensitivity"]
        cameras = {frame.id: camera_at(50.0) for frame in frames}
        whole = evaluate(
            frames,
            EvaluationInputs(found_in(frames, "exact"), reference, cameras),
            EvaluationOptions(resamples=50),
        )
        assert {table.name for table in whole.tables} == {
            "detection", "localization", "detection_by_size", "detection_by_distance",
            "boxes", "calibration", "sensitivity",
        }  # fmt: skip
        assert len(whole.figures) == 8

    def test_rows_name_the_frames_behind_them(self, frames) -> None:
        result = evaluate(
            frames, EvaluationInputs(found_in(frames, "optimized")), EvaluationOptions(resamples=50)
        )
        table = result.table("detection_by_distance")
        for row in table.rows:
            inside = [
                frame
                for frame in result.frames
                if frame.distance_m is not None
                and row.frames.low <= frame.distance_m < (row.frames.high or 1e9)
            ]
            assert len(inside) == row.cells[0].count


ONE_MATCH = MatchResamples.draw(["m"])


def beside(box: Box) -> Box:
    """A box that only touches another one."""
    return replace(box, x=box.x + box.width)


class TestBoxesTable:
    def test_measures_every_kind_over_the_same_frames(self, make_frame) -> None:
        frame, bare = make_frame(1), replace(make_frame(2), boxes={})
        reference = {1: frame.boxes["exact"], 2: frame.boxes["exact"], 99: frame.boxes["exact"]}
        table = make_boxes_table([frame, bare], reference, {}, ONE_MATCH)
        # The annotated box is 1.25 times the reference one: IoU 0.64, and a quarter of d over the
        # diagonal of a square.
        assert table.cell("annotated", "iou").value == pytest.approx(0.64)
        assert table.cell("annotated", "size_error_percent").value == pytest.approx(25 / 2**0.5)
        assert table.cell("optimized", "iou").value == pytest.approx(1)
        assert table.cell("exact", "size_error_percent").value == pytest.approx(0)
        assert all((row.cells[0].count, row.cells[0].of) == (1, 3) for row in table.rows)
        assert table.row("detected") is None

    def test_detections_get_a_row_where_they_overlap(self, make_frame) -> None:
        frame = make_frame(1)
        found = {1: [Detection(frame.boxes["annotated"], 0.4)]}
        table = make_boxes_table([frame], {1: frame.boxes["exact"]}, found, ONE_MATCH)
        assert table.cell("detected", "iou").value == pytest.approx(0.64)

    def test_only_the_row_whose_overlap_is_kept_opens_frames(self, make_frame) -> None:
        frame, bare = make_frame(1), make_frame(2)
        bare = replace(bare, boxes={"annotated": bare.boxes["annotated"]})
        reference = {1: frame.boxes["exact"], 2: frame.boxes["exact"]}
        result = evaluate(
            [frame, bare],
            EvaluationInputs(reference=reference),
            EvaluationOptions(boxes="annotated", resamples=20),
        )
        table = result.table("boxes")
        opening = {row.name: row.frames for row in table.rows if row.frames}
        assert opening == {"annotated": FrameFieldRange("box_iou")}
        kept = [item.box_iou for item in result.frames if item.box_iou is not None]
        assert kept == [pytest.approx(table.cell("annotated", "iou").value)]

    def test_the_box_that_was_drawn_as_carefully_is_the_best_of_each_column(
        self, make_frame
    ) -> None:
        frame = make_frame(1)
        table = make_boxes_table([frame], {1: frame.boxes["exact"]}, {}, ONE_MATCH)
        for column in table.columns:
            best = {"higher": max, "lower": min}[column.better]
            exact, loose = (table.cell(kind, column.name).value for kind in ("exact", "annotated"))
            assert exact != loose and best(exact, loose) == exact
        assert [(column.label, column.unit) for column in table.columns] == [
            ("IoU", ""),
            ("Size error", "%"),
        ]

    def test_rows_stand_in_the_papers_order_under_their_names(self, make_frame) -> None:
        frame = make_frame(1)
        found = {1: [Detection(frame.boxes["exact"], 0.5)]}
        table = make_boxes_table([frame], {1: frame.boxes["exact"]}, found, ONE_MATCH)
        assert [(row.name, row.label) for row in table.rows] == [
            ("annotated", "Original boxes"),
            ("optimized", "Optimised boxes"),
            ("exact", "Exact boxes"),
            ("detected", "Detected boxes, IoU > 0"),
        ]
        assert [row.name for row in table.rows if row.frames] == ["optimized"]

    @pytest.mark.parametrize("lacking", ["annotated", "optimized", "exact"])
    def test_a_frame_without_one_kind_of_box_takes_part_in_no_row(
        self, make_frame, lacking: str
    ) -> None:
        whole, part = make_frame(1), make_frame(2)
        reference = {frame.id: frame.boxes["exact"] for frame in (whole, part)}
        found = {frame.id: [Detection(frame.boxes["exact"], 0.5)] for frame in (whole, part)}
        part = replace(part, boxes={k: box for k, box in part.boxes.items() if k != lacking})
        table = make_boxes_table([whole, part], reference, found, ONE_MATCH)
        counts = {(cell.count, cell.of) for row in table.rows for cell in row.cells}
        assert len(table.rows) == 4 and counts == {(1, 2)}

    def test_without_a_drawn_box_in_any_frame_the_other_kinds_are_compared(
        self, make_frame
    ) -> None:
        """A dataset of points, as ISSIA's."""
        frames = [make_frame(1), make_frame(2)]
        reference = {frame.id: frame.boxes["exact"] for frame in frames}
        frames = [
            replace(frame, boxes={k: b for k, b in frame.boxes.items() if k != "annotated"})
            for frame in frames
        ]
        table = make_boxes_table(frames, reference, {}, ONE_MATCH)
        assert table.cell("exact", "iou").value == pytest.approx(1.0)
        assert table.cell("annotated", "iou").value is None
        assert "No frame has original boxes." in table.note
        figure = make_boxes_figure(frames, reference, {1: 50.0, 2: 60.0})
        assert [series.name for series in figure.panels[0].series] == ["optimized", "exact"]

    def test_every_number_says_of_how_many_careful_boxes_it_was_computed(self, make_frame) -> None:
        frames = [make_frame(1), make_frame(2), make_frame(3)]
        reference = dict.fromkeys((1, 2, 7, 8), frames[0].boxes["exact"])
        found = {1: [Detection(frames[0].boxes["exact"], 0.5)]}
        table = make_boxes_table(frames, reference, found, ONE_MATCH)
        told = {row.name: [(cell.count, cell.of) for cell in row.cells] for row in table.rows}
        assert told.pop("detected") == [(1, 4), (1, 4)]
        assert set(map(tuple, told.values())) == {((2, 4), (2, 4))}
        assert table.note.startswith("2 frames that ") and " of 4 reference boxes." in table.note

    def test_the_surest_of_those_that_overlap_is_measured(self, make_frame) -> None:
        frame = replace(make_frame(1), group_id=5)
        exact = frame.boxes["exact"]
        poor = replace(exact, x=exact.x + 0.75 * exact.width)
        found = {
            1: [Detection(exact, 0.3), Detection(poor, 0.6), Detection(beside(exact), 0.9)],
            5: [Detection(exact, 1.0)],
        }
        table = make_boxes_table([frame], {1: exact}, found, ONE_MATCH)
        # A quarter of both is shared: 0.25 / 1.75.
        assert table.cell("detected", "iou").value == pytest.approx(1 / 7)

    def test_a_frame_whose_detections_only_touch_the_ball_has_none(self, make_frame) -> None:
        frame = make_frame(1)
        exact = frame.boxes["exact"]
        found = {1: [Detection(beside(exact), 0.9)]}
        cell = make_boxes_table([frame], {1: exact}, found, ONE_MATCH).cell("detected", "iou")
        assert (cell.value, cell.count, cell.of) == (None, 0, 1)

    def test_intervals_are_of_whole_matches(self, make_frame) -> None:
        one, other = make_frame(1, match="a"), make_frame(2, match="b")
        reference = {1: one.boxes["exact"], 2: other.boxes["annotated"]}
        table = make_boxes_table([one, other], reference, {}, MatchResamples.draw(["a", "b"]))
        cell = table.cell("annotated", "iou")
        # Of two matches a resample draws one twice in half of all cases.
        assert (cell.low, cell.high) == pytest.approx((0.64, 1.0))


class TestBoxesFigure:
    def test_every_box_of_every_frame_is_a_point_that_opens_its_frame(self, make_frame) -> None:
        near, far, nowhere = make_frame(1), make_frame(2), make_frame(3)
        reference = {frame.id: frame.boxes["exact"] for frame in (near, far, nowhere)}
        figure = make_boxes_figure([near, far, nowhere], reference, {1: 30.0, 2: 20.0})
        overlap, size = figure.panels
        series = {item.name: item for item in overlap.series}
        assert set(series) == {"annotated", "optimized", "exact"}
        assert series["annotated"].x == (20.0, 30.0)
        assert series["annotated"].y == pytest.approx((0.64, 0.64))
        assert size.series[0].y == pytest.approx((25 / 2**0.5,) * 2)
        (first, second) = series["exact"].frames
        assert (first.field, first.low, second.low) == ("distance_m", 20.0, 30.0)
        assert first.high is not None and 20.0 < first.high < 20.001

    def test_a_run_with_careful_boxes_has_it(self, make_frame) -> None:
        frame = make_frame(1)
        result = evaluate(
            [frame],
            EvaluationInputs(reference={1: frame.boxes["exact"]}),
            EvaluationOptions(resamples=20),
        )
        (figure,) = [figure for figure in result.figures if figure.name == "box_overlap"]
        assert [len(series.x) for series in figure.panels[0].series] == [1, 1, 1]

    def test_axes_say_what_they_show_and_that_of_iou_alone_ends(self, make_frame) -> None:
        frame = make_frame(1)
        overlap, size = make_boxes_figure([frame], {1: frame.boxes["exact"]}, {1: 30.0}).panels
        assert [panel.x.unit for panel in (overlap, size)] == ["m", "m"]
        assert (overlap.y.label, overlap.y.low, overlap.y.high) == ("IoU", 0.0, 1.0)
        assert (size.y.label, size.y.unit, size.y.low) == ("Size error", "%", 0.0)
        assert size.y.high is None
        assert {series.kind for series in (*overlap.series, *size.series)} == {"points"}

    def test_frames_that_are_nearly_as_far_open_each_its_own(self, make_frame) -> None:
        frames = [make_frame(number) for number in (1, 2, 3)]
        reference = {frame.id: frame.boxes["exact"] for frame in frames}
        figure = make_boxes_figure(frames, reference, {1: 20.0, 2: 20.0 + 1e-9})
        assert figure.note.startswith("2 frames;")
        series = figure.panels[0].series[0]
        for place, behind in zip(series.x, series.frames, strict=True):
            assert [x for x in series.x if behind.low <= x < behind.high] == [place]
