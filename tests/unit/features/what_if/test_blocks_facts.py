from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from sqlalchemy import text, update

from app.db.store import Store
from app.features.groups.revision_queries import list_groups_after
from app.features.groups.submit import load_group_state
from app.features.solutions.queries import SolutionModel
from app.features.what_if.blocks import read_tables
from app.features.what_if.table import YieldTable
from app.solving.facts import COLUMNS, collect_facts_of_views, join_facts
from tests.databases import said_for_sqlite


def read(store: Store) -> tuple[YieldTable, YieldTable]:
    """The tables of every group, as it stands."""
    with store.read() as session:
        rows: Sequence[Any] = list_groups_after(session, 1, 0, 100)
        return read_tables(session, rows)


def forget_facts(store: Store) -> None:
    """Leave the solutions as they were before facts were kept beside them."""
    with store.write() as session, said_for_sqlite(session):
        session.execute(text("DROP TRIGGER solution_refuses_update"))
        session.execute(update(SolutionModel).values(facts=None))


@pytest.fixture(params=["kept", "not kept"])
def solved(request, store, fill, make_group, make_static) -> list[int]:
    """Groups solved with facts beside their solutions, or as before there were any."""
    groups: list[int] = fill(make_group(7), make_static(10), make_group(8))
    if request.param == "not kept":
        forget_facts(store)
    return groups


class TestReadTables:
    def test_facts_are_those_that_solving_judges(self, store, solved) -> None:
        states = [load_group_state(store, group) for group in solved]
        expected = join_facts(
            [
                collect_facts_of_views(
                    state.group.views, [item.calibration for item in state.solution.views]
                )
                for state in states
            ]
        )
        table, bare = read(store)
        assert (table.group_id.tolist(), bare.groups) == (solved, 0)
        for name in COLUMNS:
            found = getattr(table.facts, name)
            assert np.array_equal(found, getattr(expected, name), equal_nan=True), name

    def test_groups_that_are_not_solved_stand_apart(self, store, solved, fill, make_group) -> None:
        new = fill(make_group(9, split="test"), solved=False)[-1:]
        table, bare = read(store)
        assert (table.group_id.tolist(), bare.group_id.tolist()) == (solved, new)
        assert sum(bare.count_groups_by_match_and_split().values()) == 1
        assert {split for _, split in bare.count_groups_by_match_and_split()} == {"test"}
