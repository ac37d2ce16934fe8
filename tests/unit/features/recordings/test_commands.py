"""Recordings brought in on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from tests.videos import write_video

Run = Callable[..., tuple[int, str, str]]


class TestImportVideo:
    def test_files_become_recordings_of_a_dataset(self, tmp_path: Path, touchline: Run) -> None:
        films = [write_video(tmp_path / f"{name}.mp4", "mp4v", 30) for name in ("one", "two")]
        code, told, _ = touchline("import", "video", *films, "--dataset", "cup", "--json")
        rows = json.loads(told)
        assert code == 0
        assert [(row["id"], row["name"], row["frames"]) for row in rows] == [
            (1, "one", 30),
            (2, "two", 30),
        ]
        again = json.loads(touchline("import", "video", films[1], "--dataset", "cup", "--json")[1])
        assert again == rows[1:]

    def test_a_file_that_cannot_be_read_is_named_and_the_others_follow(
        self, tmp_path: Path, touchline: Run
    ) -> None:
        films = [write_video(tmp_path / f"{name}.mp4", "mp4v", 5) for name in ("one", "two")]
        bad = tmp_path / "bad.mp4"
        bad.write_text("no video at all")
        words = ("import", "video", films[0], bad, films[1], "--dataset", "cup")
        code, told, complaint = touchline(*words)
        assert (code, told.count("sha256"), "two" in told) == (1, 2, True)
        assert f"{bad}: bad.mp4 is not a video that can be read" in complaint
        code, told, _ = touchline(*words, "--json")
        one, refused, two = json.loads(told)
        assert (code, one["name"], two["name"]) == (1, "one", "two")
        assert refused == {
            "file": str(bad),
            "problem": "bad.mp4 is not a video that can be read",
            "hint": None,
        }

    def test_what_is_no_video_is_refused_before_anything_is_kept(
        self, tmp_path: Path, touchline: Run
    ) -> None:
        notes = tmp_path / "notes.txt"
        notes.write_text("x")
        film = write_video(tmp_path / "one.mp4", "mp4v", 30)
        code, _, complaint = touchline("import", "video", film, notes, "--dataset", "cup")
        assert (code, "notes.txt is not a video" in complaint) == (1, True)
        assert "cup" not in touchline("datasets", "list")[1]

    def test_options_of_other_formats_are_refused(self, tmp_path: Path, touchline: Run) -> None:
        film = write_video(tmp_path / "one.mp4", "mp4v", 5)
        for option in ("--dry-run", "--no-propose", "--flip=2"):
            assert touchline("import", "video", film, "--dataset", "cup", option)[0] == 2
        assert touchline("import", "coco", film, film, "--dataset", "cup")[0] == 2
