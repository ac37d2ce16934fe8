"""What the doctor finds of versions: nothing where all is well, and each planted fault by its name."""

from __future__ import annotations

import pytest
from sqlalchemy import text

from app.db.check import CheckResult
from app.db.dialects.dialect import get_dialect
from app.db.store import Store
from app.features.datasets.service import delete_dataset
from app.features.integrity.records import examine_versions
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.frozen_queries import compress_text
from tests.databases import said_for_sqlite


@pytest.fixture(autouse=True)
def version(store, fill, make_group, make_static):
    fill(make_group(7), make_group(8, shift=60.0), make_static(10))
    return freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")


def faults(store: Store) -> dict[str, CheckResult]:
    return {check.name: check for check in examine_versions(store) if not check.ok}


def change(store: Store, trigger: str, *statements: str) -> None:
    """Behind the service's back."""
    with store.write() as session, said_for_sqlite(session):
        session.execute(text(f"DROP TRIGGER {trigger}"))
        for statement in statements:
            session.execute(text(statement))


def forge(store: Store, key: str, body: bytes) -> None:
    """Put another content under a key."""
    with store.write() as session, said_for_sqlite(session):
        session.execute(text("DROP TRIGGER frozen_refuses_update"))
        statement = text("UPDATE frozen SET body = :body WHERE key = :key")
        session.execute(statement, {"key": key, "body": body})


def keys(store: Store, prefix: str) -> list[str]:
    with store.read() as session:
        found = session.scalars(text("SELECT key FROM frozen ORDER BY key"))
        return [key for key in found if key.startswith(prefix)]


def owner(store: Store, key: str) -> str | None:
    """Key of the group that a version has under a key of frozen content; None where none has."""
    statement = text("SELECT key FROM version_group WHERE :key IN (said, solution)")
    with store.read() as session:
        group: str | None = session.scalar(statement, {"key": key})
        return group


class TestVersions:
    def test_what_was_frozen_has_no_fault(self, store: Store, version) -> None:
        assert version.counts["left_out"]
        assert [check.ok for check in examine_versions(store)] == [True, True]

    @pytest.mark.parametrize(
        "forged",
        ["name = 'v2'", f"hash = '{'0' * 64}'", "actor = 'eve'", "created = '2020-01-01'"],
    )
    def test_a_version_is_the_one_that_the_log_names(self, store: Store, forged: str) -> None:
        change(store, "version_refuses_update", f"UPDATE version SET {forged}")
        found = faults(store)
        assert found.keys() == {"frozen versions"}
        assert found["frozen versions"].sentence.endswith("(the log says otherwise)")
        assert found["frozen versions"].advice == get_dialect(store.settings).restoring

    def test_all_groups_of_a_version_are_there(self, store: Store) -> None:
        change(store, "version_group_refuses_delete", "DELETE FROM version_group")
        assert faults(store)["frozen versions"].sentence == (
            "1 not as it was frozen: demo/v1 (0 groups of 3 are there)"
        )

    @pytest.mark.parametrize("forged", ["split = 'test'", 'verdict = \'{"state":"rejected"}\''])
    def test_the_hash_of_a_version_follows_from_its_groups(self, store: Store, forged: str) -> None:
        statement = f"UPDATE version_group SET {forged} WHERE position = 0"
        change(store, "version_group_refuses_update", statement)
        sentence = faults(store)["frozen versions"].sentence
        assert sentence.endswith("demo/v1 (its hash does not follow from its groups)")

    def test_a_version_that_cannot_be_read_is_a_fault_among_the_others(self, store: Store) -> None:
        change(store, "version_refuses_update", "UPDATE version SET counts = '{'")
        assert faults(store)["frozen versions"].sentence.endswith("demo/v1 (it cannot be read)")

    def test_a_version_that_is_gone_is_named(self, store: Store) -> None:
        change(
            store,
            "version_group_refuses_delete",
            "DROP TRIGGER version_refuses_delete",
            "DELETE FROM version_group",
            "DELETE FROM version",
        )
        assert faults(store)["frozen versions"].sentence.endswith("v1 of dataset 1 (it is gone)")

    def test_versions_of_a_dataset_that_was_deleted_are_not_missed(self, store: Store) -> None:
        delete_dataset(store, "demo", confirm="demo", actor="ann")
        assert faults(store) == {}


class TestFrozenContent:
    @pytest.mark.parametrize("prefix", ["said:", "station:", "solution:"])
    def test_content_has_the_digest_by_which_it_is_named(self, store: Store, prefix: str) -> None:
        key = keys(store, prefix)[0]
        forge(store, key, compress_text('{"views":[]}'))
        found = faults(store)
        assert found.keys() == {"frozen content"}
        assert found["frozen content"].sentence == f"1 not as it was frozen: {key}"

    @pytest.mark.parametrize("prefix", ["said:", "solution:", "calibration:"])
    def test_content_that_cannot_be_read_is_named_by_its_key(
        self, store: Store, prefix: str
    ) -> None:
        key = keys(store, prefix)[0]
        forge(store, key, b"garbage")
        assert faults(store)["frozen content"].sentence.endswith(f": {key}")

    @pytest.mark.parametrize("prefix", ["said:", "station:", "solution:", "calibration:"])
    def test_content_that_is_gone_is_missed_by_what_names_it(
        self, store: Store, prefix: str
    ) -> None:
        key = keys(store, prefix)[0]
        change(store, "frozen_refuses_delete", f"DELETE FROM frozen WHERE key = '{key}'")
        (found,) = faults(store).values()
        assert found.sentence.endswith(
            f"of {owner(store, key)} first)" if owner(store, key) else key
        )

    def test_a_calibration_that_is_gone_with_its_body_is_named(self, store: Store) -> None:
        key = keys(store, "calibration:")[0]
        statement = f"DELETE FROM calibration WHERE key = '{key.removeprefix('calibration:')}'"
        change(store, "calibration_stays_in_versions", statement)
        assert faults(store)["frozen content"].sentence.endswith(key)
