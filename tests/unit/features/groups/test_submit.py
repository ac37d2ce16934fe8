from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from typing import Any

import pytest
from sqlalchemy import text

from app.db.store import Store
from app.errors import (
    NotFoundError,
    SharedStationError,
    StaleRevisionError,
    StorageError,
)
from app.features.groups import state as state_module
from app.features.groups.edit import (
    SetBalls,
    SetLines,
    SetPictureGeometry,
    SetViewInclusion,
    make_set_ball_edit,
)
from app.features.groups.history import read_history
from app.features.groups.state import GroupState
from app.features.groups.submit import (
    load_group_state,
    solve_and_store_group,
    solve_edited_group,
    submit_edit,
)
from app.features.groups.undo import undo_group_edit
from app.features.policies.service import change_policy
from app.features.queue.service import list_groups
from app.features.solutions import queries as solutions
from app.features.solutions.service import solve_and_encode
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group
from app.soccer.picture import OPEN
from app.soccer.policy import STRICT
from app.solving.solve import solve_group
from tests.databases import said_for_sqlite

BALL = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
HERE = (ImagePoint(1.5, 2.5), ImagePoint(3.0, 4.0))


Counted = Callable[[Store], AbstractContextManager[Any]]
Fill = Callable[..., list[int]]


def change(store, state, edit, **more):
    return submit_edit(store, state.id, edit, if_match=state.etag, actor="ann", **more)


def four_views(make_group) -> Group:
    """One group of the views of two."""
    one, other = make_group(7), make_group(8)
    return replace(one, views=(*one.views, *other.views))


def count(store: Store, table: str) -> int:
    with store.read() as session:
        return session.execute(text(f"SELECT count(*) FROM {table}")).scalar_one()


class TestLoad:
    def test_an_unknown_group_is_not_found(self, store) -> None:
        with pytest.raises(NotFoundError, match="no group 99"):
            load_group_state(store, 99)

    def test_the_solution_is_the_solvers_to_the_last_bit(self, state) -> None:
        assert state.solution == solve_group(state.group, state.policy)
        assert state.solution.passes


