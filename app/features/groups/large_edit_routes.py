"""Large edits: solves edits and previews of hundreds of points where they keep nobody waiting.

One of them takes as long as dozens of others, and one interpreter computes one thing at a time. A
server of a team has a process for them, which gives way to the server where both want a processor
(decision 0062).
"""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError
from typing import TypeVar

from app.config import Settings
from app.errors import OverloadedError
from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import Calibration
from app.solving.solve import warm_up
from app.worker_pool import ReadyWorker, least_busy
from app.worker_process import WorkerEnded, WorkerLimits

Solved = TypeVar("Solved")

LIMITS = WorkerLimits(memory=2 * 2**30, processor=60.0, silence=120.0)
"""For one; the first one of a process may have to wait for kernels to be compiled."""
NICENESS = 5


class LargeGroupSolver:
    """Has large groups solved.

    Args:
        settings: Whether there is a process for them.
    """

    def __init__(self, settings: Settings):
        apart = settings.solves_apart
        self.workers = (
            [ReadyWorker("large", LIMITS, _process_ended_error, prepare_solver_process)]
            if apart
            else []
        )

    def solve(
        self,
        work: Callable[[Group, Policy, Mapping[str, Calibration]], Solved],
        group: Group,
        policy: Policy,
        known: Mapping[str, Calibration],
    ) -> Solved:
        """What a function of a module that solves a group makes of it; waits for the process.

        Raises:
            OverloadedError: The process ended.
        """
        worker = least_busy(self.workers)
        if worker is None:
            return work(group, policy, known)
        task = worker.submit(work, group, policy, known)
        try:
            found: Solved = task.future.result()
        except CancelledError as error:
            raise OverloadedError(
                "the server is shutting down",
                hint="Nothing was saved. Try it again in a moment.",
            ) from error
        return found

    def close(self) -> None:
        """End the process."""
        for worker in self.workers:
            worker.close()


def prepare_solver_process() -> None:
    """In the process: give way to others, and load the solver's kernels."""
    os.nice(NICENESS)
    warm_up()
    gc.collect()
    gc.freeze()


def _process_ended_error(error: WorkerEnded) -> OverloadedError:
    return OverloadedError(f"solving this {error}", hint="Nothing was saved. Try it again.")
