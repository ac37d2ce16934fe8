"""Another tau alone: most solutions are retold, none is calibrated, and all are what solving says."""

from __future__ import annotations

from dataclasses import replace

import pytest
from sqlalchemy import text

from app.db.store import Store
from app.features.groups.submit import load_group_state
from app.features.policies.service import change_policy
from app.features.queue.service import list_groups
from app.features.solutions import service as recompute
from app.features.solutions.service import list_stale_groups, solve_dataset
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from tests.databases import said_for_sqlite

TIGHT = replace(PAPER, name="tight", tau_percent=0.6)
BETWEEN = replace(PAPER, name="between", tau_percent=0.8)
LOOSE = replace(PAPER, name="loose", tau_percent=2.0)


@pytest.fixture
def ids(fill, make_group, make_static) -> list[int]:
    """Views that agree, those that are far apart, and a pair between both taus."""
    return fill(
        make_group(1), make_group(2, shift=200.0), make_group(3, shift=25.0), make_static(4)
    )


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Keys of the groups that are solved from now on."""
    found: list[str] = []
    plain = recompute.solve_and_encode

    def counted(group, policy, calibrations):
        found.append(group.key.rpartition("/")[2])
        return plain(group, policy, calibrations)

    monkeypatch.setattr(recompute, "solve_and_encode", counted)
    return found


def rows(store: Store, policy_hash: str) -> list[tuple[object, ...]]:
    """Solutions under a policy, as they are stored."""
    columns = "group_id, inputs_hash, solver_version, calibrations, summary, body, facts"
    with store.read() as session:
        query = f"SELECT {columns} FROM solution WHERE policy_hash = :policy ORDER BY group_id"
        return [tuple(row) for row in session.execute(text(query), {"policy": policy_hash})]


def judge(store: Store, policy) -> None:
    change_policy(store, "demo", policy, if_match=None, actor="ann")


class TestRetell:
    def test_only_what_tau_decides_is_solved(self, store, ids, solved) -> None:
        judge(store, TIGHT)
        report = solve_dataset(store, "demo")
        assert solved == ["3.png"]
        assert (report.total, report.solved, report.failed) == (4, 4, [])
        assert list_stale_groups(store, "demo") == []
        state = load_group_state(store, ids[1])
        assert state.solution == solve_group(state.group, state.policy)

    def test_makes_the_same_bytes_and_the_same_queue(self, store, ids, monkeypatch) -> None:
        judge(store, TIGHT)
        solve_dataset(store, "demo")
        told = rows(store, TIGHT.hash)
        listed = list_groups(store, load_group_state(store, ids[0]).dataset_id, "").items
        with store.write() as session:
            session.execute(
                text("DELETE FROM solution WHERE policy_hash = :policy"), {"policy": TIGHT.hash}
            )
        monkeypatch.setattr(recompute, "make_rethreshold_tasks", lambda *_: iter(()))
        assert solve_dataset(store, "demo").solved == 4
        assert rows(store, TIGHT.hash) == told
        assert list_groups(store, load_group_state(store, ids[0]).dataset_id, "").items == listed

    def test_starts_from_any_larger_tau_of_before(self, store, ids, solved) -> None:
        for policy in (TIGHT, BETWEEN):
            judge(store, policy)
            solve_dataset(store, "demo")
        # Under the policy before last, whose tau is larger, everything is kept.
        assert sorted(set(solved)) == ["3.png"]

    def test_a_larger_tau_is_solved(self, store, ids, solved) -> None:
        judge(store, LOOSE)
        assert solve_dataset(store, "demo").solved == 4
        assert len(solved) == 4

    def test_facts_that_are_not_kept_are_computed(self, store, ids, solved) -> None:
        with store.write() as session, said_for_sqlite(session):
            session.execute(text("DROP TRIGGER solution_refuses_update"))
            session.execute(
                text("UPDATE solution SET facts = NULL WHERE group_id = :id"), {"id": ids[0]}
            )
        judge(store, TIGHT)
        assert solve_dataset(store, "demo").solved == 4
        assert "1.png" in solved

    def test_what_is_damaged_is_solved(self, store, ids, solved) -> None:
        with store.write() as session, said_for_sqlite(session):
            session.execute(text("DROP TRIGGER solution_refuses_update"))
            session.execute(
                text("UPDATE solution SET body = :body WHERE group_id = :id"),
                {"body": b"nothing", "id": ids[0]},
            )
        judge(store, TIGHT)
        assert solve_dataset(store, "demo").solved == 4
        assert "1.png" in solved
