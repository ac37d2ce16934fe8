"""A worker process does what it is told, within its limits, and takes nobody with it."""

from __future__ import annotations

import errno
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context, resource_tracker
from multiprocessing.context import SpawnProcess
from multiprocessing.resource_tracker import ResourceTracker
from pathlib import Path
from typing import get_args

import pytest

from app.errors import (
    DatasetFormatError,
    JobCancelled,
    OverloadedError,
    StaleRevisionError,
    StorageError,
)
from app.worker_process import (
    EndReason,
    WorkerCounts,
    WorkerEnded,
    WorkerLimits,
    WorkerProcess,
    kill_executor,
)
from tests.waiting import SECONDS

pytestmark = pytest.mark.usefixtures("workers_start_anew")

MEBI = 2**20
ENDLESS = re.compile(r"(a+)+$"), "a" * 60 + "b"
"""A pattern that never comes to an end, and never lets another thread of its process run."""


def worker_pid() -> int:
    return os.getpid()


def take(bytes_: int) -> int:
    return len(bytearray(bytes_))


def never_end(*_: object) -> None:
    ENDLESS[0].match(ENDLESS[1])


def be_killed() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def be_told_to_end() -> None:
    os.kill(os.getpid(), signal.SIGTERM)


def be_killed_at_start(*_: object) -> None:
    be_killed()


def crash() -> None:
    os.abort()


def refuse() -> None:
    raise DatasetFormatError("a.json", "7.png", "x", "is no number")


def find_the_disk_full() -> None:
    try:
        raise OSError(errno.ENOSPC, "No space left on device")
    except OSError as error:
        raise StorageError("the disk is full", hint="Free some.") from error


def find_it_changed() -> None:
    raise StaleRevisionError("somebody was faster", base_etag="a", current_etag="b")


def fail() -> None:
    raise KeyError("a fault of ours")


def count(last: int, tell: Callable[[int], None]) -> str:
    for number in range(last):
        tell(number)
    return "done"


@pytest.fixture(scope="module")
def worker() -> Iterator[WorkerProcess]:
    made = WorkerProcess(WorkerLimits(memory=300 * MEBI, processor=1.0, silence=60.0))
    yield made
    made.close()


def is_alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def wait_for_end(pid: int) -> bool:
    until = time.monotonic() + SECONDS
    while is_alive(pid) and time.monotonic() < until:
        time.sleep(0.01)
    return not is_alive(pid)


