from dataclasses import replace

import numpy as np
import pytest

from app.errors import DegenerateGeometryError
from app.soccer.annotation import make_lines
from app.soccer.picture import PictureGeometry
from app.soccer.policy import CalibrationPolicy
from app.solving.match_picture import (
    PictureEstimate,
    PictureFrameLines,
    estimate_match_picture,
    select_informative_frames,
)
from app.solving.picture_camera import picture_to_warp
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEND, click

POLICY = CalibrationPolicy()
WIDE = PictureGeometry(1.05, (0.0, 0.0))


def frames(picture, count=6, noise_px=0.8):
    cameras = [
        looking((2.0, 62.0, -16.0), (-35.0 + 14.0 * index, -4.0, 0.0), 1500.0, bend=BEND)
        for index in range(count)
    ]
    return [
        PictureFrameLines(
            click(picture.camera_of_annotated_picture(camera, SIZE), noise_px, seed), SIZE
        )
        for seed, camera in enumerate(cameras)
    ]


@pytest.fixture(scope="module")
def wide():
    return estimate_match_picture(frames(WIDE), POLICY)


class TestEstimateMatchPicture:
    def test_many_frames_tell_pixels_that_are_five_per_cent_too_wide(self, wide):
        off = np.abs(picture_to_warp(wide.picture) - picture_to_warp(WIDE))
        assert off[0] < 0.012
        assert (off < 3 * np.array(wide.picture.sigma)).all()
        assert wide.frames == 6

    def test_it_is_proposed_no_better_known_than_one_frame_is(self, wide):
        assert wide.proposal.aspect == wide.picture.aspect
        assert wide.proposal.sigma[0] >= 0.006

    def test_pictures_as_they_were_taken_are_left_alone(self):
        assert estimate_match_picture(frames(PictureGeometry()), POLICY).proposal is None

    def test_a_cropped_picture_is_measured(self):
        truth = PictureGeometry(1.0, (0.2, 0.0))
        found = estimate_match_picture(frames(truth, 5), POLICY)
        assert found.picture.shift[0] == pytest.approx(0.2, abs=0.04)
        assert found.proposal is not None

    def test_a_frame_that_contradicts_the_others_counts_for_little(self, wide):
        spoilt = frames(WIDE)
        spoilt[2] = frames(PictureGeometry(0.8))[2]
        found = estimate_match_picture(spoilt, POLICY)
        assert found.picture.aspect == pytest.approx(wide.picture.aspect, abs=0.015)

    def test_too_few_frames_are_refused(self):
        with pytest.raises(DegenerateGeometryError, match="needs 3"):
            estimate_match_picture(frames(WIDE, 2), POLICY)


class TestProposal:
    def test_what_is_not_certain_is_not_proposed(self):
        unsure = PictureGeometry(1.05, (0.0, 0.0), (0.02, 0.02, 0.02))
        assert PictureEstimate(unsure, 9).proposal is None
        sure = replace(unsure, sigma=(0.005, 0.02, 0.02))
        assert PictureEstimate(sure, 9).proposal is not None


class TestChooseFrames:
    def test_frames_with_the_most_markings_are_taken(self, monkeypatch):
        monkeypatch.setattr("app.solving.match_picture.MAX_FRAMES", 3)
        many = frames(WIDE, 4)
        poor = PictureFrameLines(make_lines(dict(list(many[0].lines.items())[:3])), SIZE)
        chosen = select_informative_frames([poor, *many])
        assert len(chosen) == 3 and chosen == sorted(chosen)
        assert 0 not in chosen
