from __future__ import annotations

import random
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from app.config import Settings
from app.errors import ImageError, NotFoundError
from app.media import video as media_video
from app.video.frames import RecordingReader, read_frames
from app.video.indexing import index_recording
from tests.videos import delay_start, number_of, stretch_pixels, vary_times, write_video

COUNT = 200
_DICE = random.Random(1)
ANY_DURATION = [_DICE.randint(100, 1500) for _ in range(COUNT)]


def recording(path: Path, kind: str) -> Path:
    suffix, codec = kind.split()[0].split("/")
    write_video(path.with_suffix(f".{suffix}"), codec, COUNT)
    path = path.with_suffix(f".{suffix}")
    if "variable" in kind:
        vary_times(path, ANY_DURATION)
    if "late" in kind:
        delay_start(path, 1700)
    return path


class TestReadFrames:
    @pytest.mark.parametrize(
        "kind",
        [
            *("mp4/mp4v", "mp4/MPG2", "avi/MJPG", "webm/VP80", "mkv/MPG2", "ts/MPG2", "mpg/MPG2"),
            *("mp4/MPG2 variable", "mp4/MPG2 variable late"),
        ],
    )
    def test_every_frame_shows_its_number_in_whatever_order(
        self, kind: str, tmp_path: Path, settings: Settings
    ) -> None:
        path = recording(tmp_path / "cam1", kind)
        index = index_recording(path, settings)
        assert len(index) == COUNT
        numbers = [COUNT - 1, 0, 150, 149, 151, 40, 199, *range(60, 70), 33, 32]
        found = [number_of(frame[..., ::-1]) for _, frame in read_frames(path, index, numbers)]
        assert found == numbers

    def test_pixels_are_square(self, tmp_path: Path, settings: Settings) -> None:
        path = stretch_pixels(write_video(tmp_path / "cam1.mp4", "mp4v", 5), 4, 3)
        index = index_recording(path, settings)
        ((_, frame),) = read_frames(path, index, [3])
        assert frame.shape == (96, 213, 3)

    def test_colours_are_red_green_blue(self, tmp_path: Path, settings: Settings) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", 5)
        index = index_recording(path, settings)
        ((_, frame),) = read_frames(path, index, [0])
        moving = frame[64:76, 2:8].reshape(-1, 3).mean(axis=0)
        assert moving[2] > moving[0] + 50

    @pytest.mark.parametrize("number", [-1, 5])
    def test_a_frame_that_is_not_there_is_refused_with_their_number(
        self, number: int, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", 5)
        index = index_recording(path, settings)
        with pytest.raises(NotFoundError, match=f"no frame {number}; it has 5 frames"):
            list(read_frames(path, index, [number]))

    def test_a_file_that_became_another_one_is_said(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", 80)
        index = index_recording(path, settings)
        write_video(path, "mp4v", 20)
        with pytest.raises(ImageError, match=r"frame 70 of cam1\.mp4 cannot be decoded"):
            list(read_frames(path, index, [70]))


class TestRecordingReader:
    def test_what_was_read_is_not_decoded_again(
        self, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", COUNT)
        index = index_recording(path, settings)
        with closing(RecordingReader(path, index)) as reader:
            reader.read(100)
            reader.prefetch(100, 3)
            monkeypatch.setattr(
                media_video.FrameReader, "read", lambda *_: pytest.fail("decoded again")
            )
            assert [number_of(reader.read(n)[..., ::-1]) for n in (100, 103, 101)] == [
                100,
                103,
                101,
            ]

    def test_it_keeps_no_more_than_it_may(self, tmp_path: Path, settings: Settings) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", 60)
        index = index_recording(path, settings)
        with closing(RecordingReader(path, index, kept_bytes=5 * 160 * 96 * 3)) as reader:
            reader.prefetch(-1, 60)
            assert list(reader._kept) == [55, 56, 57, 58, 59]

    def test_frames_that_follow_are_not_sought(
        self, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", COUNT)
        index = index_recording(path, settings)
        with closing(RecordingReader(path, index)) as reader:
            reader.read(100)
            monkeypatch.setattr(
                media_video.FrameReader, "_jump", lambda *_: pytest.fail("sought again")
            )
            numbers = [101, 102, 110, 130]
            assert [number_of(reader.read(n)[..., ::-1]) for n in numbers] == numbers

    def test_behind_a_jump_in_a_stream_a_key_frame_comes_first(
        self, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = write_video(tmp_path / "cam1.ts", "MPG2", COUNT)
        index = index_recording(path, settings)
        began: list[int] = []
        jump = media_video.FrameReader._jump

        def watched(self: media_video.FrameReader, start: int, number: int) -> bool:
            done = jump(self, start, number)
            began.append(start)
            return done

        monkeypatch.setattr(media_video.FrameReader, "_jump", watched)
        ((_, frame),) = read_frames(path, index, [143])
        assert number_of(np.ascontiguousarray(frame[..., ::-1])) == 143
        assert began and began[-1] <= 132
