"""Guidelines that nobody wrote, or that were changed past the service, are seen."""

from __future__ import annotations

import pytest
from sqlalchemy import text

from app.db.check import CheckResult
from app.db.store import Store
from app.features.datasets.service import delete_dataset
from app.features.guidelines.service import write_guidelines
from app.features.integrity.checks import examine_database
from tests.databases import said_for_sqlite


@pytest.fixture
def told(store: Store, fill, make_group) -> Store:
    """A dataset with two versions of its guidelines."""
    fill(make_group(7))
    for number, words in enumerate(("Draw what you see.", "Draw what you see, not more.")):
        write_guidelines(store, "demo", words, based_on=number, actor="ann")
    return store


def found(store: Store) -> CheckResult:
    return next(check for check in examine_database(store) if check.name == "guidelines")


class TestExamineGuidelines:
    def test_what_was_written_is_as_the_log_says(self, told: Store) -> None:
        check = found(told)
        assert (check.ok, check.sentence) == (True, "2, as the log says")

    def test_those_of_a_dataset_that_was_deleted_went_with_it(self, told: Store) -> None:
        delete_dataset(told, "demo", confirm="demo", actor="ann")
        check = found(told)
        assert (check.ok, check.sentence) == (True, "0, as the log says")

    @pytest.mark.parametrize(
        ("statement", "version"),
        [
            ("UPDATE guideline SET text = 'Draw nothing.' WHERE number = 1", 1),
            ("DELETE FROM guideline WHERE number = 2", 2),
            (
                "INSERT INTO guideline (dataset_id, number, text, written, written_by)"
                " SELECT dataset_id, 3, 'Accept all.', '', 'ann' FROM guideline WHERE number = 1",
                3,
            ),
        ],
    )
    def test_what_nobody_wrote_is_named(self, told: Store, statement: str, version: int) -> None:
        with told.write() as session, said_for_sqlite(session):
            session.execute(text(statement))
        check = found(told)
        assert not check.ok
        assert f"1 not as the log says: version {version} of dataset" in check.sentence
