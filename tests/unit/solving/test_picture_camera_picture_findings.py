from dataclasses import replace

import numpy as np
import pytest

from app.soccer.annotation import make_lines
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate
from app.solving.calibration_findings import find_calibration_findings
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, PITCH, click

POLICY = CalibrationPolicy()


def cropped(camera, share):
    """The camera with its axis that share of the width right of the middle."""
    x, y = camera.principal_point
    return replace(camera, principal_point=(x + share * SIZE.width, y))


def stretched(camera, share):
    """The camera with pixels too wide by that share."""
    return replace(
        camera, focal_length=(camera.focal_length[0] * (1 + share), camera.focal_length[1])
    )


def found(camera, noise_px=0.5, seed=0):
    return calibrate(click(camera, noise_px, seed), PITCH, SIZE, POLICY)


def sentence(calibration):
    said = list(find_calibration_findings(calibration, SIZE, "a"))
    return next(item.sentence for item in said if item.kind == "picture_geometry")


class TestFindPicture:
    @pytest.mark.parametrize("camera", [MAIN, BEHIND_GOAL, OPPOSITE])
    def test_a_picture_as_it_was_taken_raises_no_alarm(self, camera):
        assert found(camera, 1.0, seed=1).picture is None

    @pytest.mark.parametrize("share", [-0.25, 0.05, 1 / 3])
    def test_pixels_that_are_not_square_are_measured(self, share):
        picture = found(stretched(BEHIND_GOAL, share)).picture
        assert picture.stretch == pytest.approx(share, abs=0.02)
        assert np.hypot(*picture.shift) < 0.1

    @pytest.mark.parametrize("share", [-0.25, 0.1])
    def test_an_axis_that_is_not_in_the_middle_is_measured(self, share):
        picture = found(cropped(BEHIND_GOAL, share)).picture
        at = picture.shift[0] * SIZE.diagonal / 2 / SIZE.width
        assert at == pytest.approx(share, abs=0.03)
        assert abs(picture.stretch) < 0.02

    def test_where_errors_are_known_to_be_each_clicks_own_one_picture_says_more(self):
        known = CalibrationPolicy(line_share=0.0)
        for seed in range(2):
            lines = click(stretched(MAIN, 0.05), 1.0, seed)
            assert calibrate(lines, PITCH, SIZE, POLICY).picture is None
            picture = calibrate(lines, PITCH, SIZE, known).picture
            assert picture.stretch == pytest.approx(0.05, abs=0.02)
            ordinary = click(MAIN, 1.0, seed)
            assert calibrate(ordinary, PITCH, SIZE, known).picture is None

    def test_too_few_points_say_nothing(self):
        lines = click(stretched(BEHIND_GOAL, 1 / 3), 0.5)
        few = make_lines({name: lines[name][:2] for name in list(lines)[:5]})
        assert calibrate(few, PITCH, SIZE, POLICY).picture is None

    def test_the_finding_says_what_was_done_to_the_picture(self):
        assert "33 % too wide: a stretched picture" in sentence(
            found(stretched(BEHIND_GOAL, 1 / 3))
        )
        said = sentence(found(cropped(BEHIND_GOAL, 0.1)))
        assert "of the width right of the middle: a cropped picture" in said
