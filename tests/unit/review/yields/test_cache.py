from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.review.yields.cache import forget_table, keep_table, kept_table
from app.review.yields.store import YieldStore
from app.review.yields.table import EMPTY, YieldTable
from app.solving.facts import COLUMNS


@pytest.fixture
def table(store, fill, make_group, make_static) -> YieldTable:
    fill(make_group(7), make_static(10), make_group(8))
    return YieldStore(store).snapshot(1).table


def same(one: YieldTable, other: YieldTable) -> bool:
    ids = np.array_equal(one.group_id, other.group_id) and np.array_equal(one.inputs, other.inputs)
    return ids and all(
        np.array_equal(getattr(one.facts, name), getattr(other.facts, name), equal_nan=True)
        for name in COLUMNS
    )


class TestKeptTable:
    def test_gives_back_the_table_that_was_kept(self, table, tmp_path) -> None:
        place = tmp_path / "cache" / "1.npz"
        keep_table(place, "calibration", table)
        assert same(kept_table(place, "calibration"), table)
        assert [path.name for path in place.parent.iterdir()] == ["1.npz"]
        forget_table(place)
        assert kept_table(place, "calibration") is EMPTY

    def test_a_table_of_another_calibration_is_not_used(self, table, tmp_path) -> None:
        place = tmp_path / "1.npz"
        keep_table(place, "one", table)
        assert kept_table(place, "another") is EMPTY

    def test_a_damaged_file_is_made_again(self, table, tmp_path) -> None:
        place = tmp_path / "1.npz"
        keep_table(place, "c", table)
        whole = place.read_bytes()
        for content in (b"", b"PK\x03\x04", whole[:900], whole[:-30], b"x" * 500):
            place.write_bytes(content)
            assert kept_table(place, "c") is EMPTY

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("pair_view", np.full((4, 2), 99)),
            ("view_group", np.full(7, -1)),
            ("pair_errors", np.zeros((4, 3))),
            ("mark_px", np.zeros(2)),
            ("view_included", np.zeros(7)),
        ],
    )
    def test_impossible_rows_are_made_again(self, table, tmp_path, name, value) -> None:
        place = tmp_path / "1.npz"
        facts = replace(table.facts, **{name: value})
        keep_table(place, "c", replace(table, facts=facts))
        assert kept_table(place, "c") is EMPTY

    def test_a_full_disk_costs_no_answer(self, table, tmp_path) -> None:
        (tmp_path / "file").write_text("")
        keep_table(tmp_path / "file" / "1.npz", "c", table)


class TestYieldStoreAfterARestart:
    def test_reads_no_solution_again(self, store, fill, make_group, monkeypatch) -> None:
        fill(make_group(7), make_group(8))
        monkeypatch.setattr("app.review.yields.store.WORTH_KEEPING", 2)
        before = YieldStore(store).snapshot(1)
        monkeypatch.setattr("app.review.yields.store.read_facts", None)
        after = YieldStore(store).snapshot(1)
        forget_table(store.settings.cache / "yields" / "1.npz")
        assert same(after.table, before.table)
        assert after.present.passes.all()
