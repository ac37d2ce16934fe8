"""Frames of recordings, as the process decodes them that gives them to browsers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.config import Settings
from app.features.recordings import frames as module
from app.features.recordings.frames import AHEAD, BEHIND, read_ahead, read_jpeg
from app.features.recordings.index import index_recording_file
from app.media.video import FrameReader
from tests.videos import number_of, write_video

FRAMES = 120


@pytest.fixture
def settings(tmp_path: Path) -> Iterator[Settings]:
    yield Settings(home=tmp_path / "home")
    while module._OPEN:
        module._OPEN.popitem()[1].reader.close()


@pytest.fixture
def film(tmp_path: Path, settings: Settings) -> tuple[Path, str]:
    """A film that is indexed, and its sha256."""
    path = write_video(tmp_path / "film.mp4", "mp4v", FRAMES)
    facts, _ = index_recording_file(path, settings, lambda _: None)
    return path, facts["sha256"]


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of the frames that were decoded, as they are."""
    found: list[int] = []
    plain = FrameReader.read

    def read(reader: FrameReader, number: int) -> object:
        found.append(number)
        return plain(reader, number)

    monkeypatch.setattr(FrameReader, "read", read)
    return found


def shown(data: bytes) -> int:
    """The number that a JPEG shows."""
    return number_of(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))


class TestReadJpeg:
    def test_steps_back_are_decoded_together(
        self, film: tuple[Path, str], settings: Settings, decoded: list[int]
    ) -> None:
        for number in range(90, 90 - BEHIND, -1):
            assert shown(read_jpeg(*film, number, None, settings)) == number
        assert decoded == list(range(90 - BEHIND, 91))

    def test_who_steps_on_finds_the_next_frames_decoded(
        self, film: tuple[Path, str], settings: Settings, decoded: list[int]
    ) -> None:
        read_jpeg(*film, 30, None, settings)
        steps = 1
        while read_ahead(*film, 30, settings):
            steps += 1
        assert steps == AHEAD
        assert decoded[-AHEAD:] == [31, 32, 33, 34]
        decoded.clear()
        assert shown(read_jpeg(*film, 31, None, settings)) == 31
        assert decoded == []

    def test_who_steps_back_finds_those_before(
        self, film: tuple[Path, str], settings: Settings, decoded: list[int]
    ) -> None:
        for number in (90, 89):
            read_jpeg(*film, number, None, settings)
        for number in range(88, 60, -1):
            while read_ahead(*film, number + 1, settings):
                pass
            decoded.clear()
            assert shown(read_jpeg(*film, number, None, settings)) == number
            assert decoded == []

    def test_the_longer_somebody_goes_back_the_more_is_decoded_together(
        self, film: tuple[Path, str], settings: Settings, decoded: list[int]
    ) -> None:
        read_jpeg(*film, 119, None, settings)
        for number in range(118, 50, -1):
            while read_ahead(*film, number + 1, settings):
                pass
            assert shown(read_jpeg(*film, number, None, settings)) == number
        turns = np.flatnonzero(np.diff(decoded) != 1)
        assert np.diff(turns)[0] == BEHIND + 1
        assert np.diff(turns).max() > 2 * BEHIND
        assert len(decoded) == len(set(decoded))

    def test_what_is_decoded_before_somebody_asks_is_ready_in_its_width_and_not_without_bound(
        self, film: tuple[Path, str], settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "READY_BYTES", 2 * len(read_jpeg(*film, 30, 100, settings)))
        while read_ahead(*film, 30, settings):
            pass
        (opened,) = module._OPEN.values()
        assert 0 < len(opened.ready) < AHEAD
        assert sum(map(len, opened.ready.values())) == opened.ready_bytes <= module.READY_BYTES
        assert {width for _, width in opened.ready} == {100}
        asked = next(iter(opened.ready))[0]
        assert read_jpeg(*film, asked, 100, settings) == opened.ready[asked, 100]

    def test_a_jump_back_is_made_in_steps_between_which_others_are_answered(
        self, film: tuple[Path, str], settings: Settings, decoded: list[int]
    ) -> None:
        read_jpeg(*film, 110, None, settings)
        read_jpeg(*film, 104, None, settings)
        asked, steps = iter([103, 102, 101]), 0
        while read_ahead(*film, 104, settings):
            decoded_before, steps = len(decoded), steps + 1
            if steps % 3 == 0 and (number := next(asked, None)) is not None:
                assert shown(read_jpeg(*film, number, None, settings)) == number
                assert len(decoded) == decoded_before
        assert steps >= BEHIND + 5
        decoded.clear()
        for number in range(100, 89, -1):
            assert shown(read_jpeg(*film, number, None, settings)) == number
        assert decoded == []

    def test_small_pictures_are_kept_in_the_cache(
        self, film: tuple[Path, str], settings: Settings, decoded: list[int]
    ) -> None:
        first = read_jpeg(*film, 50, 80, settings)
        decoded.clear()
        assert read_jpeg(*film, 50, 80, settings) == first
        assert decoded == []
        assert len(list(settings.cache.rglob("*.jpg"))) == 1

    def test_few_recordings_stay_open(
        self, tmp_path: Path, settings: Settings, film: tuple[Path, str]
    ) -> None:
        for number in range(module.MOST_OPEN + 1):
            path = write_video(tmp_path / f"{number}.mp4", "mp4v", 20 + number)
            facts, _ = index_recording_file(path, settings, lambda _: None)
            read_jpeg(path, facts["sha256"], 3, None, settings)
        assert len(module._OPEN) == module.MOST_OPEN
        assert shown(read_jpeg(*film, 7, None, settings)) == 7
