from __future__ import annotations

import numpy as np
import pytest

from app.soccer.annotation import make_lines
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate, calibrate_near_position
from app.solving.camera_positions import PositionPrior, make_match_position_prior
from app.solving.match_position import (
    NO_PLACES,
    FrameCameraPlace,
    FrameCameraPlaces,
    calibrate_with_match_position,
    find_main_camera_place,
    guess_match_of_each_frame,
)
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEHIND_GOAL, BEND, PITCH, click

POLICY = CalibrationPolicy()
STAND = np.array([1.0, 60.0, -14.0])


def place(position, sigma=0.4, pan=0.5):
    return FrameCameraPlace(np.array(position, dtype=float), sigma**2 * np.eye(3), pan)


def off(x, y, z):
    """So many metres from the stand."""
    return STAND + np.array([x, y, z])


def around(position, count, seed=0, sigma=0.3):
    generator = np.random.default_rng(seed)
    return [place(position + generator.normal(0, sigma, 3)) for _ in range(count)]


def frame(x, focal=1700.0, seed=0, stand=STAND):
    return click(looking(stand, (x, -2.0, 0.0), focal, bend=BEND), 1.0, seed)


FEW = ("Big rect. right main", "Big rect. right top", "Circle right", "Small rect. right main")


def few(seed, stand=STAND):
    """Little of a picture: its camera could stand nearer or farther."""
    lines = frame(38.0, 3200.0, seed, stand)
    return make_lines({name: lines[name] for name in FEW if name in lines})


def others(stand=STAND):
    frames = [frame(x, seed=seed, stand=stand) for seed, x in enumerate((-38, -30, 28, 34, 38, 40))]
    places = [
        find_main_camera_place(calibrate(lines, PITCH, SIZE, POLICY), SIZE) for lines in frames
    ]
    return FrameCameraPlaces([found for found in places if found is not None])


@pytest.fixture(scope="module")
def match():
    return others()


class TestPlaceOf:
    def test_a_main_camera_that_its_lines_determine_has_a_place(self):
        found = find_main_camera_place(calibrate(frame(34.0), PITCH, SIZE, POLICY), SIZE)
        assert found.position == pytest.approx(STAND, abs=1.5)
        assert np.degrees(found.pan) == pytest.approx(29, abs=3)

    def test_a_replay_has_none(self):
        assert (
            find_main_camera_place(calibrate(click(BEHIND_GOAL), PITCH, SIZE, POLICY), SIZE) is None
        )


class TestPrior:
    def test_many_frames_say_together_where_the_camera_stands(self):
        prior = FrameCameraPlaces(around(STAND, 20)).position_prior(0.5)
        assert prior.mean == pytest.approx(STAND, abs=0.3)
        assert (prior.sigma < 0.3).all()

    def test_a_bad_frame_carries_nothing_away(self):
        clean = FrameCameraPlaces(around(STAND, 10)).position_prior(0.5)
        spoilt = FrameCameraPlaces([*around(STAND, 10), place(off(0.0, 9.0, -3.0))]).position_prior(
            0.5
        )
        assert spoilt.mean == pytest.approx(clean.mean, abs=0.1)

    def test_the_place_moves_with_the_direction_of_view(self):
        turned = [
            FrameCameraPlace(it.position + np.array([2.0 * pan, 0.0, 0.0]), it.covariance, pan)
            for pan in (-0.6, -0.3, 0.3, 0.6)
            for it in around(STAND, 5, seed=int(10 * pan) + 9)
        ]
        left, right = (FrameCameraPlaces(turned).position_prior(pan).mean for pan in (-0.5, 0.5))
        assert right - left == pytest.approx([2.0, 0.0, 0.0], abs=0.4)

    def test_frames_that_look_elsewhere_say_less(self):
        turned = [FrameCameraPlace(it.position, it.covariance, -0.6) for it in around(STAND, 100)]
        there, elsewhere = (
            FrameCameraPlaces(turned).position_prior(pan).sigma for pan in (-0.6, 0.5)
        )
        assert (there < 0.2).all()
        assert elsewhere[0] > 1.0
        assert (elsewhere > there).all()

    def test_one_is_left_out_without_a_copy_of_the_others(self):
        odd = place(off(0.0, 9.0, -3.0))
        every = FrameCameraPlaces([*around(STAND, 3), odd])
        rest = every.without_frame(3)
        assert rest.position_prior(0.5).mean == pytest.approx(
            FrameCameraPlaces(around(STAND, 3)).position_prior(0.5).mean
        )
        assert FrameCameraPlaces(around(STAND, 3)).without_frame(0).position_prior(0.5) is None
        assert rest._equations is every._equations

    def test_what_is_known_with_a_frame_is_not_known_without_it(self):
        every = FrameCameraPlaces(around(STAND, 3))
        assert every.position_prior(0.5) is not None
        assert every.without_frame(0).position_prior(0.5) is None

    def test_frames_of_several_stadiums_say_nothing(self):
        mixed = [
            item
            for seed, y in enumerate((45.0, 55.0, 65.0, 75.0, 85.0))
            for item in around(np.array([0.0, y, -y / 4]), 3, seed)
        ]
        assert FrameCameraPlaces(mixed).position_prior(0.5) is None

    def test_two_frames_are_too_few(self):
        assert FrameCameraPlaces(around(STAND, 2)).position_prior(0.5) is None


