"""Solving as a job: what a change left without a solution, found in the data."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from app.db.store import Store
from app.features.datasets.service import get_dataset
from app.features.imports.ingest import ensure_dataset
from app.features.jobs.job_run import JobProgress
from app.features.jobs.service import Jobs
from app.features.solutions.service import SolveReport, list_stale_groups
from app.features.solve import jobs as full_solve
from app.features.solve import jobs as solve_job
from app.features.solve.jobs import (
    register_solve_resume,
    request_solve_job,
    request_solve_of_leftovers,
)
from tests.waiting import SECONDS


@pytest.fixture
def jobs(store: Store) -> Iterator[Jobs]:
    jobs = Jobs(store)
    yield jobs
    jobs.close()


class TestRequestSolve:
    def test_solves_what_is_stale_and_says_how_much(
        self, jobs: Jobs, store: Store, fill, make_group
    ) -> None:
        fill(make_group(7), make_group(8, shift=300.0), solved=False)
        found = get_dataset(store, "demo")
        job = request_solve_job(jobs, store, found.id, actor="ann")
        assert (job.kind, job.dataset, job.result) == ("solve", "demo", None)
        done = jobs.wait(job.id, SECONDS)
        assert done.result == {
            "policy": "paper",
            "groups": 2,
            "solved": 2,
            "passed": 1,
            "failed": 0,
            "failures": [],
            "estimated": 1,
            "proposed": 0,
            "failing": {"reprojection": 1},
            "advice": "",
        }
        assert (done.done, done.total) == (2, 2)
        assert done.sentence == (
            "2 groups solved: 1 pass, 1 do not (first failing gate: reprojection 1); 0 errors. The "
            "pitch of 1 match was estimated: no other size is proposed."
        )
        assert list_stale_groups(store, "demo") == []

    @pytest.mark.parametrize(
        ("edited", "solved", "follows"),
        [(False, True, True), (True, True, False), (True, False, True)],
        ids=["asked for", "after an edit", "after an edit that met another policy"],
    )
    def test_an_edit_estimates_no_noise(
        self,
        jobs: Jobs,
        store: Store,
        fill,
        make_group,
        monkeypatch: pytest.MonkeyPatch,
        edited: bool,
        solved: bool,
        follows: bool,
    ) -> None:
        asked: list[bool] = []

        def solve(*_: object, follow: bool, **__: object) -> SolveReport:
            asked.append(follow)
            return SolveReport()

        monkeypatch.setattr(solve_job, "solve_fully", solve)
        fill(make_group(7), make_group(8), solved=solved)
        found = get_dataset(store, "demo")
        job = request_solve_job(jobs, store, found.id, actor="ann", edited=edited)
        jobs.wait(job.id, SECONDS)
        assert asked == [follows]

    @pytest.mark.parametrize(("worth", "made"), [(2, 1), (3, 0)])
    def test_many_matches_are_estimated_in_processes_of_their_own(
        self, store: Store, fill, make_group, monkeypatch: pytest.MonkeyPatch, worth, made
    ) -> None:
        pools: list[ThreadPoolExecutor] = []

        def pool() -> ThreadPoolExecutor:
            pools.append(ThreadPoolExecutor(1))
            return pools[-1]

        monkeypatch.setattr(solve_job, "MATCHES_WORTH_A_POOL", worth)
        fill(*(replace(make_group(number), match=f"{number}") for number in (7, 8)), solved=True)
        jobs = Jobs(store, pool=pool)
        job = request_solve_job(jobs, store, get_dataset(store, "demo").id, actor="ann")
        jobs.wait(job.id, SECONDS)
        assert len(pools) == made
        jobs.close()

    @pytest.mark.parametrize(("worth", "made"), [(2, 1), (3, 0)])
    def test_many_groups_are_solved_in_processes_of_their_own(
        self, store: Store, fill, make_group, monkeypatch: pytest.MonkeyPatch, worth, made
    ) -> None:
        pools: list[ThreadPoolExecutor] = []

        def pool() -> ThreadPoolExecutor:
            pools.append(ThreadPoolExecutor(1))
            return pools[-1]

        monkeypatch.setattr(solve_job, "WORTH_A_POOL", worth)
        fill(make_group(7), make_group(8), solved=False)
        jobs = Jobs(store, pool=pool)
        job = request_solve_job(jobs, store, get_dataset(store, "demo").id, actor="ann")
        assert jobs.wait(job.id, SECONDS).result["solved"] == 2
        assert len(pools) == made
        jobs.close()

    def test_groups_that_cannot_be_solved_are_named(
        self, jobs: Jobs, store: Store, fill, make_group, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fill(make_group(), solved=False)
        report = SolveReport(total=1, failed=[("a/7.png", "ValueError: odd")])
        monkeypatch.setattr(full_solve, "solve_dataset", lambda *_, **__: report)
        job = request_solve_job(jobs, store, get_dataset(store, "demo").id, actor="ann")
        result = jobs.wait(job.id, SECONDS).result
        assert result["failures"] == [{"group": "a/7.png", "problem": "ValueError: odd"}]

    def test_one_job_a_dataset_waits_at_most(self, jobs: Jobs, store: Store) -> None:
        ensure_dataset(store, "demo", "ann")
        started, finish = threading.Event(), threading.Event()

        def slow(progress: JobProgress) -> None:
            started.set()
            assert finish.wait(SECONDS)

        jobs.submit("bulk", "Slow", slow, actor="ann")
        assert started.wait(SECONDS)
        found = get_dataset(store, "demo")
        ids = {request_solve_job(jobs, store, found.id, actor=name).id for name in ("ann", "bob")}
        assert len(ids) == 1
        finish.set()


class TestSolveLeftovers:
    def test_a_restart_goes_on_where_the_server_stopped(
        self, store: Store, fill, make_group, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fill(*(make_group(number) for number in range(1, 6)), solved=False)
        monkeypatch.setattr("app.features.solutions.service.CHUNK", 1)
        started = threading.Event()

        def stopping(
            _store: Store, _id: int, _executor: None, progress: JobProgress, _stop: object
        ) -> SolveReport:
            started.set()
            while True:
                progress(0, 5)

        first = Jobs(store)
        with monkeypatch.context() as patch:
            patch.setattr(full_solve, "solve_dataset", stopping)
            job = request_solve_job(first, store, get_dataset(store, "demo").id, actor="ann")
            assert started.wait(SECONDS)
            first.close()
        second = Jobs(store)
        register_solve_resume(second, store)
        second.start()
        request_solve_of_leftovers(second, store, actor="ann")
        done = second.wait(job.id, SECONDS)
        assert (done.state, done.result["solved"]) == ("done", 5)
        assert list_stale_groups(store, "demo") == []
        second.close()

    def test_a_dataset_that_is_complete_needs_no_job(self, jobs: Jobs, store: Store, state) -> None:
        request_solve_of_leftovers(jobs, store, actor="ann")
        assert jobs.find() == []

    def test_what_an_earlier_solver_solved_is_solved_at_the_start(
        self, jobs: Jobs, store: Store, state, upgrade_solver
    ) -> None:
        upgrade_solver()
        jobs.start()
        request_solve_of_leftovers(jobs, store, actor="ann")
        (job,) = jobs.find()
        assert jobs.wait(job.id, SECONDS).result["solved"] == 1
        assert list_stale_groups(store, "demo") == []
