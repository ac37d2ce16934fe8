"""Child: a process that works on foreign bytes within limits, and that can be killed.

A crash or a runaway takes the child down and nobody else. It is started anew (forking a process
with threads is unsafe), kept warm between tasks, and ends with its parent, however that ends.
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
from typing import Any, Literal

from app.errors import JobCancelled, OverloadedError, ReviewError

TICK = 0.1
"""Seconds between two looks whether the work is still wanted."""
START_SECONDS = 120.0
"""So long a machine that is busy may take to start a process."""
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""Each thread of these libraries reserves memory before it does anything."""

EndReason = Literal["memory", "processor", "silence", "killed", "told", "crash"]
"""``memory`` and ``processor`` are limits of ours; who is killed or told to end, is so from outside."""


@dataclass(frozen=True)
class Allowance:
    """What a child may use.

    Attributes:
        memory: Bytes of memory of its own, libraries' code left out; infinite: as many as there are.
        processor: Seconds of processor time a task; infinite: as many as it takes.
        silence: Seconds by the clock between two words of a task, its result the last one.
    """

    memory: float
    processor: float
    silence: float


class ChildEnded(Exception):  # noqa: N818
    """A child did not finish its task; it is gone, and the next task gets another."""

    def __init__(self, reason: EndReason, allowance: Allowance):
        super().__init__(_sentence(reason, allowance))
        self.reason = reason


def _sentence(reason: EndReason, allowance: Allowance) -> str:
    """What happened, to be read after the name of what was worked on."""
    return {
        "memory": f"needs more than {allowance.memory / 2**20:,.0f} MiB of memory",
        "processor": f"takes more than {allowance.processor:,.0f} seconds to work out",
        "silence": f"was at work for {allowance.silence:,.0f} seconds without a result",
        "killed": "was not finished: its process was killed, most likely for want of memory",
        "told": "was not finished: its process was told to end",
        "crash": "made its process crash",
    }[reason]


class Child:
    """A process that runs functions of modules, one at a time; the first task starts it."""

    def __init__(self, allowance: Allowance):
        self.allowance = allowance
        self._process: BaseProcess | None = None
        self._line: Connection | None = None

    def run(
        self,
        work: Callable[..., Any],
        *arguments: Any,
        heard: Callable[[Any], Any] | None = None,
        stop: Callable[[], None] | None = None,
    ) -> Any:
        """The result of a function, called in the child.

        Args:
            work: A function of a module; it, its arguments and its result travel by pickle.
            arguments: What it is called with.
            heard: Hears each word of the work: with it, the work's last argument is a function
                that sends one and returns what was answered.
            stop: Called every now and then; what it raises ends the child.

        Raises:
            ReviewError: As the work raised it; ``JobCancelled`` likewise.
            OverloadedError: No process could be started.
            ChildEnded: The work went beyond a limit, or crashed.
            RuntimeError: The work has a fault; the text is its traceback.
        """
        try:
            line = self._start(stop)
            line.send((work, arguments, heard is not None))
            kind, value = self._word(line, self.allowance.silence, stop)
            while kind == "word" and heard is not None:
                line.send(heard(value))
                kind, value = self._word(line, self.allowance.silence, stop)
        except (EOFError, ConnectionError):
            raise ChildEnded(self._cause_of_death(), self.allowance) from None
        except BaseException:
            self.close()
            raise
        return self._outcome(kind, value)

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
        process, line = self._process, self._line
        self._process = self._line = None
        if process is not None:
            process.kill()
            process.join()
        if line is not None:
            line.close()

    def _start(self, stop: Callable[[], None] | None) -> Connection:
        """The line to the process, which is started where there is none."""
        if self._process is not None and not self._process.is_alive():
            self.close()
        if self._line is None:
            try:
                self._process, self._line = _launch(self.allowance)
                self._word(self._line, START_SECONDS, stop)
            except (OSError, EOFError, ChildEnded) as error:
                raise OverloadedError(
                    "no process could be started for this",
                    hint="The machine is busy or short of memory. Try again in a moment.",
                ) from error
        return self._line

    def _word(
        self, line: Connection, seconds: float, stop: Callable[[], None] | None
    ) -> tuple[str, Any]:
        last = monotonic()
        while not line.poll(TICK):
            if stop is not None:
                stop()
            if monotonic() - last > seconds:
                raise ChildEnded("silence", self.allowance)
        kind, value = line.recv()
        return kind, value

    def _outcome(self, kind: str, value: Any) -> Any:
        if kind == "result":
            return value
        if kind == "refusal":
            raise value
        self.close()
        if kind == "memory":
            raise ChildEnded("memory", self.allowance)
        raise RuntimeError(value)

    def _cause_of_death(self) -> EndReason:
        process = self._process
        code = None
        if process is not None:
            process.join(1.0)
            code = process.exitcode
        self.close()
        causes: dict[int | None, EndReason] = {
            -signal.SIGXCPU: "processor",
            # Without a word of ours, this is the kernel's when the machine runs out of memory.
            -signal.SIGKILL: "killed",
            -signal.SIGTERM: "told",
        }
        return causes.get(code, "crash")


