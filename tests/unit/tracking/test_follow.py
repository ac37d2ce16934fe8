"""How often another camera is looked for, for one that has less paint than it should."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.paint.agreement import PaintAgreement
from app.paint.propose import FrameProposal
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.tracking import follow
from app.tracking.clip import Frame
from app.tracking.follow import PATCHY_EVERY, PATCHY_LEAST_OFTEN, TRACKED, Follower, TrackedFrame
from app.tracking.picture import Picture, read_frame

FRAMES = 200


def picture(number: int) -> Picture:
    return read_frame(Frame(number, number / 25, np.zeros((90, 160, 3), np.uint8)))


def test_another_camera_is_looked_for_ever_more_rarely_while_that_is_in_vain(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[int] = []
    black = picture(0)
    frame = TrackedFrame(0, 0.0, TRACKED, seen=PaintAgreement(0.5, 0.5, 100))
    follower = Follower(Pitch(), CalibrationPolicy())

    def nothing(*_: object) -> FrameProposal:
        asked.append(now)
        return FrameProposal("nothing", "no straight line is seen on the grass")

    monkeypatch.setattr(follow, "propose_camera", nothing)
    for now in range(FRAMES):
        assert follower._another(replace(black, number=now), frame) is frame
    waits = np.diff(asked).tolist()
    assert waits[0] == 2 * PATCHY_EVERY and waits[1:] == [PATCHY_LEAST_OFTEN] * (len(asked) - 2)
    # A picture that has nothing to do with the one before is another matter.
    follower.step(replace(black, number=FRAMES), None)
    assert follower.patchy_every == PATCHY_EVERY
