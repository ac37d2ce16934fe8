"""A child does what it is told, within its limits, and takes nobody with it."""

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

import pytest

from app.child import Allowance, Child, ChildEnded, abandon
from app.errors import (
    DatasetFormatError,
    JobCancelled,
    OverloadedError,
    StaleRevisionError,
    StorageError,
)
from tests.waiting import SECONDS

pytestmark = pytest.mark.usefixtures("children_start_anew")

MEBI = 2**20
ENDLESS = re.compile(r"(a+)+$"), "a" * 60 + "b"
"""A pattern that never comes to an end, and never lets another thread of its process run."""


def child_pid() -> int:
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
def child() -> Iterator[Child]:
    made = Child(Allowance(memory=300 * MEBI, processor=1.0, silence=60.0))
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
    def test_works_in_another_process_that_stays_warm(self, child: Child) -> None:
        first = child.run(child_pid)
        assert first != os.getpid()
        assert child.run(child_pid) == first

    def test_words_are_heard_in_their_order(self, child: Child) -> None:
        heard: list[int] = []
        assert child.run(count, 5, heard=heard.append) == "done"
        assert heard == [0, 1, 2, 3, 4]

    def test_the_work_goes_on_when_its_word_was_heard(self, child: Child) -> None:
        def hear(number: int) -> None:
            raise JobCancelled

        pid = child.run(child_pid)
        with pytest.raises(JobCancelled):
            child.run(count, 5, heard=hear)
        assert wait_for_end(pid)

    def test_a_refusal_travels_whole(self, child: Child) -> None:
        with pytest.raises(DatasetFormatError) as caught:
            child.run(refuse)
        assert str(caught.value) == "a.json, 7.png, x: is no number"
        assert (caught.value.record, caught.value.problem) == ("7.png", "is no number")
        with pytest.raises(StaleRevisionError) as stale:
            child.run(find_it_changed)
        assert (stale.value.base_etag, stale.value.current_etag) == ("a", "b")

    def test_a_full_disk_stays_one(self, child: Child) -> None:
        with pytest.raises(StorageError) as caught:
            child.run(find_the_disk_full)
        assert caught.value.hint == "Free some."
        assert isinstance(caught.value.__cause__, OSError)
        assert caught.value.__cause__.errno == errno.ENOSPC

    def test_a_fault_says_where_it_is(self, child: Child) -> None:
        with pytest.raises(RuntimeError, match=r"in fail\n(.*\n)*KeyError: 'a fault of ours'"):
            child.run(fail)

    def test_what_its_memory_does_not_hold_is_not_done(self, child: Child) -> None:
        assert child.run(take, 100 * MEBI) == 100 * MEBI
        with pytest.raises(ChildEnded, match="needs more than 300 MiB of memory") as caught:
            child.run(take, 400 * MEBI)
        assert caught.value.reason == "memory"

    def test_a_runaway_ends_by_its_processor_time(self, child: Child) -> None:
        before = child.run(child_pid)
        with pytest.raises(ChildEnded, match="takes more than 1 seconds") as caught:
            child.run(never_end)
        assert caught.value.reason == "processor"
        assert child.run(child_pid) != before

    def test_each_task_has_its_own_processor_time(self, child: Child) -> None:
        for _ in range(3):
            child.run(spend, 0.6)

    def test_what_waits_for_ever_ends_by_the_clock(self) -> None:
        child = Child(Allowance(300 * MEBI, processor=10.0, silence=2.0))
        pid = child.run(os.getpid)
        with pytest.raises(ChildEnded, match="without a result") as caught:
            child.run(time.sleep, 600.0)
        assert caught.value.reason == "silence"
        assert wait_for_end(pid)

    def test_a_crash_is_the_childs_alone(self, child: Child) -> None:
        for work, reason in ((crash, "crash"), (be_killed, "killed")):
            with pytest.raises(ChildEnded) as caught:
                child.run(work)
            assert caught.value.reason == reason
        assert child.run(child_pid) != os.getpid()

    def test_a_crash_says_on_stderr_where_it_was(self, capfd: pytest.CaptureFixture[str]) -> None:
        with pytest.raises(ChildEnded):
            Child(Allowance(300 * MEBI, 10.0, 60.0)).run(crash)
        said = capfd.readouterr().err
        assert said.startswith("Fatal Python error: Aborted")
        assert "in crash" in said

    def test_one_that_died_between_two_tasks_is_replaced(self, child: Child) -> None:
        pid = child.run(child_pid)
        os.kill(pid, signal.SIGKILL)
        assert wait_for_end(pid)
        assert child.run(child_pid) != pid

    def test_one_that_cannot_be_started_is_tried_again_later(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(_process: object) -> None:
            raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")

        child = Child(Allowance(300 * MEBI, 10.0, 60.0))
        before = len(list(Path("/proc/self/fd").iterdir()))
        with monkeypatch.context() as patch:
            patch.setattr("multiprocessing.context.SpawnProcess.start", refuse)
            with pytest.raises(OverloadedError, match="no process could be started"):
                child.run(child_pid)
        assert len(list(Path("/proc/self/fd").iterdir())) == before
        child.kill()
        assert child.run(child_pid) != os.getpid()
        child.close()

    def test_one_that_dies_before_it_is_ready_says_nothing_of_its_task(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.child._serve", be_killed_at_start)
        with pytest.raises(OverloadedError, match="no process could be started"):
            Child(Allowance(300 * MEBI, 10.0, 60.0)).run(child_pid)

    def test_one_that_hears_of_a_pressed_key_while_it_starts_works_all_the_same(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        start = SpawnProcess.start

        def start_and_interrupt(process: SpawnProcess) -> None:
            start(process)
            assert process.pid is not None
            os.kill(process.pid, signal.SIGINT)

        monkeypatch.setattr(SpawnProcess, "start", start_and_interrupt)
        # As in a process that has no child yet: its tracker would be started with the first one.
        tracker = ResourceTracker()
        for name in ("ensure_running", "getfd"):
            monkeypatch.setattr(resource_tracker, name, getattr(tracker, name))
        child = Child(Allowance(300 * MEBI, 10.0, 60.0))
        try:
            assert child.run(child_pid) != os.getpid()
        finally:
            child.close()
            tracker._stop()

    def test_one_that_is_told_to_end_did_not_crash(self, child: Child) -> None:
        with pytest.raises(ChildEnded, match="its process was told to end") as ended:
            child.run(be_told_to_end)
        assert ended.value.reason == "told"

    def test_what_is_not_wanted_any_more_is_killed(self, child: Child) -> None:
        pid = child.run(child_pid)

        def stop() -> None:
            raise JobCancelled

        with pytest.raises(JobCancelled):
            child.run(never_end, stop=stop)
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
from app.child import Allowance, Child
from test_child import never_end, child_pid
if __name__ == "__main__":
    child = Child(Allowance(300 * 2**20, 60.0, 60.0))
    print(child.run(child_pid), flush=True)
    child.run(never_end)
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
        abandon(executor)
        try:
            manager.join(SECONDS / 2)
            assert not manager.is_alive()
        finally:
            # Or this process could not end, either.
            tasks._reader.close()
