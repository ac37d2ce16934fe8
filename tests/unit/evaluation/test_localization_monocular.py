from __future__ import annotations

from dataclasses import replace

import pytest

from app.evaluation.frame import Detection, FrameWithDetections
from app.evaluation.localization import make_frame_result, measure_position_error
from app.soccer.frames import Box, ImagePoint
from tests.unit.evaluation.conftest import DIAMETER, camera_at


def judged(frame, *found: Detection) -> FrameWithDetections:
    return FrameWithDetections(frame, frame.boxes["optimized"], found)


class TestPlaceError:
    def test_of_the_optimised_box_is_nothing(self, make_frame) -> None:
        frame = make_frame(distance=50.0)
        found = Detection(frame.boxes["optimized"])
        assert measure_position_error(frame, frame.camera, found, DIAMETER) == pytest.approx(
            0, abs=1e-9
        )

    def test_of_a_box_a_quarter_too_large_is_a_fifth_of_the_distance(self, make_frame) -> None:
        # Depth times diameter is constant: 50 m / 1.25 = 40 m.
        frame = make_frame(distance=50.0)
        found = Detection(frame.boxes["annotated"])
        assert measure_position_error(frame, frame.camera, found, DIAMETER) == pytest.approx(10)

    def test_without_camera_ball_or_detection_there_is_none(self, make_frame) -> None:
        frame = make_frame()
        found = Detection(frame.boxes["optimized"])
        assert measure_position_error(frame, None, found, DIAMETER) is None
        assert (
            measure_position_error(replace(frame, point=None), frame.camera, found, DIAMETER)
            is None
        )
        assert measure_position_error(frame, frame.camera, None, DIAMETER) is None


class TestMeasureFrame:
    def test_a_hit_is_the_surest_detection_that_overlaps(self, make_frame) -> None:
        frame = make_frame()
        center = frame.boxes["optimized"].center
        away = Detection(Box(5, 5, 9, 9), 0.9)
        near = Detection(Box.square(ImagePoint(center.x + 2, center.y), 10.0), 0.6)
        exact = Detection(frame.boxes["optimized"], 0.5)
        found = make_frame_result(judged(frame, away, near, exact), DIAMETER)
        assert (found.score, found.iou) == (0.9, 0)
        assert found.hit_score == 0.6
        assert found.hit_iou is not None
        assert found.error_m is not None and found.any_error_m is not None
        assert found.error_m < found.any_error_m

    def test_numbers_by_hand(self, make_frame) -> None:
        frame = make_frame(distance=50.0)
        found = make_frame_result(judged(frame, Detection(frame.boxes["annotated"], 0.8)), DIAMETER)
        assert found.distance_m == pytest.approx(50)
        assert found.error_m == pytest.approx(10)
        assert found.error_percent == pytest.approx(20)
        assert found.size_error_percent == pytest.approx(25)
        assert found.hit_iou == pytest.approx(0.64)
        assert found.diameter_px == pytest.approx(2000 * DIAMETER / 50)

    def test_a_predicted_camera_has_its_own_error_of_the_true_distance(self, make_frame) -> None:
        frame = make_frame(distance=50.0)
        found = make_frame_result(
            judged(frame, Detection(frame.boxes["optimized"])), DIAMETER, camera_at(55.0)
        )
        # The same ball, seen from five metres farther back.
        assert found.error_m == pytest.approx(0, abs=1e-9)
        assert found.predicted_error_m == pytest.approx(5)
        assert found.predicted_error_percent == pytest.approx(10)

    def test_unsure_detections_take_no_part(self, make_frame) -> None:
        frame = make_frame()
        found = make_frame_result(
            judged(frame, Detection(frame.boxes["optimized"], 0.2)), DIAMETER, min_score=0.5
        )
        assert (found.detections, found.score, found.error_m) == (1, None, None)

    def test_a_frame_without_ball_has_no_hit(self, make_frame) -> None:
        frame = replace(make_frame(), absent=True, point=None)
        found = make_frame_result(
            FrameWithDetections(frame, None, (Detection(Box(5, 5, 9, 9), 0.9),)), DIAMETER
        )
        assert (found.ball, found.score, found.iou, found.hit_iou) == (False, 0.9, None, None)
