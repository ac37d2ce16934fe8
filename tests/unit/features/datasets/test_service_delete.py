from __future__ import annotations

from dataclasses import replace

import pytest
from sqlalchemy import func, select, text

from app.db.dialects.dialect import get_session_dialect
from app.db.log import LogModel, verify_chain
from app.db.store import Store
from app.errors import ConflictError, NotFoundError, StorageError
from app.features.batches.service import NewBatch, make_batch
from app.features.datasets import service as module
from app.features.datasets.service import delete_dataset, get_dataset, list_datasets, read_contents
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.replay import rebuild_tables, replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import UnassignedFrame, import_groups, import_unassigned_frames
from app.features.independent_annotations.service import submit_annotation
from app.features.people.access_tokens import AccessTokens
from app.features.people.logins import Login, LoginSessions, read_roles
from app.features.people.roles import DatasetRoles, Role, Scope
from app.features.people.service import give_role, invite
from app.features.queue.service import list_groups
from app.features.saved_views.service import save_view
from app.features.solutions.queries import CalibrationModel
from app.features.solutions.service import solve_dataset
from app.features.tables import Base
from app.features.verdicts.bulk import give_verdicts
from app.features.webhooks.queries import insert_webhook, read_webhooks
from app.features.what_if.service import WhatIfStore
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import Box
from app.soccer.policy import PAPER
from tests.unit.features.independent_annotations.begun import begin_take


@pytest.fixture
def two(store: Store, once, fill, make_group, make_static) -> Store:
    """The dataset "demo", to which much was done, and "other" with the same frames."""

    def make() -> None:
        ids = fill(make_group(7), make_group(8), make_static(10))
        state = load_group_state(store, ids[0])
        ball = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
        submit_edit(
            store, ids[0], make_set_ball_edit("7.png", ball), if_match=state.etag, actor="ann"
        )
        other_lines = replace(make_static(10).views[0].station, lines={})
        changed = make_static(10)
        changed = changed.with_view(replace(changed.views[0], station=other_lines))
        import_groups(
            store, "demo", [replace(make_group(7), label="new"), changed], source="b", actor="ann"
        )
        spare = [UnassignedFrame("cam1", "99", Extras(boxes=({"class": "Person"},)))]
        import_unassigned_frames(store, "demo", spare, source="spare", actor="ann")
        give_verdicts(store, 1, "", "deferred", actor="ben")
        save_view(store, 1, name="All", q="", actor="ben")
        import_groups(store, "other", [make_group(7), make_group(9)], source="test", actor="ann")
        solve_dataset(store, "other")

    once("demo and other", make)
    return store


def rows(store: Store, table: str) -> int:
    with store.read() as session:
        return session.execute(text(f'SELECT count(*) FROM "{table}"')).scalar_one()


def log_entries(store: Store) -> list[tuple[str, int | None]]:
    with store.read() as session:
        statement = select(LogModel.kind, LogModel.dataset_id).order_by(LogModel.id)
        return [tuple(row) for row in session.execute(statement)]


class TestReadContents:
    def test_counts_what_hangs_on_it(self, two: Store) -> None:
        contents = read_contents(two, "demo")
        assert (contents.id, contents.name) == (1, "demo")
        assert contents.counts["groups"] == contents.counts["verdicts"] == 3
        assert contents.counts["views"] == 7
        assert contents.counts["saved_views"] == 1

    def test_counts_work_in_progress_and_reports_it_when_it_is_deleted(self, two: Store) -> None:
        make_batch(two, "demo", NewBatch("open"), actor="lead")
        group = list_groups(two, 1).items[0].id
        submit_annotation(two, begin_take(two, group, person="ann").id, actor="ann")
        begin_take(two, group, person="ben")
        asked = read_contents(two, "demo")
        gone = delete_dataset(two, "demo", confirm="demo", actor="eve")
        for contents in (asked, gone):
            assert [contents.counts[name] for name in ("batches", "annotations")] == [1, 2]

    def test_an_unknown_dataset_is_not_found(self, store) -> None:
        with pytest.raises(NotFoundError):
            read_contents(store, "demo")


