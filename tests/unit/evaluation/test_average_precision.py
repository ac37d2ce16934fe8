"""AP against pycocotools, and against cases small enough for a pencil."""

from __future__ import annotations

import contextlib
import io
from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.average_precision import (
    DISTANCE,
    IOUS,
    PARALLAX,
    SIZE,
    area_under_curve,
    coco_average_precision,
    interpolated_average_precision,
    make_detection_table_by_bin,
    make_error_figure,
    match_detections_to_balls,
    mean_average_precision_over_ious,
    precision_recall_curve,
)
from app.evaluation.frame import Detection, FrameWithDetections
from app.evaluation.localization import make_frame_result
from app.evaluation.result import FrameResult
from app.soccer.frames import Box
from tests.unit.evaluation.conftest import DIAMETER

BALL = Box(100, 100, 10, 10)
HALF = Box(100, 100, 10, 5)
"""IoU 0.5 with the ball: just enough."""
AWAY = Box(300, 300, 10, 10)


@pytest.fixture
def random_judged(make_frame) -> list[FrameWithDetections]:
    """Two hundred frames; some without a ball, many scores alike."""
    rng = np.random.default_rng(0)
    judged = []
    for number in range(200):
        truth = None if rng.random() < 0.1 else Box(*rng.uniform(100, 500, 2).tolist(), 10, 10)
        around = truth or BALL
        found = []
        for _ in range(rng.integers(0, 4)):
            x, y = (np.array([around.x, around.y]) + rng.normal(0, 1.5, 2)).tolist()
            width, height = (10 * rng.uniform(0.7, 1.4, 2)).tolist()
            found.append(Detection(Box(x, y, width, height), float(np.round(rng.random(), 1))))
        found.sort(key=lambda item: -item.score)
        judged.append(FrameWithDetections(make_frame(number + 1), truth, tuple(found)))
    return judged


def by_pycocotools(judged: list[FrameWithDetections]) -> tuple[float, float]:
    """AP at 0.5 and over all thresholds, by the reference."""
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    with contextlib.redirect_stdout(io.StringIO()):
        truth = COCO()
        truth.dataset = {
            "info": {},
            "images": [{"id": i, "width": 1280, "height": 720} for i in range(len(judged))],
            "categories": [{"id": 1, "name": "ball"}],
            "annotations": [
                {"id": i + 1, "image_id": i, "category_id": 1, "iscrowd": 0,
                 "bbox": [b.x, b.y, b.width, b.height], "area": b.width * b.height}
                for i, item in enumerate(judged) if (b := item.truth) is not None
            ],
        }  # fmt: skip
        truth.createIndex()
        found = truth.loadRes(
            [
                {"image_id": i, "category_id": 1, "score": d.score,
                 "bbox": [d.box.x, d.box.y, d.box.width, d.box.height]}
                for i, item in enumerate(judged) for d in item.detections
            ]
        )  # fmt: skip
        run = COCOeval(truth, found, "bbox")
        run.evaluate()
        run.accumulate()
        precision = run.eval["precision"][:, :, 0, 0, -1]
    return float(precision[0].mean()), float(precision.mean())


class TestCocoAveragePrecision:
    def test_equals_pycocotools(self, random_judged) -> None:
        expected = by_pycocotools(random_judged)
        assert 0.05 < expected[1] < expected[0] < 0.95
        assert coco_average_precision(random_judged) == pytest.approx(expected, abs=1e-9)

    def test_says_nothing_on_stdout(self, random_judged, capfd) -> None:
        coco_average_precision(random_judged)
        assert capfd.readouterr() == ("", "")

    def test_of_perfect_detections_is_one(self, make_judged) -> None:
        judged = [make_judged(BALL, (BALL, 0.9), identity=number) for number in (1, 2)]
        assert coco_average_precision(judged) == (1, 1)

    def test_without_detections_is_nothing(self, make_judged) -> None:
        assert coco_average_precision([make_judged(BALL)]) == (0, 0)

    def test_without_balls_is_not_defined(self, make_judged) -> None:
        assert coco_average_precision([make_judged(None, (BALL, 0.9))]) == (None, None)


class TestFindHits:
    def test_the_surest_detection_that_overlaps_gets_the_ball(self, make_judged) -> None:
        hits = match_detections_to_balls([make_judged(BALL, (AWAY, 0.9), (HALF, 0.8), (BALL, 0.7))])
        assert hits.found[:, 0].tolist() == [False, True, False]
        # At 0.55 the half box does not reach, so the exact one does.
        assert hits.found[:, 1].tolist() == [False, False, True]

    def test_an_overlap_of_exactly_the_threshold_counts(self, make_judged) -> None:
        assert IOUS[0] == 0.5
        assert match_detections_to_balls([make_judged(BALL, (HALF, 0.8))]).found[0, 0]

    def test_whatever_is_found_where_no_ball_is_is_wrong(self, make_judged) -> None:
        assert not match_detections_to_balls([make_judged(None, (BALL, 0.9))]).found.any()


