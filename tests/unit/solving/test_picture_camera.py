from dataclasses import replace

import numpy as np
import pytest

from app.geometry.resection import PARAMETERS
from app.soccer.annotation import make_lines
from app.soccer.group import Station
from app.soccer.picture import OPEN, PictureGeometry
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import (
    calibrate,
    calibrate_altered_picture,
    calibrate_station,
    compute_calibration_key,
)
from app.solving.observations import make_observations
from app.solving.picture_camera import PictureProblem, estimate_picture, picture_to_warp
from app.solving.resect import ResectionProblem
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, PITCH, click

POLICY = CalibrationPolicy()
STRETCHED = PictureGeometry(4 / 3, (0.0, 0.0))
CROPPED = PictureGeometry(1.0, (0.3, 0.0))
BOTH = PictureGeometry(1.1, (-0.2, 0.1))


def shown(picture, camera=BEHIND_GOAL, noise_px=0.0, seed=0):
    return click(picture.camera_of_annotated_picture(camera, SIZE), noise_px, seed)


def fitted(picture, lines):
    problem = ResectionProblem.of(SIZE, POLICY)
    return PictureProblem.of(problem, make_observations(lines, PITCH, SIZE), picture)


class TestRows:
    def test_derivatives_are_those_of_the_distances(self):
        search = fitted(OPEN, shown(BOTH, noise_px=1.0))
        at = np.append(search.problem.parameters(BEHIND_GOAL), picture_to_warp(BOTH) + 0.01)
        _, jacobian = search.rows(at)
        for column in range(PARAMETERS, PARAMETERS + 3):
            step = np.zeros(PARAMETERS + 3)
            step[column] = 1e-5
            slope = (search.rows(at + step)[0] - search.rows(at - step)[0]) / 2e-5
            # The normal turns a little with the picture, which is of second order.
            np.testing.assert_allclose(jacobian[:, column], slope, rtol=0.05, atol=12.0)

    def test_distances_are_those_in_the_picture_as_it_is(self):
        lines = shown(STRETCHED)
        moved = make_lines({name: [(x + 2.0, y) for x, y in at] for name, at in lines.items()})
        search = fitted(OPEN, moved)
        at = np.append(search.problem.parameters(BEHIND_GOAL), picture_to_warp(STRETCHED))
        apart = np.abs(search.rows(at)[0])
        # Two pixels aside, whatever the direction of a line: at most two pixels off, and not 1.5.
        assert 1.8 < apart.max() < 2.1


class TestEstimatePicture:
    @pytest.mark.parametrize("truth", [STRETCHED, CROPPED, BOTH])
    def test_the_lines_of_one_view_say_what_was_done(self, truth):
        problem = ResectionProblem.of(SIZE, POLICY)
        found = estimate_picture(
            problem, make_observations(shown(truth, noise_px=0.3), PITCH, SIZE), OPEN
        )
        off = np.abs(picture_to_warp(found) - picture_to_warp(truth))
        assert (off < 4 * np.array(found.sigma)).all()
        assert off.max() < 0.05

    def test_what_is_known_is_not_asked_again(self):
        problem = ResectionProblem.of(SIZE, POLICY)
        known = replace(STRETCHED, sigma=(0.004, 0.02, 0.02))
        assert (
            estimate_picture(problem, make_observations(shown(BOTH), PITCH, SIZE), known) is known
        )


class TestCalibratePicture:
    @pytest.mark.parametrize("camera", [MAIN, BEHIND_GOAL, OPPOSITE])
    @pytest.mark.parametrize("truth", [STRETCHED, CROPPED])
    def test_the_camera_stands_where_it_stood(self, truth, camera):
        found = calibrate_altered_picture(shown(truth, camera, 0.3), PITCH, SIZE, POLICY, OPEN)
        off = found.camera.position - camera.position
        covariance = np.reshape(found.covariance, (8, 8))[3:6, 3:6]
        assert off @ np.linalg.solve(covariance, off) < 16.3
        assert found.jac[0] > 0.85
        assert found.picture is None

    def test_a_picture_that_is_known_gives_the_camera_at_once(self):
        found = calibrate_altered_picture(shown(STRETCHED), PITCH, SIZE, POLICY, STRETCHED)
        np.testing.assert_allclose(found.camera.position, BEHIND_GOAL.position, atol=0.05)
        width, height = found.camera.focal_length
        assert width / height == pytest.approx(4 / 3)

    def test_its_covariance_grows_with_what_is_not_known_of_the_picture(self):
        lines = shown(CROPPED, noise_px=0.5)
        known = calibrate_altered_picture(lines, PITCH, SIZE, POLICY, CROPPED)
        asked = calibrate_altered_picture(lines, PITCH, SIZE, POLICY, OPEN)
        assert asked.position_sigma_m > 1.2 * known.position_sigma_m

    def test_a_wrong_label_is_found_in_a_stretched_picture(self):
        lines = dict(shown(STRETCHED, noise_px=0.3))
        lines["Small rect. right main"], lines["Big rect. right main"] = (
            lines["Big rect. right main"],
            lines["Small rect. right main"],
        )
        found = calibrate_altered_picture(make_lines(lines), PITCH, SIZE, POLICY, OPEN)
        names = {suspect.marking for suspect in found.suspects}
        assert names == {"Small rect. right main", "Big rect. right main"}
        width, height = found.camera.focal_length
        assert width / height == pytest.approx(4 / 3, abs=0.02)
        assert found.position_sigma_m < 0.5

    def test_too_few_lines_say_so(self):
        few = dict(list(shown(STRETCHED).items())[:2])
        found = calibrate_altered_picture(make_lines(few), PITCH, SIZE, POLICY, OPEN)
        assert found.camera is None
        assert "a camera needs" in found.reason


class TestCalibrateStation:
    def test_a_station_without_a_picture_is_calibrated_as_ever(self):
        lines = click(MAIN, 0.5)
        station = Station("a", SIZE, lines=lines)
        assert calibrate_station(station, PITCH, POLICY) == calibrate(lines, PITCH, SIZE, POLICY)

    def test_the_key_knows_the_picture_where_the_lines_count(self):
        station = Station("a", SIZE, lines=click(MAIN, 0.5))
        other = replace(station, picture=OPEN)
        assert compute_calibration_key(station, PITCH, POLICY) != compute_calibration_key(
            other, PITCH, POLICY
        )
        given, same = (replace(item, given=MAIN) for item in (station, other))
        assert compute_calibration_key(given, PITCH, POLICY) == compute_calibration_key(
            same, PITCH, POLICY
        )