def _launch(allowance: Allowance) -> tuple[BaseProcess, Connection]:
    """A process that has been started, and the line to it."""
    context = multiprocessing.get_context("spawn")
    line, far = context.Pipe()
    with closing(far):
        process = context.Process(target=_serve, args=(far, allowance), daemon=True)
        # Ctrl+C reaches every process of a terminal; the parent alone decides what ends. The first
        # child would have multiprocessing start its tracker, which lets it through again.
        resource_tracker.ensure_running()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            process.start()
        except BaseException:
            line.close()
            raise
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    return process, line


def abandon(executor: ProcessPoolExecutor) -> None:
    """End the processes of a pool with what they are at; nothing of it is waited for."""
    workers = list((executor._processes or {}).values())
    tasks: Any = getattr(executor, "_call_queue")  # noqa: B009
    executor.shutdown(wait=False, cancel_futures=True)
    for worker in workers:
        worker.terminate()
    # Before Python 3.11.5 a large task that was being handed over is handed over for ever: this process
    # holds the end from which nobody reads any more (https://github.com/python/cpython/issues/94777).
    if tasks is not None:
        tasks._reader.close()


@contextmanager
def spawned_pool(
    workers: int, settle: Callable[[], object] | None = None
) -> Iterator[ProcessPoolExecutor]:
    """Processes that each start anew, because a fork of a process with threads may hang.

    Ctrl+C reaches every process of a terminal, where this one alone decides; they end with it, and
    with the work that fails.

    Args:
        workers: How many.
        settle: Called in each before its first task.
    """
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, _settle_down, (settle,)) as pool:
        try:
            yield pool
        except BaseException:
            abandon(pool)
            raise


def _settle_down(settle: Callable[[], object] | None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    if settle is not None:
        settle()


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


def _serve(line: Connection, allowance: Allowance) -> None:
    """What runs in the child: one task after the other, until the parent hangs up."""
    end_with_parent()
    # A library that crashes says on stderr where it was called.
    faulthandler.enable()
    # From its first moment on it was blocked.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    for name in _ONE_THREAD:
        os.environ[name] = "1"
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _limit(resource.RLIMIT_DATA, allowance.memory)
    with suppress(OSError):
        # Where memory runs out all the same, the kernel takes this process first.
        Path("/proc/self/oom_score_adj").write_text("1000")
    with suppress(EOFError, ConnectionError):
        line.send(("ready", None))
        while True:
            work, arguments, talks = line.recv()
            usage = resource.getrusage(resource.RUSAGE_SELF)
            used = usage.ru_utime + usage.ru_stime
            _limit(resource.RLIMIT_CPU, used + allowance.processor)
            line.send(_answer(work, (*arguments, _teller(line)) if talks else arguments))


def _limit(kind: int, amount: float) -> None:
    if math.isinf(amount):
        return
    hard = resource.getrlimit(kind)[1]
    soft = math.ceil(amount)
    resource.setrlimit(kind, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))


def _answer(work: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[str, Any]:
    try:
        return "result", work(*arguments)
    except (ReviewError, JobCancelled) as error:
        return "refusal", error
    except MemoryError:
        return "memory", None
    except Exception:
        return "fault", traceback.format_exc()


def _teller(line: Connection) -> Callable[[Any], Any]:
    def tell(word: Any) -> Any:
        line.send(("word", word))
        return line.recv()

    return tell
