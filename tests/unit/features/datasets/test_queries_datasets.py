from __future__ import annotations

import pytest

from app.db.store import Store
from app.features.datasets.queries import (
    find_dataset,
    insert_dataset_row,
    list_dataset_rows,
    list_group_ids,
    parse_stored_policy,
    read_dataset_name,
    read_dataset_names,
    update_policy,
)
from app.soccer.policy import PAPER, STRICT


class TestFindDataset:
    @pytest.mark.parametrize("dataset", ["demo", "1", 1])
    def test_by_its_name_or_its_id(self, filled: Store, dataset: str | int) -> None:
        with filled.read() as session:
            row = find_dataset(session, dataset)
        assert row is not None
        assert (row.id, row.name) == (1, "demo")

    @pytest.mark.parametrize("dataset", ["Demo", "", "2", 2, 2**63, str(2**63), "9" * 5000, "١"])
    def test_none_where_there_is_none(self, filled: Store, dataset: str | int) -> None:
        with filled.read() as session:
            assert find_dataset(session, dataset) is None


class TestDatasets:
    def test_come_by_name_with_the_policy_that_judges_them_now(self, filled: Store) -> None:
        with filled.write() as session:
            added = insert_dataset_row(session, "alder", PAPER, "t")
            update_policy(session, added, STRICT)
            rows = list_dataset_rows(session)
            assert [row.id for row in rows] == [added, 1]
            assert (parse_stored_policy(rows[0].policy), rows[0].policy_hash) == (
                STRICT,
                STRICT.hash,
            )
            assert read_dataset_names(session) == {1: "demo", added: "alder"}
            assert read_dataset_name(session, added) == "alder"
            assert (list_group_ids(session, 1), list_group_ids(session, added)) == ([1], [])
