from __future__ import annotations

import pytest
from sqlalchemy import text

from app.db.dialects.dialect import get_session_dialect
from app.db.store import Store


class TestFaults:
    def test_a_sound_file_has_no_fault(self, filled: Store) -> None:
        with filled.read() as session:
            assert (
                get_session_dialect(session).find_file_faults(session),
                get_session_dialect(session).count_lost_references(session),
            ) == ([], 0)

    @pytest.mark.file_of_sqlite("a reference that is lost, which PostgreSQL lets nobody write")
    def test_rows_that_refer_to_nothing_are_counted(self, filled: Store) -> None:
        with filled.read() as session:
            session.execute(text("PRAGMA defer_foreign_keys = ON"))
            session.execute(text("UPDATE view SET station_id = 99"))
            assert get_session_dialect(session).count_lost_references(session) == 3
