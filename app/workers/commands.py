"""Commands of a cluster: the scheduler, and the workers of a machine, as programs of their own."""

from __future__ import annotations

import asyncio
import logging
import signal
from collections.abc import Callable, Coroutine
from contextlib import suppress
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.errors import ClusterError
from app.terminal.options import read_settings
from app.terminal.terminal import say

if TYPE_CHECKING:
    from app.workers.cluster import SchedulerPlace

AGAIN_S = 2.0
"""Seconds until a worker whose scheduler has gone looks for it again."""
_NO_PAGES: dict[str, Any] = {
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    # A worker that is killed is no fault of what it did; a task over which ten ended is.
    "distributed.scheduler.allowed-failures": 10,
    "distributed.comm.timeouts.connect": "10s",
    "distributed.worker.daemon": True,
}
"""Neither a dashboard nor any other page: what Dask's show is for nobody but the operator."""
_NOWHERE = "127.0.0.1:0"

Say = Callable[[str], None]


def run_scheduler(place: SchedulerPlace, say: Say) -> None:
    """Carry tasks between servers and workers until the process is told to end.

    Raises:
        ClusterError: It cannot listen there.
    """
    _run_event_loop(_run_scheduler(place, say))


def run_workers(place: SchedulerPlace, count: int, memory: int | None, say: Say) -> None:
    """Solve for a scheduler until the process is told to end; one that ends is started again.

    Args:
        place: Where the scheduler is; it may come later, and go and come back.
        count: Processes.
        memory: Bytes that each may use before it is started anew; None: its share of the machine.
        say: Told when they begin.
    """
    with TemporaryDirectory(prefix="touchline-worker-") as folder:
        _run_event_loop(_run_workers(place, count, memory, folder, say))


def _run_event_loop(program: Coroutine[Any, Any, None]) -> None:
    import dask
    import distributed.scheduler  # noqa: F401  # so that its log is known

    from app.workers.cluster import silence_dask

    silence_dask()
    with dask.config.set(_NO_PAGES):
        asyncio.run(program)


async def _run_scheduler(place: SchedulerPlace, say: Say) -> None:
    from distributed import Scheduler

    end = _make_stop_event()
    try:
        scheduler = await Scheduler(
            host=place.host,
            port=place.port,
            protocol="tcp" if place.keys is None else "tls",
            security=place.make_dask_security(),
            dashboard=False,
            dashboard_address=_NOWHERE,
        )
    except OSError as error:
        raise ClusterError(f"the scheduler cannot listen on {place.address} ({error})") from error
    async with scheduler:
        say(f"The scheduler is at {scheduler.address}")
        await end.wait()


async def _run_workers(
    place: SchedulerPlace, count: int, memory: int | None, folder: str, say: Say
) -> None:
    end = _make_stop_event()
    say(f"{count} workers look for the scheduler at {place.address}")
    limit = 0.9 / count if memory is None else memory
    keepers = [
        asyncio.ensure_future(_keep_worker_running(place, limit, folder)) for _ in range(count)
    ]
    await end.wait()
    for keeper in keepers:
        keeper.cancel()
    await asyncio.gather(*keepers, return_exceptions=True)


async def _keep_worker_running(place: SchedulerPlace, limit: float, folder: str) -> None:
    """A worker, and another one whenever it has ended."""
    from distributed import Nanny

    while True:
        with suppress(OSError, TimeoutError, RuntimeError):
            async with Nanny(
                place.address,
                nthreads=1,
                memory_limit=limit,
                local_directory=folder,
                silence_logs=logging.ERROR,
                security=place.make_dask_security(),
                dashboard=False,
                dashboard_address=_NOWHERE,
            ) as nanny:
                await nanny.finished()
        await asyncio.sleep(AGAIN_S)


def _make_stop_event() -> asyncio.Event:
    end, loop = asyncio.Event(), asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, end.set)
    return end


commands = typer.Typer()

Address = Annotated[
    str | None,
    typer.Argument(
        metavar="ADDRESS",
        help="tcp://127.0.0.1:8786, or tls://HOST:PORT; default: TOUCHLINE_CLUSTER.",
    ),
]
LOCAL = "tcp://127.0.0.1:8786"


@commands.command()
def scheduler(address: Address = None) -> None:
    """Carry work between servers and workers of other machines."""
    from app.workers.cluster import parse_scheduler_address

    settings = read_settings()
    place = parse_scheduler_address(address or settings.cluster or LOCAL, settings.cluster_keys)
    run_scheduler(place, say)


@commands.command()
def worker(
    address: Address = None,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Processes; default: all cores.")
    ] = None,
    memory: Annotated[
        int | None,
        typer.Option(min=100, metavar="MB", help="Memory of each; default: its share of 90 %."),
    ] = None,
) -> None:
    """Solve on this machine for servers of others; it needs neither database nor frames."""
    from app.workers.cluster import parse_scheduler_address

    settings = read_settings()
    place = parse_scheduler_address(address or settings.cluster or LOCAL, settings.cluster_keys)
    given = None if memory is None else memory * 2**20
    run_workers(place, workers or settings.workers, given, say)
