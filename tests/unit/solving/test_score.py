from __future__ import annotations

import pytest

from app.soccer.annotation import make_lines
from app.soccer.policy import CalibrationPolicy
from app.solving.score import FrameScore, leave_one_out, score_frame, score_frames
from tests.cameras import SIZE
from tests.unit.solving.conftest import MAIN, PITCH, click


class TestScore:
    def test_a_frame_without_a_camera_counts_as_zero(self):
        good = FrameScore((1.0, 1.0, 1.0), 0.9, (1.0, 3.0))
        total = score_frames([good, None])
        assert (total.frames, total.calibrated, total.completeness) == (2, 1, 0.5)
        assert total.jac == (0.5, 0.5, 0.5)
        assert (total.share, total.challenge) == (0.5, 0.45)
        assert total.error_median_px == 2.0

    def test_three_quarters_is_not_above_three_quarters(self):
        assert score_frames([FrameScore((0.75, 1.0, 1.0), 1.0, ())]).share == 0.0

    def test_without_frames_every_score_is_zero(self):
        total = score_frames([])
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
        errors = dict(leave_one_out(lines, PITCH, SIZE, CalibrationPolicy()))
        assert set(errors) == set(lines)
        assert sorted(errors.values())[len(errors) // 2] < 5.0

    def test_what_the_others_cannot_calibrate_has_no_error(self):
        lines = click(MAIN)
        few = make_lines({name: lines[name] for name in list(lines)[:3]})
        errors = dict(leave_one_out(few, PITCH, SIZE, CalibrationPolicy()))
        assert set(errors.values()) == {None}
