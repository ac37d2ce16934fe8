"""Cameras for pictures alone, on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.paint.propose import FrameProposal
from app.soccer.group import Group, Media, Station, View
from app.soccer.pitch import Pitch
from tests.cameras import SIZE, looking, write_cameras
from tests.unit.paint.lawns import SMALL, TRUE, drawn, lawn

Run = Callable[..., tuple[int, str, str]]


class TestPropose:
    def test_cameras_of_proposed_pictures_alone_are_written(self, tmp_path: Path, touchline: Run):
        pictures, out = tmp_path / "pictures", tmp_path / "out"
        pictures.mkdir()
        out.mkdir()
        cv2.imwrite(str(pictures / "good.png"), lawn(drawn(TRUE, 3))[:, :, ::-1])
        cv2.imwrite(str(pictures / "grass.jpg"), lawn(np.zeros((540, 960), np.bool_)))
        whole = (pictures / "good.png").read_bytes()
        (pictures / "cut.png").write_bytes(whole[: len(whole) // 2])
        (out / "camera_grass.json").write_text("of an earlier run")
        code, told, _ = touchline("propose", pictures, out, "--json")
        rows = json.loads(told)
        assert code == 0
        assert rows == json.loads((out / "propose.json").read_text())
        assert {row["frame"]: row["outcome"] for row in rows} == {
            "good": "proposed",
            "grass": "nothing",
            "cut": "nothing",
        }
        assert all(row["reason"] for row in rows if row["outcome"] == "nothing")
        assert sorted(file.name for file in out.iterdir()) == ["camera_good.json", "propose.json"]
        known = json.loads((out / "camera_good.json").read_text())["covariance"]
        assert all(0.1 < known[axis][axis] ** 0.5 < 3 for axis in range(3))
        assert set(rows[0]) >= {
            "frame", "outcome", "supported", "explained", "points", "error_px", "runner_up", "ms",
        }  # fmt: skip

    def test_for_pictures_that_are_imported_cameras_are_proposed_by_themselves(
        self, tmp_path: Path, touchline: Run
    ):
        cv2.imwrite(str(tmp_path / "good.png"), lawn(drawn(TRUE, 3))[:, :, ::-1])
        command = ("import", "frames", tmp_path / "good.png", "--dataset")
        code, told, _ = touchline(*command, "made")
        assert (code, "1 view looked at: 1 proposed" in told) == (0, True)
        shown = ("propose", "--show", "--json", "--dataset")
        assert json.loads(touchline(*shown, "made")[1])[0]["proposed"] == 1
        assert "looked at" not in touchline(*command, "left", "--no-propose")[1]
        assert json.loads(touchline(*shown, "left")[1])[0]["looked"] == 0

    def test_no_camera_is_written_of_which_it_is_unsure(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, touchline: Run
    ):
        monkeypatch.setattr("app.paint.propose.LEAST_SUM", 9.0)
        cv2.imwrite(str(tmp_path / "good.png"), lawn(drawn(TRUE, 3))[:, :, ::-1])
        code, told, _ = touchline("propose", tmp_path / "good.png", tmp_path / "out")
        assert (code, "unsure" in told) == (0, True)
        assert [file.name for file in (tmp_path / "out").iterdir()] == ["propose.json"]

    def test_frames_of_one_film_show_their_pitch_together(self, tmp_path: Path, touchline: Run):
        for number, target in enumerate(((22.0, -6.0), (14.0, -10.0), (-20.0, -8.0))):
            camera = looking((1.0, 62.0, -16.0), (*target, 0.0), 1150.0, size=SMALL)
            picture = lawn(drawn(camera, 2, Pitch(100.5, 68.0)))
            cv2.imwrite(str(tmp_path / f"{number}.png"), picture[:, :, ::-1])
        code, told, _ = touchline("propose", tmp_path, tmp_path / "out", "--json")
        rows = json.loads(told)
        assert code == 0
        assert [row["outcome"] for row in rows] == ["proposed"] * 3
        assert all(row["pitch"]["length"] == pytest.approx(100.5, abs=0.4) for row in rows)
        assert all(row["pitch"]["width"] == 68.0 for row in rows)
        for row in rows:
            file = json.loads((tmp_path / "out" / f"camera_{row['frame']}.json").read_text())
            assert np.allclose(file["position_meters"], (1.0, 62.0, -16.0), atol=0.8)
        touchline("propose", tmp_path / "0.png", tmp_path / "alone", "--json")
        (alone,) = json.loads((tmp_path / "alone" / "propose.json").read_text())
        assert "pitch" not in alone

    def test_what_cannot_be_read_is_named(
        self, tmp_path: Path, touchline: Run, monkeypatch: pytest.MonkeyPatch
    ):
        nothing = FrameProposal("nothing", "it shows no grass")
        monkeypatch.setattr("app.features.file_tools.propose.propose_camera", lambda *_: nothing)
        cv2.imwrite(str(tmp_path / "good.png"), np.zeros((90, 160, 3), np.uint8))
        (tmp_path / "broken.zip").write_text("no zip")
        (known := tmp_path / "known").mkdir()
        write_cameras(known, {"1": TRUE})
        (known / "camera_2.json").write_text("{")
        words = (tmp_path / "good.png", tmp_path / "broken.zip", tmp_path / "out", "--known", known)
        code, told, err = touchline("propose", *words, "--json")
        assert (code, len(json.loads(told))) == (0, 1)
        for name in ("broken.zip", "camera_2.json"):
            assert name in err

    def test_out_is_looked_at_before_the_work(self, tmp_path: Path, touchline: Run):
        (tmp_path / "file").write_text("")
        cv2.imwrite(str(tmp_path / "good.png"), np.zeros((90, 160, 3), np.uint8))
        code, _, err = touchline("propose", tmp_path / "good.png", tmp_path / "file")
        assert (code, "file is a file; name a folder" in err) == (1, True)

    def test_a_folder_without_pictures_is_said(self, tmp_path: Path, touchline: Run):
        (tmp_path / "in").mkdir()
        code, _, err = touchline("propose", tmp_path / "in", tmp_path / "out")
        assert (code, "no picture (" in err) == (1, True)


class TestOfDataset:
    @pytest.fixture
    def propose(self, touchline: Run, home: Path, tmp_path: Path):
        store = Store.open(Settings(home=home))
        media = Media(str(tmp_path / "gone.png"))
        group = Group("1", (View("a", Station("a", SIZE), media=media),), match="m")
        import_groups(store, "demo", [group], source="files", actor="ann")
        store.close()
        return partial(touchline, "propose", "--dataset", "demo")

    def test_looks_shows_and_forgets(self, propose):
        assert propose("--show")[1] == (
            "m: 0 of 1 view looked at: 0 proposed, 0 unsure, 0 nothing, 0 accepted\n"
        )
        found = json.loads(propose("--workers", "1", "--json")[1])
        assert (found["views"], found["nothing"], found["missing"]) == (1, 1, 1)
        (row,) = json.loads(propose("--show", "--match", "m", "--json")[1])
        assert (row["looked"], row["nothing"]) == (1, 1)
        assert "forgotten  1" in propose("--undo")[1]

    @pytest.mark.parametrize(
        ("words", "code", "sentence"),
        [
            (("--match", "final"), 1, "has no match final"),
            (("--show", "--undo"), 2, "use either --show or --undo"),
            (("--size", "960x540"), 2, "leave out IMAGES, OUT"),
            (("--undo", "--match", "m"), 2, "--undo deletes all"),
        ],
    )
    def test_wrong_options_and_unknown_matches_are_refused_with_a_sentence(
        self, propose, words, code: int, sentence: str
    ):
        found, _, err = propose(*words)
        assert (found, sentence in err) == (code, True)

    def test_without_pictures_and_dataset_nothing_is_done(self, touchline):
        code, _, err = touchline("propose")
        assert (code, "name IMAGES and OUT" in err) == (2, True)
