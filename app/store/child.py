"""Long work on the database in a process of its own, so that requests do not wait for it.

One interpreter computes one thing at a time: what a thread works on for a minute, everybody who asks
something feels. The process opens the database itself and takes its turn among the writers here, so
that edits do not wait longer than they would for a thread. It says how far it is, and may ask.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing, suppress
from math import inf
from time import monotonic
from typing import Any, Literal, TypeVar

import structlog

from app.child import Allowance, Child
from app.child_figures import FIGURES
from app.config import Settings
from app.errors import DamagedError, JobCancelled, ReviewError
from app.log import log_to_stderr
from app.progress import TellProgress
from app.store.store import Store

SILENCE = 900.0
"""Seconds in which work must have come to its next step."""
NO_LIMIT = Allowance(inf, inf, inf)
"""For work on what is ours already: it takes as long as there are groups."""
STEP_SECONDS = 0.1
"""Between two words of how far the work is: each is heard by the process that answers requests."""
PATIENCE = 5.0
"""Seconds in which work that is told to end may put away what it has begun."""

Result = TypeVar("Result")
WordKind = Literal["write", "written", "step", "question"]
Word = tuple[WordKind, Any]
"""What the process says: that it wants to write, that it has written, how far it is, or a question."""
Answer = tuple[bool, Any]
"""Whether it is refused; what is answered, or the error."""


def nothing(_question: Any) -> None:
    """The answer where nothing is asked."""


class Caller:
    """Whoever waits for the work, as the work sees them; it is a ``TellProgress``."""

    def __init__(self, tell: Callable[[Word], Answer]):
        self._tell = tell
        self._place: tuple[int, int | None, str] = (0, None, "")
        self._told = -STEP_SECONDS
        self._untold = False

    def __call__(self, done: int, total: int | None = None, sentence: str = "", /) -> None:
        """Say how far the work is: every now and then, and at once what it does next.

        Raises:
            JobCancelled: It shall end here.
        """
        _, last_total, last_sentence = self._place
        self._place = done, last_total if total is None else total, sentence or last_sentence
        self._untold = True
        if self._place[2] != last_sentence or monotonic() - self._told >= STEP_SECONDS:
            self.catch_up()

    def catch_up(self) -> None:
        """Say what was kept back because the last word was just said."""
        if self._untold:
            self._say("step", self._place)
            self._told, self._untold = monotonic(), False

    def ask(self, question: Any) -> Any:
        """The answer to a question.

        Raises:
            ReviewError: As whoever was asked raised it.
        """
        return self._say("question", question)

    def take_turn(self) -> None:
        """Wait for the turn to write, which is theirs to give."""
        self._say("write", None)

    def give_turn(self) -> None:
        """Say that what was to be written is written, or will not be."""
        self._say("written", None)

    def _say(self, kind: WordKind, what: Any) -> Any:
        refused, answer = self._tell((kind, what))
        if refused:
            raise answer
        return answer


class _Turn:
    """The turn to write, which whoever waits for the work has."""

    def __init__(self, caller: Caller):
        self._caller = caller

    def __enter__(self) -> None:
        self._caller.take_turn()

    def __exit__(self, *_: object) -> None:
        self._caller.give_turn()


def work_apart(
    store: Store,
    kind: str,
    work: Callable[..., Result],
    *arguments: Any,
    allowance: Allowance = NO_LIMIT,
    progress: TellProgress,
    stop: Callable[[], None],
    answer: Callable[[Any], Any] = nothing,
) -> Result:
    """The result of ``work(store, *arguments, caller)``, called in a process of its own.

    Args:
        store: The database; the process opens it again.
        kind: What is done, as its figures are called.
        work: A function of a module; it, its arguments and its result travel by pickle.
        arguments: What it is called with, between the database and whoever waits (``Caller``).
        allowance: What the process may use.
        progress: Hears how far it is; the error that it raises is raised in the work.
        stop: Called every now and then; what it raises ends the process.
        answer: What the work's questions are answered with, or refused by raising.

    Raises:
        ReviewError: As the work raised it; ``JobCancelled`` likewise.
        DamagedError: It met damage; from then on nothing can be changed, here either.
        ChildEnded: It went beyond the allowance, or the process was killed or crashed.
    """
    with ExitStack() as turn, closing(Child(allowance)) as child:

        def hear(word: Word) -> Answer:
            said, what = word
            try:
                if said == "write":
                    # What was seen here, the process may not have seen.
                    store.require_undamaged()
                    turn.enter_context(store.turn)
                elif said == "written":
                    turn.close()
                    store.tell_listeners()
                elif said == "step":
                    progress(*what)
                else:
                    return False, answer(what)
            except (ReviewError, JobCancelled) as error:
                return True, error
            return False, None

        given = store.settings, structlog.contextvars.get_contextvars(), work, arguments
        try:
            with FIGURES[kind].working():
                result: Result = child.run(_work, *given, heard=hear, stop=stop)
        except DamagedError as error:
            store.note_damage(error)
            raise
    return result


def work_here(
    store: Store,
    work: Callable[..., Result],
    *arguments: Any,
    progress: TellProgress,
    answer: Callable[[Any], Any] = nothing,
) -> Result:
    """The same in this thread: for what is done before a process would have started."""

    def hear(word: Word) -> Answer:
        said, what = word
        if said != "step":
            return False, answer(what)
        progress(*what)
        return False, None

    return _with_last_word(work, store, arguments, Caller(hear))


def patiently(check: Callable[[], None]) -> Callable[[], None]:
    """A ``stop`` that lets work which is told to end by its next step put away what it has begun.

    Args:
        check: Raises ``JobCancelled`` once it shall end.
    """
    until = inf

    def stop() -> None:
        nonlocal until
        try:
            check()
        except JobCancelled:
            until = min(until, monotonic() + PATIENCE)
            if monotonic() > until:
                raise

    return stop


def _work(
    settings: Settings,
    log_fields: Mapping[str, Any],
    work: Callable[..., Any],
    arguments: tuple[Any, ...],
    tell: Callable[[Word], Answer],
) -> Any:
    log_to_stderr(settings.log_format)
    caller = Caller(tell)
    with (
        structlog.contextvars.bound_contextvars(**log_fields),
        closing(Store.open(settings, _Turn(caller))) as store,
    ):
        return _with_last_word(work, store, arguments, caller)


def _with_last_word(
    work: Callable[..., Result], store: Store, arguments: tuple[Any, ...], caller: Caller
) -> Result:
    result = work(store, *arguments, caller)
    # Who wants it to end now is too late: it is done.
    with suppress(JobCancelled):
        caller.catch_up()
    return result
