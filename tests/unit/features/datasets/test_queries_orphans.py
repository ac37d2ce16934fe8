from __future__ import annotations

import pytest
from sqlalchemy import insert, text

from app.db.store import Store
from app.features.datasets.queries import (
    delete_solutions,
    delete_unused_calibrations_of_keys,
    list_solution_ids,
    list_unused_calibrations,
)
from app.features.solutions.queries import (
    CalibrationModel,
    SolutionModel,
    filter_stored_calibration_keys,
)

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
        session.execute(text("UPDATE queue SET solved = true"))
    return filled


class TestSpareCalibrations:
    def test_a_calibration_stays_while_a_solution_names_it(self, solved: Store) -> None:
        with solved.write() as session:
            assert list_unused_calibrations(session) == []
            found = [sorted(list_solution_ids(session, group)) for group in (1, 2)]
            assert found == [[1, 2], []]
            delete_solutions(session, [1])
            assert list_unused_calibrations(session) == ["a"]
            assert delete_unused_calibrations_of_keys(session, KEYS[:2]) == 1
            assert filter_stored_calibration_keys(session, KEYS) == {"b", "c"}

    def test_only_those_that_were_found_go(self, solved: Store) -> None:
        with solved.write() as session:
            delete_solutions(session, [1, 2])
            assert delete_unused_calibrations_of_keys(session, KEYS[:2]) == 2
            assert filter_stored_calibration_keys(session, KEYS) == {"c"}

    def test_they_stay_while_a_group_waits_to_be_solved(self, solved: Store) -> None:
        with solved.write() as session:
            delete_solutions(session, [1, 2])
            session.execute(text("UPDATE queue SET solved = false"))
            assert (
                list_unused_calibrations(session),
                delete_unused_calibrations_of_keys(session, KEYS),
            ) == ([], 0)
