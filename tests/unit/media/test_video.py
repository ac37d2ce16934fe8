from __future__ import annotations

import random
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np
import pytest

from app.config import Settings
from app.errors import ImageError, NotFoundError, TooLargeError
from app.media import files as media_module
from app.media import video as video_index
from app.media.files import decode_frame, has_video_index, read_encoded_frame, read_video_times
from app.media.frames import FrameProvider, find_neighbouring_frames
from app.soccer.group import Media
from tests.videos import delay_start, mark_interlaced, number_of, vary_times, write_video

TICK = 512
COUNT = 200
"""Beyond a margin, so that most frames are jumped to."""
_DICE = random.Random(1)
RATES = {
    "three times as long every third frame": [TICK * (1 if n % 3 else 3) for n in range(COUNT)],
    "any duration": [_DICE.randint(100, 1500) for _ in range(COUNT)],
    "slow later": [TICK] * 100 + [4 * TICK] * 100,
    "slow first": [4 * TICK] * 100 + [TICK] * 100,
    "two frames almost at once": [1 if n % 2 else 2 * TICK - 1 for n in range(COUNT)],
    "two frames at one time": [0 if n % 5 == 0 else TICK for n in range(COUNT)],
}
CODECS = [
    ("mp4", "mp4v"),
    ("mp4", "MPG2"),
    ("avi", "MJPG"),
    ("avi", "XVID"),
    ("avi", "MPG2"),
    ("webm", "VP80"),
    ("mkv", "MPG2"),
    # They begin after zero; the last frame of an MPEG program stream has no time at all.
    ("ts", "MPG2"),
    ("mpg", "MPG2"),
]


def wrong(path: Path, settings: Settings, step: int = 7) -> list[tuple[int, int]]:
    """Frames that show another number than theirs."""
    times = read_video_times(Media(str(path), frame=0), settings)
    assert len(times) == COUNT
    found = []
    for number in [*range(0, COUNT, step), COUNT - 1]:
        shown = number_of(decode_frame(Media(str(path), frame=number), False, settings))
        found += [] if shown == number else [(number, shown)]
    return found


_CAPTURE = cv2.VideoCapture


class Astray:
    """A decoder that jumps too far, and that lands behind the first frame when it is sent back."""

    jumps: ClassVar[list[float]] = []

    def __init__(self, *arguments: Any):
        self._video = _CAPTURE(*arguments)

    def set(self, what: int, value: float) -> bool:
        if what == cv2.CAP_PROP_POS_MSEC:
            self.jumps.append(value)
            value += 1000.0
        return bool(self._video.set(what, value + 5 if what == cv2.CAP_PROP_POS_FRAMES else value))

    def __getattr__(self, name: str) -> object:
        return getattr(self._video, name)