class TestSubmit:
    def test_answers_with_the_group_as_it_is_then_solved(self, store, state) -> None:
        after = change(store, state, make_set_ball_edit("7.png", BALL))
        assert after.group.view("7.png").balls == (BALL,)
        assert after.revision == state.revision + 1
        assert after.etag != state.etag
        assert after.solution == solve_group(after.group, after.policy)
        assert after.solution != state.solution
        assert load_group_state(store, state.id) == after

    @pytest.mark.parametrize("step", ["INSERT ON log", "INSERT ON solution", "UPDATE ON queue"])
    def test_edit_revision_solution_and_log_are_one_transaction(self, store, state, step) -> None:
        """Whichever of its writes fails, the others have not happened."""
        before = {name: count(store, name) for name in ("log", "solution", "calibration")}
        with store.write() as session, said_for_sqlite(session):
            session.execute(
                text(f"CREATE TRIGGER spoils BEFORE {step} BEGIN SELECT RAISE(ABORT, 'full'); END")
            )
        with pytest.raises(StorageError, match="could not carry out"):
            change(store, state, make_set_ball_edit("7.png", BALL))
        assert load_group_state(store, state.id) == state
        assert {name: count(store, name) for name in before} == before

    def test_an_older_state_is_refused_with_both_etags(self, store, state) -> None:
        after = change(store, state, make_set_ball_edit("7.png", BALL))
        with pytest.raises(StaleRevisionError) as caught:
            change(store, state, make_set_ball_edit("7.png", None))
        assert caught.value.base_etag == state.etag
        assert caught.value.current_etag == after.etag
        assert load_group_state(store, state.id) == after

    def test_a_change_during_the_solve_is_seen_before_saving(self, store, state) -> None:
        def slow(group, policy, calibrations):
            change(store, load_group_state(store, state.id), SetViewInclusion("7_1.png", False))
            return solve_and_encode(group, policy, calibrations)

        with pytest.raises(StaleRevisionError):
            change(store, state, make_set_ball_edit("7.png", BALL), solve=slow)
        after = load_group_state(store, state.id)
        assert after.group.view("7.png") == state.group.view("7.png")
        assert not after.group.view("7_1.png").included

    def test_another_policy_during_the_solve_judges_the_edit(self, store, state) -> None:
        def slow(group, policy, calibrations):
            if policy != STRICT:
                change_policy(store, state.dataset_id, STRICT, if_match=None, actor="ann")
            return solve_and_encode(group, policy, calibrations)

        after = change(store, state, make_set_ball_edit("7.png", BALL), solve=slow)
        assert after.policy == STRICT
        assert after.solution == solve_group(after.group, STRICT)
        assert load_group_state(store, state.id) == after
        assert [item.kind for item in read_history(store, state.id)] == ["import", "edit"]

    def test_of_many_at_once_one_wins_and_nothing_is_mixed(self, store, state) -> None:
        results: list[object] = []

        def work(number: int) -> None:
            ball = BallAnnotation(box=Box(number, 300.0, 14.0, 14.0))
            try:
                results.append(change(store, state, make_set_ball_edit("7.png", ball)))
            except StaleRevisionError as error:
                results.append(error)

        threads = [threading.Thread(target=work, args=(number,)) for number in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        winners = [item for item in results if not isinstance(item, StaleRevisionError)]
        assert len(results) == 6
        assert len(winners) == 1
        assert load_group_state(store, state.id).group == winners[0].group
        assert len(read_history(store, state.id)) == 2

    def test_two_views_of_one_group_at_once_are_a_conflict_too(self, store, state) -> None:
        change(store, state, make_set_ball_edit("7.png", BALL))
        with pytest.raises(StaleRevisionError):
            change(store, state, make_set_ball_edit("7_1.png", BALL))

    def test_a_solution_that_arrives_is_no_conflict(self, store, fill, make_group) -> None:
        unsolved = load_group_state(store, fill(make_group(), solved=False)[0])
        with_solution = solve_and_store_group(store, unsolved.id)
        assert with_solution.etag != unsolved.etag
        after = change(store, unsolved, make_set_ball_edit("7.png", BALL))
        assert after.group.view("7.png").balls == (BALL,)

    def test_what_changes_nothing_makes_no_revision(self, store, state) -> None:
        same = SetBalls("7.png", state.group.view("7.png").balls)
        assert change(store, state, same) == state
        assert len(read_history(store, state.id)) == 1

    def test_lines_of_a_shared_station_name_the_station(self, store, fill, make_static) -> None:
        state = load_group_state(store, fill(make_static())[0])
        with pytest.raises(SharedStationError) as caught:
            change(store, state, SetLines("cam1", {"Middle line": HERE}))
        assert caught.value.station == state.station_ids["cam1"]
        after = change(store, state, make_set_ball_edit("cam1", None))
        assert after.group.view("cam1").balls == ()

    def test_the_picture_of_a_shared_station_is_as_it_was_taken(
        self, store, fill, make_static
    ) -> None:
        state = load_group_state(store, fill(make_static())[0])
        with pytest.raises(
            SharedStationError, match="picture geometry of view cam1 cannot be set"
        ) as caught:
            change(store, state, SetPictureGeometry("cam1", OPEN))
        assert "given camera" in str(caught.value.hint)
        with pytest.raises(SharedStationError, match="picture geometry of view cam1 cannot be set"):
            solve_edited_group(store, state.id, lambda _group: [SetPictureGeometry("cam1", OPEN)])

    def test_a_moved_ball_calibrates_nothing(self, store, state, monkeypatch) -> None:
        def refuse(*_):
            raise AssertionError("calibrated again")

        monkeypatch.setattr("app.solving.solve.calibrate_view", refuse)
        after = change(store, state, make_set_ball_edit("7.png", BALL))
        undo_group_edit(store, state.id, if_match=after.etag, actor="ann")

    def test_the_queue_is_in_step(self, store, state) -> None:
        after = change(store, state, make_set_ball_edit("7.png", None))
        (row,) = list_groups(store, state.dataset_id).items
        assert row.passes is False
        assert row.gate == after.solution.first_failing.name == "ball"
        assert row.solved


class TestPreview:
    def test_is_what_a_save_would_give_and_saves_nothing(self, store, state) -> None:
        edits = [make_set_ball_edit("7.png", BALL), SetLines("7_1.png", {"Middle line": None})]
        _, solution = solve_edited_group(store, state.id, lambda _: edits)
        assert load_group_state(store, state.id) == state
        after = state
        for edit in edits:
            after = change(store, after, edit)
        assert after.solution == solution

    def test_a_shared_station_may_move_in_it(self, store, fill, make_static) -> None:
        (group_id,) = fill(make_static())
        _, solution = solve_edited_group(
            store, group_id, lambda _: [SetLines("cam1", {"Middle line": None})]
        )
        markings = {item.marking: item.outcome for item in solution.views[0].calibration.markings}
        assert markings["Middle line"] == "fp"


class TestHistory:
    def test_an_unknown_group_is_not_found(self, store) -> None:
        with pytest.raises(NotFoundError):
            read_history(store, 99)


class TestCost:
    def test_an_edit_decodes_no_stored_solution_and_answers_what_a_reader_gets(
        self, store: Store, state: GroupState, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        decoded: list[object] = []
        plain = solutions.attach_calibrations

        def counted(*arguments):
            decoded.append(arguments)
            return plain(*arguments)

        monkeypatch.setattr(solutions, "attach_calibrations", counted)
        edit = make_set_ball_edit("7.png", None)
        done = submit_edit(store, state.id, edit, if_match=state.etag, actor="ann")
        assert decoded == []
        read = load_group_state(store, state.id)
        assert len(decoded) == 1
        assert (done.etag, done.revision, done.can_undo) == (read.etag, read.revision, True)
        assert done.solution is not None
        assert done.solution.gates == read.solution.gates
        assert done.solution.findings == read.solution.findings
        assert done.group == read.group

    @pytest.mark.parametrize(
        ("edit", "statements"),
        [
            (make_set_ball_edit("7.png", BALL), 13),
            (SetLines("7.png", {"Middle line": None}), 14),
            (SetViewInclusion("8.png", False), 13),
        ],
    )
    def test_an_edit_of_four_views_is_one_read_and_one_durable_commit(
        self, store: Store, fill: Fill, make_group, counted: Counted, edit, statements: int
    ) -> None:
        state = load_group_state(store, fill(four_views(make_group))[0])
        with counted(store) as cost:
            change(store, state, edit)
        assert (cost.reads, cost.writes, cost.commits) == (1, 1, 1)
        assert cost.statements <= statements

    def test_an_undo_reads_one_entry_more(
        self, store: Store, state: GroupState, counted: Counted
    ) -> None:
        after = change(store, state, make_set_ball_edit("7.png", BALL))
        with counted(store) as cost:
            undo_group_edit(store, state.id, if_match=after.etag, actor="ann")
        assert (cost.reads, cost.writes, cost.commits) == (1, 1, 1)
        assert cost.statements <= 14

    def test_a_preview_reads_the_group_once_and_no_solution(
        self, store: Store, state: GroupState, counted: Counted
    ) -> None:
        with counted(store) as cost:
            solve_edited_group(store, state.id, lambda _: [make_set_ball_edit("7.png", BALL)])
        assert (cost.reads, cost.writes) == (1, 0)
        assert cost.statements <= 2

    def test_while_others_wait_no_group_is_decoded(
        self, store: Store, state: GroupState, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        writing, seen = [], []
        plain_write, plain_read = Store.write, state_module.read_groups

        @contextmanager
        def write(self):
            with plain_write(self) as session:
                writing.append(session)
                yield session
                writing.remove(session)

        def read_groups(session, ids, **options):
            seen.append(session in writing)
            return plain_read(session, ids, **options)

        monkeypatch.setattr(Store, "write", write)
        monkeypatch.setattr(state_module, "read_groups", read_groups)
        submit_edit(
            store, state.id, make_set_ball_edit("7.png", None), if_match=state.etag, actor="ann"
        )
        assert seen == [False]
