"""A cluster whose members are killed while it solves: nothing is lost, nothing is there twice."""

from __future__ import annotations

import os
import random
import shutil
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import psutil
from distributed import Client

from app.workers.cluster import SchedulerPlace
from tests.e2e.service import ROOT, SERVE, run_touchline
from tests.starting import Process
from tests.torture.commands import Report, differences
from tests.waiting import SECONDS

VICTIMS = ("worker", "workers", "scheduler", "solve")
"""One process that solves, all of a machine with what keeps them, the scheduler, who asks."""


class Members:
    """The programs of a cluster on this machine.

    Args:
        home: Home of who asks.
        folder: Where their words go.
        workers: Processes that solve.
        keys: Folder of certificates; None: nothing is encrypted.
    """

    def __init__(self, home: Path, folder: Path, workers: int = 2, keys: Path | None = None):
        self._home, self._folder, self._count, self._keys = home, folder, workers, keys
        self.address = f"{'tcp' if keys is None else 'tls'}://127.0.0.1:{_free_port()}"
        self._running: dict[str, Process] = {}

    def start(self, name: str) -> Process:
        """Start the program of that name: ``scheduler``, ``workers`` or ``solve``."""
        command = {
            "scheduler": f"scheduler {self.address}",
            "workers": f"worker {self.address} --workers {self._count}",
            "solve": f"solve --dataset torture --cluster {self.address}",
        }[name]
        keys = {} if self._keys is None else {"TOUCHLINE_CLUSTER_KEYS": str(self._keys)}
        with (self._folder / f"{name}.log").open("ab") as log:
            self._running[name] = Process(
                [sys.executable, "-c", SERVE, *command.split(" ")],
                cwd=ROOT,
                env={**os.environ, **keys, "TOUCHLINE_HOME": str(self._home)},
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        return self._running[name]

    def said(self, name: str) -> str:
        """What a program has said so far."""
        return (self._folder / f"{name}.log").read_text()

    def kill(self, name: str, chance: random.Random) -> bool:
        """Kill a member with SIGKILL, and start again what would not come back by itself."""
        if name == "worker":
            found = self._solving()
            if not found:
                return False
            chance.choice(found).kill()
            return True
        self.restart(name)
        return True

    def restart(self, name: str) -> None:
        """Kill a program with SIGKILL, and start it again."""
        self._end(name)
        self.start(name)

    def wait_for_workers(self) -> None:
        """Wait until all workers are at the scheduler."""
        security = SchedulerPlace(self.address, self._keys).make_dask_security()
        with Client(
            self.address, security=security, timeout=SECONDS, set_as_default=False
        ) as client:
            client.wait_for_workers(self._count, timeout=SECONDS)

    def end(self) -> None:
        """End all of them."""
        for name in list(self._running):
            self._end(name)

    def wait(self) -> int:
        """Exit code of who asks, once they are done."""
        return self._running["solve"].wait(5 * SECONDS)

    @property
    def is_done(self) -> bool:
        """Whether who asks has ended."""
        return self._running["solve"].poll() is not None

    def _solving(self) -> list[psutil.Process]:
        """The processes that solve: children of the program that keeps them."""
        children = psutil.Process(self._running["workers"].pid).children()
        return [child for child in children if "spawn_main" in " ".join(child.cmdline())]

    def _end(self, name: str) -> None:
        process = self._running[name]
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@contextmanager
def members(home: Path, folder: Path, **options: object) -> Iterator[Members]:
    """A cluster over a home, with its scheduler and workers, until the block is left."""
    cluster = Members(home, folder, **options)  # type: ignore[arg-type]
    try:
        cluster.start("scheduler")
        cluster.start("workers")
        yield cluster
    finally:
        cluster.end()


def torture(
    folder: Path,
    *,
    kills: int,
    groups: int,
    seed: int,
    tell: Callable[[str], None] = lambda _sentence: None,
) -> Report:
    """Solve once alone, and again and again on a cluster, until so many members were killed.

    Args:
        folder: Where homes and files go; what is in it is replaced.
        kills: How often a member is killed, at random moments.
        groups: Size of the dataset.
        seed: Decides who is killed, and when.
        tell: Called with each sentence worth reading.
    """
    shutil.rmtree(folder, ignore_errors=True)
    fresh, calm, killed, tree = (folder / name for name in ("fresh", "calm", "killed", "tree"))
    run_touchline(
        fresh,
        "migrate",
        f"sample --workers 1 --groups {groups} --labels-only {tree}",
        f"import soccernet-v3 {tree} --dataset torture",
    )
    shutil.copytree(fresh, calm)
    run_touchline(calm, "solve --dataset torture --workers 1")
    report, chance = Report(), random.Random(seed)
    while report.kills < kills:
        shutil.rmtree(killed, ignore_errors=True)
        shutil.copytree(fresh, killed)
        with members(killed, folder) as cluster:
            cluster.start("solve")
            while report.kills < kills and not cluster.is_done:
                time.sleep(chance.uniform(1, 4))
                victim = chance.choice(VICTIMS)
                if not cluster.is_done and cluster.kill(victim, chance):
                    report.kills += 1
            code = cluster.wait()
            if code:
                # Who asked while no scheduler was there was refused, and asks again.
                cluster.start("solve")
                code = cluster.wait()
            refusal = cluster.said("solve")[-500:] if code else ""
        report.commands += 1
        found = [f"solve: {fault}" for fault in differences(calm, killed)]
        report.faults += found + ([f"solve ended with {code}: {refusal}"] if code else [])
        tell(f"solved after {report.kills} kills in all: {'; '.join(found) or 'the same'}")
    return report


def _free_port() -> int:
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
