"""What the doctor finds: nothing where all is well, and each planted fault by its name."""

from __future__ import annotations

import json
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text

from app.db.backup import write_backup
from app.db.check import CheckResult
from app.db.dialects.dialect import get_dialect
from app.db.store import Store
from app.features.findings.service import FindingReference, set_dismissal
from app.features.groups.replay import rebuild_tables
from app.features.groups.submit import load_group_state
from app.features.imports.ingest import import_groups
from app.features.integrity.checks import REBUILD, examine_database
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import set_verdict
from app.soccer.annotation import Extras, make_lines
from tests.databases import said_for_sqlite
from tests.unit.stores import OPPOSITE


@pytest.fixture
def ids(store: Store, fill, make_group) -> list[int]:
    ids = fill(make_group(7), make_group(8))
    set_verdict(
        store,
        ids[0],
        "accepted",
        None,
        None,
        if_match=load_group_state(store, ids[0]).etag,
        actor="a",
    )
    return ids


def faults(store: Store) -> dict[str, CheckResult]:
    return {check.name: check for check in examine_database(store) if not check.ok}


def change(store: Store, *statements: str, body: bytes = b"garbage") -> None:
    """Behind the service's back; ``body`` is what statements call so."""
    with store.write() as session, said_for_sqlite(session):
        session.execute(text("PRAGMA defer_foreign_keys = ON"))
        for statement in statements:
            session.execute(text(statement), {"body": body} if ":body" in statement else {})


def stations_of(group_id: int) -> str:
    return f"SELECT station_id FROM view WHERE group_id = {group_id}"


def swap(store: Store, table: str, columns: str, key: str, one: object, other: object) -> None:
    """Let two rows hold each other's values."""
    names = columns.split(", ")
    values = ", ".join(f"{name} = :{name}" for name in names)
    with store.write() as session, said_for_sqlite(session):
        session.execute(text(f"DROP TRIGGER {table}_refuses_update"))
        read = text(f"SELECT {columns} FROM {table} WHERE {key} = :key")
        held = [session.execute(read, {"key": place}).one() for place in (one, other)]
        for place, row in zip((other, one), held, strict=True):
            statement = text(f"UPDATE {table} SET {values} WHERE {key} = :key")
            session.execute(statement, {**row._mapping, "key": place})


def first(store: Store, statement: str) -> Any:
    with store.read() as session:
        return session.scalar(text(statement))


