"""The command that proposes cameras for frames, or views of a dataset, without annotation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, get_args

import typer

from app.commands.opened import opened_store
from app.commands.options import Json, Workers, parse_size, read_settings
from app.commands.terminal import print_json, print_values, say, show_progress
from app.plural import plural
from app.soccer.choices import ProposalOutcome

commands = typer.Typer()


@commands.command()
def propose(
    images: Annotated[
        list[Path] | None,
        typer.Argument(metavar="IMAGES...", exists=True, help="Folders, zips or files: jpg, png."),
    ] = None,
    out: Annotated[
        Path | None, typer.Argument(metavar="OUT", help="Folder for camera files.")
    ] = None,
    size: Annotated[
        str,
        typer.Option(metavar="native|WxH", help="Size of the images that the cameras are for."),
    ] = "native",
    known: Annotated[
        list[Path] | None,
        typer.Option(
            exists=True,
            metavar="CAMERAS",
            help="Cameras of the same match: a file, folder or zip; may be given several times.",
        ),
    ] = None,
    dataset: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="In place of IMAGES and OUT: a dataset's views."),
    ] = None,
    match: Annotated[str | None, typer.Option(help="With --dataset: this match alone.")] = None,
    show: Annotated[
        bool, typer.Option("--show", help="With --dataset: show what was proposed before.")
    ] = False,
    undo: Annotated[
        bool, typer.Option("--undo", help="With --dataset: forget all that was proposed.")
    ] = False,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Propose a camera for each picture from its painted lines alone.

    OUT gets camera_<stem>.json of the proposed ones, and propose.json with the outcome of each
    (proposed, unsure, nothing). Sides are by convention: the camera stands where y > 0.
    With --dataset the views without a camera are looked at, and what is found is kept
    as predictions: nothing counts before a person accepts one.
    """
    if dataset is not None:
        if images or out or known or size != "native":
            raise typer.BadParameter("a dataset has its pictures and cameras: name nothing else")
        if show and undo:
            raise typer.BadParameter("show what was proposed or forget it, one at a time")
        _propose_for_views(dataset, match, show, undo, workers, json_)
        return
    if not images or out is None:
        raise typer.BadParameter("name IMAGES and OUT, or --dataset")
    if match is not None or show or undo or workers is not None:
        raise typer.BadParameter("--match, --show, --undo and --workers go with --dataset")
    _propose_for_files(images, out, size, known or (), json_)


def _propose_for_views(
    dataset: str, match: str | None, show: bool, undo: bool, workers: int | None, json_: bool
) -> None:
    from app.review.editing.proposals import forget_proposals, get_proposals, propose_views

    matches = None if match is None else [match]
    with opened_store() as store:
        if undo:
            if match is not None:
                raise typer.BadParameter("all of a dataset is forgotten, or nothing")
            print_values({"forgotten": forget_proposals(store, dataset)}, json_)
            return
        if show:
            items = [asdict(item) for item in get_proposals(store, dataset, matches).items]
            if json_:
                print_json(items)
                return
            for item in items:
                counts = ", ".join(f"{item[name]} {name}" for name in get_args(ProposalOutcome))
                said = f"{item['looked']} of {plural(item['views'], 'view')} looked at: {counts}"
                name = f"{item['match']}: " if item["match"] else ""
                say(f"{name}{said}, {item['accepted']} accepted")
            return
        with show_progress("Proposing") as progress:
            run = propose_views(store, dataset, matches, children=workers, progress=progress)
    print_values(asdict(run), json_)


def _propose_for_files(
    images: list[Path], out: Path, size: str, known: Sequence[Path], json_: bool
) -> None:
    from app.review.datasets.propose_files import counts_of, propose_files

    wanted = None if size == "native" else parse_size(size)
    with show_progress("Proposing") as progress:
        rows = propose_files(
            images, out, read_settings(), size=wanted, known=known, progress=progress
        )
    if json_:
        print_json(rows)
        return
    for row in rows:
        if row["reason"]:
            say(f"{row['frame']}: {row['outcome']}; {row['reason']}")
    print_values(counts_of(rows), False)
