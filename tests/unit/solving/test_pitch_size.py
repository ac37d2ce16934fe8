import pytest

from app.errors import DegenerateGeometryError
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.pitch_size import estimate_pitch
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEND, click

POLICY = CalibrationPolicy()


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
    return [click(camera, noise_px, seed, pitch) for seed, camera in enumerate(cameras)]


class TestEstimatePitch:
    def test_many_frames_tell_the_size_of_their_pitch(self):
        true = Pitch(101.5, 65.0)
        found = estimate_pitch(frames(true), SIZE, POLICY)
        assert found.pitch.length == pytest.approx(true.length, abs=0.4)
        assert found.pitch.width == pytest.approx(true.width, abs=0.4)

    def test_the_truth_lies_within_what_it_says(self):
        true = Pitch(101.5, 65.0)
        found = estimate_pitch(frames(true), SIZE, POLICY)
        assert abs(found.pitch.length - true.length) < 4 * found.length_sigma_m
        assert abs(found.pitch.width - true.width) < 4 * found.width_sigma_m

    def test_too_few_frames_are_refused(self):
        with pytest.raises(DegenerateGeometryError, match="needs 5"):
            estimate_pitch(frames(Pitch(), 3), SIZE, POLICY)
