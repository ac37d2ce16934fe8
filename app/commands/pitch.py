"""The command on pitches: what size line files show, or the matches of a dataset."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.opened import opened_to_solve
from app.commands.options import Json, Size, Workers, acting
from app.commands.terminal import print_json, print_values, say

if TYPE_CHECKING:
    from app.review.editing.pitches import DatasetPitches, PitchState

commands = typer.Typer()


@commands.command()
def pitch(
    source: Annotated[
        str | None,
        typer.Argument(
            metavar="[IN]",
            help="Folder or zip of line files; the name of a dataset, where nothing is called so.",
        ),
    ] = None,
    *,
    dataset: Annotated[
        str | None, typer.Option("--dataset", help="Name of the dataset, in the place of IN.")
    ] = None,
    size: Size,
    accept: Annotated[
        bool, typer.Option("--accept", help="Dataset: give matches the size that is proposed.")
    ] = False,
    match: Annotated[
        str | None, typer.Option(help="Dataset: this match alone, as the list names it.")
    ] = None,
    set_: Annotated[
        str | None,
        typer.Option("--set", metavar="105x68|previous", help="Dataset: this size for --match."),
    ] = None,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Estimate the size of a pitch from line files of one match, or of each match of a dataset.

    A length or width that the lines do not show is unknown. After a change of a dataset's
    pitches, `touchline solve` computes what follows from it.
    """
    if (source is None) == (dataset is None):
        raise typer.BadParameter("give either line files or --dataset")
    # What this user may not see is no file of theirs, but may be a dataset.
    if source is not None and os.path.exists(source):  # noqa: PTH110
        if accept or match or set_:
            raise typer.BadParameter("--accept, --match and --set are for datasets")
        from app.review.datasets.pitch_files import estimate_pitch_of_files

        print_values(estimate_pitch_of_files(Path(source), size=size), json_)
        return
    if set_ is not None and match is None:
        raise typer.BadParameter("--set needs --match")
    name = dataset or source or ""
    _print(_of_dataset(name, accept, match, set_, workers), match, json_)


def _of_dataset(
    dataset: str, accept: bool, match: str | None, size: str | None, workers: int | None
) -> DatasetPitches:
    from app.review.editing.pitches import change_pitches, estimate_pitches, sizes_asked

    with opened_to_solve("Estimating", workers) as (store, executor, progress):
        found = estimate_pitches(store, dataset, executor, progress)
        wanted = sizes_asked(found, match, accept=accept, size=size)
        if not wanted:
            return found
        return change_pitches(store, dataset, wanted, if_match=found.etag, actor=acting())


def _print(found: DatasetPitches, match: str | None, json_: bool) -> None:
    from app.review.datasets.match_choice import of_match

    items = of_match(found.items, match)
    if json_:
        print_json([pitch_values(item) for item in items])
        return
    for item in items:
        values = pitch_values(item)
        size = f"{item.pitch.length:g} x {item.pitch.width:g} m"
        shown = f"length {_number(values, 'length')}, width {_number(values, 'width')}"
        proposed = item.proposed
        advice = "" if proposed is None else f"; use {proposed.length:g} x {proposed.width:g} m"
        name = item.match or "groups without a match"
        say(f"{name}: {size}; lines show {item.problem or shown}{advice}")


def _number(values: dict[str, Any], name: str) -> str:
    found = (values["estimate"] or {}).get(name)
    if found is None:
        return "unknown"
    return f"{found:.2f} m (sigma {values['estimate'][f'{name}_sigma_m']:.2f})"


def pitch_values(state: PitchState) -> dict[str, Any]:
    """A match's pitch as plain values, as the API spells them."""
    from dataclasses import asdict

    values = asdict(state)
    return {**values.pop("pitch"), **values}
