from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import pytest
from sqlalchemy import text

from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.queue.service import list_groups
from app.features.solutions import service as module
from app.features.solutions.queries import EncodedSolution
from app.features.solutions.service import (
    find_contradicted_cameras,
    list_stale_groups,
    solve_and_encode,
    solve_dataset,
)
from app.soccer.annotation import make_lines
from app.soccer.group import Group, Station
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER, Policy
from app.soccer.solution import GAMMAS_PERCENT, Calibration, Solution
from app.solving.calibrate import calibrate_station
from app.solving.solve import solve_group
from tests.cameras import SIZE
from tests.unit.solving.conftest import MAIN, click


def stumbling(
    group: Group, policy: Policy, calibrations: Mapping[str, Calibration]
) -> tuple[Solution, EncodedSolution]:
    """A solver that one group breaks."""
    if group.key == "11":
        raise ZeroDivisionError("frame 11")
    return solve_and_encode(group, policy, calibrations)


@pytest.fixture
def ids(fill, make_static) -> list[int]:
    return fill(*(make_static(frame) for frame in range(10, 16)), solved=False)


@pytest.fixture
def small_chunks(monkeypatch) -> None:
    monkeypatch.setattr("app.features.solutions.service.CHUNK", 2)


class TestSolveDataset:
    def test_solves_what_is_stale_as_the_solver_does(self, store, ids) -> None:
        assert list_stale_groups(store, "demo") == ids
        report = solve_dataset(store, "demo")
        assert (report.total, report.solved, report.passed) == (6, 6, 6)
        state = load_group_state(store, ids[3])
        assert state.solution == solve_group(state.group, state.policy)
        assert list_stale_groups(store, "demo") == []
        assert solve_dataset(store, "demo").total == 0

    def test_only_what_changed_is_solved_again(self, store, ids) -> None:
        solve_dataset(store, "demo")
        state = load_group_state(store, ids[2])
        submit_edit(
            store, ids[2], make_set_ball_edit("cam1", None), if_match=state.etag, actor="ann"
        )
        assert list_stale_groups(store, "demo") == []

    def test_an_executor_makes_the_same(self, store, ids, small_chunks) -> None:
        with ThreadPoolExecutor(2) as executor:
            report = solve_dataset(store, "demo", executor)
        assert report.solved == 6
        state = load_group_state(store, ids[5])
        assert state.solution == solve_group(state.group, state.policy)

    def test_tasks_and_results_travel_to_other_processes(self, store, ids) -> None:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
            assert solve_dataset(store, "demo", executor).solved == 6
        state = load_group_state(store, ids[5])
        assert state.solution == solve_group(state.group, state.policy)

    def test_progress_starts_at_nothing_and_ends_at_all(self, store, ids, small_chunks) -> None:
        calls: list[tuple[int, int]] = []
        solve_dataset(store, "demo", None, lambda done, total: calls.append((done, total)))
        assert calls == [(0, 6), (2, 6), (4, 6), (6, 6)]

    def test_a_run_that_was_killed_goes_on_where_it_ended(self, store, ids, small_chunks) -> None:
        def kill(done: int, _total: int) -> None:
            if done == 4:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            solve_dataset(store, "demo", None, kill)
        assert list_stale_groups(store, "demo") == ids[4:]
        assert solve_dataset(store, "demo").solved == 2

    def test_a_run_that_is_told_to_stop_keeps_what_is_done(self, store, ids, small_chunks) -> None:
        asked = iter([False, False, True])
        report = solve_dataset(store, "demo", stop=lambda: next(asked, True))
        assert (report.total, report.solved) == (6, 4)
        assert list_stale_groups(store, "demo") == ids[4:]

    def test_a_group_that_breaks_the_solver_stops_no_other(self, store, ids, monkeypatch) -> None:
        monkeypatch.setattr(module, "solve_and_encode", stumbling)
        report = solve_dataset(store, "demo")
        assert report.solved == 5
        assert report.failed == [("11", "ZeroDivisionError: frame 11")]
        assert list_stale_groups(store, "demo") == [ids[1]]

    def test_static_cameras_are_calibrated_once(self, store, ids, monkeypatch) -> None:
        def refuse(*_):
            raise AssertionError("calibrated in a task")

        monkeypatch.setattr("app.solving.solve.calibrate_view", refuse)
        assert solve_dataset(store, "demo").failed == []
        with store.read() as session:
            count = session.execute(text("SELECT count(*) FROM calibration")).scalar_one()
        assert count == 3

    def test_a_change_under_way_leaves_the_group_stale(self, store, ids, monkeypatch) -> None:
        def change(group, policy, calibrations):
            if group.key == "12":
                state = load_group_state(store, ids[2])
                edit = make_set_ball_edit("cam1", None)
                if state.revision == 1:
                    submit_edit(store, ids[2], edit, if_match=state.etag, actor="ann")
            return solve_and_encode(group, policy, calibrations)

        monkeypatch.setattr(module, "solve_and_encode", change)
        solve_dataset(store, "demo")
        state = load_group_state(store, ids[2])
        assert state.solution == solve_group(state.group, state.policy)
        (row,) = list_groups(store, state.dataset_id, "key:12").items
        assert row.solved


class TestContradictedCameras:
    @pytest.fixture
    def station(self) -> Station:
        """A static camera whose lines lie 9 px below the given camera's: 0.61 % of the diagonal."""
        moved = {name: [(x, y + 9.0) for x, y in points] for name, points in click(MAIN).items()}
        return Station(
            "cam1", SIZE, shared=True, lines=make_lines(moved), given=MAIN, calibration="given"
        )

    @pytest.mark.parametrize("gamma", GAMMAS_PERCENT)
    def test_jac_is_that_of_the_calibration(self, station: Station, gamma: float) -> None:
        policy = replace(PAPER, jac_gamma_percent=gamma, min_jac=1.0)
        jac = calibrate_station(station, Pitch(), policy.calibration).jac
        assert jac is not None
        found = find_contradicted_cameras([(station, Pitch())], policy)
        assert found == {"cam1": jac[GAMMAS_PERCENT.index(gamma)]}

    @pytest.mark.parametrize(("gamma", "named"), [(0.5, 1), (0.55, 1), (0.75, 0), (5.0, 0)])
    def test_gamma_may_be_any_that_a_policy_has(
        self, station: Station, gamma: float, named: int
    ) -> None:
        policy = replace(PAPER, jac_gamma_percent=gamma, min_jac=0.3)
        assert len(find_contradicted_cameras([(station, Pitch())], policy)) == named
