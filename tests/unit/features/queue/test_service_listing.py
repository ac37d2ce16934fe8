from __future__ import annotations

import random
import time
from typing import Any

import pytest
from sqlalchemy import insert, update

from app.db.store import Store
from app.errors import InputError, NotFoundError
from app.features.datasets.tables import GroupModel
from app.features.groups.submit import load_group_state
from app.features.imports.ingest import ensure_dataset
from app.features.queue.query import SORTS
from app.features.queue.service import (
    GroupRow,
    find_neighbours,
    list_groups,
    list_ids,
    summarize_groups,
)
from app.features.queue.tables import QueueModel
from app.features.verdicts.service import set_verdict
from app.soccer.solution import GATES

COUNT = 60
SEASON = 12_764
"""Groups of the largest dataset that there is."""


def queue_rows(count: int, seed: int = 5) -> list[dict[str, object]]:
    """Rows with ties and missing numbers in every column that can be sorted by."""
    rng = random.Random(seed)

    def number(*values: float) -> float | None:
        return rng.choice([*values, None])

    return [
        {
            "group_id": index,
            "dataset_id": 1,
            "number": index,
            "key": f"m/{index}.png",
            "label": f"Alder 100% _ Birch {index % 7}",
            "match": f"m{index % 3}",
            "split": rng.choice(["train", "test"]),
            "changed": f"2030-01-{1 + index % 9:02}T00:00:00.000000+00:00",
            "views": rng.choice([2, 3]),
            "view_keys": f",{index}.png,cam{index % 6 + 1},",
            "main_view": None,
            "status": rng.choice(["unreviewed", "accepted", "rejected"]),
            "stale": False,
            "reason": None,
            "reviewer": rng.choice(["ann", None]),
            "override": None,
            "fixed": False,
            "solved": True,
            "passes": rng.choice([True, False]),
            "gate": rng.choice(["jac", "sigma", "ball", None]),
            "gate_view": None,
            "gate_sentence": None,
            "margin": number(-1.0, 1.0),
            "value": number(0.1, 0.2, 0.3),
            "min_jac": number(0.5, 0.75, 0.75, 0.9),
            "error_px": number(1.0, 2.0),
            "error_percent": number(0.1, 3.0),
            "sigma_m": number(0.1, 0.1, 250.0),
            "parallax_degrees": number(1.0, 90.0),
            "size_ratio": number(0.9, 1.1),
            "height_m": number(0.1, 2.0),
            "findings": rng.choice(["", ",low_parallax,", ",low_parallax,bad_point,"]),
            "distance_m": number(20.0, 60.0),
            "box_px": number(8.0, 14.0),
            "x_m": number(-30.0, 0.0),
            "y_m": number(5.0, 20.0),
            "agreement": number(0.5, 0.9),
        }
        for index in range(1, count + 1)
    ]


@pytest.fixture
def dataset(store: Store, once) -> int:
    """Id of a dataset of rows made up."""
    return once("rows made up", lambda: fill_queue(store, COUNT))


@pytest.fixture
def season(store: Store, once) -> int:
    """Id of a dataset as large as a season."""
    return once("a season made up", lambda: fill_queue(store, SEASON))


def fill_queue(store: Store, count: int) -> int:
    """A dataset of rows made up; returns its id."""
    dataset = ensure_dataset(store, "big", "ann")
    rows = queue_rows(count)
    groups = [
        {
            **{name: row[name] for name in ("dataset_id", "number", "key", "match", "split")},
            "id": row["group_id"],
            "label": row["label"],
            "changed": row["changed"],
            "pitch_length": 105.0,
            "pitch_width": 68.0,
            "revision": 1,
            "inputs_hash": "h",
            "source_hash": "h",
        }
        for row in rows
    ]
    with store.write() as session:
        session.execute(insert(GroupModel), groups)
        session.execute(insert(QueueModel), rows, execution_options={"render_nulls": True})
    return dataset


def walk(store: Store, dataset: int, query: str, limit: int) -> list[int]:
    """Ids over all pages."""
    ids: list[int] = []
    cursor = None
    while True:
        page = list_groups(store, dataset, query, limit, cursor)
        ids += [row.id for row in page.items]
        cursor = page.next
        if cursor is None:
            return ids


def sorted_by(row: GroupRow, name: str) -> Any:
    """What a row is sorted by."""
    if name == "findings":
        return len(row.findings) + bool(row.findings)
    if name == "gate":
        return None if row.gate is None else GATES.index(row.gate)
    return getattr(row, SORTS[name])


class TestNegation:
    @pytest.mark.parametrize(
        "term", ["gate:jac", "gate:jac,none", "jac<0.8", "sigma>=0.1", "sigma:none", "status:accepted", "passes:yes"]
    )  # fmt: skip
    def test_a_term_and_its_opposite_are_all_groups_and_no_group_twice(
        self, store, dataset, term
    ) -> None:
        held, rest = (walk(store, dataset, query, 50) for query in (term, f"-{term}"))
        assert held and rest
        assert sorted(held + rest) == list(range(1, COUNT + 1))


