"""The command that proposes cameras for frames that nobody has annotated."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands.options import Json, parse_size, read_settings
from app.commands.terminal import print_json, print_values, say, show_progress

commands = typer.Typer()


@commands.command()
def propose(
    images: Annotated[
        list[Path],
        typer.Argument(metavar="IMAGES...", exists=True, help="Folders, zips or files: jpg, png."),
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder for camera files.")],
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
    json_: Json = False,
) -> None:
    """Propose a camera for each picture from its painted lines alone; needs no dataset.

    OUT gets camera_<stem>.json of the proposed ones, and propose.json with the outcome of each
    (proposed, unsure, nothing). Sides are by convention: the camera stands where y > 0.
    """
    from app.review.datasets.propose import counts_of, propose_files

    wanted = None if size == "native" else parse_size(size)
    with show_progress("Proposing") as progress:
        rows = propose_files(
            images, out, read_settings(), size=wanted, known=known or (), progress=progress
        )
    if json_:
        print_json(rows)
        return
    for row in rows:
        if row["reason"]:
            say(f"{row['frame']}: {row['outcome']}; {row['reason']}")
    print_values(counts_of(rows), False)