class TestComputed:
    @pytest.fixture
    def restoring(self, store: Store) -> str:
        return get_dialect(store.settings).restoring

    @pytest.mark.parametrize("body", [b"garbage", zlib.compress(b"[1")])
    def test_a_calibration_that_cannot_be_read_is_named_by_its_key(
        self, store: Store, ids, restoring: str, body: bytes
    ) -> None:
        key = first(store, "SELECT min(key) FROM calibration")
        trigger = "DROP TRIGGER calibration_refuses_update"
        statement = f"UPDATE calibration SET body = :body WHERE key = '{key}'"
        change(store, trigger, statement, body=body)
        found = faults(store)
        assert found.keys() == {"calibrations"}
        assert found["calibrations"].sentence == f"1 not as it was written: {key}"
        assert found["calibrations"].advice == restoring

    def test_calibrations_that_were_swapped_are_not_those_that_a_solution_rests_on(
        self, store: Store, ids
    ) -> None:
        keys = json.loads(first(store, "SELECT min(calibrations) FROM solution"))
        swap(store, "calibration", "body", "key", *keys)
        assert faults(store).keys() == {"solutions"}

    @pytest.mark.parametrize("column", ["body", "facts"])
    def test_a_solution_that_cannot_be_read_is_named_with_its_group(
        self, store: Store, ids, column: str, restoring: str
    ) -> None:
        trigger = "DROP TRIGGER solution_refuses_update"
        change(store, trigger, f"UPDATE solution SET {column} = :body WHERE group_id = {ids[1]}")
        number = first(store, f"SELECT id FROM solution WHERE group_id = {ids[1]}")
        found = faults(store)
        assert found.keys() == {"solutions"}
        sentence = f"1 not as it was written: {number} of group {ids[1]}"
        assert found["solutions"].sentence == sentence
        assert found["solutions"].advice == restoring

    @pytest.mark.parametrize("column", ["body", "summary"])
    def test_solutions_that_were_swapped_are_those_of_neither_group(
        self, store: Store, fill, make_static, column: str, restoring: str
    ) -> None:
        """Of static cameras, whose calibrations both groups share."""
        made = fill(make_static(10), make_static(11, ball=(9.0, 2.0, -0.5)), make_static(12))
        swap(store, "solution", column, "group_id", *made[:2])
        found = faults(store)
        assert found["solutions"].sentence.startswith("2 not as it was written")
        # A queue that was made of these would be as wrong.
        assert {check.advice for check in found.values()} == {restoring}

    def test_a_solution_names_the_calibrations_that_it_rests_on(self, store: Store, ids) -> None:
        turned = json.loads(first(store, "SELECT calibrations FROM solution WHERE id = 1"))[::-1]
        trigger = "DROP TRIGGER solution_refuses_update"
        statement = f"UPDATE solution SET calibrations = '{json.dumps(turned)}' WHERE id = 1"
        change(store, trigger, statement)
        assert (
            faults(store)["solutions"].sentence == f"1 not as it was written: 1 of group {ids[0]}"
        )

    def test_a_solution_is_that_of_the_policy_of_its_row(self, store: Store, ids) -> None:
        trigger = "DROP TRIGGER solution_refuses_update"
        change(store, trigger, "UPDATE solution SET policy_hash = 'x' WHERE id = 1")
        assert "solutions" in faults(store)

    def test_a_solution_is_of_the_views_of_its_group(self, store: Store, fill, make_static) -> None:
        whole = make_static(11)
        ids = fill(make_static(10), replace(whole, views=whole.views[:2]))
        swap(store, "solution", "body, summary, calibrations, facts", "group_id", *ids)
        assert faults(store)["solutions"].sentence.startswith("2 not as it was written")

    def test_a_whole_solution_of_another_group_rests_on_none_of_its_cameras(
        self, store: Store, fill, make_group
    ) -> None:
        other = make_group(8)
        moved = replace(other.views[0].station, lines=make_lines({}), given=OPPOSITE)
        views = (
            replace(other.views[0], key="7.png", station=moved),
            replace(other.views[1], key="7_1.png"),
        )
        ids = fill(make_group(7), replace(other, views=views))
        swap(store, "solution", "body, summary, calibrations, facts", "group_id", *ids)
        assert faults(store)["solutions"].sentence.startswith("2 not as it was written")

    def test_what_was_read_of_paint_has_the_digest_by_which_it_is_named(
        self, store: Store, ids
    ) -> None:
        values = f"('{'0' * 32}', (SELECT min(id) FROM dataset), :body)"
        change(store, f"INSERT INTO paint_evidence (digest, dataset_id, body) VALUES {values}")
        assert faults(store).keys() == {"readings of paint"}


class TestQueue:
    @pytest.mark.parametrize(
        "forged",
        [
            "DELETE FROM queue WHERE group_id =",
            "UPDATE queue SET passes = NOT passes WHERE group_id =",
            "UPDATE queue SET error_px = error_px + 1 WHERE group_id =",
            "UPDATE queue SET reviewer = 'eve' WHERE group_id =",
            "UPDATE queue SET views = 9 WHERE group_id =",
        ],
    )
    def test_each_group_has_the_row_that_rebuilding_writes(
        self, store: Store, ids, forged: str
    ) -> None:
        change(store, f"{forged} {ids[1]}")
        found = faults(store)
        assert found.keys() == {"queue"}
        assert found["queue"].sentence.startswith("1 not as")
        assert found["queue"].sentence.endswith(f": {ids[1]}")
        assert found["queue"].advice == REBUILD
        rebuild_tables(store)
        assert faults(store) == {}

    def test_after_an_upgrade_with_another_solver_groups_wait_and_keep_their_numbers(
        self, store: Store, ids
    ) -> None:
        change(
            store,
            "DROP TRIGGER solution_refuses_update",
            "UPDATE solution SET solver_version = '1'",
        )
        row = f"SELECT error_px FROM queue WHERE group_id = {ids[1]}"
        number = first(store, row)
        assert number is not None
        assert faults(store) == {}
        (found,) = (check for check in examine_database(store) if check.name == "solutions of demo")
        assert found.sentence == "2 of 2 groups wait to be solved"
        assert found.advice == 'touchline solve --dataset "demo"'
        rebuild_tables(store)
        assert first(store, row) == number
        assert faults(store) == {}
        solve_dataset(store, "demo")
        assert first(store, row) == number
        assert faults(store) == {}


