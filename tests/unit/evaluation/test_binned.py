from __future__ import annotations

from dataclasses import replace

import pytest

from app.evaluation.binned import DISTANCE, PARALLAX, SIZE, detection_table, error_figure
from app.evaluation.frame import Detection, JudgedFrame
from app.evaluation.localization import measure_frame
from app.evaluation.result import FrameResult
from tests.unit.evaluation.conftest import DIAMETER

RESULT = FrameResult(1, 1, "g", "v", "m", ball=True, detections=1)


class TestBins:
    def test_a_value_on_an_edge_belongs_to_the_bin_above(self) -> None:
        assert [DISTANCE.place(value) for value in (0.0, 19.9, 20.0, 100.0, 900.0)] == [
            0,
            0,
            1,
            8,
            8,
        ]
        assert DISTANCE.place(None) is None
        assert DISTANCE.name(1) == "20 to 30 m"
        assert DISTANCE.name(8) == "100 m and more"


class TestErrorFigure:
    def test_has_the_median_and_quarters_of_each_bin(self) -> None:
        frames = [replace(RESULT, distance_m=25.0, error_m=float(error)) for error in range(5)] + [
            replace(RESULT, distance_m=45.0, error_m=9.0),
            RESULT,
        ]
        points, middle = error_figure(frames, DISTANCE).panels[0].series
        assert middle.x == (25, 45)
        assert middle.y == (2, 9)
        assert (middle.low, middle.high, middle.count) == ((1, 9), (3, 9), (5, 1))
        assert len(points.x) == 6

    def test_a_median_opens_its_bin_and_a_point_its_frame(self) -> None:
        places = [20.0, 25.0, 29.9, 105.0]
        frames = [replace(RESULT, distance_m=place, error_m=1.0) for place in places]
        points, middle = error_figure(frames, DISTANCE).panels[0].series
        assert [(item.low, item.high) for item in middle.frames] == [(20, 30), (100, None)]
        assert {item.field for item in (*middle.frames, *points.frames)} == {"distance_m"}
        for behind in points.frames:
            assert sum(behind.low <= place < behind.high for place in places) == 1

    @pytest.mark.parametrize("bins", [DISTANCE, PARALLAX, SIZE])
    def test_without_values_the_figure_is_empty(self, bins) -> None:
        points, middle = error_figure([RESULT], bins).panels[0].series
        assert points.x == middle.x == ()


class TestDetectionTable:
    def test_each_bin_is_an_evaluation_of_its_own(self, make_frame) -> None:
        near, far = make_frame(1, distance=25.0), make_frame(2, distance=85.0)
        judged = [
            JudgedFrame(near, near.boxes["optimized"], (Detection(near.boxes["optimized"], 0.9),)),
            JudgedFrame(far, far.boxes["optimized"], ()),
        ]
        results = [measure_frame(item, DIAMETER) for item in judged]
        table = detection_table(judged, results, DISTANCE)
        assert [row.label for row in table.rows] == ["20 to 30 m", "80 to 100 m"]
        assert [row.cells[0].value for row in table.rows] == [1, 0]
        assert [row.cells[2].value for row in table.rows] == [1, 0]
        assert table.rows[0].frames is not None
        assert (table.rows[0].frames.low, table.rows[0].frames.high) == (20, 30)
