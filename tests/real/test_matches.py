"""Frames of one match share their camera's position: real lines, left-out markings."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from app.evaluation.cameras import measure_error_without_marking
from app.features.file_tools.matches import collect_camera_places_of_other_frames
from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import read_line_files
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate
from app.solving.match_position import NO_PLACES, find_main_camera_place
from app.solving.pitch_size import PitchSizeFrameLines, estimate_pitch

DATA = Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
LINES = DATA / "sn22-dev" / "lines.zip"
pytestmark = pytest.mark.skipif(not LINES.is_file(), reason=f"no real data in {DATA}")

SIZE, POLICY = ImageSize(960, 540), CalibrationPolicy()
FRAMES, EVERY = 150, 8
"""Whole matches are needed, so the first frames are taken, and one marking in eight is left out;
``touchline calibrate --leave-one-out --matches auto`` takes them all."""
NEAR_PX = 5.5
MIDDLE = ("Middle line", "Circle central")


@pytest.fixture(scope="module")
def files():
    return sorted(read_line_files(LINES, SIZE, ReaderReport()), key=lambda file: file.stem)[:FRAMES]


@pytest.fixture(scope="module")
def shares(files):
    places = [
        find_main_camera_place(calibrate(it.lines, Pitch(), SIZE, POLICY), SIZE) for it in files
    ]
    return collect_camera_places_of_other_frames(files, places, None)


class TestShares:
    def test_left_out_markings_are_predicted_better(self, files, shares):
        asked = [(at, name) for at, file in enumerate(files) for name in file.lines][::EVERY]
        errors = np.array(
            [
                [
                    measure_error_without_marking(
                        files[at].lines, name, Pitch(), SIZE, POLICY, others
                    )
                    for others in (NO_PLACES, shares[at].others)
                ]
                for at, name in asked
            ],
            float,
        )
        alone, shared = np.nanmean(errors < NEAR_PX, axis=0)
        assert shared > 0.86
        assert shared > alone + 0.02

    def test_a_length_that_only_one_end_shows_is_unknown(self, files, shares):
        """The frames of the second match show either end and hardly ever the middle with it."""
        names = [share.match for share in shares]
        second = [file for file, name in zip(files, names, strict=True) if name == names[10]]
        found = estimate_pitch([PitchSizeFrameLines(file.lines, SIZE) for file in second], POLICY)
        assert found.length is None
        assert found.width == pytest.approx(68.0, abs=1.5)

    def test_a_short_pitch_that_two_frames_show_is_proposed(self, files, shares):
        """At its size the middle that both show is predicted from the rest, at 105 m it is not."""
        names = [share.match for share in shares]
        match = [file for file, name in zip(files, names, strict=True) if name == names[110]]
        found = estimate_pitch([PitchSizeFrameLines(file.lines, SIZE) for file in match], POLICY)
        proposed = found.proposal(Pitch())
        assert proposed is not None and proposed.length == pytest.approx(101.2, abs=0.5)
        middle = [(it, name) for it in match for name in it.lines if name in MIDDLE]
        errors = np.array(
            [
                [
                    measure_error_without_marking(it.lines, name, pitch, SIZE, POLICY)
                    for pitch in (Pitch(), proposed)
                ]
                for it, name in middle
            ]
        )
        assert (errors[:, 0] > 40).all() and (errors[:, 1] < 15).all()
