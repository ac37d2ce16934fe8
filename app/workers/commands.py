"""Commands of a cluster: the scheduler, and the workers of a machine."""

from __future__ import annotations

from typing import Annotated

import typer

from app.terminal.options import read_settings
from app.terminal.terminal import say

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
    from app.workers.cluster import read_place
    from app.workers.cluster_serving import run_scheduler

    settings = read_settings()
    place = read_place(address or settings.cluster or LOCAL, settings.cluster_keys)
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
    from app.workers.cluster import read_place
    from app.workers.cluster_serving import run_workers

    settings = read_settings()
    place = read_place(address or settings.cluster or LOCAL, settings.cluster_keys)
    given = None if memory is None else memory * 2**20
    run_workers(place, workers or settings.workers, given, say)
