"""Commands that read the paint of pictures: paint, snap, agree, propose, track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import typer

from app.features.match_estimates.commands import print_match_states
from app.formats.report import ReaderReport
from app.soccer.choices import ProposalOutcome
from app.terminal.options import Json, Workers, get_current_actor, parse_size, read_settings
from app.terminal.server import open_store
from app.terminal.terminal import print_json, print_problems, print_values, say, show_progress
from app.wording import plural

commands = typer.Typer()


Tripod = Annotated[
    str | None,
    typer.Option(
        metavar="one|FILE",
        help="one: all pictures are of one camera that stands still; FILE (.json or .csv) names the "
        "camera (match) of each frame. Their pitch is found together, and their covariances know it.",
    ),
]


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
    from app.features.datasets.service import filter_by_existing_match
    from app.features.paint.service import (
        read_paint_of_pictures,
        summarize_paint_readings,
        undo_paint_reading,
    )

    if show and undo:
        raise typer.BadParameter("use either --show or --undo")
    if undo and match is not None:
        raise typer.BadParameter(
            "--undo takes back the newest reading of the dataset: leave out --match"
        )
    with open_store() as store:
        if undo:
            with store.write() as session:
                undo_paint_reading(session, dataset, actor=get_current_actor())
        if undo or show:
            found = summarize_paint_readings(store, dataset)
        else:
            with show_progress("Reading paint") as progress:
                found = read_paint_of_pictures(
                    store,
                    dataset,
                    None if match is None else [match],
                    actor=get_current_actor(),
                    workers=workers,
                    progress=progress,
                )
    print_match_states(filter_by_existing_match(found.items, match, found.dataset), json_)


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
    tripod: Tripod = None,
    json_: Json = False,
) -> None:
    """Cameras from clicked lines and the paint of their pictures."""
    from app.features.file_tools.paint import snap_cameras_to_paint

    if size != "native":
        raise typer.BadParameter(
            "each picture is read in its own size: leave out --size", param_hint="--size"
        )
    report = ReaderReport()
    with show_progress("Snapping") as progress:
        rows = snap_cameras_to_paint(
            lines,
            images,
            out,
            settings=read_settings(),
            tripod=tripod,
            report=report,
            progress=progress,
        )
    _print_rows(rows, report, json_)


@commands.command()
def agree(
    cameras: Annotated[
        Path, typer.Argument(metavar="CAMERAS", exists=True, help="Folder or zip of camera files.")
    ],
    images: Images,
    json_: Json = False,
) -> None:
    """How well cameras agree with the paint of their pictures; needs no lines."""
    from app.features.file_tools.paint import measure_paint_agreement_of_files

    report = ReaderReport()
    with show_progress("Reading paint") as progress:
        rows = measure_paint_agreement_of_files(
            cameras, images, settings=read_settings(), report=report, progress=progress
        )
    _print_rows(rows, report, json_)


def _print_rows(rows: list[dict[str, Any]], report: ReaderReport, as_json: bool) -> None:
    """A line for each picture, or all as JSON; what was left out goes to stderr."""
    print_problems([problem.message for problem in report.problems])
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
    tripod: Tripod = None,
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
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, help="With --dataset: processes; default: all cores."),
    ] = None,
    json_: Json = False,
) -> None:
    """Propose a camera for each picture from its painted lines alone.

    OUT gets camera_<stem>.json of the proposed ones, and propose.json with the outcome of each
    (proposed, unsure, nothing). Sides are by convention: the camera stands where y > 0.
    With --dataset the views without a camera are looked at, and what is found is kept
    as predictions: nothing counts before a person accepts one.
    """
    if dataset is not None:
        if images or out or known or tripod or size != "native":
            raise typer.BadParameter(
                "with --dataset, leave out IMAGES, OUT, --size, --known and --tripod"
            )
        if show and undo:
            raise typer.BadParameter("use either --show or --undo")
        _propose_for_views(dataset, match, show, undo, workers, json_)
        return
    if not images or out is None:
        raise typer.BadParameter("name IMAGES and OUT, or --dataset")
    if match is not None or show or undo or workers is not None:
        raise typer.BadParameter("--match, --show, --undo and --workers need --dataset")
    _propose_for_files(images, out, size, known or (), tripod, json_)


def _propose_for_views(
    dataset: str, match: str | None, show: bool, undo: bool, workers: int | None, json_: bool
) -> None:
    from app.features.paint.proposals import (
        forget_proposals,
        get_proposal_counts,
        propose_cameras_for_views,
    )

    matches = None if match is None else [match]
    with open_store() as store:
        if undo:
            if match is not None:
                raise typer.BadParameter(
                    "--undo deletes all proposals of the dataset: leave out --match"
                )
            print_values({"forgotten": forget_proposals(store, dataset)}, json_)
            return
        if show:
            items = [asdict(item) for item in get_proposal_counts(store, dataset, matches).items]
            if json_:
                print_json(items)
                return
            for item in items:
                counts = ", ".join(f"{item[name]} {name}" for name in get_args(ProposalOutcome))
                sentence = (
                    f"{item['looked']} of {plural(item['views'], 'view')} looked at: {counts}"
                )
                name = f"{item['match']}: " if item["match"] else ""
                say(f"{name}{sentence}, {item['accepted']} accepted")
            return
        with show_progress("Proposing") as progress:
            run = propose_cameras_for_views(
                store, dataset, matches, workers=workers, progress=progress
            )
    print_values(asdict(run), json_)


def _propose_for_files(
    images: list[Path],
    out: Path,
    size: str,
    known: Sequence[Path],
    tripod: str | None,
    json_: bool,
) -> None:
    from app.features.file_tools.propose import count_proposal_outcomes, propose_cameras_of_files

    wanted = None if size == "native" else parse_size(size)
    report = ReaderReport()
    with show_progress("Proposing") as progress:
        rows = propose_cameras_of_files(
            images,
            out,
            read_settings(),
            size=wanted,
            known=known,
            tripod=tripod,
            report=report,
            progress=progress,
        )
    problems = [problem.message for problem in report.problems]
    print_problems(problems)
    if json_:
        print_json(rows)
        return
    for row in rows:
        if row["reason"]:
            say(f"{row['frame']}: {row['outcome']}; {row['reason']}")
    print_values(count_proposal_outcomes(rows), False)


@commands.command()
def track(
    clip: Annotated[
        Path,
        typer.Argument(metavar="CLIP", exists=True, dir_okay=False, help="A video of one camera."),
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder for camera files.")],
    lines: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE@FRAME",
            help="Lines of a frame, which count from 0; may be given several times.",
        ),
    ] = None,
    pitch: Annotated[
        Literal["plan", "shown"],
        typer.Option(
            help="plan: cameras lay the markings of 105 x 68 m on the paint; shown: they are those "
            "of the pitch that the clip shows, of its own length, width and crown (track.json)."
        ),
    ] = "plan",
    turn: Annotated[
        bool,
        typer.Option(
            "--turn", help="The camera stands on the far side: turn it by half a turn of the pitch."
        ),
    ] = False,
    json_: Json = False,
) -> None:
    """Follow the camera of a clip: a camera for each frame.

    It starts from the lines of annotated frames, or proposes a camera where nothing is annotated.
    OUT gets camera_<frame>.json, and track.json with the outcome of each frame: tracked (on the
    paint), bridged (carried by the background between tracked frames) or lost (no camera).
    """
    from app.features.file_tools.track import count_outcomes, track_cameras_of_clip

    with show_progress("Tracking") as progress:
        on_shown = pitch == "shown"
        result = track_cameras_of_clip(
            clip, out, lines or (), on_shown=on_shown, turn=turn, progress=progress
        )
    if json_:
        print_json(result)
        return
    print_values(count_outcomes(result["frames"]), False)
    shown = result["pitch"]
    if shown is not None and shown["other"] is not None:
        length, width = shown["other"]["length"], shown["other"]["width"]
        laid = (
            "The cameras are those of that pitch"
            if on_shown
            else "The cameras lay the markings of 105 x 68 m on its paint as well as they can; "
            "--pitch shown gives those of that pitch"
        )
        say(f"The clip shows a pitch of {length:g} x {width:g} m, not 105 x 68 m. {laid}.")
