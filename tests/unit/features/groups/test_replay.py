from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest
from sqlalchemy import Table, insert, select, text

from app.db.store import Store
from app.errors import StorageError
from app.features.datasets.tables import GroupModel, ImportFindingModel, StationModel, ViewModel
from app.features.findings.queries import SEEN
from app.features.groups.edit import SetLines, SetStationLines, SetViewInclusion, make_set_ball_edit
from app.features.groups.group_edits import apply_noise_factors
from app.features.groups.replay import rebuild_tables, replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot, replace_all_rows
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import redo_group_edit, undo_group_edit
from app.features.imports.cameras import import_given_cameras
from app.features.imports.ingest import UnassignedFrame, import_groups, import_unassigned_frames
from app.features.match_estimates.queries import NoiseFactor
from app.features.policies.service import change_policy
from app.features.stations.service import load_station, submit_station_edit, undo_station
from app.features.tables import Base
from app.features.verdicts.service import set_verdict
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, Extras, make_lines
from app.soccer.frames import Box, ImagePoint
from app.soccer.policy import STRICT
from tests.databases import said_for_sqlite
from tests.unit.stores import insert_row


@pytest.fixture
def busy(store: Store, fill, make_group, make_static, opposite: Camera) -> Store:
    """A dataset to which everything has been done that can be done."""
    ids = fill(make_group(7), make_group(8), make_static(10), make_static(11))
    state = load_group_state(store, ids[0])
    ball = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
    for edit in (
        make_set_ball_edit("7.png", ball),
        SetLines("7_1.png", {"Middle line": None}),
        SetViewInclusion("7_1.png", False),
    ):
        state = submit_edit(store, ids[0], edit, if_match=state.etag, actor="ann")
    for step in (undo_group_edit, undo_group_edit, redo_group_edit):
        state = step(store, ids[0], if_match=state.etag, actor="ben")
    state = set_verdict(store, ids[0], "rejected", "other", "odd", if_match=state.etag, actor="ben")
    station = load_station(store, load_group_state(store, ids[2]).station_ids["cam2"])
    lines = {"Side line left": (ImagePoint(1.0, 2.0), ImagePoint(30.0, 40.0))}
    for _ in range(2):
        station = submit_station_edit(
            store, station.id, SetStationLines(lines), if_match=station.etag, actor="ann"
        )
        lines = {"Middle line": None}
    undo_station(store, station.id, if_match=station.etag, actor="ann")
    with store.write() as session:
        apply_noise_factors(
            session, 1, (NoiseFactor("cam2", None, 2.0), NoiseFactor("cam2", "ann", 3.0)), "ann"
        )
    state = load_group_state(store, ids[2])
    submit_edit(
        store,
        ids[2],
        make_set_ball_edit(state.group.views[-1].key, ball),
        if_match=state.etag,
        actor="ann",
    )
    _import_changed(store, make_group, make_static)
    import_given_cameras(
        store, "demo", {"8_1": opposite, "cam2": opposite}, source="cameras", actor="ann"
    )
    spare = [UnassignedFrame("cam1", "99", Extras(boxes=({"class": "Person"},)))]
    import_unassigned_frames(store, "demo", spare, source="spare", actor="ann")
    change_policy(store, "demo", STRICT, if_match=None, actor="ann")
    return store


def _import_changed(store: Store, make_group, make_static) -> None:
    """The dataset again: another ball, a view less, another camera."""
    seven, eight, static = make_group(7), make_group(8), make_static(10)
    first = seven.views[0]
    other = BallAnnotation(box=Box(1.0, 2.0, 10.0, 10.0))
    camera = static.views[1]
    lines = make_lines({"Middle line": [(1, 2), (3, 4)]})
    groups = [
        seven.with_view(replace(first, balls=(other,))),
        replace(eight, views=eight.views[:1]),
        static.with_view(replace(camera, station=replace(camera.station, lines=lines))),
    ]
    import_groups(store, "demo", groups, source="second", actor="ann")
    import_groups(store, "demo", [eight], source="third", actor="ann")


