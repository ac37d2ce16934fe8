"""Runs of frames that are followed once more from one of their ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.resection import PAN, camera_from_parameters, parameters_from_camera
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.tracking import shot, shot_solve
from app.tracking.clip import Clip
from app.tracking.follow import BRIDGED, LOST, TRACKED, TrackedFrame
from app.tracking.shot import (
    FollowedShot,
    _drop_cameras_of_unconfirmed_runs,
    _follow_run,
    _is_at_key_frame_position,
    _propagate_camera,
    follow_shot,
)
from tests.tripod_films import Film

PITCH, POLICY = Pitch(), CalibrationPolicy()
RUN = range(3, 6)
NEAR_PX = 4.0


@pytest.fixture(scope="module")
def followed(film: Film, tmp_path_factory: pytest.TempPathFactory) -> tuple[Clip, FollowedShot]:
    """The film, and its frames as they are followed."""
    clip = Clip.open(film.write(tmp_path_factory.mktemp("film")))
    return clip, follow_shot(clip, {}, PITCH, POLICY)


def lost(shot: FollowedShot) -> FollowedShot:
    """A shot whose run has no cameras."""
    frames = [
        TrackedFrame(frame.number, frame.time, LOST) if frame.number in RUN else frame
        for frame in shot.frames
    ]
    return FollowedShot(frames, shot.matches)


def turned(frame: TrackedFrame, clip: Clip) -> TrackedFrame:
    """A frame whose camera looks two degrees past what it sees, and agrees with little of its paint."""
    assert frame.camera is not None and frame.seen is not None
    half = clip.work.diagonal / 2
    parameters = parameters_from_camera(frame.camera, half)
    parameters[PAN] += 0.035
    camera = camera_from_parameters(parameters, frame.camera.principal_point, half)
    return replace(frame, camera=camera, seen=replace(frame.seen, supported=0.3), is_key=False)


def singular(*_: object, **__: object) -> None:
    """What the equations of a frame may raise."""
    raise np.linalg.LinAlgError("Singular matrix")


def off_px(film: Film, clip: Clip, frame: TrackedFrame) -> float:
    assert frame.camera is not None
    return film.off_px(frame.number, clip.scale_to_video(frame.camera))


@pytest.mark.parametrize("run", [RUN, RUN[::-1]], ids=["forwards", "backwards"])
def test_a_run_is_followed_from_either_end(
    followed: tuple[Clip, FollowedShot], film: Film, run: range
) -> None:
    clip, shot = followed[0], lost(followed[1])
    before = [*shot.frames]
    _follow_run(clip, shot, run, PITCH, POLICY)
    for number in RUN:
        assert shot.frames[number].outcome == TRACKED
        assert off_px(film, clip, shot.frames[number]) < NEAR_PX
    # Its last frame ties to the one behind it: nothing else is touched.
    for number in set(range(len(before))) - set(RUN):
        assert shot.frames[number] is before[number]


@pytest.mark.parametrize("run", [RUN, RUN[::-1]], ids=["forwards", "backwards"])
def test_wrong_cameras_behind_a_run_give_way_to_those_that_agree_better(
    followed: tuple[Clip, FollowedShot], film: Film, run: range
) -> None:
    clip, shot = followed[0], lost(followed[1])
    behind = run[-1] + run.step
    wrong = turned(shot.frames[behind], clip)
    assert off_px(film, clip, wrong) > 5 * NEAR_PX
    shot.frames[behind] = wrong
    _follow_run(clip, shot, run, PITCH, POLICY)
    assert shot.frames[behind].outcome == TRACKED
    assert off_px(film, clip, shot.frames[behind]) < NEAR_PX


def test_a_run_without_paint_behind_a_gap_has_no_cameras(
    followed: tuple[Clip, FollowedShot],
) -> None:
    clip, frames = followed[0], [*followed[1].frames]
    first = len(frames) - 3
    frames[first - 1] = TrackedFrame(first - 1, frames[first - 1].time, LOST)
    for number in range(first, len(frames)):
        frames[number] = replace(frames[number], outcome=BRIDGED, is_key=False)
    _drop_cameras_of_unconfirmed_runs(clip, frames, PITCH, POLICY)
    assert {(frame.outcome, frame.camera) for frame in frames[first:]} == {(LOST, None)}


@pytest.mark.parametrize("found", [True, False])
def test_a_run_behind_a_gap_stays_where_a_search_finds_its_camera(
    followed: tuple[Clip, FollowedShot], found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip, frames = followed[0], [*followed[1].frames]
    first = len(frames) - 4
    frames[first - 1] = TrackedFrame(first - 1, frames[first - 1].time, LOST)
    for number in range(first, len(frames)):
        frames[number] = replace(frames[number], is_key=False)
    for name, answer in (
        ("_is_at_key_frame_position", False),
        ("_stand_on_one_tripod", False),
        ("_is_proposed", found),
    ):
        monkeypatch.setattr(shot, name, lambda *_, answer=answer: answer)
    _drop_cameras_of_unconfirmed_runs(clip, frames, PITCH, POLICY)
    assert [frame.outcome for frame in frames[first:]] == [TRACKED if found else LOST] * 4
    assert any(frame.is_key for frame in frames[first:]) is found


def test_an_annotated_frame_never_gives_way(followed: tuple[Clip, FollowedShot]) -> None:
    clip, shot = followed[0], lost(followed[1])
    key = replace(turned(shot.frames[RUN.stop], clip), is_key=True)
    shot.frames[RUN.stop] = key
    _follow_run(clip, shot, RUN, PITCH, POLICY)
    assert shot.frames[RUN.stop] is key


def test_a_frame_whose_paint_cannot_be_solved_says_nothing_of_its_position(
    followed: tuple[Clip, FollowedShot], monkeypatch: pytest.MonkeyPatch
) -> None:
    clip, whole = followed
    frame = whole.frames[0]
    assert frame.camera is not None
    asked = clip, frame, [frame.camera], PITCH, POLICY
    assert _is_at_key_frame_position(*asked)

    monkeypatch.setattr(shot, "snap_to_prepared_picture", singular)
    assert not _is_at_key_frame_position(*asked)


def test_a_background_that_tells_no_turn_carries_no_camera(
    followed: tuple[Clip, FollowedShot], monkeypatch: pytest.MonkeyPatch
) -> None:
    clip, whole = followed
    for module in (shot, shot_solve):
        monkeypatch.setattr(module, "apply_background_motion", singular)
    assert _propagate_camera(whole.frames[0].camera, whole.matches[1:3]) == [None, None]
    solved = shot_solve.solve_shot(whole.frames, whole.matches, clip.work, PITCH, POLICY)
    assert all(frame.camera is not None for frame in solved.frames)
