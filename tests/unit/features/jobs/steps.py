"""Jobs that are held or stopped at a step, so that what follows happens in a known order."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from types import ModuleType
from typing import Any

import pytest

from app.db.json_columns import Json
from app.db.store import Store
from app.features.jobs.job_run import JobProgress
from app.features.jobs.queries import Job
from app.features.jobs.service import Jobs
from app.features.notifications.queries import select_notifications
from app.features.people.queries import find_person_by_name
from app.features.people.visibility_queries import EVERYTHING
from tests.waiting import SECONDS


def a_job(number: int = 1, **values: Any) -> Job:
    """A job that waits."""
    known: dict[str, Any] = {item.name: None for item in fields(Job)}
    words = {"kind": "export", "title": "Export", "state": "waiting", "actor": "ann"}
    return Job(**{**known, **words, "id": number, "done": 0, "sentence": "", **values})


class Gate:
    """Work that says when it runs, and goes on when it is told to."""

    def __init__(self, result: Json = None):
        self.started, self.finish, self.result = threading.Event(), threading.Event(), result

    def __call__(self, progress: JobProgress) -> Json:
        self.started.set()
        while not self.finish.wait(0.005):
            progress(1, 2, "Half of it.")
        return self.result


def submit(jobs: Jobs, work: Callable[[JobProgress], Json], **options: Any) -> Job:
    kind = options.pop("kind", "bulk")
    return jobs.submit(kind, "Some work", work, actor="ann", **options)


def list_sentences_told(store: Store, name: str) -> list[str]:
    """What the bell of a person says, the newest first."""
    with store.read() as session:
        person = find_person_by_name(session, name)
        seen = select_notifications(session, person.id, EVERYTHING, "", 50, None)
    return [item.sentence for item in seen]


class Held:
    """A function whose n-th call waits, once it is done, until it may go on."""

    def __init__(self, whole: Callable[..., Any], *, calls: int):
        self._whole, self._left = whole, calls
        self._there, self.go_on = threading.Event(), threading.Event()

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        found = self._whole(*arguments, **options)
        self._left -= 1
        if self._left == 0:
            self._there.set()
            assert self.go_on.wait(SECONDS)
        return found

    def wait(self) -> None:
        """Until that call is done."""
        assert self._there.wait(SECONDS)


@contextmanager
def stopped_at_its_first_step(
    module: ModuleType, name: str, jobs: Jobs, **more: Any
) -> Iterator[None]:
    """Whoever asks for a job here finds its server stopped after the first step of its work."""
    started, whole = threading.Event(), getattr(module, name)

    def stopping(*arguments: Any, progress: Callable[..., None], **options: Any) -> Any:
        def told(done: int, total: int | None) -> None:
            started.set()
            while True:
                progress(done, total)

        return whole(*arguments, progress=told, **options, **more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, name, stopping)
        yield
        assert started.wait(SECONDS)
        jobs.close()
