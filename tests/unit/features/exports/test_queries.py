from __future__ import annotations

import pytest
from sqlalchemy import insert, literal, select, update

from app.db.log import NewLogEntry, append_entries
from app.db.store import Store
from app.features.datasets.tables import DatasetModel, GroupModel
from app.features.exports.queries import (
    count_left_out_groups,
    find_newest_entry_time,
    list_exported_groups,
)
from app.features.queue.tables import QueueModel
from app.features.solutions.queries import SolutionModel
from app.soccer.solution import SOLVER_VERSION

ACCEPTED = {"status": "accepted", "solved": True, "passes": True}


@pytest.fixture
def solved(filled: Store) -> Store:
    """The one group has a solution of this solver."""
    with filled.write() as session:
        key = select(
            GroupModel.id, GroupModel.inputs_hash, DatasetModel.policy_hash, literal(SOLVER_VERSION),
            literal("[]"), literal("{}"), literal(b""),
        ).join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)  # fmt: skip
        names = [
            "group_id",
            "inputs_hash",
            "policy_hash",
            "solver_version",
            "calibrations",
            "summary",
            "body",
        ]
        session.execute(insert(SolutionModel).from_select(names, key))
    return filled


class TestExportedGroups:
    @pytest.mark.parametrize(
        ("values", "left_out"),
        [
            ({}, {}),
            ({"stale": True}, {"stale": 1}),
            ({"passes": False, "gate": "jac", "override": "jac"}, {}),
            ({"passes": False, "gate": "jac", "override": "tau"}, {"failing": 1}),
            ({"passes": False, "gate": "jac", "override": None}, {"failing": 1}),
        ],
    )
    def test_an_accepted_group_goes_out_or_says_why_not(self, solved, values, left_out) -> None:
        with solved.write() as session:
            session.execute(update(QueueModel).values(**{**ACCEPTED, **values}))
            assert count_left_out_groups(session, 1) == left_out
            assert list_exported_groups(session, 1, everything=False) == ([] if left_out else [1])

    @pytest.mark.parametrize("said", [True, False])
    def test_one_that_this_solver_has_not_solved_stays(self, filled, said: bool) -> None:
        with filled.write() as session:
            session.execute(update(QueueModel).values(**{**ACCEPTED, "solved": said}))
            assert count_left_out_groups(session, 1) == {"unsolved": 1}
            assert list_exported_groups(session, 1, everything=False) == []

    def test_an_export_of_everything_takes_every_group(self, filled) -> None:
        with filled.read() as session:
            assert list_exported_groups(session, 1, everything=True) == [1]
            assert list_exported_groups(session, 1, everything=False) == []


class TestNewestWord:
    def test_freezing_does_not_count_as_a_change(self, filled) -> None:
        with filled.write() as session:
            assert find_newest_entry_time(session, 1) is None
            append_entries(session, [NewLogEntry("edit", "ann", "2026-01-02", {}, 1)])
            append_entries(session, [NewLogEntry("freeze", "ann", "2026-01-03", {}, 1)])
            assert find_newest_entry_time(session, 1) == "2026-01-02"
