"""Commands on work that is given out: list, give, show and close batches; in a home or on a server."""

from __future__ import annotations

from datetime import date
from typing import Annotated, Any

import typer

from app.soccer.choices import GoldStart
from app.terminal import remote
from app.terminal.options import Json, get_current_actor
from app.terminal.server import ask_server, open_store
from app.terminal.terminal import print_rows, print_values

commands = typer.Typer(help="Groups that are assigned to people.", no_args_is_help=True)

Dataset = Annotated[str, typer.Argument(help="Name or id of the dataset.")]
Number = Annotated[int, typer.Argument(help="Number of the batch.", min=1)]


@commands.command("list")
def list_(dataset: Dataset, json_: Json = False) -> None:
    """List the batches of a dataset: open ones and those that are due first come first."""
    found = ask_server(lambda client: remote.fetch_batches(client, dataset))
    if found is None:
        from app.features.batches.service import list_batches

        with open_store() as store:
            found = [_batch_to_json(batch) for batch in list_batches(store, dataset)]
    print_rows(found, json_, lambda value: value, _format_batch)


@commands.command()
def give(
    dataset: Dataset,
    name: Annotated[str, typer.Argument(help="What people call the batch.")],
    query: Annotated[
        str, typer.Option("--query", help="Which groups, and in which order; default: all.")
    ] = "",
    size: Annotated[int | None, typer.Option(min=1, help="Limit to the first N of them.")] = None,
    annotator: Annotated[
        list[str] | None, typer.Option(help="Who annotates; may be given several times.")
    ] = None,
    reviewer: Annotated[
        list[str] | None, typer.Option(help="Who reviews; default: every reviewer.")
    ] = None,
    due: Annotated[str | None, typer.Option(metavar="DATE", help="By when: 2026-12-24.")] = None,
    verdicts: Annotated[int, typer.Option(min=1, help="Annotators per group.")] = 1,
    seen: Annotated[bool, typer.Option("--seen", help="Annotators see each other's work.")] = False,
    gold_every: Annotated[int | None, typer.Option(min=1, help="One gold group in N.")] = None,
    again: Annotated[
        bool, typer.Option("--again", help="Also groups that wait in another open batch.")
    ] = False,
    json_: Json = False,
) -> None:
    """Give out the groups that a query finds now, in its order."""
    day = _parse_day(due)
    fields: dict[str, Any] = {
        "name": name,
        "size": size,
        "annotators": annotator or [],
        "reviewers": reviewer or [],
        "verdicts": verdicts,
        "blind": not seen,
        "gold_every": gold_every,
        "skip_given": not again,
    }
    body = {**fields, "q": query, "due": None if day is None else day.isoformat()}
    found = ask_server(lambda client: remote.create_batch_on_server(client, dataset, body))
    if found is None:
        from app.features.batches.service import NewBatch, make_batch

        new = NewBatch(query=query, due=day, **fields)
        with open_store() as store:
            found = _batch_to_json(make_batch(store, dataset, new, actor=get_current_actor()))
    print_values(found, json_)


@commands.command()
def show(batch: Number, json_: Json = False) -> None:
    """Show how far a batch is."""
    found = ask_server(lambda client: remote.fetch_batch(client, batch))
    if found is None:
        from app.features.batches.service import get_batch

        with open_store() as store:
            found = _batch_to_json(get_batch(store, batch))
    print_values(found, json_)


@commands.command()
def gold(
    dataset: Dataset,
    source: Annotated[
        str, typer.Option("--from", help="Source of the truth: sample, or version.")
    ] = "sample",
    version: Annotated[str | None, typer.Option(help="Name or id of the version.")] = None,
    query: Annotated[str, typer.Option("--query", help="Which groups; default: all.")] = "",
    size: Annotated[
        int, typer.Option(min=1, max=1000, help="Limit to the first N of them.")
    ] = 1000,
    start: Annotated[GoldStart, typer.Option(help="What annotators start with.")] = "imported",
    json_: Json = False,
) -> None:
    """Make gold groups of those whose truth is known; batches mix them in."""
    from app.features.independent_annotations.gold import TruthSource

    if source not in (TruthSource.SAMPLE, TruthSource.VERSION):
        raise typer.BadParameter("use --from sample or --from version", param_hint="--from")
    body = {"source": source, "version": version, "q": query, "size": size, "start": start}
    made = ask_server(lambda client: remote.make_gold_groups_on_server(client, dataset, body))
    if made is not None:
        print_values(made, json_)
        return
    from app.features.independent_annotations.known_truth import (
        GoldChoice,
        mark_groups_with_known_truth,
    )

    choice = GoldChoice(TruthSource(source), version, query, size, start)
    with open_store() as store:
        found = mark_groups_with_known_truth(store, dataset, choice, actor=get_current_actor())
    print_values({"groups": [*found.groups], "left_out": found.left_out}, json_)


@commands.command()
def change(
    batch: Number,
    gold_every: Annotated[int | None, typer.Option(min=1, help="One gold group in N.")] = None,
    no_gold: Annotated[bool, typer.Option("--no-gold", help="No gold groups any more.")] = False,
    json_: Json = False,
) -> None:
    """Change how many gold groups a batch mixes in, also while people work on it."""
    if (gold_every is None) != no_gold:
        raise typer.BadParameter("use either --gold-every or --no-gold", param_hint="--gold-every")
    found = ask_server(lambda client: remote.change_gold_frequency(client, batch, gold_every))
    if found is None:
        from app.features.batches.service import change_batch

        with open_store() as store:
            changed = change_batch(
                store, batch, actor=get_current_actor(), gold_every=gold_every, no_gold=no_gold
            )
        found = _batch_to_json(changed)
    print_values(found, json_)


@commands.command()
def close(batch: Number, json_: Json = False) -> None:
    """Give nothing more out of a batch; what was said of its groups stays."""
    found = ask_server(lambda client: remote.close_batch(client, batch))
    if found is None:
        from app.features.batches.queries import CLOSED
        from app.features.batches.service import change_batch

        with open_store() as store:
            changed = change_batch(store, batch, actor=get_current_actor(), state=CLOSED)
        found = _batch_to_json(changed)
    print_values(found, json_)


def _batch_to_json(batch: Any) -> dict[str, Any]:
    return {name: getattr(batch, name) for name in remote.BATCH}


def _format_batch(value: dict[str, Any]) -> str:
    people = ", ".join([*value["annotators"], *value["reviewers"]]) or "everybody"
    due = "" if value["due"] is None else f"   due {value['due']}"
    return (
        f"{value['id']:5} {value['name']:30} {value['state']:7}"
        f"{value['settled']:6} of {value['groups']} settled, {value['submitted']} to review"
        f"   {people}{due}"
    )


def _parse_day(text: str | None) -> date | None:
    try:
        return None if text is None else date.fromisoformat(text)
    except ValueError:
        raise typer.BadParameter(
            f'"{text}" is not a day; write it as 2026-12-24', param_hint="--due"
        ) from None
