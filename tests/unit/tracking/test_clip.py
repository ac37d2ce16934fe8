"""Frames of a clip, in the size in which they are followed."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.errors import ImageError
from app.soccer.frames import ImageSize
from app.tracking.clip import Clip
from app.video.frames import RecordingReader
from app.video.indexing import index_without_measuring
from tests.cameras import looking
from tests.videos import number_of, numbered, stretch_pixels, turn, vary_times, write_pictures


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
    read = clip.scale_to_work_size(camera)
    assert read.focal_length[0] == pytest.approx(900 * work[0] / own[0])
    assert clip.scale_to_video(read).parameters == pytest.approx(camera.parameters)


def test_frames_are_numbered_from_nought_with_their_times_and_colours(tmp_path: Path):
    clip = Clip.open(write(tmp_path / "clip.avi", 640, 360))
    frames = list(clip.frames(1, 3))
    assert [frame.number for frame in frames] == [1, 2]
    assert [frame.time for frame in frames] == pytest.approx([0.1, 0.2])
    red, green, blue = frames[1].image[180, 320].tolist()
    assert abs(red - 10) < 12 and abs(green - 100) < 12 and abs(blue - 200) < 12


def test_frames_are_upright_and_have_square_pixels(tmp_path: Path):
    path = write(tmp_path / "wide.mp4", 640, 360, codec="mp4v")
    clip = Clip.open(stretch_pixels(path, 4, 3))
    assert (clip.size, clip.work) == (ImageSize(853, 360), ImageSize(853, 360))
    assert next(clip.frames()).image.shape == (360, 853, 3)
    path = write(tmp_path / "turned.mp4", 640, 720, codec="mp4v")
    assert Clip.open(turn(path, 90)).size == ImageSize(720, 640)


def test_a_stretch_is_read_alone_by_an_index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "clip.mp4"
    write_pictures(path, "mp4v", (cv2.resize(numbered(n), (640, 384)) for n in range(120)))
    vary_times(path, [512 + 128 * (number % 3) for number in range(120)])
    index = index_without_measuring(path)
    clip, asked = Clip.open(path, index, 90, 109), list[int]()
    read = RecordingReader.read
    monkeypatch.setattr(
        RecordingReader, "read", lambda self, number: (asked.append(number), read(self, number))[1]
    )
    frames = list(clip.frames(2, 5))
    assert asked == [92, 93, 94] and clip.count == 20
    assert [frame.number for frame in frames] == [2, 3, 4]
    assert [number_of(cv2.resize(each.image, (160, 96))) for each in frames] == asked
    assert [frame.time for frame in frames] == pytest.approx(index.seconds[92:95].tolist())
    assert np.ptp(np.diff(index.seconds)) > 0.01
    assert [frame.number for frame in clip.frames(18)] == [18, 19]


def test_frames_too_small_to_follow_a_line_in_are_refused(tmp_path: Path):
    with pytest.raises(ImageError, match="too small"):
        Clip.open(write(tmp_path / "clip.avi", 160, 96))
