from __future__ import annotations

from dataclasses import replace

import pytest

from app.evaluation.evaluate import Inputs, Options, evaluate
from app.evaluation.frame import Detection
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
        result = evaluate(frames, Inputs(found_in(frames, "optimized")), Options(resamples=50))
        assert result.table("detection").cell("all", "ap_50").value == 1
        assert result.table("localization").cell("oracle", "mae_m").value == pytest.approx(0)
        assert result.table("localization").cell("oracle_all", "p_2m").value == 1

    def test_loose_boxes_are_found_and_misplaced(self, frames) -> None:
        result = evaluate(frames, Inputs(found_in(frames, "annotated")), Options(resamples=50))
        assert result.table("detection").cell("all", "ap_50").value == 1
        assert result.table("detection").cell("all", "ap").value < 0.5
        assert result.table("localization").cell("oracle", "mae_percent").value == pytest.approx(20)
        assert result.table("localization").cell("oracle", "p_2m").value == 0

    def test_every_denominator_is_told(self, frames) -> None:
        found = found_in(frames, "optimized")
        found[9] = [Detection(Box(5, 5, 9, 9), 0.99)]
        found[10] = [Detection(Box(5, 5, 9, 9), 0.99)] * 2
        del found[1]
        counts = evaluate(frames, Inputs(found), Options(resamples=50)).counts
        assert {name: counts[name] for name in ("frames", "judged", "balls", "without_ball")} == {
            "frames": 10, "judged": 9, "balls": 8, "without_ball": 1,
        }  # fmt: skip
        assert (counts["detections"], counts["detections_not_judged"]) == (8, 2)
        assert (counts["frames_with_detections"], counts["matches"]) == (8, 2)

    def test_what_is_found_without_a_ball_costs_precision(self, frames) -> None:
        found = found_in(frames, "optimized")
        found[9] = [Detection(Box(5, 5, 9, 9), 0.99)]
        result = evaluate(frames, Inputs(found), Options(resamples=50))
        assert result.table("detection").cell("all", "ap_50").value == pytest.approx(8 / 9)

    def test_the_same_seed_gives_the_same_intervals(self, frames) -> None:
        found = Inputs(found_in(frames, "annotated"))
        first, again = (evaluate(frames, found, Options(resamples=50, seed=7)) for _ in range(2))
        assert first == again

    def test_only_what_the_inputs_allow_is_there(self, frames) -> None:
        careful = {frame.id: frame.boxes["exact"] for frame in frames if frame.boxes}
        result = evaluate(frames, Inputs(careful=careful), Options(resamples=50))
        assert [table.name for table in result.tables] == ["boxes", "sensitivity"]
        assert [figure.name for figure in result.figures] == ["box_overlap", "sensitivity"]
        cameras = {frame.id: camera_at(50.0) for frame in frames}
        whole = evaluate(
            frames, Inputs(found_in(frames, "exact"), careful, cameras), Options(resamples=50)
        )
        assert {table.name for table in whole.tables} == {
            "detection", "localization", "detection_by_size", "detection_by_distance",
            "boxes", "calibration", "sensitivity",
        }  # fmt: skip
        assert len(whole.figures) == 8

    def test_rows_name_the_frames_behind_them(self, frames) -> None:
        result = evaluate(frames, Inputs(found_in(frames, "optimized")), Options(resamples=50))
        table = result.table("detection_by_distance")
        for row in table.rows:
            inside = [
                frame
                for frame in result.frames
                if frame.distance_m is not None
                and row.frames.low <= frame.distance_m < (row.frames.high or 1e9)
            ]
            assert len(inside) == row.cells[0].count
