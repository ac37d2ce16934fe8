"""The ISSIA set through import, solve, freeze, export and verify; a part of it in two homes."""

from __future__ import annotations

import csv
import io
import json
import os
import zipfile
from pathlib import Path

import pytest
from sqlalchemy import select

from app.config import Settings
from app.db.store import Store
from app.features.datasets.tables import GroupModel
from app.features.exports.service import export_dataset
from app.features.groups.submit import load_group_state
from app.features.imports.ingest import import_groups
from app.features.imports.merge import merge_edits
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.verify import verify_version
from app.formats.file_tree import DEFAULT_LIMITS
from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.report import ReaderReport
from app.soccer.split import Split
from tests.homes import copy_home

DATA = (
    Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
    / "issia"
)
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no real data in {DATA}")

FROZEN = FreezeRequest("v1", groups="passing", split=Split("camera"))
ODD = "1200"
"""The frame whose ball lies ten metres below the grass."""
EVERY = 5
"""A frame in five is carried to another home and solved there and once more: with cameras that are
given, no frame knows of another."""


@pytest.fixture(scope="module")
def whole(solved_issia: Path, tmp_path_factory: pytest.TempPathFactory):
    """A home with all of it."""
    store = Store.open(Settings(home=copy_home(solved_issia, tmp_path_factory)))
    reject(store)
    yield store
    store.close()


@pytest.fixture(scope="module")
def homes(tmp_path_factory: pytest.TempPathFactory):
    """A home that imported the files, and one to which everything was carried from it."""
    one, two = (
        Store.open(Settings(home=tmp_path_factory.mktemp(name) / "home")) for name in ("a", "b")
    )
    groups = open_issia(DATA, IssiaOptions(), ReaderReport()).groups()
    some = (group for group in groups if int(group.key) % EVERY == 0)
    import_groups(one, "issia", some, source="x", actor="ann")
    solve_dataset(one, "issia")
    reject(one)
    carried = tmp_path_factory.mktemp("carried") / "issia.zip"
    export_dataset(one, "issia", "touchline", carried)
    report = ReaderReport()
    merge_edits(two, "other", carried, report, DEFAULT_LIMITS, source="a", actor="ben")
    assert report.problems == []
    solve_dataset(two, "other")
    yield one, two
    one.close()
    two.close()


def reject(store: Store) -> None:
    """A person looks at the odd frame and says no."""
    with store.read() as session:
        number = session.scalar(select(GroupModel.id).where(GroupModel.key == ODD))
    etag = load_group_state(store, number).etag
    set_verdict(store, number, "rejected", "other", "below the grass", if_match=etag, actor="ann")


@pytest.fixture(scope="module")
def versions(homes):
    one, two = homes
    return (
        freeze_dataset(one, "issia", FROZEN, actor="ann"),
        freeze_dataset(two, "other", FROZEN, actor="ben"),
    )


class TestFreeze:
    def test_as_many_groups_as_pass_are_in_it(self, whole) -> None:
        version = freeze_dataset(whole, "issia", FROZEN, actor="ann")
        assert version.counts["groups"] == 1687
        assert version.counts["left_out"]["rejected: other"] == 1
        splits = version.counts["splits"]
        assert splits["test"]["views"] + splits["train"]["views"] == version.counts["views"]
        assert splits["test"]["groups"] > 300

    def test_two_homes_freeze_the_same_hash(self, versions) -> None:
        assert versions[0].hash == versions[1].hash
        assert versions[0].counts == versions[1].counts
        assert versions[0].counts["groups"] > 300
        assert versions[0].counts["left_out"]["rejected: other"] == 1


class TestExport:
    def test_of_a_version_is_the_same_bytes_in_both_homes_but_for_names_and_dates(
        self, homes, versions, tmp_path
    ) -> None:
        files = []
        for store, version in zip(homes, versions, strict=True):
            out = tmp_path / f"{version.dataset}.zip"
            export_dataset(store, version.dataset, "issia-3d", out, version="v1")
            files.append(content(out))
        export_dataset(homes[0], "issia", "issia-3d", tmp_path / "again.zip", version="v1")
        assert (tmp_path / "again.zip").read_bytes() == (tmp_path / "issia.zip").read_bytes()
        assert {name: text for name, text in files[0].items() if name != "manifest.json"} == {
            name: text for name, text in files[1].items() if name != "manifest.json"
        }
        manifest = json.loads(files[0]["manifest.json"])
        assert manifest["frozen"]["hash"] == versions[0].hash
        assert manifest["frozen"]["rejected"][0]["group"] == ODD
        rows = list(csv.DictReader(io.StringIO(files[0]["ISSIA-3D.csv"].decode())))
        assert len(rows) == versions[0].counts["groups"]
        assert ODD not in {row["frame"] for row in rows}


class TestVerify:
    def test_from_scratch_everything_comes_out_the_same(self, homes, versions) -> None:
        report = verify_version(homes[1], versions[1].id)
        assert report.ok, report.to_values()
        assert report.equal == versions[1].counts["groups"]


def content(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}
