"""Cameras for pictures alone, on the command line."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.cli import main
from tests.unit.paint.lawns import TRUE, drawn, lawn


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Run the command; its exit code."""
    monkeypatch.setattr(sys, "argv", ["touchline", "propose", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


class TestPropose:
    def test_cameras_of_proposed_pictures_alone_are_written(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ):
        pictures, out = tmp_path / "pictures", tmp_path / "out"
        pictures.mkdir()
        out.mkdir()
        cv2.imwrite(str(pictures / "good.png"), lawn(drawn(TRUE, 3))[:, :, ::-1])
        cv2.imwrite(str(pictures / "grass.jpg"), lawn(np.zeros((540, 960), np.bool_)))
        whole = (pictures / "good.png").read_bytes()
        (pictures / "cut.png").write_bytes(whole[: len(whole) // 2])
        (out / "camera_grass.json").write_text("of an earlier run")
        assert run(monkeypatch, pictures, out, "--json") == 0
        rows = json.loads(capsys.readouterr().out)
        assert rows == json.loads((out / "propose.json").read_text())
        assert {row["frame"]: row["outcome"] for row in rows} == {
            "good": "proposed",
            "grass": "nothing",
            "cut": "nothing",
        }
        assert all(row["reason"] for row in rows if row["outcome"] == "nothing")
        assert sorted(file.name for file in out.iterdir()) == ["camera_good.json", "propose.json"]
        assert set(rows[0]) >= {
            "frame", "outcome", "supported", "explained", "points", "error_px", "runner_up", "ms",
        }  # fmt: skip

    def test_no_camera_is_written_of_which_it_is_unsure(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ):
        monkeypatch.setattr("app.paint.propose.LEAST_SUM", 9.0)
        cv2.imwrite(str(tmp_path / "good.png"), lawn(drawn(TRUE, 3))[:, :, ::-1])
        assert run(monkeypatch, tmp_path / "good.png", tmp_path / "out") == 0
        assert "unsure" in capsys.readouterr().out
        assert [file.name for file in (tmp_path / "out").iterdir()] == ["propose.json"]

    def test_a_folder_without_pictures_is_said(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ):
        (tmp_path / "in").mkdir()
        assert run(monkeypatch, tmp_path / "in", tmp_path / "out") == 1
        assert "no pictures" in capsys.readouterr().err
