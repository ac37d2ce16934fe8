from __future__ import annotations

import pytest
from sqlalchemy import update

from app.db.store import Store
from app.errors import InputError
from app.features.imports.ingest import ensure_dataset
from app.features.queue.query import NUMBERS
from app.features.queue.service import list_groups
from app.features.queue.statistics import MEASURES, X_EDGES, Y_EDGES, read_statistics
from app.features.queue.tables import QueueModel


@pytest.fixture
def spread(store: Store, fill, make_group) -> Store:
    """Twelve groups with numbers on every kind of edge, in two splits; one has none."""
    ids = fill(*(make_group(n, split="train" if n % 2 else "test") for n in range(1, 13)))
    values = [None, -5.0, 0.0, 0.05, 0.1, 0.75, 1.0, 2.0, 40.0, 120.0, 180.0, 1e9]
    names = [NUMBERS[measure.field] for measure in MEASURES]
    with store.write() as session:
        for group, value in zip(ids, values, strict=True):
            numbers = dict.fromkeys(names, value)
            statement = update(QueueModel).where(QueueModel.group_id == group)
            session.execute(statement.values({**numbers, "x_m": value, "y_m": value}))
    return store


class TestStatistics:
    def test_each_bar_opens_the_groups_that_it_counts(self, spread: Store) -> None:
        found = read_statistics(spread, 1)
        assert found.groups == 12
        assert len(found.histograms) == len(MEASURES) == 9
        assert len({NUMBERS[measure.field] for measure in MEASURES}) == 9
        for histogram in found.histograms:
            assert len(histogram.queries) == len(histogram.measure.edges) - 1
            for place, query in enumerate(histogram.queries):
                for series in histogram.series:
                    matching = list_groups(spread, 1, f"{query} split:{series.split}").total
                    assert series.counts[place] == matching, query

    def test_every_group_is_counted_where_ends_are_open(self, spread: Store) -> None:
        for histogram in read_statistics(spread, 1).histograms:
            counted = sum(sum(series.counts) for series in histogram.series)
            unknown = sum(series.unknown for series in histogram.series)
            assert unknown == 1
            measure = histogram.measure
            below = 0 if measure.open_low else 1
            above = (
                0
                if measure.open_high
                else sum(value > measure.edges[-1] for value in (1.0, 2.0, 40.0, 120.0, 180.0, 1e9))
            )
            assert counted == 11 - below - above, measure.name

    def test_positions_are_in_their_cells(self, spread: Store) -> None:
        places = read_statistics(spread, 1).positions
        assert len(places.counts) == len(Y_EDGES) - 1
        assert {len(row) for row in places.counts} == {len(X_EDGES) - 1}
        assert sum(map(sum, places.counts)) + places.outside == 11
        row, column = Y_EDGES.index(0.0), X_EDGES.index(0.0)
        cell = (
            f"x>={X_EDGES[column]} x<{X_EDGES[column + 1]} y>={Y_EDGES[row]} y<{Y_EDGES[row + 1]}"
        )
        assert places.counts[row][column] == list_groups(spread, 1, cell).total == 6

    def test_columns_of_positions_are_along_x_and_rows_along_y(self, spread: Store) -> None:
        everywhere = {"x_m": X_EDGES[-2], "y_m": Y_EDGES[0]}
        with spread.write() as session:
            session.execute(update(QueueModel).values(everywhere))
        counts = read_statistics(spread, 1).positions.counts
        assert (counts[0][-1], sum(map(sum, counts))) == (12, 12)

    def test_matches_and_splits_add_up(self, spread: Store) -> None:
        found = read_statistics(spread, 1)
        assert [(item.split, item.groups) for item in found.splits] == [("test", 6), ("train", 6)]
        assert [item.groups for item in found.matches] == [6, 6]
        assert sum(item.passing for item in found.splits) == 12

    def test_counts_only_groups_that_match(self, spread: Store) -> None:
        found = read_statistics(spread, 1, "split:train distance>=0")
        assert found.groups == list_groups(spread, 1, "split:train distance>=0").total
        assert [item.split for item in found.splits] == ["train"]
        with pytest.raises(InputError):
            read_statistics(spread, 1, "colour:red")

    def test_an_empty_dataset_has_empty_bars(self, store) -> None:
        found = read_statistics(store, ensure_dataset(store, "empty", "ann"))
        assert found.groups == 0
        assert all(histogram.series == () for histogram in found.histograms)
