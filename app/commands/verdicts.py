"""The command that judges: one verdict for every group that a query matches."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from app.commands.opened import opened_store
from app.commands.options import Dataset, Json, acting
from app.commands.terminal import complain, print_json, print_values, say
from app.soccer.choices import VerdictState

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
    from app.review.datasets.dataset import dataset_id
    from app.review.verdicts.bulk import give_verdicts, plan_verdicts

    with opened_store() as store:
        found = dataset_id(store, dataset)
        plan = plan_verdicts(store, found, query, state, reason, note)
        values: dict[str, Any] = {"matches": plan.matches, "would_change": plan.would_change}
        refused = plan.refused
        if not dry_run:
            report = give_verdicts(
                store,
                found,
                query,
                state,
                reason,
                note,
                actor=acting(),
                expected=expected,
            )
            values = {"matches": plan.matches, "changed": report.changed, "batch": report.batch}
            refused = report.refused
    values |= {"dry_run": dry_run, "refused": {item.reason: item.groups for item in refused}}
    if json_:
        print_json({**values, "sample": [vars(item) for item in plan.sample] if dry_run else []})
    else:
        print_values(values, False)
        for item in plan.sample if dry_run else ():
            say(f"  {item.number:6} {item.label or item.key}")
    if refused and not plan.would_change:
        complain("no group was judged: each that matches was refused", "Say why in --note.")
        raise typer.Exit(1)