class TestFrameAt:
    @pytest.mark.parametrize(("suffix", "codec"), CODECS)
    def test_every_frame_of_a_constant_rate_shows_its_number(
        self, suffix: str, codec: str, tmp_path: Path, settings: Settings
    ) -> None:
        assert wrong(write_video(tmp_path / f"cam1.{suffix}", codec), settings) == []

    @pytest.mark.parametrize("codec", ["mp4v", "MPG2"])
    @pytest.mark.parametrize("rate", RATES)
    def test_so_does_every_frame_of_a_variable_one(
        self, rate: str, codec: str, tmp_path: Path, settings: Settings
    ) -> None:
        path = vary_times(write_video(tmp_path / "cam1.mp4", codec), RATES[rate])
        assert wrong(path, settings) == []

    @pytest.mark.parametrize("codec", ["mp4v", "MPG2"])
    def test_and_of_one_that_begins_later(
        self, codec: str, tmp_path: Path, settings: Settings
    ) -> None:
        path = vary_times(write_video(tmp_path / "cam1.mp4", codec), RATES["any duration"])
        assert wrong(delay_start(path, 1700), settings) == []

    def test_a_jump_that_leads_elsewhere_is_not_believed(
        self, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", 100)
        read_video_times(Media(str(path), frame=60), settings)
        monkeypatch.setattr(cv2, "VideoCapture", Astray)
        monkeypatch.setattr(Astray, "jumps", [])
        picture = decode_frame(Media(str(path), frame=60), False, settings)
        assert Astray.jumps == [pytest.approx(1120.0)]
        assert number_of(picture) == 60


class TestVideoTimes:
    def test_a_video_is_decoded_once(
        self, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        media = Media(str(write_video(tmp_path / "cam1.mp4", "mp4v", 20)), frame=5)
        assert not has_video_index(media, settings)
        times = read_video_times(media, settings)
        assert times.tolist() == pytest.approx([40.0 * number for number in range(20)])
        assert has_video_index(media, settings)
        monkeypatch.setattr(media_module, "make_index", lambda *_: pytest.fail("decoded again"))
        assert (read_video_times(media, settings) == times).all()

    def test_another_video_in_its_place_is_decoded_again(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        media = Media(str(write_video(tmp_path / "cam1.mp4", "mp4v", 20)), frame=5)
        read_video_times(media, settings)
        write_video(tmp_path / "cam1.mp4", "mp4v", 9)
        assert len(read_video_times(media, settings)) == 9

    def test_a_damaged_index_is_made_again(self, tmp_path: Path, settings: Settings) -> None:
        media = Media(str(write_video(tmp_path / "cam1.mp4", "mp4v", 20)), frame=5)
        read_video_times(media, settings)
        (kept,) = (settings.cache / "videos").iterdir()
        for content in (b"", b"no array", kept.read_bytes()[:90]):
            kept.write_bytes(content)
            assert len(read_video_times(media, settings)) == 20

    def test_a_frame_behind_the_last_is_refused_with_their_number(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", 20)
        for number in (-1, 20):
            with pytest.raises(NotFoundError, match=f"no frame {number}; it has 20 frames"):
                read_encoded_frame(Media(str(path), frame=number), None, False, settings)

    def test_a_video_without_end_is_refused(
        self, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(video_index, "MAX_FRAMES", 19)
        media = Media(str(write_video(tmp_path / "cam1.mp4", "mp4v", 20)), frame=5)
        with pytest.raises(TooLargeError, match="more than 19 frames"):
            read_video_times(media, settings)

    def test_what_is_no_video_is_refused(self, tmp_path: Path, settings: Settings) -> None:
        (tmp_path / "cam1.mp4").write_bytes(b"no video")
        with pytest.raises(ImageError, match="not a video that can be read"):
            read_video_times(Media(str(tmp_path / "cam1.mp4"), frame=0), settings)


def is_indexed(media: Media, _flipped: bool, settings: Settings) -> bool:
    """What a reader is called with: whether it need not decode the whole video."""
    return has_video_index(media, settings)


def decode_frame_of(media: Media, flipped: bool, settings: Settings) -> int:
    return len(decode_frame(media, flipped, settings))


def is_indexed_here(media: Media, settings: Settings) -> bool:
    return has_video_index(media, settings)


class TestFramesOfTheServer:
    def test_a_video_is_indexed_before_a_frame_of_it_is_read(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        media = Media(str(write_video(tmp_path / "cam1.mp4", "mp4v", 20)), frame=5)
        frames = FrameProvider(settings)
        try:
            assert frames.request_work_on_frame(media, False, is_indexed).future.result(60)
            write_video(tmp_path / "cam1.mp4", "mp4v", 21)
            assert frames.request_work(media, is_indexed_here, media).future.result(60)
        finally:
            frames.close()

    def test_who_leaves_while_it_is_indexed_has_nothing_read(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        media = Media(str(write_video(tmp_path / "cam1.mp4", "mp4v", 20)), frame=5)
        frames = FrameProvider(settings)
        try:
            asked = frames.request_work_on_frame(media, False, is_indexed)
            asked.abandon()
            indexing = frames.request_frame_preparation(media)
            assert indexing is None or indexing.future.result(60)
            assert asked.future.cancelled() and frames._readers.tasks == 0
            assert has_video_index(media, settings)
        finally:
            frames.close()

    def test_a_reader_says_what_is_wrong_with_a_video(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        (tmp_path / "cam1.mp4").write_bytes(b"no video")
        frames = FrameProvider(settings)
        try:
            for name, error in (("cam1.mp4", ImageError), ("cam2.mp4", NotFoundError)):
                media = Media(str(tmp_path / name), frame=0)
                with pytest.raises(error):
                    frames.request_work_on_frame(media, False, decode_frame_of).future.result(60)
        finally:
            frames.close()

    def test_an_index_that_the_disk_refuses_is_remembered(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        settings.cache.mkdir(parents=True)
        (settings.cache / "videos").write_bytes(b"no folder")
        media = Media(str(write_video(tmp_path / "cam1.mp4", "mp4v", 40)), frame=35)
        frames = FrameProvider(settings)
        try:
            data = np.frombuffer(frames.read(media, None, False).data, np.uint8)
            assert number_of(cv2.imdecode(data, cv2.IMREAD_COLOR)) == 35
            assert frames.request_frame_preparation(media) is None
            assert frames.request_work_on_frame(media, False, is_indexed).future.result(60)
            write_video(tmp_path / "cam1.mp4", "mp4v", 41)
            assert frames.request_frame_preparation(media) is not None
        finally:
            frames.close()

    def test_a_video_is_indexed_before_its_first_frame_is_made(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = vary_times(write_video(tmp_path / "cam1.mp4", "MPG2"), RATES["any duration"])
        media, frames = Media(str(path), frame=55), FrameProvider(settings)
        try:
            indexing = frames.request_frame_preparation(media)
            assert indexing is not None and indexing.future.result(60)
            assert frames.request_frame_preparation(media) is None
            data = np.frombuffer(frames.read(media, None, False).data, np.uint8)
            assert number_of(cv2.imdecode(data, cv2.IMREAD_COLOR)) == 55
        finally:
            frames.close()

    def test_an_index_is_made_once_and_to_its_end_whoever_leaves(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "MPG2")
        media, frames = Media(str(path), frame=55), FrameProvider(settings)
        try:
            first, second = (
                frames.request_frame_preparation(media),
                frames.request_frame_preparation(media),
            )
            assert first is not None and second is not None
            assert frames._videos.pool.tasks == 1
            first.abandon()
            assert second.future.result(60) and first.future.cancelled()
            assert has_video_index(media, settings)
        finally:
            frames.close()

    def test_a_video_that_cannot_be_read_is_told_to_all_who_wait(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        (tmp_path / "cam1.mp4").write_bytes(b"no video")
        media, frames = Media(str(tmp_path / "cam1.mp4"), frame=0), FrameProvider(settings)
        try:
            for waiting in (
                frames.request_frame_preparation(media),
                frames.request_frame_preparation(media),
            ):
                assert waiting is not None
                with pytest.raises(ImageError, match="not a video that can be read"):
                    waiting.future.result(60)
        finally:
            frames.close()

    def test_one_whose_interlaced_pictures_cannot_be_read_is_refused(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = mark_interlaced(write_video(tmp_path / "cam1.ts", "MPG2", 60))
        media, frames = Media(str(path), frame=0), FrameProvider(settings)
        try:
            waiting = frames.request_frame_preparation(media)
            assert waiting is not None
            with pytest.raises(ImageError, match=r"^cam1\.ts is interlaced"):
                waiting.future.result(60)
        finally:
            frames.close()

    def test_neighbours_end_with_the_last_frame(self, tmp_path: Path, settings: Settings) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", 20)
        found = find_neighbouring_frames(Media(str(path), frame=18), "18", True, settings)
        assert max(found) == 1
