"""Accounts and roles that nobody gave, and such as were taken away past the service, are seen."""

from __future__ import annotations

import pytest
from sqlalchemy import text

from app.db.check import CheckResult
from app.db.log import NewLogEntry
from app.db.session import Session
from app.db.store import Store
from app.features.audit.service import assign_local_work
from app.features.datasets import service as delete
from app.features.datasets.service import dataset_id, delete_dataset
from app.features.imports.ingest import ensure_dataset
from app.features.integrity.checks import examine_database
from app.features.people.roles import Role
from app.features.people.service import change_person, find_person, give_role, invite
from app.soccer.policy import PAPER
from tests.databases import said_for_sqlite

PARTS = ("accounts", "roles in datasets", "adopted names")


@pytest.fixture
def team(store: Store, fill, make_group) -> Store:
    """Three people, one of them disabled and back again, with roles in a dataset."""
    fill(make_group(7))
    ids = {
        name: invite(store, name, role, actor="boss")[0].id
        for name, role in {
            "ann": Role.ADMIN,
            "bob": Role.ANNOTATOR,
            "eve": Role.REVIEWER,
        }.items()
    }
    change_person(store, ids["bob"], actor="ann", role=Role.REVIEWER, disabled=True)
    change_person(store, ids["eve"], actor="ann", disabled=True)
    change_person(store, ids["eve"], actor="ann", disabled=False)
    give_role(store, "demo", ids["bob"], Role.LEAD, actor="ann")
    give_role(store, "demo", ids["eve"], Role.LEAD, actor="ann")
    give_role(store, "demo", ids["eve"], None, actor="ann")
    assign_local_work(store, ids["ann"], actor="ann")
    return store


def found(store: Store) -> dict[str, CheckResult]:
    return {check.name: check for check in examine_database(store) if check.name in PARTS}


def forge(store: Store, statement: str) -> None:
    """Past the service."""
    with store.write() as session, said_for_sqlite(session):
        session.execute(text(statement))


class TestExaminePeople:
    def test_what_people_did_to_each_other_is_as_the_log_says(self, team: Store) -> None:
        checks = found(team)
        assert [checks[name].sentence for name in PARTS] == [
            "3, as the log says",
            "1, as the log says",
            "1, as the log says",
        ]
        assert all(check.ok for check in checks.values())

    def test_a_home_without_people_has_no_fault(self, store: Store, fill, make_group) -> None:
        fill(make_group(7))
        assert all(check.ok for check in found(store).values())

    def test_roles_in_a_dataset_that_was_deleted_went_with_it(self, team: Store) -> None:
        delete_dataset(team, "demo", confirm="demo", actor="ann")
        checks = found(team)
        assert checks["roles in datasets"].sentence == "0, as the log says"
        assert all(check.ok for check in checks.values())

    @pytest.mark.parametrize("earlier", [False, True], ids=["now", "as earlier versions wrote"])
    def test_roles_in_a_dataset_that_begins_afresh_are_those_of_the_new_one(
        self, team: Store, monkeypatch: pytest.MonkeyPatch, earlier: bool
    ) -> None:
        plain = delete.append_entries

        def without_heir(session: Session, entries: list[NewLogEntry]) -> object:
            for entry in entries:
                entry.body.pop("heir", None)
            return plain(session, entries)

        if earlier:
            monkeypatch.setattr(delete, "append_entries", without_heir)
        delete_dataset(team, "demo", confirm="demo", actor="ann", afresh=PAPER)
        assert found(team)["roles in datasets"].sentence == "1, as the log says"
        forge(team, "UPDATE dataset_role SET role = 'viewer'")
        assert not found(team)["roles in datasets"].ok

    def test_one_of_the_same_name_that_somebody_makes_later_has_none(
        self, team: Store, fill, make_group
    ) -> None:
        delete_dataset(team, "demo", confirm="demo", actor="ann")
        ensure_dataset(team, "demo", actor="ann")
        assert all(check.ok for check in found(team).values())

    @pytest.mark.parametrize(
        ("statement", "name", "whom"),
        [
            ("UPDATE person SET role = 'admin' WHERE name = 'bob'", "accounts", "bob"),
            ("UPDATE person SET disabled = false WHERE name = 'bob'", "accounts", "bob"),
            (
                "INSERT INTO person (name, role, disabled, created, created_by)"
                " VALUES ('mallory', 'admin', false, '', '')",
                "accounts",
                "mallory",
            ),
            (
                "INSERT INTO dataset_role (person_id, dataset_id, role, given, given_by)"
                " SELECT person.id, dataset.id, 'lead', '', '' FROM person, dataset"
                " WHERE person.name = 'eve'",
                "roles in datasets",
                "eve in dataset",
            ),
            ("UPDATE dataset_role SET role = 'viewer'", "roles in datasets", "bob in dataset"),
            ("DELETE FROM dataset_role", "roles in datasets", "bob in dataset"),
            (
                "UPDATE actor_alias SET person_id = (SELECT id FROM person WHERE name = 'bob')",
                "adopted names",
                "local",
            ),
        ],
    )
    def test_what_nobody_said_is_named(
        self, team: Store, statement: str, name: str, whom: str
    ) -> None:
        forge(team, statement)
        wrong = {key: check for key, check in found(team).items() if not check.ok}
        assert set(wrong) == {name}
        assert f"1 not as the log says: {whom}" in wrong[name].sentence
        assert "restore" in (wrong[name].advice or "")

    def test_the_dataset_of_a_role_is_named_by_its_number(self, team: Store) -> None:
        forge(team, "DELETE FROM dataset_role")
        number = dataset_id(team, "demo")
        assert f"bob in dataset {number}" in found(team)["roles in datasets"].sentence
        assert find_person(team, "bob").role is Role.REVIEWER
