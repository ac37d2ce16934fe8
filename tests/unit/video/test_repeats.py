from __future__ import annotations

from pathlib import Path

import numpy as np

from app.config import Settings
from app.video.indexing import index_recording
from app.video.measures import Measured
from app.video.repeats import Freeze, find_blended_frames, find_freezes, find_repeated_frames
from tests.films import Clip, freeze, rendered, slow, write_film

FAST = 2
"""A scene whose frames differ enough for repeats to be seen."""


def measured(folder: Path, film: Clip, settings: Settings) -> Measured:
    return index_recording(write_film(folder / "film.avi", film, "MJPG"), settings).measured


class TestRepeated:
    def test_a_replay_at_a_third_of_the_speed_repeats_two_of_three(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        found = find_repeated_frames(measured(tmp_path, slow(rendered(FAST, 20), 3), settings))
        assert np.flatnonzero(~found).tolist() == list(range(0, 60, 3))

    def test_a_scene_that_moves_repeats_nothing(self, tmp_path: Path, settings: Settings) -> None:
        assert not find_repeated_frames(measured(tmp_path, rendered(FAST, 40), settings)).any()

    def test_neither_does_one_that_stands_still(self, tmp_path: Path, settings: Settings) -> None:
        assert not find_repeated_frames(measured(tmp_path, rendered(FAST, 1) * 40, settings)).any()


class TestBlended:
    def test_every_second_frame_of_a_blended_replay_is(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        fast = rendered(FAST, 60)[::3]
        found = find_blended_frames(measured(tmp_path, slow(fast, 2, blend=True), settings))
        assert found[1:-2:2].mean() > 0.9 and found[2:-2:2].mean() < 0.1

    def test_frames_of_a_camera_are_not(self, tmp_path: Path, settings: Settings) -> None:
        fast = rendered(FAST, 90)[::3]
        assert find_blended_frames(measured(tmp_path, fast, settings)).mean() < 0.1


class TestFreezes:
    def test_a_freeze_is_found_with_its_ends(self, tmp_path: Path, settings: Settings) -> None:
        rows = measured(tmp_path, freeze(rendered(FAST, 80), 30, 20), settings)
        assert find_freezes(rows, 0.04) == [Freeze(31, 50)]

    def test_a_short_one_is_none(self, tmp_path: Path, settings: Settings) -> None:
        rows = measured(tmp_path, freeze(rendered(FAST, 80), 30, 5), settings)
        assert find_freezes(rows, 0.04) == []
