"""Commands on files: calibrate, score, link, cameras, shots; they need no dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from app.soccer.choices import GoalEdge
from app.soccer.frames import ImageSize
from app.terminal.options import Json, Size, Workers, parse_size, read_settings
from app.terminal.terminal import (
    print_error,
    print_json,
    print_problems,
    print_values,
    say,
    show_progress,
)
from app.wording import plural

commands = typer.Typer()

LineFiles = Annotated[
    Path, typer.Argument(metavar="IN", exists=True, help="Folder or zip of line files.")
]


@commands.command()
def calibrate(
    source: LineFiles,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder for camera files.")],
    size: Size,
    labels: Annotated[
        Literal["checked", "given"], typer.Option(help="checked leaves out wrong labels.")
    ] = "checked",
    goal: Annotated[
        GoalEdge,
        typer.Option(
            help="What is clicked of goals: their inner edges, or their middle; laws is the middle, "
            "and lines whose outer edges make the pitch, as on grass."
        ),
    ] = "middle",
    leave_one_out: Annotated[
        bool, typer.Option("--leave-one-out", help="Also calibrate without each marking in turn.")
    ] = False,
    matches: Annotated[
        str | None,
        typer.Option(
            metavar="auto|FILE",
            help="Share the main camera's position among the frames of a match: FILE (.json or "
            ".csv) names the match of each frame, auto guesses it from names and positions.",
        ),
    ] = None,
    picture: Annotated[
        str | None,
        typer.Option(
            metavar="auto|FILE",
            help="The frames are of one match or shot whose pictures were stretched or cropped: "
            "FILE (of touchline picture --json) says how, auto estimates it.",
        ),
    ] = None,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Calibrate line files (folder or zip) to camera files; needs no dataset."""
    from app.features.file_tools.calibrate import calibrate_files
    from app.workers.executors import open_process_pool

    named, shape = (
        _resolve_option_file(matches, "--matches"),
        _resolve_option_file(picture, "--picture"),
    )
    pool = open_process_pool(workers or read_settings().workers)
    with pool as executor, show_progress("Calibrating") as progress:
        result = calibrate_files(
            source,
            out,
            size=size,
            labels=labels,
            goal=goal,
            with_leave_one_out=leave_one_out,
            matches=named,
            guess=matches == "auto",
            picture=shape,
            guess_picture=picture == "auto",
            executor=executor,
            progress=progress,
        )
    print_values(result, json_)
    print_problems(result["problems"])
    if not result["calibrated"]:
        first = result["failed"][0]
        print_error(
            f"none of {plural(result['frames'], 'frame')} could be calibrated: {first['frame']}: {first['reason']}"
        )
        raise typer.Exit(1)


def _resolve_option_file(text: str | None, option: str) -> Path | None:
    """The file that an option names; None without the option and for ``auto``."""
    if text in (None, "auto"):
        return None
    path = Path(str(text))
    if not path.is_file():
        raise typer.BadParameter(f'"{text}" is neither auto nor a file', param_hint=option)
    return path


@commands.command()
def score(
    lines: Annotated[
        Path, typer.Argument(metavar="LINES", exists=True, help="Folder or zip of line files.")
    ],
    cameras: Annotated[
        Path, typer.Argument(metavar="CAMERAS", exists=True, help="Folder or zip of camera files.")
    ],
    size: Size,
    without: Annotated[
        Path | None,
        typer.Option(exists=True, dir_okay=False, help="findings.json: leave those markings out."),
    ] = None,
    json_: Json = False,
) -> None:
    """Measure camera files against line files: JaC, completeness, errors."""
    from app.features.file_tools.calibrate import score_camera_files

    with show_progress("Scoring") as progress:
        result = score_camera_files(lines, cameras, size=size, without=without, progress=progress)
    print_values(result, json_)
    print_problems(result["problems"])


@commands.command()
def shots(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="RECORDING", exists=True, dir_okay=False, help="Video file (mp4, mkv, ts, ...)."
        ),
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder for shots.json.")],
    json_: Json = False,
) -> None:
    """Find the shots of a recording: cuts, dissolves, wipes and fades, and what each shot shows.

    OUT gets shots.json: first and last frame of each shot (frames count from 0), when it begins and
    ends, its kind (main, replay, closeup, other) and how it is entered. Frames of a soft transition
    belong to no shot.
    """
    from app.features.file_tools.shots import find_shots_in_file

    with show_progress("Finding shots") as progress:
        result = find_shots_in_file(recording, out, read_settings(), progress)
    if json_:
        print_values(result, json_)
        return
    for row in result["shots"]:
        say(
            f"{row['first']:>7} - {row['last']:<7} {row['start_s']:>9.2f} s  "
            f"{row['end_s'] - row['start_s']:>7.2f} s  {row['kind']:8} {row['entered_by']}"
        )


@commands.command()
def link(
    live: Annotated[
        Path, typer.Argument(metavar="LIVE", exists=True, help="Folder of the live shot.")
    ],
    replay: Annotated[
        Path, typer.Argument(metavar="REPLAY", exists=True, help="Folder of its replay.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder for link.json.")],
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LIVE_TIME=REPLAY_TIME",
            help="One instant in both, seconds, as a person sees it; may be given several times.",
        ),
    ] = None,
    json_: Json = False,
) -> None:
    """Find which time of a live shot each time of its replay shows.

    Both folders hold camera_<frame>.json and ball.csv (frame,time_s,x,y in pixels). The rays of the
    ball that belong together meet: t_live = offset + speed * t_replay. A ball that does not tell
    the times is refused with a reason (outcome unobservable).
    """
    from app.features.file_tools.shots import link_live_and_replay, parse_hint

    try:
        hints = [parse_hint(text) for text in at or ()]
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--at") from error
    result = link_live_and_replay(live, replay, out, hints)
    if json_:
        print_json(result)
    else:
        shown = {name: value for name, value in result.items() if not isinstance(value, list)}
        print_values({name: value for name, value in shown.items() if value is not None}, False)
        for piece in result["pieces"]:
            say(
                f"from {piece['first_s']:.2f} to {piece['last_s']:.2f} s: offset "
                f"{piece['offset_s']:.3f} s, speed {piece['speed']:.4f}"
            )
        print_problems(result["problems"])


@commands.command()
def cameras(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="IN", exists=True, help="Folder of camera files, as track leaves it."
        ),
    ],
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="The npz, or a folder for OpenTrackIO's samples.")
    ],
    format_: Annotated[
        Literal["npz", "opentrackio"],
        typer.Option("--format", help="npz: K, k, R, t of each frame; opentrackio: a JSON each."),
    ],
    size: Annotated[
        ImageSize | None,
        typer.Option(parser=parse_size, metavar="WxH", help="Size of the images; for opentrackio."),
    ] = None,
    json_: Json = False,
) -> None:
    """Write the cameras of a clip for other tools: npz as FIFA's skeletal kit has it, or OpenTrackIO.

    In both z points up and y away from the main stand.
    """
    from app.features.file_tools.camera_export import export_cameras

    result = export_cameras(source, out, format_, size)
    if json_:
        print_json(result)
        return
    print_values({name: value for name, value in result.items() if name != "problems"}, False)
    print_problems(result["problems"])