class TestRun:
    def test_works_in_another_process_that_stays_warm(self, worker: WorkerProcess) -> None:
        first = worker.run(worker_pid)
        assert first != os.getpid()
        assert worker.run(worker_pid) == first

    def test_words_are_heard_in_their_order(self, worker: WorkerProcess) -> None:
        heard: list[int] = []
        assert worker.run(count, 5, on_message=heard.append) == "done"
        assert heard == [0, 1, 2, 3, 4]

    def test_the_work_goes_on_when_its_word_was_heard(self, worker: WorkerProcess) -> None:
        def hear(number: int) -> None:
            raise JobCancelled

        pid = worker.run(worker_pid)
        with pytest.raises(JobCancelled):
            worker.run(count, 5, on_message=hear)
        assert wait_for_end(pid)

    def test_a_refusal_travels_whole(self, worker: WorkerProcess) -> None:
        with pytest.raises(DatasetFormatError) as caught:
            worker.run(refuse)
        assert str(caught.value) == "a.json, 7.png, x: is no number"
        assert (caught.value.record, caught.value.problem) == ("7.png", "is no number")
        with pytest.raises(StaleRevisionError) as stale:
            worker.run(find_it_changed)
        assert (stale.value.base_etag, stale.value.current_etag) == ("a", "b")

    def test_a_full_disk_stays_one(self, worker: WorkerProcess) -> None:
        with pytest.raises(StorageError) as caught:
            worker.run(find_the_disk_full)
        assert caught.value.hint == "Free some."
        assert isinstance(caught.value.__cause__, OSError)
        assert caught.value.__cause__.errno == errno.ENOSPC

    def test_a_fault_says_where_it_is(self, worker: WorkerProcess) -> None:
        with pytest.raises(RuntimeError, match=r"in fail\n(.*\n)*KeyError: 'a fault of ours'"):
            worker.run(fail)

    def test_what_its_memory_does_not_hold_is_not_done(self, worker: WorkerProcess) -> None:
        assert worker.run(take, 100 * MEBI) == 100 * MEBI
        with pytest.raises(WorkerEnded, match="needs more than 300 MiB of memory") as caught:
            worker.run(take, 400 * MEBI)
        assert caught.value.reason == "memory"

    def test_a_runaway_ends_by_its_processor_time(self, worker: WorkerProcess) -> None:
        before = worker.run(worker_pid)
        with pytest.raises(WorkerEnded, match="takes more than 1 seconds") as caught:
            worker.run(never_end)
        assert caught.value.reason == "processor"
        assert worker.run(worker_pid) != before

    def test_each_task_has_its_own_processor_time(self, worker: WorkerProcess) -> None:
        for _ in range(3):
            worker.run(spend, 0.6)

    def test_what_waits_for_ever_ends_by_the_clock(self) -> None:
        worker = WorkerProcess(WorkerLimits(300 * MEBI, processor=10.0, silence=2.0))
        pid = worker.run(os.getpid)
        with pytest.raises(WorkerEnded, match="no result or progress") as caught:
            worker.run(time.sleep, 600.0)
        assert caught.value.reason == "silence"
        assert wait_for_end(pid)

    def test_a_crash_is_the_workers_alone(self, worker: WorkerProcess) -> None:
        for work, reason in ((crash, "crash"), (be_killed, "killed")):
            with pytest.raises(WorkerEnded) as caught:
                worker.run(work)
            assert caught.value.reason == reason
        assert worker.run(worker_pid) != os.getpid()

    def test_a_crash_says_on_stderr_where_it_was(self, capfd: pytest.CaptureFixture[str]) -> None:
        with pytest.raises(WorkerEnded):
            WorkerProcess(WorkerLimits(300 * MEBI, 10.0, 60.0)).run(crash)
        said = capfd.readouterr().err
        assert said.startswith("Fatal Python error: Aborted")
        assert "in crash" in said

    def test_one_that_died_between_two_tasks_is_replaced(self, worker: WorkerProcess) -> None:
        pid = worker.run(worker_pid)
        os.kill(pid, signal.SIGKILL)
        assert wait_for_end(pid)
        assert worker.run(worker_pid) != pid

    def test_one_that_cannot_be_started_is_tried_again_later(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(_process: object) -> None:
            raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")

        worker = WorkerProcess(WorkerLimits(300 * MEBI, 10.0, 60.0))
        before = len(list(Path("/proc/self/fd").iterdir()))
        with monkeypatch.context() as patch:
            patch.setattr("multiprocessing.context.SpawnProcess.start", refuse)
            with pytest.raises(OverloadedError, match="no process could be started"):
                worker.run(worker_pid)
        assert len(list(Path("/proc/self/fd").iterdir())) == before
        worker.kill()
        assert worker.run(worker_pid) != os.getpid()
        worker.close()

    def test_one_that_dies_before_it_is_ready_says_nothing_of_its_task(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.worker_process._serve_tasks", be_killed_at_start)
        with pytest.raises(OverloadedError, match="no process could be started"):
            WorkerProcess(WorkerLimits(300 * MEBI, 10.0, 60.0)).run(worker_pid)

    def test_one_that_hears_of_a_pressed_key_while_it_starts_works_all_the_same(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        start = SpawnProcess.start

        def start_and_interrupt(process: SpawnProcess) -> None:
            start(process)
            assert process.pid is not None
            os.kill(process.pid, signal.SIGINT)

        monkeypatch.setattr(SpawnProcess, "start", start_and_interrupt)
        # As in a process that has no worker yet: its tracker would be started with the first one.
        tracker = ResourceTracker()
        for name in ("ensure_running", "getfd"):
            monkeypatch.setattr(resource_tracker, name, getattr(tracker, name))
        worker = WorkerProcess(WorkerLimits(300 * MEBI, 10.0, 60.0))
        try:
            assert worker.run(worker_pid) != os.getpid()
        finally:
            worker.close()
            tracker._stop()

    def test_one_that_is_told_to_end_did_not_crash(self, worker: WorkerProcess) -> None:
        with pytest.raises(WorkerEnded, match="its process was stopped") as ended:
            worker.run(be_told_to_end)
        assert ended.value.reason == "terminated"

    def test_what_is_not_wanted_any_more_is_killed(self, worker: WorkerProcess) -> None:
        pid = worker.run(worker_pid)

        def stop() -> None:
            raise JobCancelled

        with pytest.raises(JobCancelled):
            worker.run(never_end, stop=stop)
        assert wait_for_end(pid)


def spend(seconds: float) -> None:
    def spent() -> float:
        usage = resource.getrusage(resource.RUSAGE_SELF)
        return usage.ru_utime + usage.ru_stime

    until = spent() + seconds
    while spent() < until:
        pass


PARENT = """
import sys
from app.worker_process import WorkerLimits, WorkerProcess
from test_worker_process import never_end, worker_pid
if __name__ == "__main__":
    worker = WorkerProcess(WorkerLimits(300 * 2**20, 60.0, 60.0))
    print(worker.run(worker_pid), flush=True)
    worker.run(never_end)
"""


class TestEndWithParent:
    @pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
    def test_a_runaway_ends_with_a_killed_parent(self, tmp_path: Path, number: int) -> None:
        script = tmp_path / "parent.py"
        script.write_text(PARENT)
        path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
        parent = subprocess.Popen(
            [sys.executable, str(script)],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": path},
        )
        try:
            assert parent.stdout is not None
            pid = int(parent.stdout.readline())
            assert is_alive(pid)
            parent.send_signal(number)
            assert wait_for_end(pid)
        finally:
            parent.kill()
            parent.communicate()


def sleep_beside(mark: Path, _large: bytes) -> None:
    mark.touch()
    time.sleep(SECONDS)


class TestAbandon:
    def test_tasks_that_are_being_handed_over_hold_nothing_up(self, tmp_path: Path) -> None:
        executor = ProcessPoolExecutor(1, get_context("spawn"))
        # More than a pipe holds: while one is at work, another is on its way.
        for _ in range(4):
            executor.submit(sleep_beside, tmp_path / "mark", bytes(2**22))
        manager, tasks = executor._executor_manager_thread, executor._call_queue
        end = time.monotonic() + SECONDS
        while not (tmp_path / "mark").exists() and time.monotonic() < end:
            time.sleep(0.05)
        time.sleep(0.2)
        kill_executor(executor)
        try:
            manager.join(SECONDS / 2)
            assert not manager.is_alive()
        finally:
            # Or this process could not end, either.
            tasks._reader.close()


LITTLE = WorkerLimits(memory=2**20, processor=1.0, silence=1.0)


@pytest.fixture
def counts() -> WorkerCounts:
    return WorkerCounts()


class TestWorkerCounts:
    def test_a_task_is_busy_until_it_is_done(self, counts: WorkerCounts) -> None:
        with counts.track_task(), counts.track_task():
            assert counts.busy == 2
        assert counts.busy == 0
        assert set(counts.ended.values()) == {0}

    @pytest.mark.parametrize("reason", get_args(EndReason))
    def test_a_worker_that_ends_is_counted_under_its_reason_alone(
        self, counts: WorkerCounts, reason: EndReason
    ) -> None:
        for _ in range(2):
            with pytest.raises(WorkerEnded), counts.track_task():
                raise WorkerEnded(reason, LITTLE)
        assert counts.ended == {**dict.fromkeys(get_args(EndReason), 0), reason: 2}
        assert counts.busy == 0

    def test_a_task_that_refuses_ended_no_worker(self, counts: WorkerCounts) -> None:
        with pytest.raises(ValueError, match="a word"), counts.track_task():
            raise ValueError("a word")
        assert set(counts.ended.values()) == {0}
        assert counts.busy == 0
