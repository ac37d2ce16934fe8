"""How often another camera is looked for, for one that has less paint than it should."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.geometry.camera import Camera
from app.paint.agreement import PaintAgreement
from app.paint.candidates import MAIN, WIDE
from app.paint.propose import FrameProposal
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.tracking import follow
from app.tracking.clip import ClipFrame
from app.tracking.follow import (
    BRIDGED,
    LOST,
    PATCHY_EVERY,
    PATCHY_LEAST_OFTEN,
    PROPOSED_EVERY,
    SAME_VIEW_FRAMES,
    TRACKED,
    CameraFollower,
    TrackedFrame,
)
from app.tracking.motion import BackgroundMatches
from app.tracking.picture import FramePicture, make_frame_picture
from tests.tripod_films import render_film

FRAMES = 200


def picture(number: int) -> FramePicture:
    return make_frame_picture(ClipFrame(number, number / 25, np.zeros((90, 160, 3), np.uint8)))


def test_another_camera_is_looked_for_ever_more_rarely_while_that_is_in_vain(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[int] = []
    black = picture(0)
    frame = TrackedFrame(0, 0.0, TRACKED, seen=PaintAgreement(0.5, 0.5, 100))
    follower = CameraFollower(Pitch(), CalibrationPolicy())

    def nothing(*_: object) -> FrameProposal:
        asked.append(now)
        return FrameProposal("nothing", "no straight line is seen on the grass")

    monkeypatch.setattr(follow, "propose_camera_in_picture", nothing)
    for now in range(FRAMES):
        assert follower._prefer_proposed_camera(replace(black, number=now), frame) is frame
    waits = np.diff(asked).tolist()
    assert waits[0] == 2 * PATCHY_EVERY and waits[1:] == [PATCHY_LEAST_OFTEN] * (len(asked) - 2)
    # A picture that has nothing to do with the one before is another matter.
    follower.step(replace(black, number=FRAMES), None)
    assert follower.patchy_every == PATCHY_EVERY


class TestFramesThatCannotBeSolved:
    """One frame whose equations are singular does not end the tracking of its shot."""

    CAMERA = render_film(1).cameras[0]

    @staticmethod
    def singular(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    def test_a_given_camera_stays_without_its_paint(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(follow, "snap_to_prepared_picture", self.singular)
        follower = CameraFollower(Pitch(), CalibrationPolicy())
        found = follower.start(picture(0), self.CAMERA, np.eye(8))
        assert (found.outcome, found.camera, found.is_key) == (BRIDGED, self.CAMERA, True)
        assert found.reason == "the paint cannot be solved" and found.covariance is not None
        assert follower.last is found

    def test_a_background_that_tells_no_turn_loses_the_frame(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(follow, "apply_background_motion", self.singular)
        follower = CameraFollower(Pitch(), CalibrationPolicy())
        follower.last = TrackedFrame(0, 0.0, TRACKED, camera=self.CAMERA)
        same = np.full((50, 2), 40.0)
        found = follower._follow_background(picture(1), BackgroundMatches(same, same))
        assert (found.outcome, found.camera) == (LOST, None)
        assert found.reason == "the background cannot be followed"


class TestWhereOneIsSought:
    """A search in vain is repeated where the view is another one, and at the tripod first."""

    @pytest.fixture
    def searches(self, monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, tuple[str, ...]]]:
        """Frames in which a camera was sought, and in which libraries besides the known positions."""
        found: list[tuple[int, tuple[str, ...]]] = []

        def nothing(shown: FramePicture, *asked: Any) -> FrameProposal:
            found.append((shown.number, tuple(library.name for library in asked[-1])))
            return FrameProposal("nothing", "no straight line is seen on the grass")

        monkeypatch.setattr(follow, "propose_camera_in_picture", nothing)
        return found

    def lose(self, known: list[Camera], shift_px: float) -> None:
        """Follow frames of black pictures whose background moves."""
        follower, black = CameraFollower(Pitch(), CalibrationPolicy(), known), picture(0)
        here = np.random.default_rng(0).uniform(0, 90, (50, 2))
        match = BackgroundMatches(here, here + np.array([shift_px, 0.0]))
        for number in range(FRAMES):
            follower.step(replace(black, number=number), match)

    def test_a_view_that_stays_is_searched_once_a_second(
        self, searches: list[tuple[int, tuple[str, ...]]]
    ) -> None:
        self.lose([], 0.0)
        assert np.diff([number for number, _ in searches]).tolist() == [SAME_VIEW_FRAMES] * 8

    def test_a_view_that_moves_is_searched_every_few_frames(
        self, searches: list[tuple[int, tuple[str, ...]]]
    ) -> None:
        self.lose([], 10.0)
        assert set(np.diff([number for number, _ in searches])) == {PROPOSED_EVERY}
        assert {libraries[0] for _, libraries in searches} == {MAIN.name}
        wide = [place for place, one in enumerate(searches) if WIDE.name in one[1]]
        assert wide == [1, 3, 7, 15, 31]

    def test_other_positions_than_the_known_one_are_searched_ever_more_rarely(
        self, searches: list[tuple[int, tuple[str, ...]]]
    ) -> None:
        self.lose([render_film(1).cameras[0]], 10.0)
        wide = [place for place, (_, libraries) in enumerate(searches) if libraries]
        assert wide == [1, 3, 7, 15, 31]
