from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from app.config import Settings
from app.video.indexing import index_recording
from app.video.replays import cluster_logos, find_shots_between_logos
from tests.films import Join, join, rendered, write_film


class TestLogoClusters:
    def test_flights_of_one_logo_are_together_and_others_apart(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        kinds = [("logo", 0), ("dissolve", 0), ("logo", 1), ("logo", 0), ("wipe", 0), ("logo", 1)]
        clips = [rendered(seed, 50) for seed in range(40, 47)]
        film, shots = join(clips, [Join(kind, 12, turn) for kind, turn in kinds])
        rows = index_recording(write_film(tmp_path / "film.mp4", film), settings).measured
        intervals = [(one.last + 1, other.first - 1) for one, other in pairwise(shots)]
        found = cluster_logos(rows, intervals)
        assert found[0] == found[3] is not None
        assert found[2] == found[5] is not None
        assert found[0] != found[2]
        assert found[1] is found[4] is None

    def test_fades_are_no_logo_though_all_are_black(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        film, shots = join([rendered(seed, 50) for seed in range(4)], [Join("fade", 14)] * 3)
        rows = index_recording(write_film(tmp_path / "film.mp4", film), settings).measured
        intervals = [(one.last + 1, other.first - 1) for one, other in pairwise(shots)]
        assert cluster_logos(rows, intervals) == [None] * 3


class TestBetweenLogos:
    @pytest.mark.parametrize(
        ("clusters", "main", "replays"),
        [
            # A replay of two shots, and a live shot before and after it.
            ([0, None, 0], [1, 0, 0, 1], [0, 1, 1, 0]),
            # Two replays; what lies between is live.
            ([0, 0, 0, 0], [1, 0, 1, 0, 1], [0, 1, 0, 1, 0]),
            # The first wipe was missed: what is live between two replays is not taken for one.
            ([0, 0, 0], [0, 1, 0, 1], [0, 0, 1, 0]),
            # Where replays stand where paint tells the camera, too, their turns tell them.
            ([0, 0, 0, 0], [1, 1, 1, 1, 1], [0, 1, 0, 1, 0]),
            ([0, 0, 0, 0, 0], [1, 1, 1, 0, 1, 1], [0, 1, 0, 1, 0, 0]),
            ([0, 0], [1, 1, 1], [0, 1, 0]),
            # Logos of two broadcasters.
            ([0, 0, 1, 1], [1, 0, 1, 0, 1], [0, 1, 0, 1, 0]),
            ([None, None], [1, 0, 1], [0, 0, 0]),
        ],
    )
    def test_what_lies_between_two_wipes_of_a_logo_is_a_replay(
        self, clusters: list[int | None], main: list[int], replays: list[int]
    ) -> None:
        seconds = [(10.0 * at, 10.0 * at + 9.0) for at in range(len(main))]
        found = find_shots_between_logos(clusters, seconds, [bool(one) for one in main])
        assert found.astype(int).tolist() == replays

    def test_a_stretch_of_minutes_is_none(self) -> None:
        seconds = [(0.0, 10.0), (10.0, 200.0), (200.0, 210.0)]
        assert not find_shots_between_logos([0, 0], seconds, [True, False, True]).any()
