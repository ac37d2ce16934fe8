"""Bins of histograms: what a bar counts is what its query finds, zeros and edges included."""

from __future__ import annotations

import numpy as np
import pytest
from sqlalchemy import update

from app.features.queue.query import NUMBERS
from app.features.queue.service import (
    COLUMNS,
    ERROR_PERCENT,
    SIGMA_M,
    find_bin_indices,
    list_groups,
    make_logarithmic_bins,
    summarize_groups,
)
from app.features.queue.statistics import MEASURES
from app.features.queue.tables import QueueModel


class TestDecades:
    def test_the_powers_of_ten_are_edges_and_nothing_lies_before_zero(self):
        assert make_logarithmic_bins(-2, 1, 3) == (0.0, 0.01, 0.0215, 0.0464, 0.1, 0.215, 0.464, 1.0, 2.15,
                                     4.64, 10.0)  # fmt: skip

    def test_bars_are_equally_wide_on_a_logarithmic_scale(self):
        widths = np.diff(np.log10(SIGMA_M[1:]))
        assert np.allclose(widths, 1 / 5, atol=0.003)

    def test_a_query_can_repeat_every_edge(self):
        for edge in (*SIGMA_M, *ERROR_PERCENT):
            assert float(f"{edge:g}") == edge


class TestPlaces:
    def test_zero_is_in_the_first_bin_and_an_edge_in_the_bin_that_it_begins(self):
        found = find_bin_indices((0.0, 0.1, 1.0), np.array([0.0, 0.1, 1.0, 9.0, np.nan]),
                       open_low=False, open_high=True)  # fmt: skip
        assert found.tolist() == [0, 1, 1, 1, -1]

    def test_beyond_a_closed_end_there_is_no_bin(self):
        found = find_bin_indices(
            (0.0, 0.5, 1.0), np.array([-1.0, 1.0, 1.1]), open_low=False, open_high=False
        )
        assert found.tolist() == [-1, 1, -1]


@pytest.mark.parametrize("name", ["error_percent", "sigma"])
def test_error_and_sigma_are_logarithmic_in_the_queue_and_in_the_statistics(name):
    assert COLUMNS[name].log
    (measure,) = [one for one in MEASURES if one.field == name]
    assert measure.log
    assert measure.edges == COLUMNS[name].edges


@pytest.mark.parametrize(
    ("name", "field"), [("error_percent", "error_percent"), ("sigma", "sigma")]
)
def test_the_range_of_each_bar_of_the_queue_finds_exactly_its_groups(
    store, fill, make_group, name, field
):
    values = [
        None,
        0.0,
        0.004,
        0.01,
        0.0147,
        0.03,
        0.1,
        0.251,
        1.0,
        6.81,
        10.0,
        57.4,
        100.0,
        2000.0,
    ]
    ids = fill(*(make_group(number) for number in range(1, len(values) + 1)))
    with store.write() as session:
        for group, value in zip(ids, values, strict=True):
            statement = update(QueueModel).where(QueueModel.group_id == group)
            session.execute(statement.values({NUMBERS[name]: value}))
    found = summarize_groups(store, 1).histograms[name]
    edges = found.column.edges
    assert sum(found.counts) == len(values) - 1
    assert found.unknown == 1
    for bar, count in enumerate(found.counts):
        upper = "" if bar == len(found.counts) - 1 else f" {field}<{edges[bar + 1]:g}"
        assert list_groups(store, 1, f"{field}>={edges[bar]:g}{upper}").total == count
