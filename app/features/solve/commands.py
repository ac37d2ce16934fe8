"""Commands on what is computed: solve, and the findings of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.features.policies.commands import read_policy_option
from app.terminal import remote
from app.terminal.options import POLICY_OR_FILE, Cluster, Dataset, Json, Workers, get_current_actor
from app.terminal.server import (
    ServerPlace,
    ask_server,
    connect_to_server,
    get_current_server,
    open_store,
    open_store_to_solve,
)
from app.terminal.terminal import (
    INTERRUPTED,
    hold_interrupts,
    print_error,
    print_json,
    say,
    show_progress,
)
from app.wording import plural

if TYPE_CHECKING:
    from app.soccer.policy import Policy

commands = typer.Typer()


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
    """Compute what is missing or out of date; Ctrl+C keeps what is done, and the next run goes on.

    A server computes by itself: there it waits, and Ctrl+C leaves the job running.
    """
    server = get_current_server()
    if server is not None:
        if workers is not None or cluster is not None:
            raise typer.BadParameter("a server solves with its own processes; leave out --workers")
        chosen = None if policy is None else read_policy_option(policy)
        _print_solve_report(*_solve_on_server(server, dataset, chosen), json_=json_)
        return
    from app.features.policies.service import change_policy
    from app.features.solve.jobs import describe_pending_work, refresh_yield_table, solve_fully

    chosen = None if policy is None else read_policy_option(policy)
    with open_store_to_solve("Solving", workers, cluster) as (store, executor, progress):
        if chosen is not None:
            change_policy(store, dataset, chosen, if_match=None, actor=get_current_actor())
        with hold_interrupts() as interrupted:
            report = solve_fully(
                store, dataset, executor, progress, interrupted, actor=get_current_actor()
            )
            left = describe_pending_work(store, dataset) if interrupted() else None
            if left is not None:
                print_error(
                    f"stopped; {plural(report.solved, 'solved group is', 'solved groups are')} stored,"
                    f" {left}"
                )
                raise typer.Exit(INTERRUPTED)
        refresh_yield_table(store, dataset, report, progress)
    _print_solve_report(vars(report), report.sentence, json_=json_)


def _solve_on_server(
    server: ServerPlace, dataset: str, policy: Policy | None
) -> tuple[Mapping[str, Any], str]:
    with connect_to_server(server) as client, show_progress("Solving") as progress:
        return remote.solve_on_server(client, dataset, policy, progress)


def _print_solve_report(values: Mapping[str, Any], sentence: str, *, json_: bool) -> None:
    if json_:
        print_json(values)
        return
    say(sentence if values["total"] else "nothing to solve: every group is up to date")
    for key, problem in values["failed"]:
        say(f"  {key}: {problem}")


@commands.command()
def findings(dataset: Dataset, json_: Json = False) -> None:
    """List what a person should look at."""
    values = ask_server(lambda client: list(remote.fetch_findings(client, dataset)))
    if values is None:
        from app.features.findings.service import iterate_findings_as_json

        with open_store() as store:
            values = list(iterate_findings_as_json(store, dataset))
    if json_:
        print_json(values)
        return
    for value in values:
        place = " ".join(value[key] for key in ("group", "view") if value.get(key))
        dismissal = value.get("dismissed")
        checked = "" if dismissal is None else f" (checked by {dismissal['by']}, fine)"
        say(f"{value['kind']:20} {place}: {value['sentence']}{checked}")
