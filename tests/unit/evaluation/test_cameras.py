from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.bootstrap import MatchResamples
from app.evaluation.cameras import (
    FrameScore,
    combine_frame_scores,
    make_cameras_table,
    make_jac_figure,
    measure_leave_one_out_errors,
    score_cameras,
    score_frame,
)
from app.evaluation.result import FrameFieldRange
from app.geometry.camera import rotation_from_pan_tilt_roll
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import MARKINGS, Pitch
from app.soccer.policy import CalibrationPolicy
from tests.cameras import SIZE
from tests.unit.solving.conftest import MAIN, PITCH, click


def with_lines(frame):
    """The frame with every marking that its camera sees, exactly."""
    lines = {}
    for marking in MARKINGS:
        pixels = frame.camera.project(Pitch().sample(marking, 0.9, 0.2))
        inside = (pixels > 0).all(axis=1) & (pixels < [1280, 720]).all(axis=1)
        if inside.any():
            lines[marking] = pixels[inside].tolist()
    return replace(frame, lines=make_lines(lines))


@pytest.fixture
def frames(make_frame):
    high = np.array([0.0, 60.0, -20.0])
    made = []
    for number in (1, 2, 3):
        frame = make_frame(number, match=f"m{number}")
        down = rotation_from_pan_tilt_roll(*np.radians([0.0, 72.0, 0.0]))
        camera = replace(frame.camera, position=high, rotation=down)
        made.append(with_lines(replace(frame, camera=camera)))
    return [*made[:2], replace(made[2], lines={})]


class TestScoreCameras:
    def test_a_frame_without_camera_counts_and_one_without_lines_does_not(self, frames) -> None:
        scores = score_cameras(frames, {1: frames[0].camera})
        assert list(scores) == [1, 2]
        assert scores[2] is None
        assert scores[1] == score_frame(frames[0].camera, frames[0].lines, Pitch(), frames[0].size)

    def test_a_static_camera_is_measured_once(self, frames, monkeypatch) -> None:
        calls = []

        def counted(*arguments):
            calls.append(arguments)
            return score_frame(*arguments)

        monkeypatch.setattr("app.evaluation.cameras.score_frame", counted)
        same = [replace(frame, station="cam1") for frame in frames[:2]]
        score_cameras(same, {frame.id: frames[0].camera for frame in same})
        assert len(calls) == 1

    def test_a_static_camera_is_measured_on_each_pitch_and_size(self, frames) -> None:
        camera = frames[0].camera
        one = replace(frames[0], station="cam1")
        small = replace(one, id=2, pitch=Pitch(95.0, 60.0))
        half = ImageSize(one.size.width // 2, one.size.height // 2)
        every = [one, small, replace(one, id=3, size=half)]
        scores = score_cameras(every, {frame.id: camera for frame in every})
        for frame in every:
            alone = score_frame(camera, frame.lines, frame.pitch, frame.size)
            assert scores[frame.id] == alone
        assert len({repr(score) for score in scores.values()}) == 3


class TestCamerasTable:
    def test_missing_cameras_count_as_nothing(self, frames) -> None:
        rows = [("predicted", "Predicted", score_cameras(frames, {1: frames[0].camera}))]
        table = make_cameras_table(rows, frames, MatchResamples.draw(["m1", "m2", "m3"]), {1})
        assert table.cell("predicted", "completeness").value == 0.5
        assert table.cell("predicted", "jac_0.5").value == pytest.approx(0.5)
        assert table.cell("predicted", "challenge").value == pytest.approx(0.5)
        assert table.cell("predicted", "jac_2").of == 2
        assert table.cell("predicted", "error_median_px").value == pytest.approx(0, abs=0.5)
        assert table.row("predicted").frames == FrameFieldRange("predicted_jac")
        assert "The list of frames has 1 of them" in table.note


class TestJacFigure:
    def test_counts_frames_above_each_threshold(self, frames) -> None:
        rows = [("predicted", "Predicted", score_cameras(frames, {1: frames[0].camera}))]
        (panel,) = make_jac_figure(rows, 0.75).panels
        at = dict(zip(panel.series[0].x, panel.series[0].y, strict=True))
        assert (at[0.0], at[0.75], at[1.0]) == (0.5, 0.5, 0)
        assert panel.marks[0].at == 0.75

    def test_a_point_opens_the_frames_above_it_where_their_number_is_kept(self, frames) -> None:
        scores = score_cameras(frames, {1: frames[0].camera})
        rows = [("predicted", "Predicted", scores), ("dataset", "Own", scores)]
        predicted, own = make_jac_figure(rows, 0.75).panels
        at = dict(zip(predicted.series[0].x, predicted.series[0].frames, strict=True))
        assert at[0.75].low > 0.75 == np.nextafter(at[0.75].low, 0)
        assert at[0.75].high is None
        others = [*predicted.series[1:], *own.series]
        assert [series.frames for series in others] == [()] * 5


class TestScore:
    def test_a_frame_without_a_camera_counts_as_zero(self):
        good = FrameScore((1.0, 1.0, 1.0), 0.9, (1.0, 3.0))
        total = combine_frame_scores([good, None])
        assert (total.frames, total.calibrated, total.completeness) == (2, 1, 0.5)
        assert total.jac == (0.5, 0.5, 0.5)
        assert (total.share, total.challenge) == (0.5, 0.45)
        assert total.error_median_px == 2.0

    def test_three_quarters_is_not_above_three_quarters(self):
        assert combine_frame_scores([FrameScore((0.75, 1.0, 1.0), 1.0, ())]).share == 0.0

    def test_without_frames_every_score_is_zero(self):
        total = combine_frame_scores([])
        assert (total.completeness, total.share, total.error_median_px) == (0.0, 0.0, None)


class TestScoreFrame:
    def test_the_true_camera_scores_high_with_small_errors(self):
        found = score_frame(MAIN, click(MAIN, 0.5), PITCH, SIZE)
        assert min(found.jac) > 0.9
        assert max(found.distances_px) < 3
        assert found.challenge == pytest.approx(found.jac[0], abs=0.1)


class TestLeaveOneOut:
    def test_the_others_predict_a_marking_they_were_not_shown(self):
        lines = click(MAIN, 0.5)
        errors = dict(measure_leave_one_out_errors(lines, PITCH, SIZE, CalibrationPolicy()))
        assert set(errors) == set(lines)
        assert sorted(errors.values())[len(errors) // 2] < 5.0

    def test_what_the_others_cannot_calibrate_has_no_error(self):
        lines = click(MAIN)
        few = make_lines({name: lines[name] for name in list(lines)[:3]})
        errors = dict(measure_leave_one_out_errors(few, PITCH, SIZE, CalibrationPolicy()))
        assert set(errors.values()) == {None}