class TestReplay:
    def test_the_log_alone_gives_the_state_of_the_tables(self, busy: Store) -> None:
        with busy.read() as session:
            replayed, present = replay_log(session), read_state_snapshot(session)
        assert replayed.groups == present.groups
        assert replayed.stations == present.stations
        assert replayed.verdicts == present.verdicts
        assert replayed.noticed == present.noticed
        assert replayed == present
        assert len(present.noticed) == 2

    def test_the_inputs_hashes_of_the_tables_follow_from_it(self, busy: Store) -> None:
        with busy.read() as session:
            replayed = replay_log(session)
            stored = dict(session.execute(text("SELECT id, inputs_hash FROM groups")).all())
        assert {key: replayed.inputs_hash(key) for key in replayed.groups} == stored

    def test_a_table_that_was_changed_behind_the_log_is_seen(self, busy: Store) -> None:
        with busy.write() as session:
            session.execute(text("UPDATE view SET included = NOT included WHERE key = '8.png'"))
        with busy.read() as session:
            assert replay_log(session) != read_state_snapshot(session)

    def test_a_log_that_was_tampered_with_is_refused(self, busy: Store) -> None:
        with busy.write() as session, said_for_sqlite(session):
            session.execute(text("DROP TRIGGER log_refuses_update"))
            session.execute(text("UPDATE log SET actor = 'eve' WHERE id = 3"))
        with busy.read() as session, pytest.raises(StorageError, match="row 3 of the log"):
            replay_log(session)


class TestRebuild:
    def test_lost_tables_come_back(self, busy: Store) -> None:
        with busy.read() as session:
            before = read_state_snapshot(session)
            queue = session.execute(text("SELECT * FROM queue ORDER BY group_id")).all()
        with busy.write() as session:
            session.execute(text("DELETE FROM queue"))
            session.execute(text("DELETE FROM view WHERE key = '7.png'"))
            session.execute(text("UPDATE station SET lines = '{}'"))
        assert rebuild_tables(busy) == []
        with busy.read() as session:
            assert read_state_snapshot(session) == before
            again = session.execute(text("SELECT * FROM queue ORDER BY group_id")).all()
        assert again == queue

    def test_rows_of_other_tables_stay_with_their_groups_and_views(
        self, store: Store, fill, make_group
    ) -> None:
        ids = fill(make_group(7), make_group(8))
        with store.write() as session:
            tables = [insert_row(session, table) for table in _list_cascading_tables()]
            said = [{"group_id": ids[0], "kind": kind, "sentence": kind} for kind in SEEN]
            session.execute(insert(ImportFindingModel), said)
        assert {"take", "gold", "lease", "agreement", "batch_group", "prediction"} < set(tables)
        before = _read_all_rows(store)
        assert rebuild_tables(store) == []
        assert _read_all_rows(store) == before

    def test_rows_of_what_is_no_more_are_counted_and_named(
        self, store: Store, fill, make_group
    ) -> None:
        ids = fill(make_group(7), make_group(8))
        with store.write() as session:
            for table in _list_cascading_tables():
                insert_row(session, table)
            said = {"group_id": ids[0], "view": "none.png", "kind": SEEN[0], "sentence": "odd"}
            session.execute(insert(ImportFindingModel), [said])
            stations, groups, views = (
                [dict(row._mapping) for row in session.execute(select(*model.__table__.columns))]
                for model in (StationModel, GroupModel, ViewModel)
            )
            rebuilt = partial(
                replace_all_rows,
                session,
                stations=stations,
                groups=groups[1:],
                views=[row for row in views if row["group_id"] != ids[0]],
                noticed=[],
                unassigned=[],
            )
            with pytest.raises(StorageError, match=f"the groups {ids[0]}, .* the tables solution;"):
                rebuilt()
            session.execute(text("DELETE FROM solution"))
            left_out = rebuilt()
        has_not = "left out: the log does not have"
        assert f"1 row of the table gold {has_not} groups {ids[0]}" in left_out
        assert f"1 row of the table proposal {has_not} view {views[0]['id']}" in left_out
        named = f"1 row of the table import_finding {has_not} groups or views of groups {ids[0]}"
        assert left_out[-1] == named
        assert len(left_out) == len(_list_cascading_tables()) + 1


def _list_cascading_tables() -> list[Table]:
    """Tables whose rows go with a group or a view, but for marks, which triggers write."""
    return [
        table
        for table in Base.metadata.sorted_tables
        if table.name != "group_change"
        and any(
            key.column.table.name in ("groups", "view") and key.ondelete == "CASCADE"
            for key in table.foreign_keys
        )
    ]


def _read_all_rows(store: Store) -> dict[str, list[str]]:
    """The rows of every table but those of marks, which are written anew."""
    with store.read() as session:
        return {
            table.name: sorted(map(repr, session.execute(select(*table.columns))))
            for table in Base.metadata.sorted_tables
            if table.name not in ("group_change", "queue")
        }
