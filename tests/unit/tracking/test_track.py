"""A clip gets a camera for each frame, or is told why a frame has none."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.errors import ImageError, InputError
from app.soccer.annotation import Lines, make_lines
from app.soccer.choices import GoalEdge
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.jaccard import project_markings
from app.tracking import track
from app.tracking.track import FrameCamera, track_clip
from tests.tripod_films import Film


def outcomes(found: list[FrameCamera]) -> list[str]:
    return [frame.outcome for frame in found]


def farthest(film: Film, found: list[FrameCamera]) -> float:
    return max(film.off_px(each.number, each.camera) for each in found if each.camera is not None)


def drawn(film: Film, number: int) -> Lines:
    """The lines of a frame where they are."""
    height, width = film.images[0].shape[:2]
    shown = project_markings(film.cameras[number], Pitch(), ImageSize(width, height))
    return make_lines(
        {
            name: tuple(ImagePoint(*point) for point in line[:: max(len(line) // 6, 1)].tolist())
            for name, line in shown.items()
            if len(line) > 5
        }
    )


def test_every_frame_is_tracked_without_any_annotation(film: Film, tmp_path: Path):
    heard: list[int] = []
    found = track_clip(film.write(tmp_path), {}, tell=heard.append).frames
    assert outcomes(found) == ["tracked"] * len(film.images)
    assert [frame.number for frame in found] == list(range(len(film.images)))
    assert [frame.time for frame in found] == pytest.approx(np.arange(len(found)) / 25)
    assert heard[-1] == len(found)
    assert found[0].is_keyframe and not any(frame.is_keyframe for frame in found[1:])
    assert farthest(film, found) < 1.5
    for frame in found:
        assert frame.supported is not None and frame.supported > 0.8
        assert frame.explained is not None and frame.explained > 0.6
        assert frame.error_px is not None and frame.error_px < 0.5
        assert frame.covariance is not None and frame.reason is None


def test_lines_of_one_frame_place_the_frames_before_and_behind_it(film: Film, tmp_path: Path):
    middle = len(film.images) // 2
    lines = drawn(film, middle)
    found = track_clip(film.write(tmp_path), {middle: lines}).frames
    assert outcomes(found) == ["tracked"] * len(film.images)
    assert [frame.number for frame in found if frame.is_keyframe] == [middle]
    assert farthest(film, found) < 1.5


def test_lines_of_a_frame_that_shows_nothing_hold_its_camera(film: Film, tmp_path: Path):
    images, rng = list(film.images), np.random.default_rng(1)
    for number in (3, 4):
        images[number] = rng.integers(0, 255, images[number].shape, dtype=np.uint8)
    found = track_clip(film.write(tmp_path, images), {3: drawn(film, 3)}).frames
    expected = ["tracked"] * len(images)
    expected[3:5] = "bridged", "lost"
    assert outcomes(found) == expected
    assert found[3].is_keyframe and found[3].error_px is None
    assert found[3].covariance is not None and farthest(film, found) < 3.0


def test_frames_without_paint_are_bridged_by_the_background(film: Film, tmp_path: Path):
    images = list(film.images)
    for number in (4, 5):
        images[number] = cv2.medianBlur(images[number], 15)
    found = track_clip(film.write(tmp_path, images), {}).frames
    expected = ["tracked"] * len(images)
    expected[4] = expected[5] = "bridged"
    assert outcomes(found) == expected
    assert all(found[number].reason for number in (4, 5))
    assert all(found[number].covariance is not None for number in (4, 5))
    assert farthest(film, found) < 3.0


def test_frames_of_something_else_have_no_camera_and_those_behind_them_do(
    film: Film, tmp_path: Path
):
    images, rng = list(film.images), np.random.default_rng(1)
    for number in (4, 5):
        images[number] = rng.integers(0, 255, images[number].shape, dtype=np.uint8)
    found = track_clip(film.write(tmp_path, images), {}).frames
    expected = ["tracked"] * len(images)
    expected[4] = expected[5] = "lost"
    assert outcomes(found) == expected
    assert all(found[number].camera is None and found[number].reason for number in (4, 5))
    assert farthest(film, found) < 1.5


def test_a_film_of_nothing_has_no_camera(tmp_path: Path):
    images = [np.full((270, 480, 3), (40, 110, 40), np.uint8)] * 3
    found = track_clip(Film(images, []).write(tmp_path), {}).frames
    assert outcomes(found) == ["lost"] * 3


def test_lines_of_a_frame_that_is_not_there_are_refused(film: Film, tmp_path: Path):
    lines = drawn(film, 0)
    path = film.write(tmp_path, film.images[:2])
    with pytest.raises(InputError, match=r"frame 7 is not in .*, whose frames are 0 to 1"):
        track_clip(path, {7: lines})
    few = make_lines(dict(list(lines.items())[:1]))
    with pytest.raises(InputError, match="no camera can be computed from the lines of frame 0"):
        track_clip(path, {0: few})


def test_what_is_no_video_is_refused(tmp_path: Path):
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"no video")
    with pytest.raises(ImageError, match=r"clip\.mp4 is not a video"):
        track_clip(path, {})


@pytest.mark.parametrize(("goal", "followed"), [("middle", "inner"), ("laws", "laws")])
def test_a_policy_whose_lines_lie_by_the_laws_is_followed(
    film: Film, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, goal: GoalEdge, followed: GoalEdge
):
    seen: list[str] = []

    def keep(_clip: object, _given: object, pitch: Pitch, *_: object) -> None:
        seen.append(pitch.goal)
        raise InputError("that was all")

    monkeypatch.setattr(track, "follow_shot", keep)
    with pytest.raises(InputError, match="that was all"):
        track_clip(film.write(tmp_path), {0: drawn(film, 0)}, None, CalibrationPolicy(goal=goal))
    assert seen == [followed]
