from __future__ import annotations

import numpy as np
import pytest
from sqlalchemy import select, text, update

from app.review.editing.edit import SetBall
from app.review.editing.submit import load, submit
from app.review.yields.facts import Wanted, read_facts
from app.solving.facts import COLUMNS, group_facts, join
from app.store.models import SolutionModel
from app.store.session import Store


def wanted(store: Store) -> list[Wanted]:
    """Every solution there is, the oldest first."""
    columns = (SolutionModel.group_id, SolutionModel.inputs_hash, SolutionModel.id)
    with store.read() as session:
        rows = session.execute(select(*columns).order_by(SolutionModel.id))
        return [Wanted(*row) for row in rows]


def forget_facts(store: Store) -> None:
    """Leave the solutions as they were before facts were kept beside them."""
    with store.write() as session:
        session.execute(text("DROP TRIGGER solution_refuses_update"))
        session.execute(update(SolutionModel).values(facts=None))


@pytest.fixture(params=["kept", "not kept"])
def solved(request, store, fill, make_group, make_static) -> list[int]:
    """Groups solved with facts beside their solutions, or as before there were any."""
    groups: list[int] = fill(make_group(7), make_static(10), make_group(8))
    if request.param == "not kept":
        forget_facts(store)
    return groups


class TestReadFacts:
    def test_read_facts_are_those_that_solving_judges(self, store, solved) -> None:
        states = [load(store, group) for group in solved]
        expected = join(
            [
                group_facts(state.group.views, [item.calibration for item in state.solution.views])
                for state in states
            ]
        )
        table = read_facts(store, wanted(store))
        assert table.group_id.tolist() == solved
        for name in COLUMNS:
            found = getattr(table.facts, name)
            assert np.array_equal(found, getattr(expected, name), equal_nan=True), name

    def test_a_solution_that_is_gone_is_left_out(self, store, solved) -> None:
        first, *_ = wanted(store)
        table = read_facts(store, [first, Wanted(solved[1], "inputs", 999)])
        assert table.group_id.tolist() == [solved[0]]

    def test_facts_that_were_not_kept_are_made_only_for_the_group_as_it_is(
        self, store, fill, make_group
    ) -> None:
        (group,) = fill(make_group(7))
        edit = SetBall("7.png", None)
        submit(store, group, edit, if_match=load(store, group).etag, actor="ann")
        before, after = wanted(store)
        forget_facts(store)
        assert read_facts(store, [before]).groups == 0
        assert read_facts(store, [after]).group_id.tolist() == [group]
