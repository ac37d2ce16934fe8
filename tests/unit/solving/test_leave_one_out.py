from app.soccer.annotation import make_lines
from app.soccer.policy import CalibrationPolicy
from app.solving.leave_one_out import leave_one_out
from tests.cameras import SIZE
from tests.unit.solving.conftest import MAIN, PITCH, click


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