NEAR = (COUNT - 7) // 2
"""Where the last page of seven begins that is looked for from the start and not from the end."""
SORTED = [f"sort:{name}{end}" for name in SORTS for end in ("", "-desc")]


class TestListGroups:
    @pytest.mark.parametrize("query", SORTED)
    def test_pages_hold_each_group_once_and_in_order(self, store, dataset, query: str) -> None:
        whole = walk(store, dataset, query, 500)
        assert sorted(whole) == list(range(1, COUNT + 1))
        assert walk(store, dataset, query, 13) == whole
        assert walk(store, dataset, f"{query} status:unreviewed", 13) == [
            row.id
            for row in list_groups(store, dataset, query, 500).items
            if row.status == "unreviewed"
        ]

    @pytest.mark.parametrize("query", SORTED)
    def test_numbers_that_are_missing_come_last(self, store, dataset, query: str) -> None:
        name = query[5:].removesuffix("-desc")
        rows = list_groups(store, dataset, query, 500).items
        values = [sorted_by(row, name) for row in rows]
        known = [value for value in values if value is not None]
        assert values[: len(known)] == known
        backwards = query.endswith("-desc") != (name == "newest")
        assert known == sorted(known, reverse=backwards)

    @pytest.mark.parametrize(
        ("query", "holds"),
        [
            ("status:accepted,rejected", lambda row: row.status != "unreviewed"),
            ("-status:accepted", lambda row: row.status != "accepted"),
            ("jac<0.75", lambda row: row.min_jac is not None and row.min_jac < 0.75),
            ("jac:none", lambda row: row.min_jac is None),
            ("finding:bad_point", lambda row: "bad_point" in row.findings),
            ("finding:none", lambda row: row.findings == ()),
            ("finding:any", lambda row: row.findings != ()),
            ("split:train", lambda row: row.split == "train"),
            ("view:2", lambda row: row.views == 2),
            ("views>2", lambda row: row.views > 2),
            ("view:cam3", lambda row: row.id % 6 + 1 == 3),
            ("match:m1", lambda row: row.match == "m1"),
            ("gate:jac", lambda row: row.gate == "jac"),
            ("gate:none", lambda row: row.passes),
            ("gate:unsolved", lambda row: not row.solved),
            ("reviewer:none", lambda row: row.reviewer is None),
            ("reviewer:any", lambda row: row.reviewer is not None),
            ("override:any", lambda row: row.override is not None),
            ("distance>=20 distance<60", lambda row: row.distance_m == 20.0),
            ("box:none", lambda row: row.box_px is None),
            ("x<0 y>5", lambda row: row.x_m == -30.0 and row.y_m == 20.0),
            ("passes:no", lambda row: not row.passes),
            ("reviewer:ann", lambda row: row.reviewer == "ann"),
            ("-reviewer:ann", lambda row: row.reviewer != "ann"),
            ('"Birch 3"', lambda row: row.label.endswith("Birch 3")),
            ("100%", lambda row: True),
            ("1_0", lambda row: False),
            ("m/17.png", lambda row: row.id == 17),
            ("id:3,17,3,999", lambda row: row.id in (3, 17)),
            ("-id:3,17", lambda row: row.id not in (3, 17)),
            ("id:3,17 status:accepted", lambda row: row.id in (3, 17) and row.status == "accepted"),
            ("size_ratio>1 error<2", lambda row: row.size_ratio == 1.1 and row.error_px == 1.0),
        ],
    )
    def test_filters(self, store, dataset, query: str, holds) -> None:
        odd = {"gate:unsolved": {"solved": False}, "override:any": {"override": "jac"}}
        if query in odd:
            with store.write() as session:
                some = update(QueueModel).where(QueueModel.number.in_([3, 40]))
                session.execute(some.values(odd[query]))
        rows = list_groups(store, dataset, "", 500).items
        page = list_groups(store, dataset, query, 500)
        assert [row.id for row in page.items] == [row.id for row in rows if holds(row)]
        assert page.total == len(page.items)
        assert query not in odd or page.total == 2

    def test_a_cursor_belongs_to_its_query(self, store, dataset) -> None:
        cursor = list_groups(store, dataset, "sort:jac", 5).next
        for bad in (cursor + "x!", "", "W10", "bnVsbA", "eyJhIjoxfQ"):
            with pytest.raises(InputError) as caught:
                list_groups(store, dataset, "sort:jac", 5, bad)
            assert caught.value.pointer == "/cursor"
        with pytest.raises(InputError, match="another query"):
            list_groups(store, dataset, "sort:sigma", 5, cursor)

    @pytest.mark.parametrize("limit", [0, -1, 501])
    def test_a_page_is_neither_empty_nor_endless(self, store, limit: int) -> None:
        with pytest.raises(InputError):
            list_groups(store, 1, "", limit)

    def test_a_season_of_groups_is_listed_at_once(self, store, season: int) -> None:
        list_groups(store, season, "status:unreviewed jac<0.95 sort:value", 50)
        spent = []
        for sort in SORTS:
            start = time.process_time()
            list_groups(store, season, f"status:unreviewed jac<0.95 sort:{sort}", 50)
            spent.append(time.process_time() - start)
        # 50 ms are promised, and `make bench` measures them. Of processor time, as other work shares
        # the machine: what takes five times as long reads every row.
        assert min(spent) < 0.05
        assert max(spent) < 0.25


