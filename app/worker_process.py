"""Worker process: runs functions within limits of memory and time, and can be killed.

For untrusted files and for long work. A crash or a runaway ends the worker alone. It is spawned
(forking a process with threads is unsafe), stays warm between tasks, and ends with its parent, however
the parent ends (decision 0013; why not pebble or loky: 0068).
"""

from __future__ import annotations

import faulthandler
import fcntl
import math
import multiprocessing
import os
import resource
import select
import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import monotonic
from typing import Any, Literal, get_args

from app.errors import JobCancelled, OverloadedError, ReviewError

TICK = 0.1
"""Seconds between two calls of ``stop``."""
START_SECONDS = 120.0
"""Longest time that a busy machine may take to start a process."""
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""Each thread of these libraries reserves memory before it does anything."""
KINDS = (
    "pictures",
    "readers",
    "fetchers",
    "indexers",
    "previews",
    "large",
    "predictions",
    "imports",
    "exports",
    "freezing",
    "verifying",
    "evaluating",
    "accepting",
    "practice",
    "paint",
    "proposals",
    "recordings",
    "tracks",
)
"""What workers are used for, as the metrics call it."""

EndReason = Literal["memory", "processor", "silence", "killed", "terminated", "crash"]
"""``memory``, ``processor`` and ``silence`` are our limits; a worker is killed or terminated from outside."""


@dataclass(frozen=True)
class WorkerLimits:
    """What a worker process may use; infinite: no limit.

    Attributes:
        memory: Bytes of private memory, without the code of libraries.
        processor: Seconds of processor time for one task.
        silence: Seconds by the clock between two messages of a task; its result is the last one.
    """

    memory: float
    processor: float
    silence: float


class WorkerEnded(Exception):  # noqa: N818
    """A worker process ended before it finished its task; the next task gets another worker."""

    def __init__(self, reason: EndReason, limits: WorkerLimits):
        # Read after the name of what was worked on.
        super().__init__(
            {
                "memory": f"needs more than {limits.memory / 2**20:,.0f} MiB of memory",
                "processor": f"takes more than {limits.processor:,.0f} seconds of processor time",
                "silence": f"gave no result or progress for {limits.silence:,.0f} seconds",
                "killed": "was not finished: its process was killed, most likely because the machine ran"
                " out of memory",
                "terminated": "was not finished: its process was stopped",
                "crash": "made its process crash",
            }[reason]
        )
        self.reason = reason


class WorkerCounts:
    """Counts of the workers of one kind; any thread may change them.

    Attributes:
        busy: Tasks at work.
        waiting: Tasks that wait for a worker.
        ended: Workers that ended before they finished a task, by reason.
    """

    def __init__(self) -> None:
        self.busy = self.waiting = 0
        self.ended: dict[EndReason, int] = dict.fromkeys(get_args(EndReason), 0)
        self._lock = threading.Lock()

    def add_waiting(self, more: int) -> None:
        """Change how many tasks wait."""
        with self._lock:
            self.waiting += more

    @contextmanager
    def track_task(self) -> Iterator[None]:
        """Count the block as a task at work, and its worker where that ends before the task."""
        with self._lock:
            self.busy += 1
        try:
            yield
        except WorkerEnded as error:
            with self._lock:
                self.ended[error.reason] += 1
            raise
        finally:
            with self._lock:
                self.busy -= 1


COUNTS = {kind: WorkerCounts() for kind in KINDS}
"""Of all pools and jobs of this process."""


class WorkerProcess:
    """A process that runs functions of modules, one at a time; the first task starts it."""

    def __init__(self, limits: WorkerLimits):
        self.limits = limits
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None

    def run(
        self,
        work: Callable[..., Any],
        *arguments: Any,
        on_message: Callable[[Any], Any] | None = None,
        stop: Callable[[], None] | None = None,
    ) -> Any:
        """Call a function in the process and return its result.

        Args:
            work: A function of a module; it, its arguments and its result travel by pickle.
            arguments: Its arguments.
            on_message: Answers each message of the work; with it, the work's last argument is a
                function that sends a message and returns the answer.
            stop: Called every ``TICK`` seconds; an error that it raises ends the process.

        Raises:
            ReviewError: As the work raised it; ``JobCancelled`` likewise.
            OverloadedError: No process could be started.
            WorkerEnded: The work went beyond a limit, or crashed.
            RuntimeError: The work has a fault; the text is its traceback.
        """
        try:
            pipe = self._ensure_process(stop)
            pipe.send((work, arguments, on_message is not None))
            kind, value = self._receive(pipe, self.limits.silence, stop)
            while kind == "message" and on_message is not None:
                pipe.send(on_message(value))
                kind, value = self._receive(pipe, self.limits.silence, stop)
        except (EOFError, ConnectionError):
            raise WorkerEnded(self._find_end_reason(), self.limits) from None
        except BaseException:
            self.close()
            raise
        if kind == "result":
            return value
        if kind == "refusal":
            raise value
        self.close()
        if kind == "memory":
            raise WorkerEnded("memory", self.limits)
        raise RuntimeError(value)

    @property
    def is_alive(self) -> bool:
        """Whether there is a process now."""
        process = self._process
        return process is not None and process.is_alive()

    def kill(self) -> None:
        """End the process from another thread than the one that waits for its result."""
        process = self._process
        if process is not None:
            process.kill()

    def close(self) -> None:
        """End the process."""
        process, pipe = self._process, self._pipe
        self._process = self._pipe = None
        if process is not None:
            process.kill()
            process.join()
        if pipe is not None:
            pipe.close()

    def _ensure_process(self, stop: Callable[[], None] | None) -> Connection:
        """The pipe to the process, which is started where there is none."""
        if self._process is not None and not self._process.is_alive():
            self.close()
        if self._pipe is None:
            try:
                self._process, self._pipe = _start_process(self.limits)
                self._receive(self._pipe, START_SECONDS, stop)
            except (OSError, EOFError, WorkerEnded) as error:
                raise OverloadedError(
                    "no process could be started for this",
                    hint="The machine is busy or short of memory. Try again in a moment.",
                ) from error
        return self._pipe

    def _receive(
        self, pipe: Connection, seconds: float, stop: Callable[[], None] | None
    ) -> tuple[str, Any]:
        last = monotonic()
        while not pipe.poll(TICK):
            if stop is not None:
                stop()
            if monotonic() - last > seconds:
                raise WorkerEnded("silence", self.limits)
        kind, value = pipe.recv()
        return kind, value

    def _find_end_reason(self) -> EndReason:
        process = self._process
        code = None
        if process is not None:
            process.join(1.0)
            code = process.exitcode
        self.close()
        causes: dict[int | None, EndReason] = {
            -signal.SIGXCPU: "processor",
            # Not sent by us: the kernel sends it when the machine runs out of memory.
            -signal.SIGKILL: "killed",
            -signal.SIGTERM: "terminated",
        }
        return causes.get(code, "crash")


def _start_process(limits: WorkerLimits) -> tuple[BaseProcess, Connection]:
    """A process that has been started, and the pipe to it."""
    context = multiprocessing.get_context("spawn")
    pipe, far = context.Pipe()
    with closing(far):
        process = context.Process(target=_serve_tasks, args=(far, limits), daemon=True)
        # Ctrl+C reaches every process of a terminal; the parent alone decides what ends. The first
        # worker would have multiprocessing start its tracker, which lets it through again.
        resource_tracker.ensure_running()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            process.start()
        except BaseException:
            pipe.close()
            raise
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    return process, pipe


def _serve_tasks(pipe: Connection, limits: WorkerLimits) -> None:
    """Run one task after the other in the worker process, until the parent hangs up."""
    end_with_parent()
    # A library that crashes says on stderr where it was called.
    faulthandler.enable()
    # From its first moment on it was blocked.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    for name in _ONE_THREAD:
        os.environ[name] = "1"
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    set_resource_limit(resource.RLIMIT_DATA, limits.memory)
    with suppress(OSError):
        # Where memory runs out all the same, the kernel takes this process first.
        Path("/proc/self/oom_score_adj").write_text("1000")

    def send_message(message: Any) -> Any:
        pipe.send(("message", message))
        return pipe.recv()

    with suppress(EOFError, ConnectionError):
        pipe.send(("ready", None))
        while True:
            work, arguments, sends = pipe.recv()
            usage = resource.getrusage(resource.RUSAGE_SELF)
            set_resource_limit(
                resource.RLIMIT_CPU, usage.ru_utime + usage.ru_stime + limits.processor
            )
            pipe.send(_run_work(work, (*arguments, send_message) if sends else arguments))


def set_resource_limit(kind: int, amount: float) -> None:
    """Set a soft limit (``resource.RLIMIT_...``) of this process, within its hard one; infinite: none."""
    if math.isinf(amount):
        return
    hard = resource.getrlimit(kind)[1]
    soft = math.ceil(amount)
    resource.setrlimit(kind, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))


def _run_work(work: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[str, Any]:
    try:
        return "result", work(*arguments)
    except (ReviewError, JobCancelled) as error:
        return "refusal", error
    except MemoryError:
        return "memory", None
    except Exception:
        return "fault", traceback.format_exc()


def end_with_parent() -> None:
    """Let this process, started by ``multiprocessing``, end at once when its parent has ended.

    The parent holds the other end of a pipe, which closes with it. The kernel then sends SIGIO;
    nothing in this process needs to be able to run, so that a runaway ends, too.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    lifeline = parent.sentinel
    signal.signal(signal.SIGIO, signal.SIG_DFL)
    fcntl.fcntl(lifeline, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(lifeline, fcntl.F_SETFL, fcntl.fcntl(lifeline, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([lifeline], [], [], 0)[0]:
        os._exit(1)


@contextmanager
def open_spawned_pool(
    workers: int, initialize: Callable[[], object] | None = None
) -> Iterator[ProcessPoolExecutor]:
    """An executor of processes without limits, for our own work; they end with this process.

    Args:
        workers: Number of processes.
        initialize: Called in each before its first task.
    """
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, _initialize_spawned, (initialize,)) as pool:
        try:
            yield pool
        except BaseException:
            kill_executor(pool)
            raise


def _initialize_spawned(initialize: Callable[[], object] | None) -> None:
    # Ctrl+C reaches every process of a terminal, where the parent alone decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    if initialize is not None:
        initialize()


def kill_executor(executor: ProcessPoolExecutor) -> None:
    """End the processes of an executor with the tasks that they run, without waiting for them."""
    workers = list((executor._processes or {}).values())
    tasks: Any = getattr(executor, "_call_queue")  # noqa: B009
    executor.shutdown(wait=False, cancel_futures=True)
    for worker in workers:
        worker.terminate()
    # Before Python 3.11.5 a large task that was being handed over is handed over for ever: this process
    # holds the end from which nobody reads any more (https://github.com/python/cpython/issues/94777).
    if tasks is not None:
        tasks._reader.close()
