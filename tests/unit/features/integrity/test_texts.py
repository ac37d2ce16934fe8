"""What the doctor says of texts that one of the databases cannot keep."""

from __future__ import annotations

import pytest
from sqlalchemy import text

from app.db.check import CheckResult
from app.db.store import Store
from app.features.integrity.checks import examine_database

pytestmark = pytest.mark.file_of_sqlite("PostgreSQL has never kept U+0000")


def texts_check(store: Store) -> CheckResult:
    (found,) = (check for check in examine_database(store) if check.name == "texts")
    return found


class TestTexts:
    def test_texts_that_both_can_keep_are_counted_as_whole(self, store: Store, fill, make_group):
        fill(make_group(7))
        assert texts_check(store) == CheckResult(
            "texts", True, "SQLite and PostgreSQL can keep each"
        )

    def test_a_text_with_u_0000_is_named_by_table_row_and_column(
        self, store: Store, fill, make_group
    ) -> None:
        (group,) = fill(make_group(7))
        with store.write() as session:
            session.execute(text("UPDATE groups SET label = label || char(0)"))
        found = texts_check(store)
        assert found.ok
        assert found.sentence == (
            f"1 with U+0000, which PostgreSQL cannot keep: groups id={group} column label"
        )
        assert found.advice == "touchline transfer --replace-null writes U+FFFD there."
