"""Commands that read files into a dataset and write them from it: import and export."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.features.policies.commands import read_policy_option
from app.object_store.path import StoredPath, find_path, is_address, resolve_target_path
from app.soccer.choices import (
    BoxKind,
    CalibrationChoice,
    CommandFormat,
    ExportFormat,
    PicturesWritten,
    TrainingViews,
)
from app.soccer.frames import ImageSize
from app.terminal import remote
from app.terminal.options import (
    POLICY_OR_FILE,
    Dataset,
    Json,
    get_current_actor,
    parse_cameras,
    parse_frame_offset,
    parse_path_or_store_address,
    parse_size,
    read_settings,
)
from app.terminal.server import connect_to_server, get_current_server, open_store
from app.terminal.terminal import print_error, print_export, print_import, say, show_progress

if TYPE_CHECKING:
    from app.config import Settings

commands = typer.Typer()


@commands.command("import")
def import_(
    format_: Annotated[CommandFormat, typer.Argument(metavar="FORMAT")],
    paths: Annotated[
        list[str],
        typer.Argument(
            parser=parse_path_or_store_address,
            metavar="PATH...",
            help="A folder, a file or s3://NAME/...; of video one file or more.",
        ),
    ],
    dataset: Dataset,
    lines: Annotated[
        Path | None, typer.Option(exists=True, help="ISSIA: line files of the static cameras.")
    ] = None,
    calibration: Annotated[
        CalibrationChoice | None,
        typer.Option(
            help="Which one counts; said of ISSIA, given leaves the lines of given cameras aside.",
            show_default="given",
        ),
    ] = None,
    frame_offset: Annotated[
        str, typer.Option(help="ISSIA: XGTF frame minus video frame; 8, or 1=8,2=9 by camera.")
    ] = "8",
    flip: Annotated[
        str, typer.Option(metavar="2,6", help="ISSIA: cameras whose videos are mirrored.")
    ] = "",
    size: Annotated[
        ImageSize | None,
        typer.Option(
            "--size",
            parser=parse_size,
            metavar="WxH",
            help="Size of the annotated images: default 960x540, ISSIA as its files say, else "
            "1920x1080; of cameras the size that they were made for, default that of each view.",
        ),
    ] = None,
    ball_category: Annotated[
        str,
        typer.Option(metavar="NAME", help="COCO: the category that is the ball; default: by name."),
    ] = "",
    group_by: Annotated[
        str,
        typer.Option(
            metavar="folder|PATTERN",
            help="frames: which pictures are one group, by folder or by a pattern of their names, "
            "{instant}_{camera}.jpg; default: each is one.",
        ),
    ] = "",
    propose: Annotated[
        bool,
        typer.Option("--propose/--no-propose", help="frames: propose cameras for them afterwards."),
    ] = True,
    policy: Annotated[
        str | None,
        typer.Option(
            metavar=POLICY_OR_FILE,
            help="Judges the dataset where this import makes it.",
            show_default="paper",
        ),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(
            parser=parse_path_or_store_address,
            metavar="LIST",
            help="JSON list of where frames lie in stores.",
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Dry run: report what would happen, change nothing.")
    ] = False,
    json_: Json = False,
) -> None:
    """Read files into a dataset; doing it again changes nothing.

    FORMAT is soccernet-v3, soccernet-v3d, issia, issia-3d, sn-calibration, cameras, gamestate,
    coco, parquet, frames (pictures alone), video (recordings) or touchline; docs/formats.md says what
    each of them holds.
    """
    if format_ == "video":
        from app.features.recordings.commands import import_videos

        if dry_run:
            raise typer.BadParameter("the format video has no dry run: leave out --dry-run")
        usual = lines, calibration, size, policy, frames, ball_category or None, group_by or None
        if any(value is not None for value in usual) or frame_offset != "8" or flip or not propose:
            raise typer.BadParameter(
                "the format video uses only --dataset and --json: leave out the other options"
            )
        import_videos([Path(path) for path in paths], dataset, json_)
        return
    if len(paths) > 1:
        raise typer.BadParameter(f"{format_} is read from one PATH, not {len(paths)}")
    path = paths[0]
    server = get_current_server()
    if server is not None:
        options: dict[str, Any] = {
            **({} if calibration is None else {"calibration": calibration}),
            "frame_offset": parse_frame_offset(frame_offset),
            "flipped": sorted(parse_cameras(flip)),
            "size": None if size is None else [size.width, size.height],
            **({"ball_category": ball_category} if ball_category else {}),
            **({"grouping": group_by} if group_by else {}),
            **({} if propose else {"propose": False}),
        }
        with connect_to_server(server) as client, show_progress("Importing") as progress:
            values, nothing = remote.import_on_server(
                client, dataset, format_, path if is_address(path) else Path(path), options,
                lines=lines, frames=frames, policy=policy or _choose_default_policy(format_),
                dry_run=dry_run, progress=progress,
            )  # fmt: skip
        print_import(values, json_)
        if nothing is not None:
            print_error(*nothing)
            raise typer.Exit(1)
        return
    from app.features.imports.sources import ImportSource, import_source

    settings = read_settings()
    root = _resolve_source(settings, path)
    source = ImportSource(
        format_,
        root,
        size=size,
        lines=None if lines is None else lines.resolve(),
        calibration=calibration,
        frame_offset=parse_frame_offset(frame_offset),
        flipped=parse_cameras(flip),
        frames=None if frames is None else _resolve_source(settings, frames),
        ball_category=ball_category,
        grouping=group_by,
        propose=propose,
    )
    source.require_used_options(policy=policy is not None)
    chosen = read_policy_option(policy or "paper")
    with open_store(settings, may_create=True) as store, show_progress("Importing") as progress:
        imported = import_source(
            store, dataset, source, settings, progress,
            actor=get_current_actor(), dry_run=dry_run, policy=chosen,
        )  # fmt: skip
    print_import(imported.to_report_values(), json_)
    if not imported.imported_anything:
        print_error(*imported.explain_nothing_imported())
        raise typer.Exit(1)
    if format_ in ("issia", "issia-3d") and not dry_run and not json_:
        say(
            f"Given cameras may contradict each other: touchline rig --dataset {dataset} says how far."
        )
    if format_ == "frames" and propose and not dry_run:
        _propose_cameras(dataset, settings, silent=json_)


def _propose_cameras(dataset: str, settings: Settings, *, silent: bool) -> None:
    """Propose cameras for pictures that were imported; Ctrl+C keeps what was found until then."""
    from app.features.jobs.result_sentences import describe_result
    from app.features.paint.proposals import propose_cameras_for_views

    with open_store(settings) as store, show_progress("Proposing cameras") as progress:
        run = propose_cameras_for_views(store, dataset, progress=progress)
    if not silent:
        say(describe_result("proposals", asdict(run)) or "")


def _choose_default_policy(format_: str) -> str | None:
    """The policy of a dataset that an import makes; None where the format brings none into being."""
    return None if format_ in ("cameras", "touchline") else "paper"


def _resolve_source(settings: Settings, text: str) -> Path | StoredPath:
    return find_path(settings, text) if is_address(text) else Path(text).resolve()


@commands.command()
def export(
    out: Annotated[
        str, typer.Argument(help="A folder, or a zip by its ending; s3://NAME/... in a store.")
    ],
    dataset: Dataset,
    format_: Annotated[ExportFormat, typer.Option("--format", help="Which format to write.")],
    everything: Annotated[
        bool, typer.Option("--all", help="Every group, failed and rejected too.")
    ] = False,
    boxes: Annotated[
        BoxKind,
        typer.Option(help="coco, parquet, soccernet-v3d and yolo: which ball box is written."),
    ] = "optimized",
    images: Annotated[
        PicturesWritten, typer.Option(help="What happens to frames; touchline holds none.")
    ] = "none",
    views: Annotated[
        TrainingViews, typer.Option(help="coco and yolo: balls that no other view confirms, too?")
    ] = "valid",
    version: Annotated[
        str | None, typer.Option(help="A frozen version (name, id or hash): always the same bytes.")
    ] = None,
    json_: Json = False,
) -> None:
    """Write accepted groups, all of them, or a frozen version, with a manifest."""
    options: dict[str, Any] = {
        "boxes": boxes,
        "images": images,
        "views": views,
        "version": version,
    }
    server = get_current_server()
    if server is not None:
        if images == "link":
            raise typer.BadParameter(
                "a server cannot link to frames of this computer: use --images copy or --images none"
            )
        request = {"dataset": dataset, "format": format_, "all": everything, **options}
        with connect_to_server(server) as client, show_progress("Exporting") as progress:
            sent_to = out if is_address(out) else Path(out)
            values = remote.export_on_server(client, sent_to, request, progress)
        print_export(values, json_)
        return
    from app.features.exports.service import export_dataset as run_export
    from app.features.exports.service import require_exportable

    with open_store() as store, show_progress("Exporting") as progress:
        require_exportable(store, dataset, format_, everything=everything, **options)
        target = resolve_target_path(store.settings, out) if is_address(out) else Path(out)
        report = run_export(
            store, dataset, format_, target, everything=everything, **options, progress=progress
        )
    # How many groups were to be written is a matter of progress; what was is in the counts.
    values = {name: value for name, value in vars(report).items() if name != "groups"}
    print_export({**values, "out": str(report.out)}, json_)
