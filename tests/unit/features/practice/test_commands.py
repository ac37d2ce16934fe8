"""The sample's recording on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from app.sample import recording

Run = Callable[..., tuple[int, str, str]]


class TestSampleRecording:
    def test_a_video_and_its_truth_are_written(
        self, tmp_path: Path, touchline: Run, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(recording, "PARTS", (recording.ShotPlan("main", 180, "start"),))
        out = tmp_path / "made" / "film.mp4"
        # All that there is of three minutes, a hundredth as long.
        monkeypatch.setattr(recording, "FPS", 1)
        code, told, _ = touchline("sample-recording", out, "--seconds", "36", "--json")
        assert code == 0
        assert json.loads(told) == {
            "recording": str(out), "truth": str(out.with_suffix(".json")),
            "frames": 36, "seconds": 36.0, "shots": 1,
        }  # fmt: skip
        assert sorted(path.name for path in out.parent.iterdir()) == ["film.json", "film.mp4"]

    def test_what_is_too_short_or_no_video_is_refused(self, tmp_path: Path, touchline: Run) -> None:
        assert touchline("sample-recording", tmp_path / "film.mp4", "--seconds", "20")[0] == 2
        code, _, complaint = touchline("sample-recording", tmp_path / "film.doc")
        assert (code, "does not end in .mp4, .avi or .mkv" in complaint) == (1, True)
        assert list(tmp_path.iterdir()) == []
