"""Changes: what is told to others, each group once."""

from __future__ import annotations

import pytest

from app.db.log import find_newest_entry_id
from app.db.store import Store
from app.features.comments.service import begin_thread
from app.features.datasets.service import delete_dataset, get_dataset
from app.features.groups.edit import SetStationCalibrationSource, SetViewInclusion
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import ensure_dataset
from app.features.policies.service import change_policy
from app.features.queue import changes as module
from app.features.queue.changes import (
    LoggedChange,
    read_changes,
    read_new_changes,
    read_newly_solved_groups,
)
from app.features.solutions.queries import find_newest_solution_id
from app.features.solutions.service import solve_dataset
from app.features.stations.service import load_station, submit_station_edit
from app.features.verdicts.service import set_verdict
from app.soccer.policy import STRICT


def since(store: Store, after: int) -> list[LoggedChange]:
    with store.read() as session:
        return read_changes(session, after)


def newest(store: Store) -> int:
    with store.read() as session:
        return find_newest_entry_id(session)


class TestReadChanges:
    def test_an_edit_and_a_verdict_of_one_group_are_one_change(
        self, store: Store, fill, make_group
    ) -> None:
        one, _two = fill(make_group(7), make_group(8))
        before, etag = newest(store), load_group_state(store, one).etag
        edited = submit_edit(
            store, one, SetViewInclusion("7.png", False), if_match=etag, actor="ann"
        )
        judged = set_verdict(store, one, "deferred", if_match=edited.etag, actor="bob")
        found = get_dataset(store, "demo").id
        assert since(store, before) == [
            LoggedChange(before + 2, found, "demo", "verdict", "bob", one, judged.etag)
        ]
        assert since(store, before + 2) == []

    def test_a_comment_hides_no_change_of_its_group(self, store: Store, fill, make_group) -> None:
        (one,) = fill(make_group(7))
        before, etag = newest(store), load_group_state(store, one).etag
        submit_edit(store, one, SetViewInclusion("7.png", False), if_match=etag, actor="ann")
        begin_thread(store, one, "Is it?", actor="bob")
        edited, commented = since(store, before)
        assert (edited.group_id, edited.actor) == (commented.group_id, "ann") == (one, "ann")
        assert (commented.kind, commented.actor) == ("comment", "bob")

    def test_an_edit_of_a_static_camera_changes_each_of_its_groups(
        self, store: Store, fill, make_static
    ) -> None:
        ids = fill(make_static(10), make_static(20))
        station = next(iter(load_group_state(store, ids[0]).station_ids.values()))
        before, etag = newest(store), load_station(store, station).etag
        submit_station_edit(
            store, station, SetStationCalibrationSource("lines"), if_match=etag, actor="ann"
        )
        told = since(store, before)
        assert [(item.kind, item.group_id) for item in told if item.group_id] == [
            ("station_edit", ids[0]),
            ("station_edit", ids[1]),
        ]
        assert {item.etag for item in told if item.group_id} == {
            load_group_state(store, number).etag for number in ids
        }

    def test_a_policy_changes_the_dataset(self, store: Store) -> None:
        ensure_dataset(store, "demo", "ann")
        before = newest(store)
        change_policy(store, "demo", STRICT, if_match=None, actor="ann")
        (told,) = since(store, before)
        assert (told.dataset, told.kind, told.group_id) == ("demo", "policy", None)

    def test_too_many_groups_at_once_are_a_change_of_the_dataset(
        self, store: Store, fill, make_group, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "MANY", 2)
        ensure_dataset(store, "demo", "ann")
        before = newest(store)
        fill(*(make_group(number) for number in range(1, 4)), solved=False)
        told = since(store, before)
        assert {item.group_id for item in told} == {None}
        assert {item.kind for item in told} == {"import"}

    def test_who_was_away_for_long_is_told_to_read_everything(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "FAR", 1)
        for name in ("one", "two", "three"):
            ensure_dataset(store, name, "ann")
        told = since(store, 0)
        assert {(item.dataset, item.kind) for item in told} == {
            (name, "everything") for name in ("one", "two", "three")
        }
        assert {item.id for item in told} == {newest(store)}

    def test_that_a_dataset_is_gone_is_told_once(self, store: Store, fill, make_group) -> None:
        fill(make_group(7))
        before = newest(store)
        change_policy(store, "demo", STRICT, if_match=None, actor="eve")
        delete_dataset(store, "demo", confirm="demo", actor="eve")
        assert [(item.dataset, item.group_id, item.id) for item in since(store, before)] == [
            (None, None, newest(store))
        ]


class TestReadSolved:
    def test_tells_the_groups_that_got_a_solution(self, store: Store, fill, make_group) -> None:
        one, two = fill(make_group(7), make_group(8), solved=False)
        with store.read() as session:
            before = find_newest_solution_id(session)
        solve_dataset(store, "demo")
        with store.read() as session:
            told = read_newly_solved_groups(session, before)
            rest = read_newly_solved_groups(session, before, {one})
        assert [(item.group_id, item.kind, item.id) for item in told] == [
            (one, "solved", None),
            (two, "solved", None),
        ]
        assert [item.group_id for item in rest] == [two]

    def test_who_read_long_before_is_told_of_datasets_as_a_whole(
        self, store: Store, fill, make_group, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fill(*(make_group(number) for number in (1, 2, 3)))
        with store.read() as session:
            newest, entry = find_newest_solution_id(session), find_newest_entry_id(session)
        near, far = newest, newest - 3
        places = [(entry, near), (entry, far)]
        solved = read_new_changes(store, places).solved
        assert {after: [one.group_id for one in found] for after, found in solved.items()} == {
            (entry, far): [1, 2, 3]
        }
        monkeypatch.setattr(module, "FAR", 2)
        (whole,) = read_new_changes(store, places).solved[entry, far]
        assert (whole.dataset, whole.kind, whole.group_id) == ("demo", "solved", None)

    def test_who_is_up_to_date_hears_of_solutions_although_another_listener_is_behind(
        self, store: Store, fill, make_group
    ) -> None:
        one, two = fill(make_group(1), make_group(2), solved=False)
        with store.read() as session:
            entry, solution = find_newest_entry_id(session), find_newest_solution_id(session)
        solve_dataset(store, "demo")
        solved = read_new_changes(store, [(entry, solution), (0, solution)]).solved
        assert [item.group_id for item in solved[entry, solution]] == [one, two]
        assert solved[0, solution] == []
