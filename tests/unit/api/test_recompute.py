"""Solving beside the requests."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from app.api import recompute
from app.api.recompute import Recompute
from app.config import Settings
from app.review.datasets import get_dataset
from app.review.ingest import ingest
from app.soccer.group import Group
from app.store.session import Store


@pytest.fixture
def store(tmp_path: Path, group: Group) -> Iterator[Store]:
    """A store with one group that is not solved."""
    store = Store.open(Settings(home=tmp_path))
    ingest(store, "small", [group], source="test", actor="local")
    yield store
    store.close()


class TestRecompute:
    def test_what_is_asked_for_is_solved(self, store: Store) -> None:
        worker = Recompute(store)
        worker.request("small").result(20)
        assert get_dataset(store, "small").solved == 1
        worker.close()

    def test_a_dataset_that_waits_is_not_queued_twice(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        started, finish, runs = threading.Event(), threading.Event(), []

        def slow(_store: Store, dataset: str, progress: object) -> None:
            runs.append(dataset)
            started.set()
            assert finish.wait(10)

        monkeypatch.setattr(recompute, "solve_dataset", slow)
        worker = Recompute(store)
        first = worker.request("small")
        assert started.wait(10)
        # The first one runs: what changes from now on needs another round, but only one.
        second, third = worker.request("small"), worker.request("small")
        finish.set()
        first.result(10)
        second.result(10)
        assert (third, runs) == (None, ["small", "small"])
        worker.close()

    def test_a_failure_is_logged_and_the_next_request_works(self, store: Store) -> None:
        worker = Recompute(store)
        with capture_logs() as logs:
            worker.request("nothing").result(10)
        assert [entry["event"] for entry in logs] == ["solving failed"]
        worker.request("small").result(20)
        assert get_dataset(store, "small").solved == 1
        worker.close()

    def test_closing_ends_a_long_run_at_its_next_step(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        started = threading.Event()

        def endless(_store: Store, dataset: str, progress) -> None:
            while True:
                started.set()
                progress(1, 2)

        monkeypatch.setattr(recompute, "solve_dataset", endless)
        worker = Recompute(store)
        running = worker.request("small")
        assert started.wait(10)
        worker.close()
        assert running.done()
        assert worker.request("small") is None
