from __future__ import annotations

from app.store.datasets import dataset_rows
from app.store.group_rows import next_id
from app.store.removal import (
    count_contents,
    delete_rows,
    keep_used_ids,
)
from app.store.soundness import count_lost_references
from app.store.store import Store
from app.store.tables.groups import GroupModel


class TestRemoval:
    def test_contents_are_counted(self, filled: Store) -> None:
        with filled.read() as session:
            counts = count_contents(session, 1)
            assert (counts["groups"], counts["views"], counts["verdicts"]) == (1, 3, 0)
            assert set(count_contents(session, 2).values()) == {0}

    def test_everything_that_was_said_goes_and_no_id_comes_again(self, filled: Store) -> None:
        with filled.write() as session:
            keep_used_ids(session)
            delete_rows(session, 1)
            assert dataset_rows(session) == []
            assert count_lost_references(session) == 0
            assert next_id(session, GroupModel) == 2
