"""Shots of a recording, on the command line."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.films import Join, join, rendered, write_film

Run = Callable[..., tuple[int, str, str]]


class TestShots:
    def test_shots_are_written_and_printed(self, tmp_path: Path, touchline: Run) -> None:
        clips = [rendered(seed, 50) for seed in (3, 4, 5)]
        film, known = join(clips, [Join("cut"), Join("dissolve", 10)])
        path, out = write_film(tmp_path / "film.mp4", film), tmp_path / "out"
        code, told, _ = touchline("shots", path, out, "--json")
        document = json.loads(told)
        assert code == 0
        assert document == json.loads((out / "shots.json").read_text())
        assert (document["frames"], document["fps"], document["variable"]) == (140, 25.0, False)
        assert [row["entered_by"] for row in document["shots"]] == ["start", "cut", "dissolve"]
        assert document["shots"][1]["first"] == known[1].first
        for row, shot in zip(document["shots"], known, strict=True):
            assert abs(row["first"] - shot.first) <= 2 and abs(row["last"] - shot.last) <= 2
            assert row["kind"] in ("main", "replay", "closeup", "other")
        assert set(document["shots"][0]) >= {
            "first", "last", "start_s", "end_s", "kind", "entered_by",
        }  # fmt: skip
        code, told, _ = touchline("shots", path, out)
        assert code == 0 and len(told.splitlines()) == 3

    @pytest.mark.parametrize("content", [b"", b"this is no video, but a text", os.urandom(4000)])
    def test_what_is_no_recording_is_one_sentence(
        self, content: bytes, tmp_path: Path, touchline: Run
    ) -> None:
        (tmp_path / "film.mp4").write_bytes(content)
        code, told, error = touchline("shots", tmp_path / "film.mp4", tmp_path / "out")
        assert (code, told) == (1, "")
        assert error.startswith("film.mp4 is ")
        assert len(error.splitlines()) == 1 and "Traceback" not in error
        assert not (tmp_path / "out").exists()

    def test_so_is_one_of_which_the_rest_is_missing(self, tmp_path: Path, touchline: Run) -> None:
        path = write_film(tmp_path / "film.mp4", rendered(3, 40))
        path.write_bytes(path.read_bytes()[:-2000])
        code, _, error = touchline("shots", path, tmp_path / "out")
        assert code == 1
        assert "film.mp4 is cut off" in error and "Copy the file again" in error

    def test_a_folder_that_cannot_be_written_is_named(self, tmp_path: Path, touchline: Run) -> None:
        path = write_film(tmp_path / "film.mp4", rendered(3, 10))
        (tmp_path / "out").write_text("no folder")
        code, _, error = touchline("shots", path, tmp_path / "out")
        assert code == 1 and "out is a file; name a folder" in error

    def test_a_recording_that_is_not_there_is_wrong_usage(
        self, tmp_path: Path, touchline: Run
    ) -> None:
        assert touchline("shots", tmp_path / "film.mp4", tmp_path / "out")[0] == 2
