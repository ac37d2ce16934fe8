from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.config import Settings
from app.video.cuts import find_hard_cuts
from app.video.index import RecordingIndex
from app.video.indexing import index_recording
from app.video.transitions import find_soft_transitions
from tests.films import Clip, Join, flash, freeze, join, rendered, slow, whip, write_film
from tests.videos import vary_times


def indexed(folder: Path, film: Clip, settings: Settings, codec: str = "mp4v") -> RecordingIndex:
    return index_recording(write_film(folder / "film.mp4", film, codec), settings)


def cuts_of(index: RecordingIndex) -> list[int]:
    return find_hard_cuts(index.measured, index.step)[0].tolist()


class TestHardCuts:
    @pytest.mark.parametrize("codec", ["mp4v", "MPG2"])
    def test_every_cut_is_found_at_its_frame(
        self, codec: str, tmp_path: Path, settings: Settings
    ) -> None:
        lengths = [9, 30, 12, 41, 25, 8, 33, 20]
        clips = [rendered(seed, length) for seed, length in enumerate(lengths)]
        film, _ = join(clips, [Join("cut")] * (len(clips) - 1))
        found = cuts_of(indexed(tmp_path, film, settings, codec))
        assert found == np.cumsum(lengths[:-1]).tolist()

    def test_so_it_is_at_a_variable_rate(self, tmp_path: Path, settings: Settings) -> None:
        clips = [rendered(seed, 25) for seed in range(5)]
        film, _ = join(clips, [Join("cut")] * 4)
        dice = np.random.default_rng(5)
        path = write_film(tmp_path / "film.mp4", film)
        vary_times(path, dice.choice([256, 512, 1024], len(film)).tolist())
        assert cuts_of(index_recording(path, settings)) == [25, 50, 75, 100]

    @pytest.mark.parametrize("frames", [1, 2, 4])
    def test_a_flash_is_no_cut_and_its_frames_are_known(
        self, frames: int, tmp_path: Path, settings: Settings
    ) -> None:
        film = flash(rendered(3, 60), 30, frames)
        index = indexed(tmp_path, film, settings)
        cuts, lit = find_hard_cuts(index.measured, index.step)
        assert cuts.tolist() == []
        assert np.flatnonzero(lit).tolist() == list(range(30, 30 + frames))

    def test_a_flash_that_fades_is_no_cut_and_no_transition(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        film = flash(rendered(3, 60), 30, 1)
        film[31] = cv2.addWeighted(film[31], 0.5, np.full_like(film[31], 255), 0.5, 0)
        index = indexed(tmp_path, film, settings)
        cuts, lit = find_hard_cuts(index.measured, index.step)
        assert cuts.tolist() == [] and np.flatnonzero(lit).tolist() == [30, 31]
        assert find_soft_transitions(index.measured, index.step, cuts, lit) == []

    @pytest.mark.parametrize("foreign", ["one", "two", "white", "black"])
    def test_foreign_frames_between_two_shots_are_no_reason_to_miss_the_cut(
        self, foreign: str, tmp_path: Path, settings: Settings
    ) -> None:
        between = {
            "one": rendered(7, 1),
            "two": rendered(7, 2),
            "white": [np.full((180, 320, 3), 255, np.uint8)],
            "black": [np.zeros((180, 320, 3), np.uint8)],
        }[foreign]
        film = rendered(1, 40) + between + rendered(2, 40)
        assert cuts_of(indexed(tmp_path, film, settings)) == [40, 40 + len(between)]

    @pytest.mark.parametrize("frames", [1, 2])
    def test_foreign_frames_amid_a_shot_are_no_cut(
        self, frames: int, tmp_path: Path, settings: Settings
    ) -> None:
        shot = rendered(1, 60)
        film = shot[:30] + rendered(7, frames) + shot[30:]
        assert cuts_of(indexed(tmp_path, film, settings)) == []

    def test_a_flash_of_two_frames_is_no_cut_at_a_variable_rate(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        film = flash(rendered(3, 60), 30, 2)
        path = write_film(tmp_path / "film.mp4", film)
        dice = np.random.default_rng(5)
        vary_times(path, dice.choice([256, 512, 1024], len(film)).tolist())
        assert cuts_of(index_recording(path, settings)) == []

    @pytest.mark.parametrize("speed", [0.1, 0.2, 0.35])
    def test_a_whip_pan_is_no_cut(self, speed: float, tmp_path: Path, settings: Settings) -> None:
        still = np.hstack([rendered(1, 1)[0], rendered(1, 1)[0][:, ::-1], rendered(2, 1)[0]])
        film = whip(still, (320, 180), 50, speed)
        assert cuts_of(indexed(tmp_path, film, settings)) == []

    @pytest.mark.parametrize("skip", [False, True])
    def test_a_freeze_is_no_cut(self, skip: bool, tmp_path: Path, settings: Settings) -> None:
        film = freeze(rendered(6, 90), 30, 25, skip)
        assert cuts_of(indexed(tmp_path, film, settings)) == []

    def test_slow_motion_is_no_cut(self, tmp_path: Path, settings: Settings) -> None:
        film = slow(rendered(6, 30), 4) + slow(rendered(6, 30), 3, blend=True)[:1]
        assert cuts_of(indexed(tmp_path, film[:-1], settings)) == []

    def test_out_of_the_dark_is_no_cut(self, tmp_path: Path, settings: Settings) -> None:
        black = [np.zeros((180, 320, 3), np.uint8)] * 10
        film = rendered(1, 20) + black + rendered(2, 20)
        assert cuts_of(indexed(tmp_path, film, settings)) == []
