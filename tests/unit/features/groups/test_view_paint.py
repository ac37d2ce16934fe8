"""Paint that follows: edits of lines read it again, within the edit."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest

from app.errors import OverloadedError
from app.features.groups.edit import SetLines, make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.replay import rebuild_tables, replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, solve_edited_group, submit_edit
from app.features.groups.undo import redo_group_edit, undo_group_edit
from app.features.groups.view_paint import PaintUpdater
from app.features.paint.service import undo_paint_reading
from app.features.policies.service import change_policy
from app.features.solutions.service import solve_dataset
from app.soccer.policy import PAPER
from app.worker_pool import PoolTask
from app.worker_process import WorkerEnded, WorkerLimits
from tests.unit.features.paint import test_service as test_paint
from tests.unit.features.paint.test_service import calibrations, kinds, scenes

here, looked = test_paint.here, test_paint.looked
painted, pictures = test_paint.painted, test_paint.pictures


class Frames:
    """In place of the processes that make pictures: the test reads them itself."""

    def __init__(self, settings, problem: Exception | None = None):
        self.settings, self.problem = settings, problem

    def request_work(self, _media, work, *arguments):
        if isinstance(self.problem, OverloadedError):
            raise self.problem
        task = PoolTask(lambda error: error)
        task.future = Future()
        if self.problem is not None:
            task.future.set_exception(self.problem)
        else:
            task.future.set_result(work(*arguments, self.settings))
        return task


@pytest.fixture
def paint(painted) -> PaintUpdater:
    return PaintUpdater(Frames(painted.settings))


def without_a_line(store, number=1):
    view = load_group_state(store, number).group.views[0]
    return SetLines(view.key, {next(iter(view.station.lines)): None})


def change(store, paint, edit, number=1):
    at = load_group_state(store, number)
    return submit_edit(store, number, edit, if_match=at.etag, actor="ann", paint=paint)


class TestFollow:
    def test_an_edit_of_lines_keeps_its_camera_on_the_paint(self, painted, paint, looked):
        after = change(painted, paint, without_a_line(painted))
        key = after.group.views[0].key
        assert looked == [key]
        first = after.solution.views[0].calibration
        assert (first.source, kinds(painted)) == ("paint", [])
        truth = scenes()[0].truth.view(key).camera
        assert np.linalg.norm(first.camera.position - truth.position) < 0.25
        assert [entry.kind for entry in read_history(painted, 1)][-2:] == ["edit", "paint"]
        assert load_group_state(painted, 1) == after

    def test_an_edit_of_a_ball_looks_at_no_picture(self, painted, paint, looked):
        view = load_group_state(painted, 1).group.views[0]
        change(painted, paint, make_set_ball_edit(view.key, None))
        assert looked == []
        assert [entry.kind for entry in read_history(painted, 1)][-1] == "edit"

    def test_undo_and_redo_take_it_along(self, painted, paint):
        before = calibrations(painted)
        changed = calibrations_of(change(painted, paint, without_a_line(painted)))
        state = load_group_state(painted, 1)
        back = undo_group_edit(painted, 1, if_match=state.etag, actor="ann", paint=paint)
        assert calibrations_of(back) == before
        again = redo_group_edit(painted, 1, if_match=back.etag, actor="ann", paint=paint)
        assert calibrations_of(again) == changed
        assert not again.can_redo and again.can_undo

    def test_a_preview_shows_what_saving_would(self, painted, paint):
        edit = without_a_line(painted)
        _, expected = solve_edited_group(painted, 1, lambda _group: [edit], paint)
        assert change(painted, paint, edit).solution == expected

    def test_the_log_tells_it_again(self, painted, paint):
        change(painted, paint, without_a_line(painted))
        with painted.read() as session:
            assert replay_log(session) == read_state_snapshot(session)
        before = load_group_state(painted, 1).stored
        rebuild_tables(painted)
        assert load_group_state(painted, 1).stored == before

    def test_taking_back_a_reading_takes_back_the_one_of_the_dataset(self, painted, paint):
        change(painted, paint, without_a_line(painted))
        with painted.write() as session:
            undo_paint_reading(session, "demo", actor="ann")
        solve_dataset(painted, "demo")
        assert {item.source for item in calibrations(painted)} == {"lines"}

    @pytest.mark.parametrize(
        "problem",
        [
            OverloadedError("too many"),
            WorkerEnded("memory", WorkerLimits(1, 1.0, 1.0)),
            TimeoutError(),
        ],
        ids=["too many wait", "its process ended", "it took too long"],
    )
    def test_where_no_frame_can_be_read_the_edit_is_saved_all_the_same(self, painted, problem):
        broken = PaintUpdater(Frames(painted.settings, problem))
        after = change(painted, broken, without_a_line(painted))
        assert after.solution.views[0].calibration.source == "lines"
        assert kinds(painted) == ["no_paint"]

    def test_what_the_policy_does_not_use_is_not_read(self, painted, paint, looked):
        change_policy(painted, "demo", PAPER, if_match=None, actor="ann")
        change(painted, paint, without_a_line(painted))
        assert looked == []

    def test_lines_that_make_no_camera_are_not_looked_for_again_and_again(
        self, painted, paint, monkeypatch
    ):
        view = load_group_state(painted, 1).group.views[0]
        gone = SetLines(view.key, dict.fromkeys([*view.station.lines][1:]))
        after = change(painted, paint, gone)
        assert after.solution.views[0].calibration.camera is None
        monkeypatch.setattr(
            Frames, "request_work", lambda *_: pytest.fail("a picture was asked for")
        )
        change(painted, paint, make_set_ball_edit(view.key, None))

    def test_a_view_that_gets_its_first_lines_is_read_with_the_others(
        self, painted, paint, monkeypatch
    ):
        view = load_group_state(painted, 1).group.views[0]
        state = load_group_state(painted, 1)
        paint_of = {key: item for key, item in state.group.paint.items() if key != view.key}
        bare = replace(state.group, paint=paint_of)
        policy = state.stored.policy.calibration
        assert set(paint.update_paint(bare, policy, {}).paint) == set(state.group.paint)
        monkeypatch.setattr(
            Frames, "request_work", lambda *_: pytest.fail("a picture was asked for")
        )
        without = bare.with_view(replace(view, media=None))
        assert paint.update_paint(without, policy, {}) is without

    def test_after_its_reading_was_taken_back_an_edit_reads_no_paint(self, painted, paint, looked):
        with painted.write() as session:
            undo_paint_reading(session, "demo", actor="ann")
        change(painted, paint, without_a_line(painted))
        assert looked == []


def calibrations_of(state):
    return [view.calibration for view in state.solution.views]
