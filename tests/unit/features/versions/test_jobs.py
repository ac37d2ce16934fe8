"""The jobs of versions: what their process leaves where it does not come to its end."""

from __future__ import annotations

import multiprocessing
import threading
from typing import Any

import pytest

from app.db.store import Store
from app.errors import JobCancelled, OverloadedError
from app.features.jobs import job_run
from app.features.jobs.job_run import JobProgress
from app.features.jobs.queries import Job
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.jobs import run_verify_job
from app.features.versions.service import Version, get_version
from app.worker_process import WorkerProcess
from tests.unit.features.jobs.steps import a_job


@pytest.fixture
def version(store: Store, fill: Any, make_group: Any) -> Version:
    fill(make_group(7), make_group(8))
    return freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")


def asked(version: Version, actor: str) -> Job:
    return a_job(kind="verify", actor=actor, request={"version": version.id})


class Killed(JobProgress):
    """The progress of a job whose process is killed at its first step."""

    def __init__(self, version: Version, *, cancelled: bool = False):
        super().__init__(asked(version, "ben"), threading.Event())
        self._cancels = cancelled

    def __call__(self, done: int, total: int | None = None, sentence: str = "") -> None:
        if done:
            for process in multiprocessing.active_children():
                process.kill()
            if self._cancels:
                self.cancelled.set()
            return
        super().__call__(done, total, sentence)


@pytest.fixture(autouse=True)
def _apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job_run, "SMALL", 0)
    monkeypatch.setattr(job_run, "STOP_SECONDS", 0.0)


class TestVerifyWork:
    def test_one_whose_process_is_killed_is_kept_as_failed(
        self, store: Store, version: Version
    ) -> None:
        with pytest.raises(OverloadedError, match="the process of the verification was killed"):
            run_verify_job(store, Killed(version))
        kept = get_version(store, version.id).verified
        assert kept is not None
        assert (kept.actor, kept.report) == ("ben", None)
        assert kept.problem is not None and kept.problem.startswith("the process of")

    def test_one_whose_process_cannot_be_started_leaves_what_was_kept(
        self, store: Store, version: Version, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(_child: WorkerProcess, *_: Any, **__: Any) -> None:
            raise OverloadedError("no process could be started for this") from OSError(12, "memory")

        run_verify_job(store, JobProgress(asked(version, "ann"), threading.Event()))
        monkeypatch.setattr("app.db.database_worker.WorkerProcess.run", refuse)
        with pytest.raises(OverloadedError, match="no process"):
            run_verify_job(store, JobProgress(asked(version, "ben"), threading.Event()))
        kept = get_version(store, version.id).verified
        assert kept is not None and (kept.actor, kept.problem) == ("ann", None)

    def test_one_that_was_cancelled_leaves_what_was_kept(
        self, store: Store, version: Version
    ) -> None:
        with pytest.raises(JobCancelled):
            run_verify_job(store, Killed(version, cancelled=True))
        assert get_version(store, version.id).verified is None
