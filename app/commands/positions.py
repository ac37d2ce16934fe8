"""The command on shared positions: where each match's main camera stands, shared or taken back."""

from __future__ import annotations

from typing import Annotated

import typer

from app.commands.matches import print_sentences
from app.commands.opened import opened_store, opened_to_solve
from app.commands.options import Dataset, Json, Workers, acting

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
    from app.review.datasets.match_choice import of_match
    from app.review.editing.positions import get_positions, share_positions, take_back_positions

    if share and undo:
        raise typer.BadParameter("share positions or take them back, one at a time")
    if undo and match is None:
        raise typer.BadParameter("--undo needs --match")
    if share:
        chosen = None if match is None else [match]
        with opened_to_solve("Estimating", workers) as (store, executor, progress):
            found = share_positions(
                store, dataset, chosen, actor=acting(), executor=executor, progress=progress
            )
    else:
        with opened_store() as store:
            found = (
                take_back_positions(store, dataset, match or "", actor=acting())
                if undo
                else get_positions(store, dataset)
            )
    print_sentences(of_match(found.items, match), json_)
