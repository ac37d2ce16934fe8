"""Commands that read files into a dataset and write them from it: import and export."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from app.commands.opened import opened_store
from app.commands.options import (
    Dataset,
    Json,
    acting,
    parse_cameras,
    parse_frame_offset,
    parse_size,
    read_settings,
)
from app.commands.policy import read_policy_option
from app.commands.terminal import complain, print_export, print_import, show_progress
from app.datasets.format_names import ExportFormat, ImportFormat
from app.soccer.frames import ImageSize

commands = typer.Typer()


class Calibration(StrEnum):
    """Which calibration counts where there are both."""

    GIVEN = "given"
    LINES = "lines"


class Boxes(StrEnum):
    """Which ball box an export writes."""

    OPTIMIZED = "optimized"
    ANNOTATED = "annotated"
    EXACT = "exact"


class Views(StrEnum):
    """From which views training data are made."""

    VALID = "valid"
    ALL = "all"


class Images(StrEnum):
    """What an export does with frames."""

    NONE = "none"
    COPY = "copy"
    LINK = "link"


@commands.command("import")
def import_(
    format_: Annotated[ImportFormat, typer.Argument(metavar="FORMAT")],
    path: Annotated[Path, typer.Argument(exists=True, help="A folder or a file.")],
    dataset: Dataset,
    lines: Annotated[
        Path | None, typer.Option(exists=True, help="ISSIA: line files of the static cameras.")
    ] = None,
    calibration: Annotated[Calibration, typer.Option(help="Which one counts.")] = Calibration.GIVEN,
    frame_offset: Annotated[
        str, typer.Option(help="ISSIA: XGTF frame minus video frame; 8, or 1=8,2=9 by camera.")
    ] = "8",
    flip: Annotated[
        str, typer.Option(metavar="2,6", help="ISSIA: cameras whose videos are mirrored.")
    ] = "",
    size: Annotated[
        ImageSize | None,
        typer.Option(
            "--size", parser=parse_size, metavar="WxH", help="Default 960x540; ISSIA 1920x1080."
        ),
    ] = None,
    policy: Annotated[
        str,
        typer.Option(
            metavar="paper|strict|touchline|FILE.yaml",
            help="Judges the dataset where this import makes it.",
        ),
    ] = "paper",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would happen, and keep nothing.")
    ] = False,
    json_: Json = False,
) -> None:
    """Read files into a dataset; doing it again changes nothing.

    FORMAT is soccernet-v3, soccernet-v3d, issia, issia-3d, sn-calibration, cameras, gamestate,
    coco, parquet or touchline; docs/formats.md says what each of them holds.
    """
    from app.review.importing.sources import Source, import_source

    source = Source(
        format_,
        path.resolve(),
        size=size,
        lines=None if lines is None else lines.resolve(),
        calibration=calibration.value,
        frame_offset=parse_frame_offset(frame_offset),
        flipped=parse_cameras(flip),
    )
    chosen = read_policy_option(policy)
    settings = read_settings()
    with opened_store(settings) as store, show_progress("Importing") as progress:
        imported = import_source(
            store, dataset, source, settings, progress,
            actor=acting(), dry_run=dry_run, policy=chosen,
        )  # fmt: skip
    print_import(imported.values(), json_)
    if not imported.something:
        complain(*imported.nothing_read())
        raise typer.Exit(1)


@commands.command()
def export(
    out: Annotated[Path, typer.Argument(help="A folder, or a zip by its ending.")],
    dataset: Dataset,
    format_: Annotated[ExportFormat, typer.Option("--format", help="Which format to write.")],
    everything: Annotated[
        bool, typer.Option("--all", help="Every group, failed and rejected too.")
    ] = False,
    boxes: Annotated[Boxes, typer.Option(help="Which ball box is written.")] = Boxes.OPTIMIZED,
    images: Annotated[Images, typer.Option(help="What happens to frames.")] = Images.NONE,
    views: Annotated[
        Views, typer.Option(help="coco and yolo: balls that no other view confirms, too?")
    ] = Views.VALID,
    version: Annotated[
        str | None, typer.Option(help="A frozen version (name, id or hash): always the same bytes.")
    ] = None,
    json_: Json = False,
) -> None:
    """Write accepted groups, all of them, or a frozen version, with a manifest."""
    from app.review.exporting.export import export as run_export
    from app.review.exporting.export import require_possible

    with opened_store() as store, show_progress("Exporting") as progress:
        require_possible(
            store,
            dataset,
            format_,
            everything=everything,
            boxes=boxes.value,
            images=images.value,
            views=views.value,
            version=version,
        )
        report = run_export(
            store,
            dataset,
            format_,
            out,
            everything=everything,
            boxes=boxes.value,
            images=images.value,
            views=views.value,
            version=version,
            progress=progress,
        )
    print_export({**vars(report), "out": str(report.out)}, json_)
