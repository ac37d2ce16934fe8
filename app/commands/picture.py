"""The command on pictures: were those of a match, or of line files, stretched or cropped."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.opened import opened_to_solve
from app.commands.options import Json, Size, Workers, acting
from app.commands.terminal import print_json, print_values, say
from app.plural import plural

if TYPE_CHECKING:
    from app.review.editing.pictures import PictureState

commands = typer.Typer()


@commands.command()
def picture(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="[LINES]", exists=True, help="Folder or zip of line files of one match or shot."
        ),
    ] = None,
    *,
    dataset: Annotated[
        str | None, typer.Option("--dataset", help="Name of a dataset, in the place of LINES.")
    ] = None,
    size: Size,
    match: Annotated[
        str | None, typer.Option(help="Dataset: this match alone, as the list names it.")
    ] = None,
    accept: Annotated[
        bool, typer.Option("--accept", help="Dataset: solve main cameras with what is proposed.")
    ] = False,
    as_taken: Annotated[
        bool, typer.Option("--as-taken", help="Dataset: take main cameras of --match as they are.")
    ] = False,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Estimate how pictures were stretched or cropped, from many frames of one match or shot.

    After a change of a dataset's pictures, `touchline solve` computes what follows from it.
    """
    if (source is None) == (dataset is None):
        raise typer.BadParameter("give either line files or --dataset")
    if source is not None:
        if accept or as_taken or match:
            raise typer.BadParameter("--accept, --as-taken and --match are for datasets")
        from app.review.datasets.pictures import estimate_picture_of_files

        print_values(estimate_picture_of_files(source, size=size), json_)
        return
    if accept and as_taken:
        raise typer.BadParameter("--accept and --as-taken contradict each other")
    if as_taken and match is None:
        raise typer.BadParameter("--as-taken needs --match")
    _of_dataset(dataset or "", match, accept, as_taken, workers, json_)


def _of_dataset(
    dataset: str,
    match: str | None,
    accept: bool,
    as_taken: bool,
    workers: int | None,
    json_: bool,
) -> None:
    from app.review.datasets.match_choice import need_match
    from app.review.editing.pictures import change_pictures, estimate_pictures, pictures_asked

    with opened_to_solve("Estimating", workers) as (store, executor, progress):
        found = estimate_pictures(store, dataset, executor, progress)
        chosen = need_match(found, match, dataset)
        wanted = pictures_asked(chosen, accept=accept, as_taken=as_taken)
        changed = change_pictures(store, dataset, wanted, actor=acting()) if wanted else 0
    if json_:
        print_json([{**_values(item), "changed": item.match in wanted} for item in chosen])
        return
    for item in chosen:
        say(f"{item.match}: {_sentence(item)}")
    if wanted:
        say(f"{plural(changed, 'view')} changed; run touchline solve --dataset {dataset}")


def _sentence(state: PictureState) -> str:
    if state.estimate is None:
        return state.sentence
    return f"{state.sentence}; {'use it with --accept' if state.proposed else 'nothing to change'}"


def _values(state: PictureState) -> dict[str, Any]:
    from dataclasses import asdict

    values = asdict(state)
    proposed = state.proposed
    return {**values, "proposed": None if proposed is None else asdict(proposed)}
