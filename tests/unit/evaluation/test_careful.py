from __future__ import annotations

from dataclasses import replace

import pytest

from app.evaluation.bootstrap import Resamples
from app.evaluation.careful import boxes_figure, boxes_table
from app.evaluation.evaluate import Inputs, Options, evaluate
from app.evaluation.frame import Detection
from app.evaluation.table import FrameRange


class TestBoxesTable:
    def test_measures_every_kind_over_the_same_frames(self, make_frame) -> None:
        frame, bare = make_frame(1), replace(make_frame(2), boxes={})
        careful = {1: frame.boxes["exact"], 2: frame.boxes["exact"], 99: frame.boxes["exact"]}
        table = boxes_table([frame, bare], careful, {}, Resamples.draw(["m"]))
        # The annotated box is 1.25 times the careful one: IoU 0.64, and a quarter of d over the
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
        table = boxes_table([frame], {1: frame.boxes["exact"]}, found, Resamples.draw(["m"]))
        assert table.cell("detected", "iou").value == pytest.approx(0.64)

    def test_only_the_row_whose_overlap_is_kept_opens_frames(self, make_frame) -> None:
        frame, bare = make_frame(1), make_frame(2)
        bare = replace(bare, boxes={"annotated": bare.boxes["annotated"]})
        careful = {1: frame.boxes["exact"], 2: frame.boxes["exact"]}
        result = evaluate(
            [frame, bare], Inputs(careful=careful), Options(boxes="annotated", resamples=20)
        )
        table = result.table("boxes")
        opening = {row.name: row.frames for row in table.rows if row.frames}
        assert opening == {"annotated": FrameRange("box_iou")}
        kept = [item.box_iou for item in result.frames if item.box_iou is not None]
        assert kept == [pytest.approx(table.cell("annotated", "iou").value)]


class TestBoxesFigure:
    def test_every_box_of_every_frame_is_a_point_that_opens_its_frame(self, make_frame) -> None:
        near, far, nowhere = make_frame(1), make_frame(2), make_frame(3)
        careful = {frame.id: frame.boxes["exact"] for frame in (near, far, nowhere)}
        figure = boxes_figure([near, far, nowhere], careful, {1: 30.0, 2: 20.0})
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
        result = evaluate([frame], Inputs(careful={1: frame.boxes["exact"]}), Options(resamples=20))
        (figure,) = [figure for figure in result.figures if figure.name == "box_overlap"]
        assert [len(series.x) for series in figure.panels[0].series] == [1, 1, 1]