class TestSharePosition:
    def test_a_frame_of_few_markings_gets_its_camera_from_the_others(self, match):
        alone, shared = [], []
        for seed in range(6):
            lines = few(seed)
            found = calibrate(lines, PITCH, SIZE, POLICY)
            both = calibrate_with_match_position(found, match, lines, PITCH, SIZE, POLICY)
            alone.append(np.linalg.norm(found.camera.position - STAND))
            shared.append(np.linalg.norm(both.camera.position - STAND))
        assert np.mean(shared) < 0.5 * np.mean(alone)

    def test_clicks_that_err_together_count_less_against_the_others(self):
        lines = frame(38.0, 1700.0)
        alone = calibrate(lines, PITCH, SIZE, POLICY)
        near = alone.camera.position + np.array([0.0, 1.0, -0.2])
        apart = []
        for prior in (
            PositionPrior(near, np.full(3, 0.2), 4.0),
            make_match_position_prior(near, np.full(3, 0.2)),
        ):
            found = calibrate_near_position(alone, prior, lines, PITCH, SIZE, POLICY)
            apart.append(np.linalg.norm(found.camera.position - near))
        assert apart[1] < 0.9 * apart[0]

    def test_the_wrong_match_harms_no_frame_whose_lines_contradict_it(self):
        wrong = others(np.array([-2.0, 85.0, -21.0]))
        lines = frame(38.0, 1300.0)
        alone = calibrate(lines, PITCH, SIZE, POLICY)
        found = calibrate_with_match_position(alone, wrong, lines, PITCH, SIZE, POLICY)
        assert found.camera.position == pytest.approx(alone.camera.position, abs=0.2)

    def test_a_prior_that_does_not_give_way_is_dropped_where_the_lines_contradict_it(self):
        lines = frame(38.0, 1300.0)
        alone = calibrate(lines, PITCH, SIZE, POLICY)
        stiff = PositionPrior(off(0.0, 25.0, -7.0), np.full(3, 0.1), 1e9)
        assert calibrate_near_position(alone, stiff, lines, PITCH, SIZE, POLICY) is alone

    def test_a_replay_is_left_alone(self, match):
        lines = click(BEHIND_GOAL, 1.0)
        alone = calibrate(lines, PITCH, SIZE, POLICY)
        assert calibrate_with_match_position(alone, match, lines, PITCH, SIZE, POLICY) is alone

    def test_without_others_nothing_changes(self):
        alone = calibrate(few(0), PITCH, SIZE, POLICY)
        assert calibrate_with_match_position(alone, NO_PLACES, few(0), PITCH, SIZE, POLICY) is alone


NEAR_STAND = np.array([0.3, 60.0, -14.0])
OTHER = NEAR_STAND + np.array([0.0, 12.0, -4.0])


def turning(stand, count, seed=0, slope=2.0, sigma=0.4):
    """Places of a camera that looks left and right in turn and moves with its pan."""
    generator = np.random.default_rng(seed)
    pans = np.where(np.arange(count) % 2, 0.6, -0.6) + generator.normal(0, 0.1, count)
    moved = stand + np.outer(pans, [slope, 0.0, 0.0]) + generator.normal(0, sigma, (count, 3))
    return [
        FrameCameraPlace(at, sigma**2 * np.eye(3), float(pan))
        for at, pan in zip(moved, pans, strict=True)
    ]


class TestGuessMatches:
    def test_runs_of_frames_whose_places_agree_are_matches(self):
        assert (
            guess_match_of_each_frame([*turning(NEAR_STAND, 5), *turning(OTHER, 4, 1)])
            == [0] * 5 + [1] * 4
        )

    def test_a_frame_that_says_nothing_goes_with_the_one_before(self):
        first, second = turning(NEAR_STAND, 3), turning(OTHER, 3, 1)
        found = guess_match_of_each_frame([None, *first, None, *second, None])
        assert found == [0, 0, 0, 0, 0, 1, 1, 1, 1]

    def test_a_camera_that_moves_with_its_pan_is_one_camera(self):
        assert guess_match_of_each_frame(turning(NEAR_STAND, 12, slope=8.0)) == [0] * 12

    def test_stadiums_that_are_nearly_alike_are_two(self):
        near = NEAR_STAND + np.array([0.0, 3.0, -1.0])
        frames = [*turning(NEAR_STAND, 12), *turning(near, 12, 1)]
        assert guess_match_of_each_frame(frames) == [0] * 12 + [1] * 12

    def test_one_odd_frame_does_not_end_a_match(self):
        frames = turning(NEAR_STAND, 8)
        frames[3] = FrameCameraPlace(
            NEAR_STAND + np.array([0.0, 15.0, -10.0]), frames[3].covariance, 0.5
        )
        assert guess_match_of_each_frame(frames) == [0] * 8

    def test_frames_that_say_nothing_are_each_their_own(self):
        assert guess_match_of_each_frame([None, None]) == [0, 1]
        assert guess_match_of_each_frame([]) == []
