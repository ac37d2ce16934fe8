"""The pitch of a film: told by three frames together, by none alone, and never from several films."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.camera import Camera
from app.paint.frame_pitch import (
    collect_pitch_size_evidence,
    find_differing_agreed_pitch,
    group_by_position,
)
from app.paint.propose import propose_camera
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.solving.pitch_size import PitchSizeFrameLines
from tests.cameras import looking
from tests.unit.paint.lawns import PITCH, SMALL, drawn, lawn

SHORT = Pitch(100.5, 68.0)
TARGETS = ((22.0, -6.0), (14.0, -10.0), (-20.0, -8.0))


def camera(x: float, y: float) -> Camera:
    return looking((1.0, 62.0, -16.0), (x, y, 0.0), 1150.0, size=SMALL)


def frames(pitch: Pitch) -> list[PitchSizeFrameLines]:
    """Frames of one camera, with the places of paint beside those that are found on 105 x 68 m."""
    pictures = [lawn(drawn(camera(*target), 2, pitch)) for target in TARGETS]
    found = [(picture, propose_camera(picture).camera) for picture in pictures]
    return [
        collect_pitch_size_evidence(picture, one, PITCH)
        for picture, one in found
        if one is not None
    ]


class TestPitchOf:
    def test_three_frames_show_a_shorter_pitch(self) -> None:
        found = find_differing_agreed_pitch(frames(SHORT), PITCH)
        assert found is not None
        assert found.length == pytest.approx(100.5, abs=0.4)
        assert found.width == 68.0

    def test_the_pitch_in_use_is_left_alone(self) -> None:
        assert find_differing_agreed_pitch(frames(PITCH), PITCH) is None

    def test_one_frame_decides_nothing(self) -> None:
        assert find_differing_agreed_pitch(frames(SHORT)[:1], PITCH) is None


class TestFilms:
    def test_frames_of_one_place_and_size_belong_together(self) -> None:
        one, size = camera(20.0, 0.0), ImageSize(960, 540)
        far = replace(one, position=one.position + np.array([0.0, 12.0, 0.0]))
        cameras = [one, far, None, camera(-20.0, 0.0), one]
        sizes = [size, size, None, size, ImageSize(1280, 720)]
        assert group_by_position(cameras, sizes) == [[0, 3], [1], [4]]
