from __future__ import annotations

import time

import pytest
from sqlalchemy import insert

from app.db.idempotency import without_pending_response
from app.errors import ConflictError, NotFoundError, StaleRevisionError
from app.features.groups.edit import SetStationCalibrationSource, SetStationLines
from app.features.groups.submit import load_group_state
from app.features.independent_annotations.tables import GoldModel
from app.features.people.visibility_queries import READER, RestrictedReader
from app.features.queue.service import list_groups
from app.features.solutions.service import list_stale_groups, solve_dataset
from app.features.stations.service import (
    load_station,
    redo_station,
    submit_station_edit,
    undo_station,
)
from app.features.verdicts.service import set_verdict
from app.soccer.frames import ImagePoint
from app.solving.solve import solve_group
from tests.unit.features.pending import stored_by

EDIT = SetStationLines({"Middle line": (ImagePoint(1.5, 2.5), ImagePoint(3.0, 4.0))})


def change(store, state, edit=EDIT, **more):
    return submit_station_edit(store, state.id, edit, if_match=state.etag, actor="ann", **more)


@pytest.fixture
def ids(fill, make_static) -> list[int]:
    return fill(*(make_static(frame) for frame in range(10, 14)))


@pytest.fixture
def station(store, ids):
    return load_station(store, load_group_state(store, ids[0]).station_ids["cam1"])


class TestSubmitStation:
    def test_changes_the_station_in_every_group_and_makes_them_stale(
        self, store, ids, station
    ) -> None:
        before = [load_group_state(store, number) for number in ids]
        after = change(store, station)
        assert after.groups == tuple(ids)
        assert after.station.lines["Middle line"] == EDIT.lines["Middle line"]
        assert (after.revision, after.can_undo) == (2, True)
        assert list_stale_groups(store, "demo") == ids
        for old, number in zip(before, ids, strict=True):
            new = load_group_state(store, number)
            assert new.group.view("cam1").station == after.station
            assert new.solution is None
            assert new.etag != old.etag
            assert new.station_etags["cam1"] == after.etag

    def test_solving_again_makes_the_groups_whole(self, store, ids, station) -> None:
        change(store, station)
        assert solve_dataset(store, "demo").solved == len(ids)
        assert list_stale_groups(store, "demo") == []

    def test_an_older_state_is_refused(self, store, station) -> None:
        change(store, station)
        with pytest.raises(StaleRevisionError):
            change(store, station, SetStationLines({"Circle central": None}))

    def test_the_group_in_view_is_solved_and_kept_with_the_edit(self, store, ids, station) -> None:
        kept = []

        with stored_by(lambda session, state: kept.append((state, session.in_transaction()))):
            after = change(store, station, shown=ids[1])
        ((shown, within),) = kept
        assert within
        assert after.shown is shown
        assert shown == load_group_state(store, ids[1])
        assert shown.solution == solve_group(shown.group, shown.policy)
        assert load_group_state(store, ids[0]).solution is None

    def test_a_verdict_becomes_stale_and_is_kept(self, store, ids, station) -> None:
        state = load_group_state(store, ids[0])
        accepted = set_verdict(store, ids[0], "deferred", if_match=state.etag, actor="ann")
        assert not accepted.verdict.stale
        after = change(store, station)
        assert load_group_state(store, ids[0]).verdict.stale
        assert [row.stale for row in list_groups(store, 1).items] == [True, False, False, False]
        undo_station(store, station.id, if_match=after.etag, actor="ann")
        assert not load_group_state(store, ids[0]).verdict.stale

    def test_a_station_of_one_view_is_edited_there(self, store, state) -> None:
        own = load_station(store, next(iter(state.station_ids.values())))
        with pytest.raises(ConflictError, match="belongs to one view alone"):
            change(store, own)

    def test_which_calibration_counts_is_a_switch(self, store, station) -> None:
        after = change(store, station, SetStationCalibrationSource("lines"))
        assert after.station.calibration == "lines"

    def test_who_does_not_see_a_group_is_not_told_of_it_by_its_camera(
        self, store, ids, station
    ) -> None:
        with store.write() as session, without_pending_response():
            row = {"group_id": ids[0], "dataset_id": station.dataset_id, "start": "imported"}
            session.execute(
                insert(GoldModel).values(**row, truth=b"", marked="2026", marked_by="lea")
            )
        blind = RestrictedReader("bo", {station.dataset_id: frozenset()}, lambda _: False)
        token = READER.set(blind)
        try:
            seen = load_station(store, station.id)
            assert (seen.groups, seen.visible_groups) == (tuple(ids), tuple(ids[1:]))
        finally:
            READER.reset(token)

    def test_an_unknown_station_is_not_found(self, store) -> None:
        with pytest.raises(NotFoundError, match="no static camera with id 9"):
            load_station(store, 9)

    def test_hundreds_of_groups_are_brought_in_step_at_once(self, store, fill, make_static) -> None:
        ids = fill(*(make_static(frame) for frame in range(300)), solved=False)[:1]
        station = load_station(store, load_group_state(store, ids[0]).station_ids["cam1"])
        start = time.process_time()
        after = change(store, station)
        assert len(after.groups) == 300
        assert time.process_time() - start < 5.0


class TestUndoStation:
    def test_leads_back_to_solutions_that_are_there(self, store, ids, station) -> None:
        before = load_group_state(store, ids[0])
        after = change(store, station)
        back = undo_station(store, station.id, if_match=after.etag, actor="ann")
        assert back.station == station.station
        assert (back.can_undo, back.can_redo) == (False, True)
        assert list_stale_groups(store, "demo") == []
        assert load_group_state(store, ids[0]).solution == before.solution
        again = redo_station(store, station.id, if_match=back.etag, actor="ann")
        assert again.station == after.station

    def test_without_an_edit_there_is_nothing(self, store, station) -> None:
        with pytest.raises(ConflictError, match="nothing to undo"):
            undo_station(store, station.id, if_match=station.etag, actor="ann")
        with pytest.raises(ConflictError, match="nothing to redo"):
            redo_station(store, station.id, if_match=station.etag, actor="ann")
