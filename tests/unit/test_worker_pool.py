"""A pool has a few workers, and a bound on what waits for them."""

from __future__ import annotations

import asyncio
import gc
import os
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from pathlib import Path

import pytest

from app.errors import ImageError, OverloadedError
from app.worker_pool import PoolTask, WorkerPool
from app.worker_process import WorkerCounts, WorkerEnded, WorkerLimits

LIMITS = WorkerLimits(memory=1000 * 2**20, processor=60.0, silence=60.0)


@pytest.fixture
def counts() -> WorkerCounts:
    return WorkerCounts()


@pytest.fixture
def pool(counts: WorkerCounts) -> Iterator[WorkerPool]:
    made = WorkerPool(LIMITS, 1, 2, "pictures", counts)
    yield made
    made.close()


class Gate:
    """Holds a worker until it is opened."""

    def __init__(self, folder: Path):
        self.reached, self.open = folder / "reached", folder / "open"

    def wait_until_reached(self) -> None:
        until = time.monotonic() + 60
        while not self.reached.exists() and time.monotonic() < until:
            time.sleep(0.01)
        assert self.reached.exists()


def pass_gate(gate: Gate, name: str) -> str:
    gate.reached.write_text(name)
    while not gate.open.exists():
        time.sleep(0.01)
    return name


def note(folder: Path, name: str) -> None:
    (folder / name).write_text("done")


def submit_many(pool: WorkerPool, folder: Path) -> list[PoolTask]:
    return [pool.submit(note, folder, "late") for _ in range(20)]


class TestSubmit:
    def test_one_worker_does_one_task_after_the_other(self, pool: WorkerPool) -> None:
        tasks = [pool.submit(os.getpid) for _ in range(3)]
        pids = {task.future.result(60) for task in tasks}
        assert len(pids) == 1
        assert pids != {os.getpid()}

    def test_more_than_may_wait_are_refused_and_later_taken(
        self, pool: WorkerPool, tmp_path: Path
    ) -> None:
        gate = Gate(tmp_path)
        tasks = [pool.submit(pass_gate, gate, "a") for _ in range(3)]
        with pytest.raises(OverloadedError, match="3 requests for pictures already run or wait"):
            pool.submit(pass_gate, gate, "b")
        patient = pool.submit(pass_gate, gate, "c", bounded=False)
        gate.open.touch()
        assert [task.future.result(60) for task in (*tasks, patient)] == ["a", "a", "a", "c"]
        assert pool.submit(pass_gate, gate, "d").future.result(60) == "d"

    def test_what_nobody_waits_for_is_not_begun(self, pool: WorkerPool, tmp_path: Path) -> None:
        gate = Gate(tmp_path)
        first = pool.submit(pass_gate, gate, "a")
        gate.wait_until_reached()
        left = pool.submit(note, tmp_path, "left")
        last = pool.submit(note, tmp_path, "last")
        left.abandon()
        gate.open.touch()
        first.future.result(60)
        last.future.result(60)
        assert not (tmp_path / "left").exists()
        with pytest.raises(CancelledError):
            left.future.result(60)
        assert (tmp_path / "last").exists()

    def test_what_nobody_waits_for_any_more_is_ended(
        self, pool: WorkerPool, tmp_path: Path
    ) -> None:
        task = pool.submit(pass_gate, Gate(tmp_path), "a")
        Gate(tmp_path).wait_until_reached()
        task.abandon()
        with pytest.raises(CancelledError):
            task.future.result(60)
        assert pool.submit(os.getpid).future.result(60) != os.getpid()

    def test_what_has_become_needless_until_its_turn_is_not_begun(
        self, pool: WorkerPool, tmp_path: Path
    ) -> None:
        def begin() -> None:
            raise ImageError("tried before")

        task = pool.submit(note, tmp_path, "late", begin=begin)
        with pytest.raises(ImageError, match="tried before"):
            task.future.result(60)
        assert not (tmp_path / "late").exists()
        assert not pool.has_all_processes

    def test_a_worker_that_ends_is_explained_and_replaced(self, pool: WorkerPool) -> None:
        def explain(error: WorkerEnded) -> Exception:
            return ImageError(f"7.png {error}")

        task = pool.submit(os.abort, explain=explain)
        with pytest.raises(ImageError, match=r"^7\.png made its process crash$"):
            task.future.result(60)
        assert pool.submit(os.getpid).future.result(60) != os.getpid()


