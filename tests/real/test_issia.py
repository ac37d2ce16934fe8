"""The ISSIA set from files to export, against the facts that its README lists."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path

import numpy as np
import pytest

from app.config import Settings
from app.db.store import Store
from app.features.datasets.service import get_dataset
from app.features.exports.service import export_dataset
from app.features.groups.state import GroupState, read_states
from app.features.imports.ingest import import_groups
from app.features.queue.service import list_ids
from app.features.solutions.service import solve_dataset
from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.report import ReaderReport
from app.soccer.policy import PAPER
from app.soccer.solution import Solution
from tests.bench.people import apart as people_apart
from tests.homes import copy_home

DATA = (
    Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
    / "issia"
)
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no real data in {DATA}")

IMPOSSIBLE = (1492, 1493, 1494, 1495)
REPAIRED = (423, 1763, 2045, 3013, 3017)


PIECE = 400
"""Groups that are read at a time."""


@pytest.fixture(scope="module")
def states(solved_issia: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, GroupState]:
    """Every group with its solution, by its frame."""
    store = Store.open(Settings(home=copy_home(solved_issia, tmp_path_factory)))
    found = get_dataset(store, "issia")
    assert found.policy == PAPER
    ids = list_ids(store, found.id).ids
    with store.read() as session:
        pieces = [read_states(session, ids[at : at + PIECE]) for at in range(0, len(ids), PIECE)]
    store.close()
    return {state.key: state for piece in pieces for state in piece}


@pytest.fixture(scope="module")
def groups(states):
    return [state.group for state in states.values()]


@pytest.fixture(scope="module")
def solutions(states) -> dict[str, Solution]:
    return {key: state.solution for key, state in states.items()}


class TestSolve:
    def test_as_many_frames_keep_a_ball_as_were_released(self, groups, solutions):
        assert len(groups) == 2465
        assert sum(len(group.views) >= 2 for group in groups) == 1801
        assert 1685 <= sum(item.ball is not None for item in solutions.values()) <= 1692

    @pytest.mark.parametrize("frame", IMPOSSIBLE)
    def test_impossible_pairs_are_dropped(self, solutions, frame):
        assert solutions[str(frame)].ball is None
        assert solutions[str(frame)].first_failing.name == "reprojection"

    @pytest.mark.parametrize("frame", REPAIRED)
    def test_three_camera_frames_are_repaired_by_leaving_wrong_pairs_out(self, solutions, frame):
        solution = solutions[str(frame)]
        assert solution.passes
        assert sum(pair.valid for pair in solution.pairs) == 1
        assert "view_disagrees" in {finding.kind for finding in solution.findings}
        assert "implausible_ball" not in {finding.kind for finding in solution.findings}

    def test_the_ball_ten_metres_below_the_grass_carries_a_finding(self, solutions):
        (finding,) = [
            item for item in solutions["1200"].findings if item.kind == "implausible_ball"
        ]
        assert finding.number == pytest.approx(10.2, abs=0.2)


class TestPeople:
    """Those of cameras 2 and 6 are mirrored in the files (``formats.issia``)."""

    @pytest.mark.parametrize("cameras", [(1, 2), (5, 6), (2, 4), (4, 6), (3, 4)])
    def test_the_same_person_stands_at_one_place_in_two_cameras(self, cameras):
        report = ReaderReport()
        apart = people_apart(open_issia(DATA, IssiaOptions(), report), *cameras, 20)
        assert len(apart) > 50
        assert np.median(apart) < 2.0
        assert [text for text in report.remarks if text.startswith("People of cam2 and cam6")]


class TestExport:
    def test_every_annotated_frame_is_a_row_and_the_manifest_counts_them(self, groups, tmp_path):
        few = [group for group in groups if len(group.views) >= 2][:40]
        store = Store.open(Settings(home=tmp_path / "home"))
        import_groups(store, "issia", few, source=str(DATA), actor="test")
        solve_dataset(store, "issia")
        out = tmp_path / "out"
        export_dataset(store, "issia", "issia-3d", out, everything=True)
        with (out / "ISSIA-3D.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
        assert [int(row["frame"]) for row in rows] == sorted(int(group.key) for group in few)
        assert not any("nan" in cell for row in rows for cell in row.values())
        manifest = json.loads((out / "manifest.json").read_text())
        assert manifest["counts"]["groups"] == len(few)
        store.close()
