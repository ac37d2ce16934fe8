from __future__ import annotations

import pytest
from sqlalchemy import insert, text

from app.store.datasets import dataset_rows
from app.store.group_rows import next_id
from app.store.models import CalibrationModel, GroupModel, SolutionModel
from app.store.removal import (
    count_contents,
    delete_rows,
    delete_solutions,
    delete_unused_calibrations,
    has_unsolved,
    keep_used_ids,
    solutions_of,
)
from app.store.session import Store
from app.store.solutions import known_calibrations

KEYS = ("a", "b", "c")


@pytest.fixture
def solved(filled: Store) -> Store:
    """The group 1 with two solutions that share the calibration "b"."""
    with filled.write() as session:
        session.execute(insert(CalibrationModel), [{"key": key, "body": b""} for key in KEYS])
        for place, names in enumerate(('["a", "b"]', '["b", "c"]'), 1):
            values = {"id": place, "group_id": 1, "inputs_hash": str(place), "policy_hash": "p"}
            values |= {"solver_version": "s", "calibrations": names, "summary": "{}", "body": b""}
            session.execute(insert(SolutionModel), [values])
    return filled


class TestRemoval:
    def test_contents_are_counted(self, filled: Store) -> None:
        with filled.read() as session:
            counts = count_contents(session, 1)
            assert (counts["groups"], counts["views"], counts["verdicts"]) == (1, 3, 0)
            assert set(count_contents(session, 2).values()) == {0}
            assert has_unsolved(session)

    def test_a_calibration_stays_while_a_solution_names_it(self, solved: Store) -> None:
        with solved.write() as session:
            assert (solutions_of(session, 1), solutions_of(session, 2)) == ([1, 2], [])
            assert delete_solutions(session, [1]) == {"a", "b"}
            delete_unused_calibrations(session, KEYS[:2])
            assert known_calibrations(session, KEYS) == {"b", "c"}

    def test_everything_that_was_said_goes_and_no_id_comes_again(self, filled: Store) -> None:
        with filled.write() as session:
            keep_used_ids(session)
            delete_rows(session, 1)
            assert dataset_rows(session) == []
            assert not session.execute(text("PRAGMA foreign_key_check")).all()
            assert next_id(session, GroupModel) == 2
