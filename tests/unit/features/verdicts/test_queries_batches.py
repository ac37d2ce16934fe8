from __future__ import annotations

from app.features.verdicts.queries import (
    find_bulk_verdict,
    insert_bulk_verdict,
    read_bulk_verdicts,
    update_bulk_verdict,
)

GIVEN = {"actor": "ann", "at": "t", "query": "", "state": "accepted", "reason": None, "note": None}


class TestBatches:
    def test_a_batch_is_remembered_as_it_goes_on(self, filled) -> None:
        with filled.write() as session:
            first = insert_bulk_verdict(session, dataset_id=1, changed=2, spans=[(1, 2)], **GIVEN)
            batch = find_bulk_verdict(session, first)
            assert batch is not None
            assert (batch.spans, batch.undo_spans, batch.done) == ([[1, 2]], None, False)
            update_bulk_verdict(session, first, changed=4, spans=[(1, 2), (5, 6)], log_id=9)
            update_bulk_verdict(session, first, undone="t", undone_by="bob", undo_spans=[])
            batch = find_bulk_verdict(session, first)
            assert batch is not None
            assert (batch.changed, batch.spans, batch.done) == (4, [[1, 2], [5, 6]], True)
            assert (batch.undone_by, batch.undo_spans) == ("bob", [])

    def test_they_are_listed_the_newest_first(self, filled) -> None:
        with filled.write() as session:
            ids = [
                insert_bulk_verdict(session, dataset_id=1, changed=1, spans=[], **GIVEN)
                for _ in range(3)
            ]
            assert [batch.id for batch in read_bulk_verdicts(session, 1, 2)] == [ids[2], ids[1]]
            assert read_bulk_verdicts(session, 2, 9) == []
            assert find_bulk_verdict(session, 99) is None
