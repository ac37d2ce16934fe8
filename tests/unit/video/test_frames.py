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
from tests.videos import (
    delay_start,
    number_of,
    stretch_pixels,
    turn,
    unmark_key_frames,
    vary_times,
    write_video,
)

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


def damaged(path: Path) -> Path:
    """The file with noise in its middle."""
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 3000] = np.random.default_rng(1).bytes(3000)
    path.write_bytes(data)
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

    @pytest.mark.parametrize("rate", [50, 60000 / 1001, 24000 / 1001])
    def test_a_rate_of_television_or_film_is_kept(
        self, rate: float, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "MPG2" if rate < 60 else "mp4v", COUNT, rate)
        index = index_recording(path, settings)
        assert index.fps == pytest.approx(rate, rel=1e-5) and not index.is_variable
        assert index.seconds[-1] == pytest.approx((COUNT - 1) / rate, rel=1e-5)
        found = [number_of(frame[..., ::-1]) for _, frame in read_frames(path, index, [150, 3])]
        assert found == [150, 3]

    def test_it_is_found_where_the_only_key_frame_is_a_minute_before(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = unmark_key_frames(write_video(tmp_path / "cam1.mp4", "mp4v", 1023))
        index = index_recording(path, settings)
        numbers = [1022, 400, 399]
        found = [number_of(frame[..., ::-1]) for _, frame in read_frames(path, index, numbers)]
        assert found == numbers

    @pytest.mark.parametrize("degrees", [90, 180, 270])
    def test_it_is_upright(self, degrees: int, tmp_path: Path, settings: Settings) -> None:
        path = turn(write_video(tmp_path / "cam1.mp4", "mp4v", 50), degrees)
        index = index_recording(path, settings)
        ((_, frame),) = read_frames(path, index, [40])
        assert frame.shape[:2] == (index.facts.height, index.facts.width)
        assert number_of(np.rot90(frame, degrees // 90)[..., ::-1]) == 40

    @pytest.mark.parametrize("kind", ["mp4/mp4v", "ts/MPG2", "webm/VP80"])
    def test_damaged_pictures_are_left_out_and_all_behind_them_are_there(
        self, kind: str, tmp_path: Path, settings: Settings
    ) -> None:
        path = damaged(recording(tmp_path / "cam1", kind))
        index = index_recording(path, settings)
        in_order = dict(read_frames(path, index, range(len(index))))
        assert number_of(in_order[len(index) - 1][..., ::-1]) == COUNT - 1
        assert len(index) < COUNT
        # Where the container itself is torn, times say how much is missing.
        assert index.facts.damaged or np.diff(index.times).max() > 1.5 * 40
        # However one comes to it, a number is one frame.
        for number in (len(index) - 2, 5, len(index) - 30):
            ((_, frame),) = read_frames(path, index, [number])
            assert number_of(frame[..., ::-1]) == number_of(in_order[number][..., ::-1])

    def test_an_avi_whose_times_are_counted_anew_behind_damage_is_refused(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = damaged(recording(tmp_path / "cam1", "avi/MJPG"))
        with pytest.raises(ImageError, match=r"cam1\.avi is damaged: its frame table"):
            index_recording(path, settings)

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
            assert all(reader.step_towards_frame(number, 3) for number in (101, 102, 103))
            monkeypatch.setattr(
                media_video.FrameReader, "read", lambda *_: pytest.fail("decoded again")
            )
            assert [number_of(reader.read(n)[..., ::-1]) for n in (100, 103, 101)] == [
                100,
                103,
                101,
            ]

    def test_a_frame_far_behind_is_approached_in_steps(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", COUNT)
        index = index_recording(path, settings)
        with closing(RecordingReader(path, index)) as reader:
            reader.read(110)
            steps = 1
            while not reader.step_towards_frame(70, 5):
                steps += 1
            assert steps > 4 and reader.has(70)
            assert number_of(reader.read(70)[..., ::-1]) == 70
            # One that is asked for meanwhile is another jump, and right.
            assert not reader.step_towards_frame(116, 5)
            assert number_of(reader.read(50)[..., ::-1]) == 50
            while not reader.step_towards_frame(116, 5):
                assert not reader.has(116)
            assert number_of(reader.read(116)[..., ::-1]) == 116

    def test_it_keeps_no_more_than_it_may(self, tmp_path: Path, settings: Settings) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", 60)
        index = index_recording(path, settings)
        with closing(RecordingReader(path, index, kept_bytes=5 * 160 * 96 * 3)) as reader:
            assert all(reader.step_towards_frame(number, 60) for number in range(60))
            assert list(reader._kept) == [55, 56, 57, 58, 59]

    def test_frames_that_follow_are_not_sought(
        self, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", COUNT)
        index = index_recording(path, settings)
        with closing(RecordingReader(path, index)) as reader:
            reader.read(100)
            monkeypatch.setattr(
                media_video.FrameReader, "_seek_to_frame", lambda *_: pytest.fail("sought again")
            )
            numbers = [101, 102, 110, 130]
            assert [number_of(reader.read(n)[..., ::-1]) for n in numbers] == numbers

    def test_behind_a_jump_in_a_stream_a_key_frame_comes_first(
        self, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = write_video(tmp_path / "cam1.ts", "MPG2", COUNT)
        index = index_recording(path, settings)
        began: list[int] = []
        jump = media_video.FrameReader._seek_to_frame

        def watched(self: media_video.FrameReader, start: int, number: int) -> bool:
            done = jump(self, start, number)
            began.append(start)
            return done

        monkeypatch.setattr(media_video.FrameReader, "_seek_to_frame", watched)
        ((_, frame),) = read_frames(path, index, [143])
        assert number_of(np.ascontiguousarray(frame[..., ::-1])) == 143
        assert began and began[-1] <= 132
