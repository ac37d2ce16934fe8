"""Frames of a clip, in the size in which they are followed."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.errors import ImageError
from app.soccer.frames import ImageSize
from app.tracking.clip import Clip
from tests.cameras import looking
from tests.videos import stretch_pixels


def write(path: Path, width: int, height: int, count: int = 4, codec: str = "MJPG") -> Path:
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), 10, (width, height))
    for number in range(count):
        video.write(np.full((height, width, 3), (200, 20 + 40 * number, 10), np.uint8))
    video.release()
    return path


@pytest.mark.parametrize(
    ("own", "work"),
    [((398, 224), (796, 448)), ((848, 478), (848, 478)), ((1920, 1080), (960, 540))],
)
def test_small_frames_are_enlarged_and_large_ones_made_smaller(tmp_path: Path, own, work):
    clip = Clip.open(write(tmp_path / "clip.avi", *own, 1))
    assert (clip.size, clip.work) == (ImageSize(*own), ImageSize(*work))
    assert next(clip.frames()).image.shape == (work[1], work[0], 3)
    camera = looking((0, 60, -15), (10, 0, 0), 900, size=clip.size)
    read = clip.as_read(camera)
    assert read.focal_length[0] == pytest.approx(900 * work[0] / own[0])
    assert clip.as_shown(read).parameters == pytest.approx(camera.parameters)


def test_frames_are_numbered_from_nought_with_their_times_and_colours(tmp_path: Path):
    clip = Clip.open(write(tmp_path / "clip.avi", 640, 360))
    frames = list(clip.frames(1, 3))
    assert [frame.number for frame in frames] == [1, 2]
    assert [frame.time for frame in frames] == pytest.approx([0.1, 0.2])
    red, green, blue = frames[1].image[180, 320].tolist()
    assert abs(red - 10) < 12 and abs(green - 100) < 12 and abs(blue - 200) < 12


def test_pixels_that_are_not_square_are_refused_with_what_to_do(tmp_path: Path):
    path = write(tmp_path / "clip.mp4", 640, 360, codec="mp4v")
    assert Clip.open(stretch_pixels(path, 200, 199)).size == ImageSize(640, 360)
    path = write(tmp_path / "wide.mp4", 640, 360, codec="mp4v")
    with pytest.raises(ImageError, match=r"not square \(4:3\)") as refused:
        Clip.open(stretch_pixels(path, 4, 3))
    assert "setsar=1" in (refused.value.hint or "")


def test_frames_too_small_to_follow_a_line_in_are_refused(tmp_path: Path):
    with pytest.raises(ImageError, match="too small"):
        Clip.open(write(tmp_path / "clip.avi", 160, 96))
