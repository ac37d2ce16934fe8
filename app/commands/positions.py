"""The command on shared positions: where each match's main camera stands, shared or taken back."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from app.commands.opened import executor_of, opened_store
from app.commands.options import Dataset, Json, Workers, acting, read_settings
from app.commands.terminal import print_rows, show_progress

commands = typer.Typer()


@commands.command()
def positions(
    dataset: Dataset,
    share: Annotated[
        bool, typer.Option("--share", help="Estimate it and give it to the pictures of the match.")
    ] = False,
    undo: Annotated[
        bool, typer.Option("--undo", help="Give --match what it had before it was shared last.")
    ] = False,
    match: Annotated[
        str | None, typer.Option(help="This match alone, as the list names it.")
    ] = None,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Show where each match's main camera stands, or share that with the pictures of the match.

    Without --match it is shared where what it was estimated from has changed since. The policy
    must say calibration.share_position; `touchline solve` computes what follows.
    """
    from app.review.editing.positions import get_positions, share_positions, take_back_positions

    if share and undo:
        raise typer.BadParameter("share positions or take them back, one at a time")
    if undo and match is None:
        raise typer.BadParameter("--undo needs --match")
    settings = read_settings()
    with opened_store(settings) as store:
        if undo:
            found = take_back_positions(store, dataset, match or "", actor=acting())
        elif share:
            with (
                executor_of(settings, workers) as executor,
                show_progress("Estimating") as progress,
            ):
                chosen = None if match is None else [match]
                found = share_positions(
                    store, dataset, chosen, actor=acting(), executor=executor, progress=progress
                )
        else:
            found = get_positions(store, dataset)
    items = [item for item in found.items if match in (None, item.match)]
    print_rows(
        items,
        json_,
        lambda item: {**asdict(item), "sentence": item.sentence},
        lambda item: f"{item.match}: {item.sentence}",
    )
