"""Commands on estimates of a match: pitch, positions, picture."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.plural import plural
from app.terminal.options import Dataset, Json, Size, Workers, acting
from app.terminal.server import opened_store, opened_to_solve
from app.terminal.terminal import print_json, print_rows, print_values, say

if TYPE_CHECKING:
    from app.features.match_estimates.pictures import PictureState
    from app.features.pitches.service import DatasetPitches, PitchState

commands = typer.Typer()


@commands.command()
def pitch(
    source: Annotated[
        str | None,
        typer.Argument(
            metavar="[IN]",
            help="Folder or zip of line files, or else the name of a dataset.",
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
        from app.features.file_tools.matches import estimate_pitch_of_files

        print_values(estimate_pitch_of_files(Path(source), size=size), json_)
        return
    if set_ is not None and match is None:
        raise typer.BadParameter("--set needs --match")
    name = dataset or source or ""
    _print_pitches(_estimate_pitches_of_dataset(name, accept, match, set_, workers), match, json_)


def _estimate_pitches_of_dataset(
    dataset: str, accept: bool, match: str | None, size: str | None, workers: int | None
) -> DatasetPitches:
    from app.features.pitches.service import change_pitches, estimate_pitches, requested_sizes

    with opened_to_solve("Estimating", workers) as (store, executor, progress):
        found = estimate_pitches(store, dataset, executor, progress)
        wanted = requested_sizes(found, match, accept=accept, size=size)
        if not wanted:
            return found
        with store.write() as session:
            return change_pitches(session, dataset, wanted, if_match=found.etag, actor=acting())


def _print_pitches(found: DatasetPitches, match: str | None, json_: bool) -> None:
    from app.features.datasets.service import of_match

    items = of_match(found.items, match)
    if json_:
        print_json([pitch_values(item) for item in items])
        return
    for item in items:
        values = pitch_values(item)
        size = f"{item.pitch.length:g} x {item.pitch.width:g} m"
        shown = f"length {_metres_with_sigma(values, 'length')}, width {_metres_with_sigma(values, 'width')}"
        proposed = item.proposed
        advice = "" if proposed is None else f"; use {proposed.length:g} x {proposed.width:g} m"
        name = item.match or "groups without a match"
        say(f"{name}: {size}; lines show {item.problem or shown}{advice}")


def _metres_with_sigma(values: dict[str, Any], name: str) -> str:
    found = (values["estimate"] or {}).get(name)
    if found is None:
        return "unknown"
    return f"{found:.2f} m (sigma {values['estimate'][f'{name}_sigma_m']:.2f})"


def pitch_values(state: PitchState) -> dict[str, Any]:
    """A match's pitch as plain values, as the API spells them."""
    from dataclasses import asdict

    values = asdict(state)
    return {**values.pop("pitch"), **values}


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
        from app.features.file_tools.matches import estimate_picture_of_files

        print_values(estimate_picture_of_files(source, size=size), json_)
        return
    if accept and as_taken:
        raise typer.BadParameter("--accept and --as-taken contradict each other")
    if as_taken and match is None:
        raise typer.BadParameter("--as-taken needs --match")
    _pictures_of_dataset(dataset or "", match, accept, as_taken, workers, json_)


def _pictures_of_dataset(
    dataset: str,
    match: str | None,
    accept: bool,
    as_taken: bool,
    workers: int | None,
    json_: bool,
) -> None:
    from app.features.datasets.service import need_match
    from app.features.match_estimates.pictures import (
        change_pictures,
        estimate_pictures,
        requested_pictures,
    )

    with opened_to_solve("Estimating", workers) as (store, executor, progress):
        found = estimate_pictures(store, dataset, executor, progress)
        chosen = need_match(found, match, dataset)
        wanted = requested_pictures(chosen, accept=accept, as_taken=as_taken)
        changed = 0
        if wanted:
            with store.write() as session:
                changed = change_pictures(session, dataset, wanted, actor=acting())
    if json_:
        print_json([{**_picture_values(item), "changed": item.match in wanted} for item in chosen])
        return
    for item in chosen:
        say(f"{item.match}: {_picture_sentence(item)}")
    if wanted:
        say(f"{plural(changed, 'view')} changed; run touchline solve --dataset {dataset}")


def _picture_sentence(state: PictureState) -> str:
    if state.estimate is None:
        return state.sentence
    return f"{state.sentence}; {'use it with --accept' if state.proposed else 'nothing to change'}"


def _picture_values(state: PictureState) -> dict[str, Any]:
    from dataclasses import asdict

    values = asdict(state)
    proposed = state.proposed
    return {**values, "proposed": None if proposed is None else asdict(proposed)}


def print_sentences(states: Iterable[Any], as_json: bool) -> None:
    """The sentence of each match after its name, or the values of all as one JSON list."""
    print_rows(
        states,
        as_json,
        asdict,
        lambda state: f"{state.match}: {state.sentence}" if state.match else state.sentence,
    )


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
    from app.features.datasets.service import of_match
    from app.features.match_estimates.positions import (
        get_positions,
        share_positions,
        take_back_positions,
    )

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
            if undo:
                with store.write() as session:
                    take_back_positions(session, dataset, match, actor=acting())
            found = get_positions(store, dataset)
    print_sentences(of_match(found.items, match), json_)
