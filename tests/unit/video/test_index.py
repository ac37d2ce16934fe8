from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.config import Settings
from app.errors import InputError
from app.video.index import (
    RecordingIndex,
    find_time_base,
    index_from_bytes,
    index_to_bytes,
    read_index_seconds,
)
from app.video.indexing import index_recording
from tests.videos import vary_times, write_video

TICK = 512


@pytest.fixture
def index(tmp_path: Path, settings: Settings) -> RecordingIndex:
    return index_recording(write_video(tmp_path / "cam1.mp4", "mp4v", 30), settings)


class TestTimeBaseOf:
    @pytest.mark.parametrize(
        ("over", "under"), [(1, 25), (1, 50), (1001, 24000), (1001, 30000), (1001, 60000), (1, 30)]
    )
    def test_a_rate_of_broadcasts_is_exact_after_ninety_minutes(
        self, over: int, under: int
    ) -> None:
        count = 5400 * under // over
        base, ticks = find_time_base(np.arange(count) * (over / under) * 1000.0)
        assert base == (over, under)
        assert (ticks == np.arange(count)).all()

    def test_any_durations_are_counted_in_the_ticks_of_their_container(self) -> None:
        wanted = np.cumsum(np.random.default_rng(1).integers(100, 1500, 500))
        wanted = np.append([0], wanted)
        base, ticks = find_time_base(wanted / 12800 * 1000)
        assert base == (1, 12800)
        assert (ticks == wanted).all()

    def test_times_without_a_common_tick_are_counted_in_nanoseconds(self) -> None:
        times = np.sort(np.random.default_rng(2).uniform(0, 1e5, 100))
        base, ticks = find_time_base(times)
        assert base == (1, 10**9)
        assert np.abs(ticks / 1e6 - times).max() < 1e-6

    def test_a_single_frame_has_a_time_base(self) -> None:
        base, ticks = find_time_base(np.zeros(1))
        assert base[0] > 0 and ticks.tolist() == [0]


class TestRecordingIndex:
    def test_a_clock_that_starts_again_goes_on(self, tmp_path: Path, settings: Settings) -> None:
        path = write_video(tmp_path / "cam1.ts", "MPG2", 60)
        path.write_bytes(2 * path.read_bytes())
        index = index_recording(path, settings)
        assert (len(index), index.fps, index.is_variable) == (120, 25.0, False)
        assert index.seconds == pytest.approx(np.arange(120) / 25)
        assert index.end == pytest.approx(120 / 25)

    def test_a_constant_rate_is_said_as_it_is(self, index: RecordingIndex) -> None:
        assert index.fps == 25.0 and not index.is_variable
        assert index.end == pytest.approx(1.2)

    def test_a_rate_that_changes_is_variable_and_its_mean_is_said(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        ticks = [TICK] * 15 + [4 * TICK] * 15
        path = vary_times(write_video(tmp_path / "cam1.mp4", "mp4v", 30), ticks)
        index = index_recording(path, settings)
        assert index.is_variable
        assert index.seconds[15] == pytest.approx(0.6)
        assert index.seconds[29] == pytest.approx(0.6 + 14 * 0.16)

    def test_a_container_that_counts_in_milliseconds_is_not_variable_for_it(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.mkv", "MJPG", 60, rate=30000 / 1001)
        index = index_recording(path, settings)
        assert not index.is_variable
        assert index.fps == pytest.approx(29.97, abs=0.05)


class TestBytes:
    def test_an_index_comes_back_as_it_was(self, index: RecordingIndex) -> None:
        back = index_from_bytes(index_to_bytes(index))
        assert back.facts == index.facts
        for name in ("pts", "keys", "measured"):
            assert (getattr(back, name) == getattr(index, name)).all()

    @pytest.mark.parametrize("damage", ["empty", "text", "half", "version"])
    def test_what_is_no_index_is_refused(
        self, damage: str, index: RecordingIndex, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        data = index_to_bytes(index)
        if damage == "version":
            monkeypatch.setattr("app.video.index.VERSION", 0)
        made = {"empty": b"", "text": b"no index", "half": data[: len(data) // 2]}.get(damage, data)
        with pytest.raises(InputError, match=r"recording\.idx.*index the recording again"):
            index_from_bytes(made, "recording.idx")

    def test_times_alone_are_read_from_a_file_that_is_whole(
        self, index: RecordingIndex, tmp_path: Path
    ) -> None:
        path = tmp_path / "index.npz"
        data = index_to_bytes(index)
        path.write_bytes(data)
        assert (read_index_seconds(path) == index.seconds).all()
        place = data.index(b"measured.npy") + 200
        path.write_bytes(data[:place] + bytes([data[place] ^ 255]) + data[place + 1 :])
        with pytest.raises(InputError, match="index the recording again"):
            read_index_seconds(path)
