from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from app.config import Settings
from app.video.indexing import index_recording
from app.video.shots import (
    FrameContent,
    analyse_frame,
    choose_frames_for_kind,
    classify_shot,
    find_shots,
)
from tests.films import Join, freeze, join, rendered, write_film
from tests.videos import vary_times


def looked(grass: float, proposed: bool) -> FrameContent:
    return FrameContent(grass, proposed)


class TestFindShots:
    def test_shots_and_transitions_part_the_recording(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        clips = [rendered(seed, 60) for seed in (21, 22, 23, 24, 25)]
        joins = [Join("cut"), Join("dissolve", 10), Join("fade", 14), Join("logo", 12)]
        film, known = join(clips, joins)
        found = find_shots(index_recording(write_film(tmp_path / "film.mp4", film), settings))
        assert found.frames == len(film) and found.fps == 25.0 and not found.variable
        assert [shot.entered_by for shot in found.shots] == [shot.entered_by for shot in known]
        for shot, wanted in zip(found.shots, known, strict=True):
            assert abs(shot.first - wanted.first) <= 2 and abs(shot.last - wanted.last) <= 2
            assert shot.start_s == pytest.approx(shot.first / 25)
            assert shot.end_s == pytest.approx((shot.last + 1) / 25)
        inside = [set(range(shot.first, shot.last + 1)) for shot in found.shots]
        inside += [set(range(one.first, one.last + 1)) for one in found.transitions]
        assert sum(map(len, inside)) == len(set().union(*inside)) == len(film)

    def test_times_follow_a_variable_rate(self, tmp_path: Path, settings: Settings) -> None:
        film, _ = join([rendered(1, 20), rendered(2, 20)], [Join("cut")])
        path = vary_times(write_film(tmp_path / "film.mp4", film), [512] * 20 + [2048] * 20)
        found = find_shots(index_recording(path, settings))
        assert found.variable
        assert [shot.start_s for shot in found.shots] == pytest.approx([0.0, 0.8])
        assert found.shots[1].end_s == pytest.approx(0.8 + 19 * 0.16 + 0.04, abs=0.13)

    def test_what_lies_between_two_flights_of_a_logo_is_a_replay(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        clips = [rendered(seed, 60) for seed in (21, 22, 23)]
        film, _ = join(clips, [Join("logo", 12), Join("logo", 12)])
        index = index_recording(write_film(tmp_path / "film.mp4", film), settings)

        def look(numbers: Sequence[int]) -> list[FrameContent]:
            return [looked(0.8, not 60 < number < 110) for number in numbers]

        found = find_shots(index, look)
        assert [shot.kind for shot in found.shots] == ["main", "replay", "main"]
        assert [shot.logo for shot in found.shots] == [None, 0, 0]

    def test_freezes_lie_in_their_shot(self, tmp_path: Path, settings: Settings) -> None:
        film, _ = join([rendered(1, 40), freeze(rendered(2, 60), 20, 20)], [Join("cut")])
        path = write_film(tmp_path / "film.avi", film, "MJPG")
        found = find_shots(index_recording(path, settings))
        assert [len(shot.freezes) for shot in found.shots] == [0, 1]
        assert found.shots[1].freezes[0].first == 61

    def test_a_single_frame_is_a_shot(self, tmp_path: Path, settings: Settings) -> None:
        path = write_film(tmp_path / "film.mp4", rendered(1, 1))
        (shot,) = find_shots(index_recording(path, settings)).shots
        assert (shot.first, shot.last, shot.entered_by) == (0, 0, "start")


class TestKindOf:
    @pytest.mark.parametrize(
        ("looks", "kind"),
        [
            ([(0.8, True), (0.8, True), (0.8, False)], "main"),
            ([(0.8, True)], "main"),
            ([(0.8, True), (0.8, False), (0.8, False)], "closeup"),
            ([(0.3, False), (0.2, False), (0.2, False)], "closeup"),
            ([(0.0, False), (0.02, False), (0.1, False)], "other"),
        ],
    )
    def test_it_follows_from_what_its_frames_show(
        self, looks: list[tuple[float, bool]], kind: str
    ) -> None:
        assert classify_shot([looked(*look) for look in looks]) == kind

    def test_three_frames_are_looked_at_and_one_of_a_short_shot(self) -> None:
        assert choose_frames_for_kind(100, 200, 4.0) == [120, 150, 180]
        assert choose_frames_for_kind(100, 110, 0.4) == [105]


class TestLookAt:
    def test_a_picture_without_grass_shows_none(self) -> None:
        grey = np.full((180, 320, 3), 128, np.uint8)
        assert analyse_frame(grey) == FrameContent(0.0, False)
