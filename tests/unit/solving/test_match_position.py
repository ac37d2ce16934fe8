import numpy as np
import pytest

from app.soccer.annotation import make_lines
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate, calibrate_near
from app.solving.match_position import (
    NO_PLACES,
    Place,
    Places,
    guess_matches,
    place_of,
    share_position,
)
from app.solving.resect import PositionPrior, match_prior
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEHIND_GOAL, BEND, PITCH, click

POLICY = CalibrationPolicy()
STAND = np.array([1.0, 60.0, -14.0])


def place(position, sigma=0.4, pan=0.5):
    return Place(np.array(position, dtype=float), sigma**2 * np.eye(3), pan)


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
    places = [place_of(calibrate(lines, PITCH, SIZE, POLICY), SIZE) for lines in frames]
    return Places([found for found in places if found is not None])


@pytest.fixture(scope="module")
def match():
    return others()


class TestPlaceOf:
    def test_a_main_camera_that_its_lines_determine_has_a_place(self):
        found = place_of(calibrate(frame(34.0), PITCH, SIZE, POLICY), SIZE)
        assert found.position == pytest.approx(STAND, abs=1.5)
        assert np.degrees(found.pan) == pytest.approx(29, abs=3)

    def test_a_replay_has_none(self):
        assert place_of(calibrate(click(BEHIND_GOAL), PITCH, SIZE, POLICY), SIZE) is None


class TestPrior:
    def test_many_frames_say_together_where_the_camera_stands(self):
        prior = Places(around(STAND, 20)).prior(0.5)
        assert prior.mean == pytest.approx(STAND, abs=0.3)
        assert (prior.sigma < 0.3).all()

    def test_a_bad_frame_carries_nothing_away(self):
        clean = Places(around(STAND, 10)).prior(0.5)
        spoilt = Places([*around(STAND, 10), place(off(0.0, 9.0, -3.0))]).prior(0.5)
        assert spoilt.mean == pytest.approx(clean.mean, abs=0.1)

    def test_frames_that_look_the_same_way_count_more(self):
        here, there = around(STAND, 5), around(off(2.0, 0.0, 0.0), 5)
        turned = [Place(item.position, item.covariance, -0.6) for item in there]
        prior = Places([*here, *turned]).prior(0.5)
        assert prior.mean[0] - STAND[0] < 0.8

    def test_many_frames_that_look_elsewhere_say_no_more_than_their_common_drift(self):
        turned = [Place(it.position, it.covariance, -0.6) for it in around(STAND, 100)]
        assert (Places(turned).prior(0.5).sigma > 0.6).all()
        assert (Places(turned).prior(-0.6).sigma < 0.2).all()

    def test_one_is_left_out_without_a_copy_of_the_others(self):
        odd = place(off(0.0, 9.0, -3.0))
        every = Places([*around(STAND, 3), odd])
        rest = every.without(3)
        assert rest.prior(0.5).mean == pytest.approx(Places(around(STAND, 3)).prior(0.5).mean)
        assert Places(around(STAND, 3)).without(0).prior(0.5) is None
        assert rest._positions is every._positions

    def test_frames_of_several_stadiums_say_nothing(self):
        mixed = [
            item
            for seed, y in enumerate((45.0, 55.0, 65.0, 75.0, 85.0))
            for item in around(np.array([0.0, y, -y / 4]), 3, seed)
        ]
        assert Places(mixed).prior(0.5) is None

    def test_two_frames_are_too_few(self):
        assert Places(around(STAND, 2)).prior(0.5) is None


class TestSharePosition:
    def test_a_frame_of_few_markings_gets_its_camera_from_the_others(self, match):
        alone, shared = [], []
        for seed in range(6):
            lines = few(seed)
            found = calibrate(lines, PITCH, SIZE, POLICY)
            both = share_position(found, match, lines, PITCH, SIZE, POLICY)
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
            match_prior(near, np.full(3, 0.2)),
        ):
            found = calibrate_near(alone, prior, lines, PITCH, SIZE, POLICY)
            apart.append(np.linalg.norm(found.camera.position - near))
        assert apart[1] < 0.9 * apart[0]

    def test_the_wrong_match_harms_no_frame_whose_lines_contradict_it(self):
        wrong = others(np.array([-2.0, 85.0, -21.0]))
        lines = frame(38.0, 1300.0)
        alone = calibrate(lines, PITCH, SIZE, POLICY)
        found = share_position(alone, wrong, lines, PITCH, SIZE, POLICY)
        assert found.camera.position == pytest.approx(alone.camera.position, abs=0.2)

    def test_a_prior_that_does_not_give_way_is_dropped_where_the_lines_contradict_it(self):
        lines = frame(38.0, 1300.0)
        alone = calibrate(lines, PITCH, SIZE, POLICY)
        stiff = PositionPrior(off(0.0, 25.0, -7.0), np.full(3, 0.1), 1e9)
        assert calibrate_near(alone, stiff, lines, PITCH, SIZE, POLICY) is alone

    def test_a_replay_is_left_alone(self, match):
        lines = click(BEHIND_GOAL, 1.0)
        alone = calibrate(lines, PITCH, SIZE, POLICY)
        assert share_position(alone, match, lines, PITCH, SIZE, POLICY) is alone

    def test_without_others_nothing_changes(self):
        alone = calibrate(few(0), PITCH, SIZE, POLICY)
        assert share_position(alone, NO_PLACES, few(0), PITCH, SIZE, POLICY) is alone


class TestGuessMatches:
    def test_runs_of_frames_whose_positions_agree_are_matches(self):
        first, second = around(STAND, 5), around(off(0.0, 12.0, -4.0), 4, seed=1)
        assert guess_matches([*first, *second]) == [0] * 5 + [1] * 4

    def test_a_frame_that_says_nothing_goes_with_the_one_before(self):
        first, second = around(STAND, 3), around(off(0.0, 12.0, -4.0), 3, seed=1)
        found = guess_matches([None, *first, None, *second, None])
        assert found == [0, 0, 0, 0, 0, 1, 1, 1, 1]

    def test_one_odd_frame_does_not_end_a_match(self):
        frames = around(STAND, 6)
        frames[3] = place(off(15.0, 15.0, -10.0))
        assert guess_matches(frames) == [0, 0, 0, 1, 0, 0]

    def test_where_no_frame_is_sure_each_is_a_match_of_its_own(self):
        vague = [place(STAND, sigma=2.0) for _ in range(3)]
        assert guess_matches([None, *vague]) == [0, 1, 2, 3]

    def test_no_frames_are_no_matches(self):
        assert guess_matches([]) == []