class TestResultUnless:
    def test_is_the_result_while_somebody_waits(self, pool: WorkerPool) -> None:
        async def here() -> bool:
            return False

        async def ask() -> int:
            return await pool.submit(os.getpid).result_unless_client_gone(here)

        assert asyncio.run(ask()) != os.getpid()

    def test_a_task_that_nobody_waits_for_is_given_up(self) -> None:
        async def gone() -> bool:
            return True

        task = PoolTask(lambda error: error)
        assert asyncio.run(task.result_unless_client_gone(gone)) is None
        assert task.future.cancelled()

    def test_nothing_is_told_of_the_end_of_a_task_that_was_given_up(
        self, caplog: pytest.LogCaptureFixture
    ) -> None:
        async def gone() -> bool:
            return True

        async def ask() -> None:
            task = PoolTask(lambda error: error)
            # It runs: its worker is killed later, which ends it with an error.
            assert task.future.set_running_or_notify_cancel()
            assert await task.result_unless_client_gone(gone) is None
            task.future.set_exception(CancelledError())
            await asyncio.sleep(0)
            gc.collect()
            await asyncio.sleep(0)

        asyncio.run(ask())
        gc.collect()
        assert caplog.records == []


class TestCounts:
    def test_who_is_at_work_and_who_waits_is_counted(
        self, pool: WorkerPool, counts: WorkerCounts, tmp_path: Path
    ) -> None:
        gate = Gate(tmp_path)
        tasks = [pool.submit(pass_gate, gate, "a") for _ in range(3)]
        with pytest.raises(OverloadedError):
            pool.submit(pass_gate, gate, "b")
        gate.wait_until_reached()
        assert (counts.busy, counts.waiting) == (1, 2)
        for _ in range(2):
            tasks[1].abandon()
        assert (counts.busy, counts.waiting) == (1, 1)
        gate.open.touch()
        assert [tasks[number].future.result(60) for number in (0, 2)] == ["a", "a"]
        assert (counts.busy, counts.waiting) == (0, 0)

    def test_a_worker_that_ends_is_counted_before_anybody_hears_of_it(
        self, pool: WorkerPool, counts: WorkerCounts
    ) -> None:
        with pytest.raises(WorkerEnded):
            pool.submit(os.abort).future.result(60)
        assert (counts.busy, counts.waiting, counts.ended["crash"]) == (0, 0, 1)

    def test_one_that_was_ended_because_nobody_waits_is_not(
        self, pool: WorkerPool, counts: WorkerCounts, tmp_path: Path
    ) -> None:
        task = pool.submit(pass_gate, Gate(tmp_path), "a")
        Gate(tmp_path).wait_until_reached()
        task.abandon()
        with pytest.raises(CancelledError):
            task.future.result(60)
        assert (counts.busy, counts.waiting) == (0, 0)
        assert set(counts.ended.values()) == {0}


class TestClose:
    def test_ends_what_runs_and_what_waits(self, pool: WorkerPool, tmp_path: Path) -> None:
        running = pool.submit(pass_gate, Gate(tmp_path), "a")
        waiting = pool.submit(note, tmp_path, "b")
        Gate(tmp_path).wait_until_reached()
        pool.close()
        for task in (running, waiting):
            with pytest.raises((WorkerEnded, CancelledError)):
                task.future.result(0)

    def test_what_comes_later_is_not_begun(
        self, pool: WorkerPool, counts: WorkerCounts, tmp_path: Path
    ) -> None:
        pool.close()
        late = pool.submit(note, tmp_path, "late")
        with pytest.raises(CancelledError):
            late.future.result(0)
        assert (pool.tasks, counts.waiting) == (0, 0)
        assert not (tmp_path / "late").exists()

    def test_what_comes_at_the_same_moment_has_its_end_too(
        self, counts: WorkerCounts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.worker_pool.ABANDONED_SECONDS", 0.0)
        for _ in range(5):
            pool = WorkerPool(LIMITS, 1, 1000, "pictures", counts)
            with ThreadPoolExecutor(4) as threads:
                begun = [threads.submit(submit_many, pool, tmp_path) for _ in range(3)]
                pool.close()
            for task in (task for submitted in begun for task in submitted.result()):
                assert task.future.done()
            assert (pool.tasks, counts.waiting) == (0, 0)
