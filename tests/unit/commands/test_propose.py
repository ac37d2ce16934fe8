"""Cameras for pictures alone, on the command line."""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.cli import main
from app.config import Settings
from app.review.importing.ingest import ingest
from app.soccer.group import Group, Media, Station, View
from app.store.session import Store
from tests.cameras import SIZE
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


class TestOfDataset:
    @pytest.fixture
    def home(self, touchline, tmp_path: Path):
        store = Store.open(Settings(home=tmp_path / "home"))
        media = Media(str(tmp_path / "gone.png"))
        group = Group("1", (View("a", Station("a", SIZE), media=media),), match="m")
        ingest(store, "demo", [group], source="files", actor="ann")
        store.close()
        return partial(touchline, "propose", "--dataset", "demo")

    def test_looks_shows_and_forgets(self, home):
        assert home("--show")[1] == (
            "m: 0 of 1 views looked at: 0 proposed, 0 unsure, 0 nothing, 0 accepted\n"
        )
        found = json.loads(home("--workers", "1", "--json")[1])
        assert (found["views"], found["nothing"], found["missing"]) == (1, 1, 1)
        (row,) = json.loads(home("--show", "--match", "m", "--json")[1])
        assert (row["looked"], row["nothing"]) == (1, 1)
        assert "forgotten  1" in home("--undo")[1]

    @pytest.mark.parametrize(
        ("words", "code", "sentence"),
        [
            (("--match", "final"), 1, "has no match final"),
            (("--show", "--undo"), 2, "one at a time"),
            (("--size", "960x540"), 2, "name nothing else"),
            (("--undo", "--match", "m"), 2, "all of a dataset"),
        ],
    )
    def test_what_cannot_be_is_said(self, home, words, code: int, sentence: str):
        found, _, err = home(*words)
        assert (found, sentence in err) == (code, True)

    def test_without_pictures_and_dataset_nothing_is_done(self, touchline):
        code, _, err = touchline("propose")
        assert (code, "name IMAGES and OUT" in err) == (2, True)
