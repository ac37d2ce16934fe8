"""A cluster on this machine: two workers against one, and against a pool of two processes."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import AbstractContextManager, closing
from functools import partial
from pathlib import Path

from app.config import Settings
from app.db.store import Store
from app.features.solutions.service import solve_dataset
from app.workers.cluster import ClusterExecutor, SchedulerPlace
from app.workers.executors import open_process_pool
from tests.bench.table import print_table
from tests.e2e.service import run_touchline
from tests.torture.cluster import members

GROUPS = 600
ROUNDS = 2


def bench_cluster() -> None:
    """Measure and print; the ways take turns."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fresh, tree = folder / "fresh", folder / "tree"
        run_touchline(
            fresh,
            "migrate",
            f"sample --workers 2 --groups {GROUPS} --labels-only {tree}",
            f"import soccernet-v3 {tree} --dataset torture",
        )
        seconds: dict[str, list[float]] = {}
        for _ in range(ROUNDS):
            for count in (1, 2):
                with members(fresh, folder, workers=count) as cluster:
                    cluster.wait_for_workers()
                    pool = partial(ClusterExecutor, SchedulerPlace(cluster.address))
                    what = f"{count} worker{'s' * (count > 1)} of a cluster"
                    taken = _seconds(fresh, folder / "home", pool)
                    seconds.setdefault(what, []).append(taken)
            taken = _seconds(fresh, folder / "home", partial(open_process_pool, 2))
            seconds.setdefault("a pool of 2 processes", []).append(taken)
        best = {what: min(values) for what, values in seconds.items()}
        one = best["1 worker of a cluster"]
        print_table(
            f"Solving {GROUPS} groups of the sample, warm",
            ("by", "seconds", "times as fast as one worker"),
            [(what, value, one / value) for what, value in best.items()],
        )


def _seconds(
    fresh: Path, home: Path, pool: Callable[[], AbstractContextManager[Executor]]
) -> float:
    """How long a home takes to be solved, by processes that have solved before."""
    with pool() as executor:
        _solve(fresh, home, executor)
        return _solve(fresh, home, executor)


def _solve(fresh: Path, home: Path, executor: Executor) -> float:
    shutil.rmtree(home, ignore_errors=True)
    shutil.copytree(fresh, home)
    with closing(Store.open(Settings(home=home))) as store:
        start = time.perf_counter()
        solve_dataset(store, "torture", executor)
        return time.perf_counter() - start


if __name__ == "__main__":
    bench_cluster()
