"""Places of a frame that may be the ball, also of a large one that its motion smears far."""

from __future__ import annotations

import numpy as np
import pytest

from app.tracking.ball_candidates import find_candidates
from app.tracking.ball_frames import BallFrame
from app.tracking.ball_picture import BallGreyConversion
from tests.drawn_balls import drawn, grass

SIZE, DIAMETER = (700, 400), 50.0
PLACE = (350.0, 200.0)


def frame_of(*balls: tuple[float, float, float]) -> BallFrame:
    image = drawn(balls, size=SIZE, ground=grass(*SIZE), noise=2)
    return BallFrame.of(0, image, BallGreyConversion.of(image, *PLACE, DIAMETER))


class TestFindCandidates:
    @pytest.mark.parametrize("smear", [0.0, 100.0, 150.0])
    def test_a_large_ball_is_found_however_far_its_motion_may_smear_it(self, smear: float) -> None:
        # 400 pixels a frame smear a ball of 50 by three diameters at most.
        frame = frame_of((*PLACE, DIAMETER))
        area = np.array([250.0, 120.0]), np.array([450.0, 280.0])
        found = find_candidates(frame, DIAMETER, area, [(0.0, 0.0), (smear, 0.4)], (), ())
        assert found.places[np.argmax(found.looks)] == pytest.approx(PLACE, abs=1.0)

    def test_one_that_is_smeared_is_found_as_that(self) -> None:
        steps = np.linspace(-75, 75, 151)
        image = np.asarray(
            np.mean(
                [
                    drawn([(PLACE[0] + s, PLACE[1], DIAMETER)], size=SIZE, ground=grass(*SIZE))
                    for s in steps[::5]
                ],
                axis=0,
            ),
            np.uint8,
        )
        frame = BallFrame.of(0, image, BallGreyConversion.of(image, *PLACE, DIAMETER))
        area = np.array([250.0, 120.0]), np.array([450.0, 280.0])
        found = find_candidates(frame, DIAMETER, area, [(0.0, 0.0), (150.0, 0.0)], (), ())
        best = int(np.argmax(found.looks))
        assert found.places[best] == pytest.approx(PLACE, abs=2.0)
        assert found.smears[best, 0] == 150.0
