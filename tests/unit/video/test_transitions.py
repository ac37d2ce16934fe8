from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.config import Settings
from app.video.cuts import find_hard_cuts
from app.video.indexing import index_recording
from app.video.transitions import Transition, find_soft_transitions
from tests.films import Clip, Join, flash, freeze, join, rendered, whip, write_film

NEAR = 2
"""Frames that an end may be off."""


def transitions_of(
    folder: Path, film: Clip, settings: Settings, rate: float = 25
) -> list[Transition]:
    index = index_recording(write_film(folder / "film.mp4", film, rate=rate), settings)
    return find_soft_transitions(
        index.measured, index.step, *find_hard_cuts(index.measured, index.step)
    )


class TestSoftTransitions:
    @pytest.mark.parametrize(
        ("how", "kind"),
        [
            (Join("dissolve", 6), "dissolve"),
            (Join("dissolve", 12), "dissolve"),
            (Join("dissolve", 20), "dissolve"),
            (Join("wipe", 12), "wipe"),
            (Join("wipe", 16, 180), "wipe"),
            (Join("fade", 14), "fade"),
            (Join("fade", 24), "fade"),
            (Join("logo", 12), "wipe"),
            (Join("logo", 18, 1), "wipe"),
        ],
    )
    def test_its_ends_are_found(
        self, how: Join, kind: str, tmp_path: Path, settings: Settings
    ) -> None:
        film, shots = join([rendered(3, 60), rendered(4, 60)], [how])
        (found,) = transitions_of(tmp_path, film, settings)
        assert found.kind == kind
        assert abs(found.first - shots[0].last - 1) <= NEAR
        assert abs(found.last - shots[1].first + 1) <= NEAR

    def test_so_they_are_at_fifty_frames_a_second(self, tmp_path: Path, settings: Settings) -> None:
        film, shots = join([rendered(3, 90), rendered(4, 90)], [Join("dissolve", 24)])
        (found,) = transitions_of(tmp_path, film, settings, rate=50)
        assert abs(found.first - shots[0].last - 1) <= NEAR
        assert abs(found.last - shots[1].first + 1) <= NEAR

    def test_a_cut_is_none(self, tmp_path: Path, settings: Settings) -> None:
        film, _ = join([rendered(seed, 40) for seed in range(4)], [Join("cut")] * 3)
        assert transitions_of(tmp_path, film, settings) == []

    def test_neither_is_a_flash_or_a_freeze(self, tmp_path: Path, settings: Settings) -> None:
        film = freeze(flash(rendered(3, 120), 30, 3), 70, 20)
        assert transitions_of(tmp_path, film, settings) == []

    @pytest.mark.parametrize("speed", [0.1, 0.2, 0.35])
    def test_nor_a_whip_pan(self, speed: float, tmp_path: Path, settings: Settings) -> None:
        still = np.hstack([rendered(1, 1)[0], rendered(1, 1)[0][:, ::-1], rendered(2, 1)[0]])
        film = whip(still, (320, 180), 60, speed)
        assert transitions_of(tmp_path, film, settings) == []

    def test_two_that_follow_each_other_are_two(self, tmp_path: Path, settings: Settings) -> None:
        clips = [rendered(seed, 60) for seed in (3, 4, 5)]
        film, shots = join(clips, [Join("dissolve", 10), Join("fade", 12)])
        found = transitions_of(tmp_path, film, settings)
        assert [one.kind for one in found] == ["dissolve", "fade"]
        assert found[0].last < shots[1].last < found[1].first + NEAR