class TestDeleteDataset:
    def test_the_whole_dataset_goes_and_the_other_one_stays(self, two: Store) -> None:
        before = list_groups(two, 2, limit=500)
        contents = delete_dataset(two, "demo", confirm="demo", actor="eve")
        assert contents.counts["groups"] == 3
        assert [item.name for item in list_datasets(two)] == ["other"]
        assert list_groups(two, 2, limit=500) == before
        assert load_group_state(two, before.items[0].id).solution is not None
        with two.read() as session:
            assert get_session_dialect(session).count_lost_references(session) == 0
            for table in Base.metadata.sorted_tables:
                if "dataset_id" in table.c and table.name not in ("log", "job"):
                    owners = set(session.scalars(select(table.c.dataset_id)))
                    assert owners <= {2}, table.name

    def test_the_log_stays_whole_and_replays_to_what_is_left(self, two: Store) -> None:
        before = log_entries(two)
        delete_dataset(two, "demo", confirm="demo", actor="eve")
        assert log_entries(two) == [*before, ("dataset_deleted", 1)]
        with two.read() as session:
            assert verify_chain(session) == len(before) + 1
            assert replay_log(session) == read_state_snapshot(session)
        assert rebuild_tables(two) == []

    def test_no_id_is_given_again(self, two: Store, make_group) -> None:
        old = [row.id for row in list_groups(two, 2, limit=500).items]
        delete_dataset(two, "other", confirm="other", actor="eve")
        import_groups(two, "other", [make_group(7)], source="again", actor="ann")
        found = get_dataset(two, "other")
        assert found.id == 3
        (row,) = list_groups(two, 3).items
        assert row.id > max(old)
        with pytest.raises(NotFoundError):
            read_history(two, old[0])
        with pytest.raises(NotFoundError):
            load_group_state(two, old[0])
        with two.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_calibrations_that_the_other_dataset_uses_stay(self, two: Store) -> None:
        assert rows(two, "calibration") == 3
        delete_dataset(two, "demo", confirm="demo", actor="eve")
        with two.read() as session:
            left = session.scalar(select(func.count()).select_from(CalibrationModel))
        assert left == 2
        delete_dataset(two, "other", confirm="other", actor="eve")
        assert rows(two, "calibration") == rows(two, "solution") == 0

    def test_calibrations_stay_while_something_is_to_be_solved(self, two, make_group) -> None:
        import_groups(two, "third", [make_group(7)], source="test", actor="ann")
        before = rows(two, "calibration")
        delete_dataset(two, "demo", confirm="demo", actor="eve")
        assert rows(two, "calibration") == before
        assert solve_dataset(two, "third").solved == 1

    @pytest.mark.parametrize("confirm", ["", "Demo", "other", "1"])
    def test_without_typing_its_name_nothing_is_deleted(self, two: Store, confirm: str) -> None:
        with pytest.raises(ConflictError, match='which is "demo"'):
            delete_dataset(two, "demo", confirm=confirm, actor="eve")
        assert rows(two, "dataset") == 2
        assert rows(two, "solution") > 2

    def test_a_deletion_that_is_killed_midway_loses_nothing_that_people_said(
        self, two: Store, monkeypatch
    ) -> None:
        def killed(_session, _identity):
            raise KeyboardInterrupt

        monkeypatch.setattr(module.removal, "delete_dataset_rows", killed)
        with pytest.raises(KeyboardInterrupt):
            delete_dataset(two, "demo", confirm="demo", actor="eve")
        monkeypatch.undo()
        with two.read() as session:
            assert replay_log(session) == read_state_snapshot(session)
        solve_dataset(two, "demo")
        assert get_dataset(two, "demo").solved == 3
        delete_dataset(two, "demo", confirm="demo", actor="eve")
        assert rows(two, "groups") == 2

    def test_one_that_begins_afresh_keeps_who_may_what_in_it(self, two: Store) -> None:
        person, _ = invite(two, "zoe", Role.VIEWER, actor="eve")
        give_role(two, "demo", person.id, Role.NONE, actor="eve")
        seen = LoginSessions(two)._clock()
        zoe = Login(1, person.id, "zoe", DatasetRoles(Role.VIEWER), seen)
        AccessTokens(two).make(zoe, "demo alone", [Scope.READ], dataset_id=1)
        with two.write() as session:
            insert_webhook(session, 1, "https://a.example", ["ping"], salt="0" * 32, by="eve")
        delete_dataset(two, "demo", confirm="demo", actor="eve", afresh=PAPER)
        made = get_dataset(two, "demo")
        assert (made.id, made.groups) == (3, 0)
        with two.read() as session:
            assert [row.url for row in read_webhooks(session, made.id)] == ["https://a.example"]
        with two.read() as session:
            assert read_roles(session, person.id, Role.VIEWER).single == {3: Role.NONE}
            assert replay_log(session) == read_state_snapshot(session)
            assert get_session_dialect(session).count_lost_references(session) == 0
        assert [one.dataset for one in AccessTokens(two).list_of_person(person.id)] == ["demo"]

    def test_verdicts_can_be_deleted_only_with_their_dataset(self, two: Store) -> None:
        delete_dataset(two, "other", confirm="other", actor="eve")
        with pytest.raises(StorageError), two.write() as session:
            session.execute(text("DELETE FROM verdict"))
        assert rows(two, "verdict") == 3

    def test_its_yield_is_not_found_any_more(self, two: Store) -> None:
        yields = WhatIfStore(two)
        yields.get_snapshot(1)
        delete_dataset(two, "demo", confirm="demo", actor="eve")
        with pytest.raises(NotFoundError):
            yields.get_snapshot(1)
