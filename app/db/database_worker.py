"""Database worker: long work on the database in a worker process, so that requests do not wait for it.

One interpreter computes one thing at a time: what a thread works on for a minute slows every request
(decision 0066). The process opens the database itself and takes its turn among the writers of the
server, so that edits do not wait longer than they would for a thread. It reports its progress, and may
ask the server questions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing, suppress
from math import inf
from time import monotonic
from typing import Any, Literal, TypeVar

import structlog

from app.config import Settings
from app.db.store import Store
from app.errors import DamagedError, JobCancelled, ReviewError
from app.log import log_to_stderr
from app.progress import ReportProgress
from app.worker_process import COUNTS, WorkerLimits, WorkerProcess

SILENCE = 900.0
"""Seconds within which work must come to its next step."""
NO_LIMIT = WorkerLimits(inf, inf, inf)
"""For work on data of the home: it takes as long as there are groups."""
STEP_SECONDS = 0.1
"""Between two messages of progress: the server, which answers requests, receives each."""
GRACE_SECONDS = 5.0
"""Time in which cancelled work may put away what it has begun."""

Result = TypeVar("Result")
Message = tuple[Literal["write", "written", "step", "question"], Any]
"""What the worker sends: that it wants to write, that it has written, its progress, or a question."""
Answer = tuple[bool, Any]
"""Whether it is an error; the answer or the error."""


def ignore_question(_question: Any) -> None:
    """The answer where no questions are asked."""


class ServerProxy:
    """The server, as the work sees it; it is a ``ReportProgress`` and a context that is a turn to write."""

    def __init__(self, send: Callable[[Message], Answer]):
        self._send = send
        self._place: tuple[int, int | None, str] = (0, None, "")
        self._sent_at = -STEP_SECONDS
        self._unsent = False

    def __call__(self, done: int, total: int | None = None, sentence: str = "", /) -> None:
        """Report progress: every ``STEP_SECONDS``, and a new sentence at once.

        Raises:
            JobCancelled: The work shall end here.
        """
        _, last_total, last_sentence = self._place
        self._place = done, last_total if total is None else total, sentence or last_sentence
        self._unsent = True
        if self._place[2] != last_sentence or monotonic() - self._sent_at >= STEP_SECONDS:
            self.send_progress()

    def send_progress(self) -> None:
        """Report the progress that was held back."""
        if self._unsent:
            self._send_request("step", self._place)
            self._sent_at, self._unsent = monotonic(), False

    def ask(self, question: Any) -> Any:
        """The answer to a question.

        Raises:
            ReviewError: As the server raised it.
        """
        return self._send_request("question", question)

    def __enter__(self) -> None:
        self._send_request("write", None)

    def __exit__(self, *_: object) -> None:
        self._send_request("written", None)

    def _send_request(
        self, kind: Literal["write", "written", "step", "question"], value: Any
    ) -> Any:
        is_error, answer = self._send((kind, value))
        if is_error:
            raise answer
        return answer


def run_in_worker(
    store: Store,
    kind: str,
    work: Callable[..., Result],
    *arguments: Any,
    limits: WorkerLimits = NO_LIMIT,
    progress: ReportProgress,
    stop: Callable[[], None],
    answer: Callable[[Any], Any] = ignore_question,
) -> Result:
    """Call ``work(store, *arguments, caller)`` in a worker process and return its result.

    Args:
        store: The database; the process opens it again.
        kind: What is done; see ``worker_process.KINDS``.
        work: A function of a module; it, its arguments and its result travel by pickle.
        arguments: Its arguments between the database and the ``ServerProxy``.
        limits: What the process may use.
        progress: Receives the progress; the error that it raises is raised in the work.
        stop: Called every now and then; an error that it raises ends the process.
        answer: Answers the work's questions; the error that it raises is raised in the work.

    Raises:
        ReviewError: As the work raised it; ``JobCancelled`` likewise.
        DamagedError: It met damage; from then on this process refuses changes, too.
        WorkerEnded: It went beyond the limits, or the process was killed or crashed.
    """
    with ExitStack() as turn, closing(WorkerProcess(limits)) as worker:

        def on_message(message: Message) -> Answer:
            kind, value = message
            try:
                if kind == "write":
                    # The process may not know of damage that was seen here.
                    store.require_undamaged()
                    turn.enter_context(store.turn)
                elif kind == "written":
                    turn.close()
                    store.notify_listeners()
                elif kind == "step":
                    progress(*value)
                else:
                    return False, answer(value)
            except (ReviewError, JobCancelled) as error:
                return True, error
            return False, None

        given = store.settings, structlog.contextvars.get_contextvars(), work, arguments
        try:
            with COUNTS[kind].track_task():
                result: Result = worker.run(
                    _run_work_in_process, *given, on_message=on_message, stop=stop
                )
        except DamagedError as error:
            store.record_damage(error)
            raise
    return result


def run_in_this_thread(
    store: Store,
    work: Callable[..., Result],
    *arguments: Any,
    progress: ReportProgress,
    answer: Callable[[Any], Any] = ignore_question,
) -> Result:
    """Like ``run_in_worker``, in this thread: for work that is done before a process would have started."""

    def on_message(message: Message) -> Answer:
        kind, value = message
        if kind != "step":
            return False, answer(value)
        progress(*value)
        return False, None

    return _run_and_flush(work, store, arguments, ServerProxy(on_message))


def make_stop_with_grace_period(check: Callable[[], None]) -> Callable[[], None]:
    """A ``stop`` that gives cancelled work ``GRACE_SECONDS`` to end by its next step.

    Args:
        check: Raises ``JobCancelled`` once the work is cancelled.
    """
    until = inf

    def stop() -> None:
        nonlocal until
        try:
            check()
        except JobCancelled:
            until = min(until, monotonic() + GRACE_SECONDS)
            if monotonic() > until:
                raise

    return stop


def _run_work_in_process(
    settings: Settings,
    log_fields: Mapping[str, Any],
    work: Callable[..., Any],
    arguments: tuple[Any, ...],
    send: Callable[[Message], Answer],
) -> Any:
    log_to_stderr(settings.log_format)
    caller = ServerProxy(send)
    with (
        structlog.contextvars.bound_contextvars(**log_fields),
        closing(Store.open(settings, caller)) as store,
    ):
        return _run_and_flush(work, store, arguments, caller)


def _run_and_flush(
    work: Callable[..., Result], store: Store, arguments: tuple[Any, ...], caller: ServerProxy
) -> Result:
    result = work(store, *arguments, caller)
    # It is done: to cancel it now is too late.
    with suppress(JobCancelled):
        caller.send_progress()
    return result
