from __future__ import annotations

import numpy as np
import pytest

from app.errors import DegenerateGeometryError
from app.geometry.resection import PARAMETERS
from app.soccer.annotation import make_lines
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.pitch_size import (
    PitchEstimate,
    PitchSizeFrameLines,
    eliminate_camera,
    eliminate_frame_deviations,
    estimate_pitch,
    estimate_sigmas_of_shared_numbers,
    select_informative_frames,
)
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEND, click

POLICY = CalibrationPolicy()
SMALL = Pitch(103.0, 66.0)


def frames(pitch, count=10, noise_px=0.8):
    cameras = [
        looking(
            (4.0 * (index % 3 - 1), 62.0, -16.0),
            (-36.0 + 8.0 * index, -4.0, 0.0),
            1300.0,
            bend=BEND,
        )
        for index in range(count)
    ]
    return [
        PitchSizeFrameLines(click(camera, noise_px, seed, pitch), SIZE)
        for seed, camera in enumerate(cameras)
    ]


def among_frames_of_one_end(*telling):
    """The size that frames tell together with six that say nothing of the length."""
    one_end = looking((2.0, 62.0, -16.0), (40.0, 0.0, 0.0), 2600.0, bend=BEND)
    others = [PitchSizeFrameLines(click(one_end, 0.8, seed, SMALL), SIZE) for seed in range(6)]
    return estimate_pitch([*others, *telling], POLICY)


@pytest.fixture(scope="module")
def small():
    return estimate_pitch(frames(SMALL), POLICY)


class TestEstimatePitch:
    def test_many_frames_tell_the_size_of_their_pitch(self, small):
        assert small.length == pytest.approx(SMALL.length, abs=0.3)
        assert small.width == pytest.approx(SMALL.width, abs=0.3)

    def test_the_truth_lies_within_what_it_says(self, small):
        assert abs(small.length - SMALL.length) < 3 * small.length_sigma_m
        assert abs(small.width - SMALL.width) < 3 * small.width_sigma_m
        # Ten frames, none of which is believed to know a size better than 0.25 m.
        assert 0.05 < small.length_sigma_m < 0.3

    def test_a_frame_with_a_wrong_label_is_left_out(self, small):
        spoilt = frames(SMALL)
        lines = dict(spoilt[1].lines)
        lines["Big rect. left top"], lines["Side line top"] = (
            lines["Side line top"],
            lines["Big rect. left top"],
        )
        spoilt[1] = PitchSizeFrameLines(make_lines(lines), SIZE)
        found = estimate_pitch(spoilt, POLICY)
        assert found.frames == small.frames - 1
        assert found.length == pytest.approx(small.length, abs=0.15)

    def test_a_length_that_no_frame_shows_is_unknown(self):
        camera = looking((2.0, 62.0, -16.0), (40.0, 0.0, 0.0), 1500.0)
        one_end = [PitchSizeFrameLines(click(camera, 0.8, seed, SMALL), SIZE) for seed in range(6)]
        kept = [
            PitchSizeFrameLines(
                make_lines({name: it for name, it in frame.lines.items() if "right" in name}), SIZE
            )
            for frame in one_end
        ]
        found = estimate_pitch(kept, POLICY)
        assert (found.length, found.length_sigma_m) == (None, None)
        assert found.proposal(Pitch()) is None

    def test_a_length_that_one_frame_alone_shows_is_unknown(self):
        assert among_frames_of_one_end(frames(SMALL)[5]).length is None

    def test_a_length_that_a_second_frame_confirms_is_known(self):
        loud, quiet = frames(SMALL)[3], frames(SMALL)[5]
        found = among_frames_of_one_end(loud, quiet)
        assert found.length == pytest.approx(SMALL.length, abs=0.5)
        assert 0.2 < found.length_sigma_m < 0.5

    @pytest.mark.parametrize("length", [101.2, 104.8])
    def test_a_length_that_a_second_frame_contradicts_is_unknown(self, length):
        loud, other = frames(SMALL)[3], frames(Pitch(length, SMALL.width))[5]
        assert among_frames_of_one_end(loud, other).length is None

    def test_too_few_frames_are_refused(self):
        with pytest.raises(DegenerateGeometryError, match="needs 5"):
            estimate_pitch(frames(Pitch(), 3), POLICY)


