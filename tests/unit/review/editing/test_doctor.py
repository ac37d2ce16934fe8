"""What the doctor finds: nothing where all is well, and each planted fault by its name."""

from __future__ import annotations

import pytest
from sqlalchemy import text

from app.review.editing.check import Check
from app.review.editing.doctor import REBUILD, examine
from app.review.editing.replay import rebuild
from app.review.editing.submit import load
from app.review.verdicts.verdict import set_verdict
from app.store.dialect.dialect import dialect_of
from app.store.store import Store
from tests.databases import said_for_sqlite


@pytest.fixture
def ids(store: Store, fill, make_group) -> list[int]:
    ids = fill(make_group(7), make_group(8))
    set_verdict(store, ids[0], "accepted", None, None, if_match=load(store, ids[0]).etag, actor="a")
    return ids


def faults(store: Store) -> dict[str, Check]:
    return {check.name: check for check in examine(store) if not check.ok}


def change(store: Store, *statements: str) -> None:
    """Behind the service's back."""
    with store.write() as session, said_for_sqlite(session):
        session.execute(text("PRAGMA defer_foreign_keys = ON"))
        for statement in statements:
            session.execute(text(statement))


class TestExamine:
    def test_a_healthy_database_has_no_fault(self, store: Store, ids) -> None:
        checks = {check.name: check for check in examine(store)}
        assert all(check.ok for check in checks.values())
        assert checks["groups"].sentence == "2, as the log says"
        assert checks["solutions of demo"].sentence == "0 of 2 groups wait to be solved"

    def test_a_table_that_was_changed_is_named_and_mended_by_rebuilding(
        self, store: Store, ids
    ) -> None:
        change(store, f"UPDATE view SET included = NOT included WHERE group_id = {ids[1]}")
        found = faults(store)
        assert found.keys() == {"groups"}
        assert found["groups"].sentence == f"1 not as the log says: {ids[1]}"
        assert found["groups"].mend == REBUILD
        rebuild(store)
        assert faults(store) == {}

    def test_a_verdict_that_was_changed_needs_a_backup(self, store: Store, ids) -> None:
        trigger = "DROP TRIGGER verdict_refuses_update"
        change(store, trigger, f"UPDATE verdict SET actor = 'eve' WHERE group_id = {ids[0]}")
        assert faults(store)["groups' verdicts"].mend == dialect_of(store.settings).restoring

    def test_a_log_that_was_changed_ends_the_comparison(self, store: Store, ids) -> None:
        change(
            store, "DROP TRIGGER log_refuses_update", "UPDATE log SET actor = 'eve' WHERE id = 3"
        )
        found = faults(store)
        assert found.keys() == {"log"}
        assert "row 3 of the log" in found["log"].sentence

    def test_groups_that_wait_are_told_and_are_no_fault(
        self, store: Store, fill, make_group
    ) -> None:
        fill(make_group(7), solved=False)
        (told,) = (check for check in examine(store) if check.mend)
        assert (told.ok, told.mend) == (True, 'touchline solve --dataset "demo"')
