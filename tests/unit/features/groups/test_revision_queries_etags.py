from __future__ import annotations

from app.db.store import Store
from app.features.groups.revision_queries import find_etag_row, read_etag_rows
from app.features.verdicts.queries import StoredVerdict, insert_verdicts_and_end_work

VERDICT = StoredVerdict(7, 1, "ann", "t", "accepted", None, None, "h", "p", False, None)


class TestHeads:
    def test_name_the_newest_verdict_or_none(self, filled: Store) -> None:
        with filled.write() as session:
            before = find_etag_row(session, 1)
            insert_verdicts_and_end_work(session, 1, [VERDICT], actor="ann", at="t")
            after = find_etag_row(session, 1)
            assert before is not None and after is not None
            assert (before.last, after.last) == (0, 7)
            assert (after.revision, after.policy_hash) == (1, "p")
            assert find_etag_row(session, 9) is None

    def test_many_at_once_say_the_same_and_whether_there_is_a_solution(self, filled: Store) -> None:
        with filled.read() as session:
            head = find_etag_row(session, 1)
            assert head is not None
            (row,) = read_etag_rows(session, [1, 9])
        assert (row.id, row.summary) == (1, None)
        same = (row.inputs_hash, row.revision, row.policy_hash, row.last, row.last_dismissal)
        assert same == tuple(head)
