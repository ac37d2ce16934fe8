"""The queue's rows, asked for as lists ask; orders and positions are tested with the lists."""

from __future__ import annotations

import shutil
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import event, insert, select

from app.config import Settings
from app.db.session import Session
from app.db.store import Store
from app.features.datasets.tables import GroupModel
from app.features.queue.queries import (
    GroupListing,
    RowOrder,
    compare_condition,
    count_states,
    find_dataset_and_sort_keys,
    read_columns_of_groups,
    read_rows,
)
from app.features.queue.tables import QueueModel

SIGMA = {1: None, 2: 0.5, 3: 0.1, 4: 0.5}


@pytest.fixture
def listed(filled: Store) -> Store:
    """The dataset 1 with four groups, the first without a sigma, the last one accepted."""
    with filled.write() as session:
        for number in (2, 3, 4):
            group = session.execute(select(*GroupModel.__table__.columns)).first()
            row = session.execute(select(*QueueModel.__table__.columns)).first()
            assert group is not None and row is not None
            names = {"number": number, "key": f"m/{number}.png"}
            session.execute(insert(GroupModel), [{**group._mapping, **names, "id": number}])
            values = {"group_id": number, "sigma_m": SIGMA[number], "solved": number > 2}
            values["status"] = "accepted" if number == 4 else "unreviewed"
            session.execute(insert(QueueModel), [{**row._mapping, **names, **values}])
    return filled


@pytest.fixture
def session(listed: Store):
    with listed.read() as session:
        yield session


OPEN = [compare_condition("status", "=", "unreviewed")]
BY_SIGMA = RowOrder("sigma_m", descending=True)


class TestCounts:
    def test_groups_of_the_dataset_that_fulfil_all_conditions(self, session: Session) -> None:
        assert [GroupListing(session, 1).count(), GroupListing(session, 2).count()] == [4, 0]
        assert (
            GroupListing(session, 1, [*OPEN, compare_condition("sigma_m", ">", 0.2)]).count() == 1
        )

    def test_states_with_the_groups_that_are_solved(self, session: Session) -> None:
        rows = {row.status: (row.groups, row.solved) for row in count_states(session, [1, 2])}
        assert rows == {"unreviewed": (3, 1), "accepted": (1, 1)}


class TestReadColumns:
    def test_columns_come_in_the_order_of_the_numbers(self, session: Session) -> None:
        rows = GroupListing(session, 1, OPEN).columns(("number", "sigma_m"), by_number=True)
        assert [tuple(row) for row in rows] == [(1, None), (2, 0.5), (3, 0.1)]

    def test_of_some_groups_alone(self, session: Session) -> None:
        rows = read_columns_of_groups(session, [4, 3, 9, 1], OPEN, ("group_id",))
        assert [row.group_id for row in rows] == [1, 3]


class TestOrder:
    def test_all_ids_or_the_first_few_come_in_the_order(self, session: Session) -> None:
        assert GroupListing(session, 1).ids(BY_SIGMA) == [2, 4, 3, 1]
        assert GroupListing(session, 1, OPEN).ids(BY_SIGMA, 2) == [2, 3]

    def test_ids_from_a_position_on_either_side_of_the_middle(self, session: Session) -> None:
        whole = [2, 4, 3, 1]
        for start in range(6):
            assert (
                GroupListing(session, 1).ids_from(BY_SIGMA, start, 2, 4) == whole[start : start + 2]
            )

    def test_a_page_goes_on_after_the_keys_of_a_row(self, session: Session) -> None:
        first = GroupListing(session, 1).rows_after(BY_SIGMA, None, 2)
        assert [row.group_id for row in first] == [2, 4]
        keys = BY_SIGMA.keys_of(first[-1])
        rest = GroupListing(session, 1).rows_after(BY_SIGMA, keys, 9)
        assert [row.group_id for row in rest] == [3, 1]
        assert [row.group_id for row in read_rows(session, [1, 4], BY_SIGMA)] == [4, 1]

    def test_a_group_has_a_place_also_where_it_is_not_among_those_that_are_meant(
        self, session: Session
    ) -> None:
        place = find_dataset_and_sort_keys(session, 4, BY_SIGMA)
        assert place is not None
        dataset, keys = place
        assert (dataset, find_dataset_and_sort_keys(session, 9, BY_SIGMA)) == (1, None)
        assert GroupListing(session, 1, OPEN).ids_around(BY_SIGMA, keys, 5, total=5) == (
            [2],
            [3, 1],
        )
        assert GroupListing(session, 1, OPEN).ids_around(BY_SIGMA, keys, 1, total=5) == ([2], [3])

    @pytest.mark.parametrize("column", ["number", "changed", "gate", "findings", "label"])
    def test_no_two_groups_have_the_same_keys(self, session: Session, column: str) -> None:
        order = RowOrder(column)
        rows = read_rows(session, [1, 2, 3, 4], order)
        keys = [tuple(order.keys_of(row)) for row in rows]
        assert len(set(keys)) == 4
        assert keys == sorted(keys)


class TestWhatIsRead:
    @pytest.mark.parametrize(
        ("conditions", "index"),
        [
            (
                [compare_condition("views", ">", 2), compare_condition("error_px", ">", 5)],
                "COVERING INDEX queue_scanned",
            ),
            (
                [compare_condition("views", ">", 2), compare_condition("key", "=", "x")],
                "INDEX queue_number",
            ),
        ],
    )
    @pytest.mark.file_of_sqlite("SQLite's plan of a question")
    def test_groups_are_counted_without_their_rows_where_one_index_holds_what_is_asked(
        self, settings: Settings, migrated: Path, conditions, index: str
    ) -> None:
        """Plans are those of SQLite, which is told by which index to go."""
        settings.home.mkdir()
        shutil.copy(migrated, settings.database_file)
        statements: list[str] = []
        with closing(Store.open(settings)) as store, store.read() as session:
            event.listen(session, "before_cursor_execute", lambda *told: statements.append(told[2]))
            GroupListing(session, 1, conditions).count()
            explain = f"EXPLAIN QUERY PLAN {statements[-1]}"
            plan = session.exec_driver_sql(explain, (1, 2, 5)).all()
        assert index in " ".join(row[3] for row in plan)