class TestProposal:
    def test_the_true_size_is_proposed_for_a_wrong_one(self, small):
        proposed = small.proposal(Pitch())
        assert proposed.length == pytest.approx(SMALL.length, abs=0.3)
        assert proposed.width == pytest.approx(SMALL.width, abs=0.3)

    def test_nothing_is_proposed_for_the_right_size(self, small):
        assert small.proposal(SMALL) is None

    def test_what_agrees_within_its_uncertainty_stays(self):
        found = PitchEstimate(103.0, 67.8, 0.1, 0.1, 10)
        assert found.proposal(Pitch(105.0, 68.0)) == Pitch(103.0, 68.0)
        unsure = PitchEstimate(103.0, 67.8, 0.5, 0.1, 10)
        assert unsure.proposal(Pitch(105.0, 68.0)) is None


class TestChooseFrames:
    def test_frames_that_show_length_and_width_come_first(self, monkeypatch):
        monkeypatch.setattr("app.solving.pitch_size.MAX_FRAMES", 4)
        narrow = looking((2.0, 62.0, -16.0), (40.0, 0.0, 0.0), 2600.0)
        telling = frames(Pitch(), 4, noise_px=0.0)
        many = [PitchSizeFrameLines(click(narrow), SIZE)] * 6 + telling
        chosen = select_informative_frames(many)
        assert len(chosen) == 4 and np.isin(chosen, [6, 7, 8, 9]).sum() >= 3


SHARED = 2


@pytest.fixture
def rows() -> np.ndarray:
    """Derivatives of 40 measurements by camera and shared numbers, shape (40, P + 2)."""
    return np.random.default_rng(3).normal(size=(40, PARAMETERS + SHARED))


class TestWithoutCamera:
    def test_it_is_what_the_whole_adjustment_says_of_the_shared_numbers(self, rows) -> None:
        apart = np.random.default_rng(4).normal(size=len(rows))
        pull, told = eliminate_camera(rows.T @ apart, rows.T @ rows, 4.0)
        whole = np.linalg.lstsq(rows, apart, rcond=None)[0][PARAMETERS:]
        assert np.linalg.solve(told, pull) == pytest.approx(whole, abs=1e-12)
        covariance = 4.0 * np.linalg.inv(rows.T @ rows)[PARAMETERS:, PARAMETERS:]
        assert np.linalg.inv(told) == pytest.approx(covariance, rel=1e-9)

    def test_what_a_camera_could_explain_says_nothing(self, rows) -> None:
        rows[:, PARAMETERS:] = rows[:, :SHARED]
        apart = np.random.default_rng(4).normal(size=len(rows))
        _, told = eliminate_camera(rows.T @ apart, rows.T @ rows, 1.0)
        assert told == pytest.approx(np.zeros((SHARED, SHARED)), abs=1e-10)


class TestWithOwnNumbers:
    def test_variances_add_up(self, rows) -> None:
        share = eliminate_camera(rows.T @ np.ones(len(rows)), rows.T @ rows, 1.0)
        sigma = np.array([0.3, 2.0])
        pull, told = eliminate_frame_deviations(share, sigma)
        assert np.linalg.inv(told) == pytest.approx(np.linalg.inv(share[1]) + np.diag(sigma**2))
        # What the frame says the numbers are stays the same.
        assert np.linalg.solve(told, pull) == pytest.approx(np.linalg.solve(share[1], share[0]))


class TestSharedSigmas:
    def test_frames_that_agree_leave_what_clicks_say(self) -> None:
        found = estimate_sigmas_of_shared_numbers(np.zeros((5, 2)), np.diag([4.0, 25.0]), spent=1)
        assert found == pytest.approx([0.5, 0.2])

    def test_frames_that_disagree_know_it_worse_than_clicks_say(self) -> None:
        pulls = np.array([[3.0, 0.0], [-3.0, 0.0], [3.0, 0.0], [-3.0, 0.0]])
        found = estimate_sigmas_of_shared_numbers(pulls, np.diag([4.0, 25.0]), spent=2)
        assert found == pytest.approx([np.sqrt(36 * 4 / 2) / 4, 0.2])
