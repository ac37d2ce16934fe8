"""Commands on what is computed: solve, and the findings of it."""

from __future__ import annotations

from typing import Annotated

import typer

from app.commands.opened import opened_store, opened_to_solve
from app.commands.options import POLICY_OR_FILE, Cluster, Dataset, Json, Workers, acting
from app.commands.policy import read_policy_option
from app.commands.server import connected, given_server
from app.commands.terminal import (
    complain,
    held_interrupts,
    print_json,
    say,
)

commands = typer.Typer()

INTERRUPTED = 130
"""Exit code of what Ctrl+C ended, as shells have it."""


@commands.command()
def solve(
    dataset: Dataset,
    policy: Annotated[
        str | None,
        typer.Option(
            metavar=POLICY_OR_FILE,
            help="Judge the dataset by this policy from now on.",
        ),
    ] = None,
    workers: Workers = None,
    cluster: Cluster = None,
    json_: Json = False,
) -> None:
    """Compute what is missing or out of date; Ctrl+C keeps what is done, and the next run goes on."""
    from app.review.jobs.full_solve import count_yield, left_undone, solve_fully
    from app.review.policies.policy import change_policy

    chosen = None if policy is None else read_policy_option(policy)
    with opened_to_solve("Solving", workers, cluster) as (store, executor, progress):
        if chosen is not None:
            change_policy(store, dataset, chosen, if_match=None, actor=acting())
        with held_interrupts() as interrupted:
            report = solve_fully(store, dataset, executor, progress, interrupted)
            left = left_undone(store, dataset) if interrupted() else None
            if left is not None:
                complain(f"stopped; {report.solved} groups are kept, {left}")
                raise typer.Exit(INTERRUPTED)
        count_yield(store, dataset, report, progress)
    if json_:
        print_json(vars(report))
        return
    say(report.sentence if report.total else "nothing to solve: every group is up to date")
    for key, problem in report.failed:
        say(f"  {key}: {problem}")


@commands.command()
def findings(dataset: Dataset, json_: Json = False) -> None:
    """List what a person should look at."""
    server = given_server()
    if server is not None:
        from app.commands import remote

        with connected(server) as client:
            values = list(remote.finding_values(client, dataset))
    else:
        from app.review.queue.findings import finding_values

        with opened_store() as store:
            values = list(finding_values(store, dataset))
    if json_:
        print_json(values)
        return
    for value in values:
        place = " ".join(value[key] for key in ("group", "view") if value.get(key))
        said = value.get("dismissed")
        checked = "" if said is None else f" (checked by {said['by']}, fine)"
        say(f"{value['kind']:20} {place}: {value['sentence']}{checked}")
