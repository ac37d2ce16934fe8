from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest

from app.errors import InputError, NotFoundError
from app.features.exports.service import export_dataset
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.formats.export_formats import FORMATS, TRACKS
from app.soccer.split import Split

STATIC = ("issia", "issia-3d")


def judge(store, group_id, state, reason=None, note=None):
    etag = load_group_state(store, group_id).etag
    return set_verdict(store, group_id, state, reason, note, if_match=etag, actor="ann")


def manifest_of(path: Path) -> dict:
    with zipfile.ZipFile(path) as archive:
        return json.loads(archive.read("manifest.json"))


@pytest.fixture
def version(store, fill, make_group):
    """Frozen: one that passes, one against a gate; one is rejected."""
    ids = fill(make_group(7), make_group(8, shift=80.0), make_group(9))
    judge(store, ids[0], "accepted")
    judge(store, ids[1], "accepted", note="seen on video")
    judge(store, ids[2], "rejected", "sides_confused")
    return freeze_dataset(store, "demo", FreezeRequest("v1", licence="ours"), actor="ann")


class TestVersionSource:
    @pytest.mark.parametrize(
        "name", [item for item in FORMATS if item not in (*STATIC, *TRACKS, "touchline")]
    )
    def test_every_format_is_the_same_bytes_after_later_edits(
        self, store, version, tmp_path, name: str
    ) -> None:
        export_dataset(store, "demo", name, tmp_path / "a.zip", version="v1")
        etag = load_group_state(store, 1).etag
        submit_edit(store, 1, make_set_ball_edit("7.png", None), if_match=etag, actor="ben")
        judge(store, 2, "rejected", "bad_calibration")
        export_dataset(store, "demo", name, tmp_path / "b.zip", version=version.hash[:12])
        assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()

    @pytest.mark.parametrize("name", STATIC)
    def test_formats_of_static_cameras_are_the_same_bytes_too(
        self, store, fill, make_static, tmp_path, name: str
    ) -> None:
        fill(make_static(10), make_static(9))
        freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")
        for out in ("a.zip", "b.zip"):
            export_dataset(store, "demo", name, tmp_path / out, version="v1")
        assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()

    def test_the_manifest_is_stamped_with_verdicts_and_their_reasons(
        self, store, version, tmp_path
    ) -> None:
        export_dataset(store, "demo", "cameras", tmp_path / "a.zip", version="v1")
        manifest = manifest_of(tmp_path / "a.zip")
        assert (manifest["version"], manifest["date"]) == ("v1", version.created)
        assert (manifest["licence"], manifest["verdicts"]) == ("ours", {"accepted": 2})
        (override,) = manifest["overrides"]
        assert override["gate"] == "reprojection"
        assert override["reason"] == "overrides reprojection: seen on video"
        (rejected,) = manifest["frozen"]["rejected"]
        assert rejected["reason"] == "sides_confused"

    def test_the_reason_of_an_override_stands_beside_its_image(
        self, store, version, tmp_path
    ) -> None:
        export_dataset(store, "demo", "soccernet-v3d", tmp_path / "out", version="v1")
        (path,) = (tmp_path / "out").rglob("Labels-v3D.json")
        actions = json.loads(path.read_text())["actions"]
        told = {key: value["imageMetadata"].get("verdict") for key, value in actions.items()}
        assert told == {
            "7.png": None,
            "8.png": "accepted: overrides reprojection: seen on video",
        }

    def test_the_split_of_the_version_is_what_lists_say(self, store, version, tmp_path) -> None:
        split = Split("camera", test_cameras=("7_1.png",))
        freeze_dataset(store, "demo", FreezeRequest("v2", split=split), actor="ann")
        export_dataset(store, "demo", "soccernet-v3d", tmp_path / "out", version="v2")
        test = (tmp_path / "out" / "SNv3D-test.txt").read_text().splitlines()
        assert [line.rpartition("/")[2] for line in test] == ["7_1"]

    def test_a_version_exports_exactly_its_own_groups(self, store, version, tmp_path) -> None:
        with pytest.raises(InputError, match="exports exactly its own groups"):
            export_dataset(store, "demo", "cameras", tmp_path / "x", version="v1", everything=True)
        with pytest.raises(NotFoundError, match='no version "v9"'):
            export_dataset(store, "demo", "cameras", tmp_path / "x", version="v9")
        assert not (tmp_path / "x").exists()


class TestLiveSource:
    def test_what_an_earlier_solver_solved_is_left_out_and_counted(
        self, store, fill, make_group, tmp_path, upgrade_solver
    ) -> None:
        ids = fill(make_group(7))
        judge(store, ids[0], "accepted")
        upgrade_solver()
        with pytest.raises(InputError, match="unsolved"):
            export_dataset(store, "demo", "coco", tmp_path / "a.zip")
