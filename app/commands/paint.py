"""Commands that read the paint of pictures: of a dataset's, or of files (snap, agree)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from app.commands.matches import print_sentences
from app.commands.opened import opened_store
from app.commands.options import Json, Workers, acting, read_settings
from app.commands.terminal import print_json, say, show_progress

commands = typer.Typer()

Images = Annotated[
    list[Path],
    typer.Argument(metavar="IMAGES...", exists=True, help="Folder, zip or files (jpg, png, webp)."),
]


@commands.command()
def paint(
    dataset: Annotated[str, typer.Argument(metavar="DATASET", help="Name of the dataset.")],
    match: Annotated[str | None, typer.Option(help="The pictures of this match alone.")] = None,
    show: Annotated[
        bool, typer.Option("--show", help="Read nothing: show what was read before.")
    ] = False,
    undo: Annotated[
        bool, typer.Option("--undo", help="Give all groups what they had before the last reading.")
    ] = False,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Read the paint of a dataset's pictures: cameras are drawn onto it.

    Pictures that were read for the lines that they have now are left alone. The policy must say
    calibration.source paint, as touchline does; `touchline solve` computes what follows.
    """
    from app.review.datasets.match_choice import of_match
    from app.review.editing.paint import get_paint, read_paint, take_back_paint

    if show and undo:
        raise typer.BadParameter("show what was read or take it back, one at a time")
    with opened_store() as store:
        if undo:
            found = take_back_paint(store, dataset, actor=acting())
        elif show:
            found = get_paint(store, dataset)
        else:
            with show_progress("Reading paint") as progress:
                found = read_paint(
                    store,
                    dataset,
                    None if match is None else [match],
                    actor=acting(),
                    workers=workers,
                    progress=progress,
                )
    print_sentences(of_match(found.items, match), json_)


@commands.command()
def snap(
    lines: Annotated[
        Path, typer.Argument(metavar="LINES", exists=True, help="Folder or zip of line files.")
    ],
    images: Images,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder for camera files.")],
    size: Annotated[
        str, typer.Option(help="native: the size of each picture is its own.")
    ] = "native",
    json_: Json = False,
) -> None:
    """Cameras from clicked lines and the paint of their pictures."""
    from app.review.datasets.paint_files import snap_files

    if size != "native":
        raise typer.BadParameter(
            "each picture is read in its own size; leave this out", param_hint="--size"
        )
    with show_progress("Snapping") as progress:
        rows = snap_files(lines, images, out, settings=read_settings(), progress=progress)
    _print_rows(rows, json_)


@commands.command()
def agree(
    cameras: Annotated[
        Path, typer.Argument(metavar="CAMERAS", exists=True, help="Folder or zip of camera files.")
    ],
    images: Images,
    json_: Json = False,
) -> None:
    """How well cameras agree with the paint of their pictures; needs no lines."""
    from app.review.datasets.paint_files import agree_files

    with show_progress("Reading paint") as progress:
        rows = agree_files(cameras, images, settings=read_settings(), progress=progress)
    _print_rows(rows, json_)


def _print_rows(rows: list[dict[str, Any]], as_json: bool) -> None:
    """A line for each picture, or all as JSON."""
    if as_json:
        print_json(rows)
        return
    for row in rows:
        numbers = [
            f"{name.replace('_', ' ')} {row[name]:.3g}"
            for name in ("supported", "explained", "points", "error_px", "moved_px")
            if row[name] is not None
        ]
        say("  ".join([row["frame"], row["outcome"], *numbers, row["reason"] or ""]).rstrip())
