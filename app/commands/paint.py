"""Commands that read the paint of pictures: snap, agree; they need no dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from app.commands.options import Json, read_settings
from app.commands.terminal import print_json, say, show_progress

commands = typer.Typer()

Images = Annotated[
    list[Path],
    typer.Argument(metavar="IMAGES...", exists=True, help="Folder, zip or files (jpg, png, webp)."),
]


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
        raise typer.BadParameter("the size of each picture is its own", param_hint="--size")
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
