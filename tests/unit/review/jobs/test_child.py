"""The work of a job is done where it keeps nobody waiting: here where it is small, else apart."""

from __future__ import annotations

import os
import signal
import threading
from typing import Any

import pytest

from app.errors import InputError, JobCancelled, OverloadedError
from app.review.datasets.dataset import dataset_id
from app.review.jobs import child as module
from app.review.jobs.child import carry_out_apart
from app.review.jobs.run import JobProgress
from app.store.child import Caller
from app.store.store import Store
from tests.waiting import SECONDS


def number_of_process(_store: Store, caller: Caller) -> int:
    caller(1, 2, "counting")
    caller(2)
    return os.getpid()


def ask(_store: Store, question: str, caller: Caller) -> Any:
    return caller.ask(question)


def step_for_ever(_store: Store, caller: Caller) -> None:
    for number in range(10_000_000):
        caller(number)


def be_refused(_store: Store, _caller: Caller) -> None:
    raise InputError("there is nothing to count")


def break_down(*_: object) -> None:
    os.abort()


def be_told_to_end(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGTERM)


def have_no_process(*_: object) -> None:
    raise OverloadedError("no process could be started for this")


@pytest.fixture
def own(store: Store, fill: Any, make_group: Any) -> int:
    """Id of a dataset with two groups."""
    fill(make_group(7), make_group(8), solved=False)
    return dataset_id(store, "demo")


@pytest.fixture
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every dataset with a group is large."""
    monkeypatch.setattr(module, "SMALL", 0)


def progress() -> JobProgress:
    return JobProgress(1, threading.Event())


def carry_out(store: Store, work: Any, *arguments: Any, **options: Any) -> Any:
    told = {"progress": progress(), **options}
    return carry_out_apart(store, "exports", "the export", work, *arguments, **told)


class TestCarryOutApart:
    def test_what_is_small_is_done_here(self, store: Store, own: int) -> None:
        told = progress()
        done = carry_out(store, number_of_process, dataset_id=own, progress=told)
        assert done == os.getpid()
        assert told.place == (2, 2, "counting")

    @pytest.mark.usefixtures("large")
    def test_what_is_large_is_done_by_another_process(self, store: Store, own: int) -> None:
        told = progress()
        done = carry_out(store, number_of_process, dataset_id=own, progress=told)
        assert done != os.getpid()
        assert told.place == (2, 2, "counting")

    def test_so_is_what_is_of_no_dataset(self, store: Store) -> None:
        assert carry_out(store, number_of_process, dataset_id=None) != os.getpid()

    @pytest.mark.parametrize("small", [True, False])
    def test_questions_are_answered_by_this_process(
        self, store: Store, own: int, small: bool
    ) -> None:
        def answer(question: str) -> tuple[str, int]:
            return question, os.getpid()

        answered = carry_out(store, ask, "who", dataset_id=own if small else None, answer=answer)
        assert answered == ("who", os.getpid())

    @pytest.mark.parametrize("small", [True, False])
    def test_what_it_refuses_is_the_jobs_failure(self, store: Store, own: int, small: bool) -> None:
        with pytest.raises(InputError, match="nothing to count"):
            carry_out(store, be_refused, dataset_id=own if small else None)

    @pytest.mark.parametrize("small", [True, False])
    def test_who_cancels_it_ends_it(self, store: Store, own: int, small: bool) -> None:
        told = progress()
        ended: list[BaseException] = []

        def run() -> None:
            try:
                place = own if small else None
                carry_out(store, step_for_ever, dataset_id=place, progress=told)
            except JobCancelled as error:
                ended.append(error)

        running = threading.Thread(target=run)
        running.start()
        told.cancelled.set()
        running.join(SECONDS)
        assert len(ended) == 1

    def test_one_that_breaks_down_is_a_sentence(self, store: Store) -> None:
        with pytest.raises(OverloadedError, match=r"^the process of the export crashed$"):
            carry_out(store, break_down, dataset_id=None)

    @pytest.mark.parametrize("end", [break_down, be_told_to_end, have_no_process])
    def test_one_that_ends_before_its_server_is_told_to_stop_goes_on_with_the_next(
        self, store: Store, end: Any
    ) -> None:
        closing = threading.Event()
        threading.Timer(0.5, closing.set).start()
        with pytest.raises(JobCancelled):
            carry_out(store, end, dataset_id=None, progress=JobProgress(1, closing))

    def test_one_that_was_told_to_end_is_a_sentence_that_says_so(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "STOP_SECONDS", 0.0)
        with pytest.raises(OverloadedError, match=r"^the process of the export was told to end$"):
            carry_out(store, be_told_to_end, dataset_id=None)
