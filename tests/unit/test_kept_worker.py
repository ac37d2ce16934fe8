"""Workers of tests are kept where that hides nothing: one in the midst of a task ends as ever."""

from __future__ import annotations

import os
import time

import pytest

from app.errors import JobCancelled
from app.worker_process import WorkerLimits
from tests.kept_worker import KeptWorker

ALLOWED = WorkerLimits(memory=1001 * 2**20, processor=30.0, silence=60.0)
"""As no other test allows it: these workers are of this file alone."""


class TestKeptChild:
    def test_one_that_has_done_its_work_serves_the_next_of_its_kind(self) -> None:
        first, second = KeptWorker(ALLOWED), KeptWorker(ALLOWED)
        number = first.run(os.getpid)
        first.kill()
        first.close()
        assert second.run(os.getpid) == number
        second.close()
        other = KeptWorker(WorkerLimits(1002 * 2**20, 30.0, 60.0))
        assert other.run(os.getpid) != number
        other.close()

    def test_one_that_is_told_to_end_in_the_midst_is_not_kept(self) -> None:
        worker = KeptWorker(ALLOWED)
        number = worker.run(os.getpid)

        def stop() -> None:
            raise JobCancelled

        with pytest.raises(JobCancelled):
            worker.run(time.sleep, 60, stop=stop)
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)
        assert worker.run(os.getpid) != number
        worker.close()