class TestExamine:
    def test_a_healthy_database_has_no_fault(self, store: Store, ids) -> None:
        checks = {check.name: check for check in examine_database(store)}
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
        assert found["groups"].advice == REBUILD
        rebuild_tables(store)
        assert faults(store) == {}

    @pytest.mark.parametrize(
        ("forged", "named"),
        [
            ("UPDATE groups SET inputs_hash = 'x' WHERE id = {group}", "group"),
            ("UPDATE view SET digest = 'x' WHERE group_id = {group}", "group"),
            ("UPDATE station SET digest = 'x' WHERE id IN ({stations})", "camera"),
        ],
    )
    def test_a_digest_is_that_of_what_was_said(
        self, store: Store, ids, forged: str, named: str
    ) -> None:
        change(store, forged.format(group=ids[1], stations=stations_of(ids[1])))
        found = faults(store)["digests"]
        assert f" with a digest that does not match the annotations: {named} " in found.sentence
        assert found.advice == REBUILD
        rebuild_tables(store)
        assert faults(store) == {}

    def test_a_text_with_u0000_in_the_log_is_no_fault_and_is_backed_up(
        self, store: Store, make_group, tmp_path: Path
    ) -> None:
        group = make_group(1)
        odd = replace(group.views[0], extras=Extras(metadata={"comment": "a\0b"}))
        import_groups(store, "demo", [group.with_view(odd)], source="test", actor="ann")
        assert faults(store) == {}
        rebuild_tables(store)
        assert faults(store) == {}
        if get_dialect(store.settings).is_file:
            write_backup(store.settings, tmp_path / "backup.zip")

    def test_a_verdict_that_was_changed_needs_a_backup(self, store: Store, ids) -> None:
        trigger = "DROP TRIGGER verdict_refuses_update"
        change(store, trigger, f"UPDATE verdict SET actor = 'eve' WHERE group_id = {ids[0]}")
        assert faults(store)["groups' verdicts"].advice == get_dialect(store.settings).restoring

    @pytest.mark.parametrize(
        ("verb", "forged"),
        [
            ("delete", "DELETE FROM dismissal"),
            ("update", "UPDATE dismissal SET note = 'never looked'"),
            ("update", "UPDATE dismissal SET dismissed = NOT dismissed"),
        ],
    )
    def test_a_dismissal_that_is_gone_or_was_changed_needs_a_backup(
        self, store: Store, fill, make_group, verb: str, forged: str
    ) -> None:
        state = load_group_state(store, fill(make_group(9, shift=80.0))[0])
        assert state.solution is not None
        name = FindingReference(state.solution.findings[0].kind, state.solution.findings[0].view)
        set_dismissal(store, state.id, name, dismissed=True, if_match=state.etag, actor="ann")
        assert faults(store) == {}
        change(store, f"DROP TRIGGER dismissal_refuses_{verb}", forged)
        found = faults(store)["dismissed findings"]
        assert found.sentence == f"1 not as the log says: {state.id}"
        assert found.advice == get_dialect(store.settings).restoring

    def test_a_log_that_was_changed_ends_the_comparison(self, store: Store, ids) -> None:
        change(
            store, "DROP TRIGGER log_refuses_update", "UPDATE log SET actor = 'eve' WHERE id = 3"
        )
        found = faults(store)
        assert found.keys() == {"log"}
        assert "row 3 of the log" in found["log"].sentence

    def test_a_reading_of_the_tables_that_breaks_off_is_a_fault_among_the_others(
        self, store: Store, ids
    ) -> None:
        change(store, f"UPDATE station SET lines = '[' WHERE id IN ({stations_of(ids[0])})")
        assert faults(store)["tables"].advice == REBUILD
        rebuild_tables(store)
        assert faults(store) == {}

    def test_groups_that_wait_are_told_and_are_no_fault(
        self, store: Store, fill, make_group
    ) -> None:
        fill(make_group(7), solved=False)
        (told,) = (check for check in examine_database(store) if check.advice)
        assert (told.ok, told.advice) == (True, 'touchline solve --dataset "demo"')
