from __future__ import annotations

import pytest
from sqlalchemy import select, text
from sqlalchemy.dialects import sqlite

from app.db.store import Store
from app.features.people.queries import select_with_rights
from app.features.people.tables import PersonModel


class TestWithRights:
    def test_a_batch_that_is_done_is_not_walked_through_at_each_request(
        self, own_store: Store
    ) -> None:
        if own_store.settings.database_url:
            pytest.skip("the plan of SQLite")
        statement = select_with_rights(select(PersonModel.id).where(PersonModel.id == 1), ["lead"])
        plain = statement.compile(dialect=sqlite.dialect(), compile_kwargs={"literal_binds": True})
        with own_store.read() as session:
            explained = text("EXPLAIN QUERY PLAN " + str(plain).replace(":", "\\:"))
            plan = [row[3] for row in session.execute(explained)]
        (groups,) = [step for step in plan if "batch_group" in step]
        assert "INDEX batch_group_free (batch_id=?)" in groups
        takes = [step.partition(" (")[2] for step in plan if "SEARCH take " in step]
        # Of all that a batch has it is asked alone whether a gold one is there, unless it is blind.
        assert takes == [
            "batch_id=?)",
            "batch_id=? AND person=?)",
            "batch_id=? AND group_id=? AND person=?)",
            "batch_id=? AND group_id=?)",
            "batch_id=? AND person=? AND handed_in=? AND settled=?)",
        ]