class TestPositions:
    @pytest.mark.parametrize("query", [*SORTED, "sort:jac status:unreviewed", "jac>2"])
    def test_a_page_from_a_position_is_that_part_of_the_whole_list(
        self, store, dataset, query
    ) -> None:
        whole = list_groups(store, dataset, query, 500)
        for start in (0, 1, NEAR, NEAR + 1, COUNT - 7, COUNT - 1, COUNT, 10**15):
            page = list_groups(store, dataset, query, 7, start=start)
            assert page.items == whole.items[start : start + 7]
            assert page.total == whole.total
            found = list_ids(store, dataset, query, 7, start)
            assert list(found.ids) == [row.id for row in page.items]
            assert found.total == whole.total

    def test_a_page_of_a_position_has_a_cursor_that_goes_on(self, store, dataset) -> None:
        ids = walk(store, dataset, "sort:sigma", 500)
        page = list_groups(store, dataset, "sort:sigma", 10, start=40)
        after = list_groups(store, dataset, "sort:sigma", 10, page.next)
        assert [row.id for row in after.items] == ids[50:60]
        assert list_groups(store, dataset, "sort:sigma", 10, start=COUNT - 10).next is None

    def test_a_cursor_or_a_position_but_not_both(self, store, dataset) -> None:
        cursor = list_groups(store, dataset, "", 5).next
        with pytest.raises(InputError, match="not both") as caught:
            list_groups(store, dataset, "", 5, cursor, 5)
        assert caught.value.pointer == "/from"

    def test_all_ids_come_at_once(self, store, dataset) -> None:
        found = list_ids(store, dataset, "sort:sigma-desc")
        assert list(found.ids) == walk(store, dataset, "sort:sigma-desc", 500)

    def test_far_into_a_season_of_groups_is_as_near_as_its_start(self, store, season: int) -> None:
        spent = []
        for start in (6_300, 9_000, SEASON - 100):
            began = time.process_time()
            page = list_groups(store, season, "sort:value", 100, start=start)
            spent.append(time.process_time() - began)
            assert len(page.items) == 100
        # 50 ms are promised, and `make bench` measures them. Of processor time, as other work shares
        # the machine: what takes five times as long reads every row.
        assert min(spent) < 0.05
        assert max(spent) < 0.25


class TestNeighbours:
    @pytest.mark.parametrize("query", ["", "sort:jac", "sort:sigma-desc status:unreviewed"])
    def test_neighbours_are_those_of_the_list(self, store, dataset, query: str) -> None:
        ids = walk(store, dataset, query, 500)
        for place in (0, 3, len(ids) // 2, len(ids) - 1):
            found = find_neighbours(store, ids[place], query)
            assert (found.index, found.total) == (place, len(ids))
            assert list(found.next) == ids[place + 1 : place + 6]
            assert list(found.previous) == ids[max(place - 5, 0) : place][::-1]

    def test_a_group_that_was_just_judged_still_has_a_place(self, store, fill, make_group) -> None:
        ids = fill(make_group(7), make_group(8), make_group(9))
        state = load_group_state(store, ids[1])
        set_verdict(store, ids[1], "deferred", if_match=state.etag, actor="ann")
        found = find_neighbours(store, ids[1], "status:unreviewed")
        assert (found.index, found.total) == (None, 2)
        assert (found.previous, found.next) == ((ids[0],), (ids[2],))

    def test_an_unknown_group_is_not_found(self, store) -> None:
        with pytest.raises(NotFoundError):
            find_neighbours(store, 99)


class TestSummary:
    def test_counts_and_histograms_are_of_what_matches(self, store, dataset) -> None:
        rows = list_groups(store, dataset, "split:train", 500).items
        found = summarize_groups(store, dataset, "split:train")
        assert found.groups == found.solved == len(rows)
        assert found.accepted == sum(row.status == "accepted" for row in rows)
        assert found.unreviewed + found.accepted + found.rejected == found.groups
        jac = found.histograms["jac"]
        assert len(jac.counts) == 20
        assert jac.counts[15] == sum(row.min_jac == 0.75 for row in rows)
        assert sum(jac.counts) == sum(row.min_jac is not None for row in rows)

    def test_what_lies_beyond_counts_in_the_end_bins(self, store, dataset) -> None:
        found = summarize_groups(store, dataset).histograms["sigma"]
        rows = list_groups(store, dataset, "sigma>=100", 500).items
        assert found.counts[-1] == len(rows) > 0

    def test_an_empty_dataset_has_zeros(self, store) -> None:
        found = summarize_groups(store, ensure_dataset(store, "empty", "ann"))
        assert (found.groups, found.solved, found.unreviewed) == (0, 0, 0)
        assert set(found.histograms["jac"].counts) == {0}