class TestCurve:
    def test_recall_and_precision_of_three_detections_are_those_computed_by_hand(
        self, make_judged
    ) -> None:
        # Right, wrong, right: of two balls.
        judged = [
            make_judged(BALL, (BALL, 0.9), (AWAY, 0.8), identity=1),
            make_judged(BALL, (BALL, 0.7), identity=2),
        ]
        found = precision_recall_curve(match_detections_to_balls(judged))
        assert found.recall.tolist() == [0.5, 0.5, 1.0]
        assert found.precision == pytest.approx([1, 0.5, 2 / 3])
        # VOC: half of the recall at precision 1, half at 2/3.
        assert area_under_curve(found) == pytest.approx(0.5 + 0.5 * 2 / 3)
        # COCO: recalls 0 to 0.5 at 1, the 50 others at 2/3.
        assert interpolated_average_precision(found) == pytest.approx((51 + 50 * 2 / 3) / 101)

    def test_a_frame_that_counts_twice_is_a_frame_that_is_there_twice(self, make_judged) -> None:
        one, two = make_judged(BALL, (BALL, 0.9), identity=1), make_judged(BALL, (AWAY, 0.8))
        twice = precision_recall_curve(
            match_detections_to_balls([one, two]), 0, np.array([1.0, 2.0])
        )
        written = precision_recall_curve(match_detections_to_balls([one, two, two]))
        assert interpolated_average_precision(twice) == pytest.approx(
            interpolated_average_precision(written)
        )

    def test_its_means_are_those_of_the_public_evaluator(self, random_judged) -> None:
        hits = match_detections_to_balls(random_judged)
        ap_50, ap = coco_average_precision(random_judged)
        assert interpolated_average_precision(precision_recall_curve(hits)) == pytest.approx(
            ap_50, abs=1e-12
        )
        assert mean_average_precision_over_ious(hits) == pytest.approx(ap, abs=1e-12)


class TestMeanInterpolated:
    @pytest.mark.parametrize("seed", range(5))
    def test_is_that_of_each_threshold_to_the_last_bit(self, random_judged, seed: int) -> None:
        hits = match_detections_to_balls(random_judged)
        weights = np.random.default_rng(seed).integers(0, 3, len(hits.balls)).astype(float)
        each = [
            interpolated_average_precision(precision_recall_curve(hits, index, weights))
            for index in range(len(IOUS))
        ]
        assert mean_average_precision_over_ious(hits, weights) == np.mean(each)

    def test_without_a_ball_there_is_none_and_without_a_detection_it_is_nought(
        self, make_judged
    ) -> None:
        assert np.isnan(
            mean_average_precision_over_ious(
                match_detections_to_balls([make_judged(None, (BALL, 0.9))])
            )
        )
        assert (
            mean_average_precision_over_ious(match_detections_to_balls([make_judged(BALL)])) == 0.0
        )


RESULT = FrameResult(1, 1, "g", "v", "m", ball=True, detections=1)


class TestBins:
    def test_a_value_on_an_edge_belongs_to_the_bin_above(self) -> None:
        assert [DISTANCE.find_bin_index(value) for value in (0.0, 19.9, 20.0, 100.0, 900.0)] == [
            0,
            0,
            1,
            8,
            8,
        ]
        assert DISTANCE.find_bin_index(None) is None
        assert DISTANCE.format_bin_name(1) == "20 to 30 m"
        assert DISTANCE.format_bin_name(8) == "100 m and more"


class TestErrorFigure:
    def test_has_the_median_and_quarters_of_each_bin(self) -> None:
        frames = [replace(RESULT, distance_m=25.0, error_m=float(error)) for error in range(5)] + [
            replace(RESULT, distance_m=45.0, error_m=9.0),
            RESULT,
        ]
        points, middle = make_error_figure(frames, DISTANCE).panels[0].series
        assert middle.x == (25, 45)
        assert middle.y == (2, 9)
        assert (middle.low, middle.high, middle.count) == ((1, 9), (3, 9), (5, 1))
        assert len(points.x) == 6

    def test_a_median_opens_its_bin_and_a_point_its_frame(self) -> None:
        places = [20.0, 25.0, 29.9, 105.0]
        frames = [replace(RESULT, distance_m=place, error_m=1.0) for place in places]
        points, middle = make_error_figure(frames, DISTANCE).panels[0].series
        assert [(item.low, item.high) for item in middle.frames] == [(20, 30), (100, None)]
        assert {item.field for item in (*middle.frames, *points.frames)} == {"distance_m"}
        for behind in points.frames:
            assert sum(behind.low <= place < behind.high for place in places) == 1

    @pytest.mark.parametrize("bins", [DISTANCE, PARALLAX, SIZE])
    def test_without_values_the_figure_is_empty(self, bins) -> None:
        points, middle = make_error_figure([RESULT], bins).panels[0].series
        assert points.x == middle.x == ()


class TestDetectionTable:
    def test_each_bin_is_an_evaluation_of_its_own(self, make_frame) -> None:
        near, far = make_frame(1, distance=25.0), make_frame(2, distance=85.0)
        judged = [
            FrameWithDetections(
                near, near.boxes["optimized"], (Detection(near.boxes["optimized"], 0.9),)
            ),
            FrameWithDetections(far, far.boxes["optimized"], ()),
        ]
        results = [make_frame_result(item, DIAMETER) for item in judged]
        table = make_detection_table_by_bin(judged, results, DISTANCE)
        assert [row.label for row in table.rows] == ["20 to 30 m", "80 to 100 m"]
        assert [row.cells[0].value for row in table.rows] == [1, 0]
        assert [row.cells[2].value for row in table.rows] == [1, 0]
        assert table.rows[0].frames is not None
        assert (table.rows[0].frames.low, table.rows[0].frames.high) == (20, 30)
