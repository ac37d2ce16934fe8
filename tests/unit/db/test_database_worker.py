"""Work in a worker process: it sees the database, takes its turn, tells, asks, and ends when it is told to."""

from __future__ import annotations

import os
import re
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import structlog

from app.db import database_worker as module
from app.db.database_worker import ServerProxy, make_stop_with_grace_period, run_in_worker
from app.db.session import now
from app.db.store import Store
from app.errors import DamagedError, InputError, JobCancelled, NotFoundError
from app.features.datasets.queries import insert_dataset_row
from app.features.datasets.service import list_datasets
from app.progress import ReportProgress
from app.soccer.policy import PAPER
from app.worker_process import COUNTS, WorkerEnded, WorkerProcess
from tests.waiting import SECONDS

KIND = "exports"


def wanted() -> None:
    """Nobody ends it."""


def deaf(*_: object) -> None:
    """Hears nothing."""


def run(
    own_store: Store,
    work: Any,
    *arguments: Any,
    progress: ReportProgress = deaf,
    stop: Any = wanted,
    answer: Any = lambda question: None,
) -> Any:
    return run_in_worker(
        own_store, KIND, work, *arguments, progress=progress, stop=stop, answer=answer
    )


def name_process(own_store: Store, word: str, _caller: ServerProxy) -> tuple[int, str, Path]:
    return os.getpid(), word, own_store.settings.home


def count(_store: Store, last: int, caller: ServerProxy) -> None:
    for number in range(1, last + 1):
        caller(number, last, "counting")


def change_over(_store: Store, caller: ServerProxy) -> None:
    caller(1, 9, "reading")
    caller(1, 9, "packing")
    caller(2, 9, "packing")


def log_a_word(*_: object) -> None:
    structlog.get_logger("touchline.tests").warning("seen")


def count_slowly(_store: Store, mark: Path, caller: ServerProxy) -> None:
    try:
        for number in range(10_000):
            caller(number)
            time.sleep(0.01)
    finally:
        mark.write_text("put away")


def never_look_up(_store: Store, caller: ServerProxy) -> None:
    caller(1)
    time.sleep(SECONDS)


def take_turn(_store: Store, mark: Path, caller: ServerProxy) -> None:
    caller.__enter__()
    mark.write_text("taken")
    time.sleep(SECONDS)


def ask(_store: Store, question: str, caller: ServerProxy) -> str:
    try:
        return f"answered {caller.ask(question)}"
    except NotFoundError as error:
        return f"refused: {error.message}"


def write(own_store: Store, _caller: ServerProxy) -> None:
    with own_store.write() as session:
        insert_dataset_row(session, "made apart", PAPER, now())


def break_down(*_: object) -> None:
    os.abort()


def meet_damage(*_: object) -> None:
    raise DamagedError("touchline.db is damaged", hint="Restore it.")


