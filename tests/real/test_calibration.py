"""Calibration and scoring on real SoccerNet lines and cameras of PnLCalib."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.evaluation.cameras import combine_frame_scores, score_frame
from app.formats.cameras import read_cameras
from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import read_line_files
from app.soccer.frames import ImageSize
from app.soccer.pitch import GOAL_PARTS, Pitch
from app.soccer.policy import CLICKED, CalibrationPolicy
from app.solving.calibrate import calibrate
from tests.bench.goals import LIMIT_PX, goal_distances, left_out_grass

DATA = Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
LINES = DATA / "sn22-dev" / "lines.zip"
PNLCALIB = DATA / "sn22-dev" / "pnlcalib-predicted-cameras.zip"
pytestmark = pytest.mark.skipif(not LINES.is_file(), reason=f"no real data in {DATA}")

SIZE = ImageSize(960, 540)
EVERY = 4
"""One frame in four is enough to notice a loss; ``make bench`` takes them all."""


@pytest.fixture(scope="module")
def frames():
    files = list(read_line_files(LINES, SIZE, ReaderReport()))
    return {file.stem: file.lines for file in files[::EVERY]}


@pytest.fixture(scope="module")
def calibrations(frames):
    policy = CalibrationPolicy()
    return {stem: calibrate(lines, Pitch(), SIZE, policy) for stem, lines in frames.items()}


class TestCalibrate:
    def test_beats_the_published_calibrators_by_far(self, frames, calibrations):
        total = combine_frame_scores(
            None if found.camera is None else score_frame(found.camera, frames[stem], Pitch(), SIZE)
            for stem, found in calibrations.items()
        )
        assert total.completeness == 1.0
        assert total.jac[0] > 0.94
        assert total.share > 0.94

    def test_wrong_labels_are_found_in_about_one_frame_in_twenty(self, calibrations):
        share = np.mean([bool(found.suspects) for found in calibrations.values()])
        assert 0.02 < share < 0.10

    def test_cameras_stand_where_main_cameras_stand(self, calibrations):
        positions = np.array([found.camera.position for found in calibrations.values()])
        low, high = np.percentile(positions, [5, 95], axis=0)
        assert (low > [-12, 38, -27]).all()
        assert (high < [12, 100, -7]).all()


class TestGoals:
    def test_their_middle_predicts_left_out_grass_better_than_their_inner_edges(self):
        """Of the dev half 83.2, 86.7 and, lines by the Laws, 88.6 % lie within 5.5 px."""
        files = [*read_line_files(LINES, SIZE, ReaderReport())][::2]
        few = [file.lines for file in files if not file.lines.keys().isdisjoint(GOAL_PARTS)][::8]
        shares, clicks = [], []
        for policy in (CalibrationPolicy(), CLICKED, replace(CLICKED, goal="laws")):
            errors = [error for lines in few for error in left_out_grass(lines, policy)]
            shares.append(np.mean(np.array(errors) < LIMIT_PX))
            clicks.append(
                np.median([one for lines in few for one in goal_distances(lines, policy)])
            )
        assert shares[2] > shares[1] > shares[0]
        assert clicks[1] < 0.75 * clicks[0]


class TestScore:
    def test_gives_cameras_of_others_the_numbers_of_the_public_evaluator(self):
        report = ReaderReport()
        cameras = read_cameras(PNLCALIB, report)
        total = combine_frame_scores(
            score_frame(cameras[file.stem], file.lines, Pitch(), SIZE)
            if file.stem in cameras
            else None
            for file in read_line_files(LINES, SIZE, ReaderReport())
        )
        assert report.problems == []
        assert (total.frames, total.calibrated) == (727, 712)
        assert total.jac[0] == pytest.approx(0.80695, abs=1e-4)
        assert total.share == pytest.approx(0.75103, abs=1e-4)
        assert total.challenge == pytest.approx(0.78565, abs=1e-4)
