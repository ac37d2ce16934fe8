"""The command that judges: one verdict for every group that a query matches."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

import typer

from app.soccer.choices import VerdictState
from app.terminal import remote
from app.terminal.options import Dataset, Json, get_current_actor
from app.terminal.server import ask_server, open_store
from app.terminal.terminal import print_error, print_json, print_values, say

commands = typer.Typer()


@commands.command()
def verdict(
    state: Annotated[VerdictState, typer.Argument(help="unreviewed takes a verdict back.")],
    dataset: Dataset,
    query: Annotated[
        str,
        typer.Option(
            help='Which groups, as in the browser: "passes:yes sigma<0.1", "id:12,15"; "" is all.'
        ),
    ],
    reason: Annotated[
        str | None, typer.Option(help="Of a rejection, such as bad_field_lines.")
    ] = None,
    note: Annotated[
        str | None,
        typer.Option(help="Why; needed for groups that fail a gate or have no picture."),
    ] = None,
    expected: Annotated[
        int | None, typer.Option(min=0, help="Judge nothing where another number would change.")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Dry run: report what would happen, change nothing.")
    ] = False,
    json_: Json = False,
) -> None:
    """Accept, reject or defer every group that a query matches; the browser can take it back.

    Groups that cannot be accepted as they are stay as they are and are counted by reason.
    """
    from app.features.verdicts.service import check_verdict

    check_verdict(state, reason, note)
    body = {"q": query, "state": state, "reason": reason, "note": note, "expected": expected}
    arguments = (query, state, reason, note)
    plan, report = ask_server(
        lambda client: remote.plan_or_give_verdicts(client, dataset, body, dry_run=dry_run)
    ) or _give_verdicts_in_home(dataset, arguments, expected, dry_run=dry_run)
    done = plan if report is None else report
    values: dict[str, Any] = {"matches": plan["matches"]}
    if report is None:
        replaced = {item["state"]: item["groups"] for item in plan["replaced"]}
        values |= {"would_change": plan["would_change"], "unchanged": plan["unchanged"]}
        values |= {"replaced": replaced}
    else:
        values |= {"changed": report["changed"], "batch": report["batch"]}
    refused = {item["reason"]: item["groups"] for item in done["refused"]}
    values |= {"dry_run": dry_run, "refused": refused}
    sample = plan["sample"] if dry_run else []
    if json_:
        print_json({**values, "sample": sample})
    else:
        print_values(values, False)
        for item in sample:
            say(f"  {item['number']:6} {item['label'] or item['key']}")
    if refused and not plan["would_change"]:
        print_error("no verdict was set: all matching groups were refused", "Say why in --note.")
        raise typer.Exit(1)


def _give_verdicts_in_home(
    dataset: str,
    values: tuple[str, str, str | None, str | None],
    expected: int | None,
    *,
    dry_run: bool,
) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """What the verdicts would do in a home, and what they did."""
    from app.features.datasets.service import dataset_id
    from app.features.verdicts.bulk import give_verdicts, plan_verdicts

    with open_store() as store:
        found = dataset_id(store, dataset)
        plan = plan_verdicts(store, found, *values)
        if dry_run:
            return asdict(plan), None
        report = give_verdicts(store, found, *values, actor=get_current_actor(), expected=expected)
    return asdict(plan), asdict(report)