class TestRunInWorker:
    def test_is_done_by_another_process_over_the_same_home(self, own_store: Store) -> None:
        number, word, home = run(own_store, name_process, "word")
        assert number != os.getpid()
        assert (word, home) == ("word", own_store.settings.home)

    def test_who_waits_hears_the_first_step_and_the_last_and_not_every_one(
        self, own_store: Store
    ) -> None:
        heard: list[Any] = []
        run(own_store, count, 5_000, progress=lambda *told: heard.append(told))
        assert heard[0] == (1, 5_000, "counting")
        assert heard[-1] == (5_000, 5_000, "counting")
        assert len(heard) < 500

    def test_what_the_work_does_next_is_heard_at_once(self, own_store: Store) -> None:
        heard: list[Any] = []
        run(own_store, change_over, progress=lambda *told: heard.append(told))
        assert heard == [(1, 9, "reading"), (1, 9, "packing"), (2, 9, "packing")]

    def test_what_it_logs_is_a_line_of_the_log_here_that_names_the_job(
        self, own_store: Store, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # One that was kept from another test writes to the stderr of then.
        monkeypatch.setattr(module, "WorkerProcess", WorkerProcess)
        with structlog.contextvars.bound_contextvars(job=31):
            run(own_store, log_a_word)
        printed = capfd.readouterr()
        assert printed.out == ""
        assert re.search(r"level='warning' event='seen' .*job=31", printed.err)

    def test_a_question_is_answered_here(self, own_store: Store) -> None:
        assert run(own_store, ask, "why", answer=str.upper) == "answered WHY"

    def test_a_question_that_is_refused_is_refused_in_the_work(self, own_store: Store) -> None:
        def refuse(question: str) -> None:
            raise NotFoundError(f"nobody knows {question}")

        assert run(own_store, ask, "why", answer=refuse) == "refused: nobody knows why"

    def test_it_writes_in_the_turn_of_those_here(self, own_store: Store) -> None:
        with ExitStack() as others:
            others.enter_context(own_store.write())
            working = threading.Thread(target=run, args=(own_store, write))
            working.start()
            working.join(0.5)
            assert working.is_alive()
        working.join(SECONDS)
        assert [item.name for item in list_datasets(own_store)] == ["made apart"]

    def test_who_listens_here_hears_what_it_writes(self, own_store: Store) -> None:
        told: list[str] = []
        own_store.listen(lambda: told.append("committed"))
        run(own_store, write)
        assert told == ["committed"]

    def test_told_to_end_it_puts_away_what_it_has_begun(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        def progress(done: int, *_: object) -> None:
            if done > 3:
                raise JobCancelled

        mark = tmp_path / "mark"
        with pytest.raises(JobCancelled):
            run(own_store, count_slowly, mark, progress=progress)
        assert mark.read_text() == "put away"

    def test_told_to_end_after_its_last_step_it_is_done(self, own_store: Store) -> None:
        told: list[int] = []

        def progress(done: int, *_: object) -> None:
            told.append(done)
            if done == 2:
                raise JobCancelled

        run(own_store, count, 2, progress=progress)
        assert told[-1] == 2

    def test_one_that_comes_to_no_step_is_ended_and_lets_others_write(
        self, own_store: Store, tmp_path: Path
    ) -> None:
        mark = tmp_path / "mark"

        def stop() -> None:
            if mark.exists():
                raise JobCancelled

        with pytest.raises(JobCancelled):
            run(own_store, take_turn, mark, stop=stop)
        with own_store.write():
            pass

    def test_damage_that_it_meets_ends_changes_here(self, own_store: Store) -> None:
        with pytest.raises(DamagedError, match=r"^touchline\.db is damaged$"):
            run(own_store, meet_damage)
        with pytest.raises(DamagedError, match="nothing can be changed now"), own_store.write():
            pass

    def test_damage_that_was_seen_here_ends_its_changes(self, own_store: Store) -> None:
        own_store.record_damage(DamagedError("a page is lost"))
        with pytest.raises(DamagedError, match="nothing can be changed now"):
            run(own_store, write)
        assert list_datasets(own_store) == []

    def test_one_that_breaks_down_is_counted(self, own_store: Store) -> None:
        before = COUNTS[KIND].ended["crash"]
        with pytest.raises(WorkerEnded, match="made its process crash"):
            run(own_store, break_down)
        assert COUNTS[KIND].ended["crash"] == before + 1

    def test_what_it_refuses_is_refused_here(self, own_store: Store) -> None:
        def progress(*_: object) -> None:
            raise InputError("no")

        with pytest.raises(InputError, match=r"^no$"):
            run(own_store, count_slowly, own_store.settings.home / "mark", progress=progress)


class TestWithGrace:
    def test_nothing_ends_what_is_wanted(self) -> None:
        stop = make_stop_with_grace_period(wanted)
        stop()
        stop()

    def test_what_is_not_wanted_may_come_to_its_next_step(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def unwanted() -> None:
            raise JobCancelled

        stop, clock = make_stop_with_grace_period(unwanted), [100.0]
        monkeypatch.setattr(module, "monotonic", lambda: clock[0])
        stop()
        clock[0] += module.GRACE_SECONDS
        stop()
        clock[0] += 0.1
        with pytest.raises(JobCancelled):
            stop()

    def test_it_ends_work_that_comes_to_none(
        self, own_store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def unwanted() -> None:
            raise JobCancelled

        monkeypatch.setattr(module, "GRACE_SECONDS", 0.3)
        with pytest.raises(JobCancelled):
            run(own_store, never_look_up, stop=make_stop_with_grace_period(unwanted))
