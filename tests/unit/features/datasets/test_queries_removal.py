from __future__ import annotations

import pytest
from sqlalchemy import text

from app.db.dialects.dialect import get_session_dialect
from app.db.log import NewLogEntry, append_entries
from app.db.store import Store
from app.features.datasets.queries import (
    count_dataset_contents,
    delete_dataset_rows,
    list_dataset_rows,
    reserve_used_ids,
)
from app.features.datasets.tables import GroupModel
from app.features.findings.queries import insert_dismissal
from app.features.groups.insert_queries import find_next_row_id
from app.soccer.finding import Dismissal
from tests.databases import said_for_sqlite

SAID = Dismissal("bad_point", None, None, None, 1.9, "It is off.", "ann", "2026-01-01")


@pytest.fixture
def dismissed(filled: Store) -> Store:
    """A finding of the one group was dismissed."""
    with filled.write() as session:
        insert_dismissal(session, 1, 1, SAID, dismissed=True)
    return filled


class TestDismissals:
    @pytest.mark.parametrize(
        "statement",
        [
            "UPDATE dismissal SET actor = 'eve'",
            "DELETE FROM dismissal",
            "INSERT OR REPLACE INTO dismissal (id, group_id, actor, at, kind, sentence, dismissed)"
            " SELECT id, group_id, 'eve', at, kind, sentence, dismissed FROM dismissal",
        ],
    )
    def test_what_was_dismissed_cannot_be_rewritten(self, dismissed: Store, statement: str) -> None:
        with dismissed.write() as session:
            refused = pytest.raises(Exception, match="rows of dismissal are never changed")
            with said_for_sqlite(session), refused:
                session.execute(text(statement))
            session.rollback()
        with dismissed.read() as session:
            assert session.scalars(text("SELECT actor FROM dismissal")).all() == ["ann"]

    def test_they_go_with_their_dataset_once_the_log_says_so(self, dismissed: Store) -> None:
        with dismissed.write() as session:
            append_entries(session, [NewLogEntry("dataset_deleted", "ann", "2026-01-02", {}, 1)])
            delete_dataset_rows(session, 1)
            assert get_session_dialect(session).count_lost_references(session) == 0
            assert session.scalar(text("SELECT count(*) FROM dismissal")) == 0


class TestRemoval:
    def test_contents_are_counted(self, filled: Store) -> None:
        with filled.read() as session:
            counts = count_dataset_contents(session, 1)
            assert (counts["groups"], counts["views"], counts["verdicts"]) == (1, 3, 0)
            assert set(count_dataset_contents(session, 2).values()) == {0}

    def test_everything_that_was_said_goes_and_no_id_comes_again(self, filled: Store) -> None:
        with filled.write() as session:
            reserve_used_ids(session)
            delete_dataset_rows(session, 1)
            assert list_dataset_rows(session) == []
            assert get_session_dialect(session).count_lost_references(session) == 0
            assert find_next_row_id(session, GroupModel) == 2
