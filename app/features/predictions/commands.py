"""Commands on predictions: predictions, accept, detect, evaluate."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.progress import ReportProgress
from app.soccer.choices import AnyPredictionFormat, BoxKind, LiveRule
from app.soccer.frames import ImageSize
from app.terminal import remote
from app.terminal.options import (
    Dataset,
    Json,
    Workers,
    get_current_actor,
    parse_size,
    read_settings,
)
from app.terminal.server import ServerPlace, connect_to_server, get_current_server, open_store
from app.terminal.terminal import (
    print_error,
    print_json,
    print_rows,
    print_values,
    say,
    show_progress,
)
from app.wording import plural

if TYPE_CHECKING:
    from app.evaluation.result import Cell, Table
    from app.features.predictions.detect import OnnxModel
    from app.features.predictions.evaluation_run import SourcesEvaluationRequest


commands = typer.Typer()

Query = Annotated[
    str, typer.Option("--query", help="Which groups, in the query language of the queue.")
]


BALLS, CAMERAS = "Predicted balls", "Predicted cameras"
RECORDING = "Frames of a recording"
REFERENCE, TRUTH, RESULT = "Reference boxes", "The truth", "The result"
Predictions = Annotated[
    Path | None,
    typer.Argument(
        help="File, folder or zip of ball boxes, or of tracks (ball.csv, events.csv), or the name of a set."
    ),
]
Format = Annotated[
    AnyPredictionFormat,
    typer.Option("--format", rich_help_panel=BALLS, help="auto goes by the files' endings."),
]
Images = Annotated[
    Path | None,
    typer.Option(
        exists=True,
        rich_help_panel=BALLS,
        help="COCO: the document that image numbers refer to.",
    ),
]
Category = Annotated[
    int | None,
    typer.Option(
        min=0, rich_help_panel=BALLS, help="The class that is the ball, where there are several."
    ),
]
MinScore = Annotated[
    float,
    typer.Option(
        min=0,
        max=1,
        rich_help_panel=BALLS,
        help="Detections with a lower score take no part in localisation.",
    ),
]
Cameras = Annotated[
    Path | None,
    typer.Option(
        exists=True, rich_help_panel=CAMERAS, help="Folder or zip of SoccerNet camera JSON."
    ),
]
Reference = Annotated[
    Path | None,
    typer.Option(
        "--reference",
        "--careful",
        rich_help_panel=REFERENCE,
        help="Reference boxes, one a frame, which the dataset's are measured with: a file, folder or "
        "zip, or the name of a set. Only the --reference options apply to them.",
    ),
]
ReferenceFormat = Annotated[
    AnyPredictionFormat,
    typer.Option(
        "--reference-format",
        "--careful-format",
        rich_help_panel=REFERENCE,
        help="As --format, of the reference boxes.",
    ),
]
ReferenceCategory = Annotated[
    int | None,
    typer.Option(
        "--reference-category",
        "--careful-category",
        min=0,
        rich_help_panel=REFERENCE,
        help="As --category, of the reference boxes.",
    ),
]
Version = Annotated[
    str | None,
    typer.Option(
        rich_help_panel=TRUTH,
        help="Name, id or hash of a frozen version; default: the dataset as it is now.",
    ),
]
Groups = Annotated[
    LiveRule,
    typer.Option(rich_help_panel=TRUTH, help="Without a version: which groups take part."),
]
SplitName = Annotated[
    str | None, typer.Option("--split", rich_help_panel=TRUTH, help="Frames of this split alone.")
]
Boxes = Annotated[
    BoxKind, typer.Option(rich_help_panel=TRUTH, help="Which box of the dataset is the truth.")
]
Name = Annotated[str, typer.Option(rich_help_panel=RESULT, help="Name of the evaluation.")]
Out = Annotated[
    Path | None,
    typer.Option(rich_help_panel=RESULT, help="Folder for tables and figures (CSV, JSON, PNG)."),
]
_Values = dict[str, Any]


@commands.command("predictions")
def list_(dataset: Dataset, json_: Json = False) -> None:
    """List the sets of predictions of a dataset, newest first."""
    from app.features.predictions.service import list_prediction_sets

    with open_store() as store:
        found = list_prediction_sets(store, dataset)
    print_rows(
        found,
        json_,
        vars,
        lambda item: (
            f"{item.name:24} {item.format:8} {item.created[:19]} {_describe_contents(vars(item))}"
        ),
    )


@commands.command()
def accept(
    dataset: Dataset,
    predictions: Annotated[str, typer.Argument(help="Name of a set of predictions.")],
    query: Query = "",
    min_score: Annotated[
        float, typer.Option(min=0, max=1, help="Predictions with a lower score are not taken.")
    ] = 0.0,
    replace: Annotated[
        bool, typer.Option("--replace", help="Also where a view has another ball.")
    ] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Count, and change nothing.")] = False,
    json_: Json = False,
) -> None:
    """Make annotations of predictions: an edit each, which can be undone.

    The surest prediction of each view is taken, where it has no ball yet.
    """
    from app.features.predictions.accept import AcceptRequest, plan_accept
    from app.features.predictions.accept import accept_predicted_balls as run_accept
    from app.features.predictions.service import find_predictions

    with open_store() as store, show_progress("Accepting") as progress:
        chosen = find_predictions(store, dataset, predictions)
        request = AcceptRequest(chosen.id, query, None, min_score, replace)
        if dry_run:
            plan = plan_accept(store, dataset, request)
            values = {
                "views": len(plan.changes),
                "groups": plan.group_count,
                "refused": plan.refused,
            }
        else:
            report = run_accept(
                store, dataset, request, actor=get_current_actor(), progress=progress
            )
            values = vars(report)
    print_values(values, json_)


@commands.command()
def detect(
    dataset: Dataset,
    model: Annotated[
        Path | None, typer.Option("--model", help="MODEL.onnx, as Ultralytics exports it.")
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="Name of the set of predictions; default: that of the model."),
    ] = None,
    query: Query = "",
    missing: Annotated[bool, typer.Option("--missing", help="Only views without a ball.")] = False,
    min_score: Annotated[
        float, typer.Option(min=0, max=1, help="Detections with a lower score are not kept.")
    ] = 0.05,
    category: Annotated[
        int | None,
        typer.Option(min=0, help="The class that is the ball, where there are several."),
    ] = None,
    side: Annotated[
        int | None,
        typer.Option(
            min=32, max=4096, help="Side of the model's input in pixels, where it is variable."
        ),
    ] = None,
    recording: Annotated[
        str | None,
        typer.Option(
            help="Look at the frames of this recording instead; what is found are candidates where a ball is followed.",
            rich_help_panel=RECORDING,
        ),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="FIRST-LAST", help="Of the recording; default: all.", rich_help_panel=RECORDING
        ),
    ] = None,
    boxes: Annotated[
        Path | None,
        typer.Option(
            exists=True,
            help="Boxes that were made elsewhere, instead of --model.",
            rich_help_panel=RECORDING,
        ),
    ] = None,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Let a detector look for balls; what it finds stays a prediction until somebody accepts it."""
    from app.features.predictions.detect import DetectRequest, OnnxModel
    from app.features.predictions.detect import run_detector as run_detect

    source = model if boxes is None else boxes
    if source is None or (model is not None and boxes is not None):
        raise typer.BadParameter("use either --model, or --boxes with --recording")
    if recording is None and (frames is not None or boxes is not None):
        raise typer.BadParameter("--frames and --boxes need --recording")
    if recording is not None and (query or missing):
        raise typer.BadParameter(
            "--query and --missing choose groups: leave them out with --recording"
        )
    settings = read_settings()
    opened = None
    if model is not None:
        threads = workers or settings.workers
        opened = OnnxModel.open(model, category=category, side=side, threads=threads)
    if opened is None or recording is not None:
        place = dataset, recording or "", frames
        _detect_or_import_boxes(place, opened or source, name or source.stem, min_score, json_)
        return
    with open_store() as store, show_progress("Detecting") as progress:
        request = DetectRequest(name or source.stem, query, missing, min_score)
        found = run_detect(
            store, dataset, opened, request, actor=get_current_actor(), progress=progress
        )
    if json_:
        print_json(vars(found))
        return
    say(
        f"{plural(found.boxes, 'box', 'boxes')} in {found.frames:,} of {plural(found.report['looked_at'], 'frame')}"
    )
    _print_problems(found.report)
    say(
        f"They stay predictions; touchline accept --dataset {dataset} {found.name} takes them over."
    )


def _detect_or_import_boxes(
    place: tuple[str, str, str | None],
    source: OnnxModel | Path,
    name: str,
    min_score: float,
    json_: bool,
) -> None:
    """What a detector, or a file of boxes, says of frames of a recording."""
    from app.features.recordings.frame_boxes import (
        detect_in_frames,
        find_recording,
        import_boxes_from_file,
    )

    dataset, recording, frames = place
    numbers = None if frames is None else _parse_frame_range(frames)
    with open_store() as store, show_progress("Detecting") as progress:
        found, by = find_recording(store, dataset, recording), get_current_actor()
        if isinstance(source, Path):
            if numbers is not None:
                raise typer.BadParameter("--frames needs --model: leave it out with --boxes")
            kept = import_boxes_from_file(store, found, source, name, min_score=min_score, actor=by)
        else:
            kept = detect_in_frames(
                store,
                found,
                source,
                name,
                numbers,
                min_score=min_score,
                actor=by,
                progress=progress,
            )
    if json_:
        print_json(vars(kept))
        return
    say(
        f"{plural(kept.boxes, 'box', 'boxes')} in {kept.frames:,} of {plural(kept.looked_at, 'frame')} "
        f"of {recording}; they are candidates where a ball is followed"
    )
    if kept.unknown:
        print_error(
            f"  the file has {plural(kept.unknown, 'frame')} that the recording does not have"
        )
    _print_problems(vars(kept))


def _parse_frame_range(text: str) -> range:
    """Frames of an option: ``100-400``, both included, or one number."""
    first, _, last = text.partition("-")
    try:
        return range(int(first), int(last or first) + 1)
    except ValueError as error:
        raise typer.BadParameter(f'--frames "{text}" is not FIRST-LAST') from error


def _describe_contents(found: Mapping[str, Any]) -> str:
    """What a set holds: tracks, or boxes and cameras."""
    if found["tracks"]:
        rows = plural(found["report"]["read"], "row")
        return f"{rows} of {plural(found['tracks'], 'ball track')}"
    boxes = f"{plural(found['boxes'], 'box', 'boxes')} in {plural(found['frames'], 'frame')}"
    return f"{boxes}, {plural(found['cameras'], 'camera')}"


def print_prediction_set(found: Mapping[str, Any]) -> None:
    """What was read into a set, and what could not be read."""
    unknown = "" if found["tracks"] else f", {plural(found['unknown'], 'unknown frame')}"
    what = f"{_describe_contents(found)}{unknown}"
    say(f"{found['source']}: {what} (predictions {found['name']})")
    report = found["report"]
    if report.get("without_score"):
        say(f"  {report['without_score']} boxes have no score and count as sure")
    for item in report.get("unknown_frames", [])[:5]:
        print_error(f"  {item['frame']} {item['problem']}")
    _print_problems(report)


def _print_problems(report: Mapping[str, Any]) -> None:
    problems = report["problems"]
    for item in problems[:5]:
        place = ", ".join(str(item[part]) for part in ("file", "record", "field") if item[part])
        print_error(f"  {place}: {item['problem']}")
    rest = len(problems) - 5 + report["more_problems"]
    if rest > 0:
        print_error(f"  and {rest} more problems")


def _make_size_option(panel: str, text: str, *names: str) -> Any:
    """An option that is the size of images."""
    return typer.Option(*names, parser=parse_size, metavar="WxH", rich_help_panel=panel, help=text)


PixelSize = Annotated[
    ImageSize | None,
    _make_size_option(BALLS, "Size of the images that boxes in pixels refer to.", "--size"),
]
CamerasSize = Annotated[
    ImageSize | None,
    _make_size_option(CAMERAS, "Size of the images of these cameras."),
]
ReferenceSize = Annotated[
    ImageSize | None,
    _make_size_option(
        REFERENCE, "As --size, of the reference boxes.", "--reference-size", "--careful-size"
    ),
]


@commands.command()
def evaluate(
    dataset: Dataset,
    predictions: Predictions = None,
    format_: Format = "auto",
    images: Images = None,
    category: Category = None,
    size: PixelSize = None,
    min_score: MinScore = 0.0,
    cameras: Cameras = None,
    cameras_size: CamerasSize = None,
    reference: Reference = None,
    reference_format: ReferenceFormat = "auto",
    reference_size: ReferenceSize = None,
    reference_category: ReferenceCategory = None,
    version: Version = None,
    groups: Groups = "passing",
    split: SplitName = None,
    boxes: Boxes = "optimized",
    name: Name = "",
    out: Out = None,
    json_: Json = False,
) -> None:
    """Measure predictions against a dataset: AP, MAE, P_2m, boxes, cameras, sensitivity; or tracks.

    What was read is kept in the dataset as predictions, and the result as an evaluation.
    """
    if predictions is None and reference is None and cameras is None:
        raise typer.BadParameter("name predictions, --cameras or --reference")
    from app.features.file_tools.output_folder import require_writable_folder
    from app.features.predictions.evaluation_run import EvaluationRequest, SourcesEvaluationRequest
    from app.features.predictions.reader import PredictionFiles

    request = SourcesEvaluationRequest(
        EvaluationRequest(name=name, groups=groups, split=split, boxes=boxes, min_score=min_score),
        PredictionFiles(predictions, format_, images, cameras, category, size, cameras_size),
        PredictionFiles(
            reference, reference_format, category=reference_category, size=reference_size
        ),
        version,
    )
    request.refuse_unused_options()
    if out is not None:
        require_writable_folder(out)
    server = get_current_server()
    run = _evaluate_locally if server is None else partial(_evaluate_on_server, server)
    with show_progress("Evaluating") as progress:
        values, sets = run(dataset, request, out, progress)
    if json_:
        print_json({**values, "sets": [_prediction_set_to_values(item) for item in sets]})
        return
    for item in sets:
        print_prediction_set(item)
    _print_evaluation(values)


def _evaluate_locally(
    dataset: str, request: SourcesEvaluationRequest, out: Path | None, progress: ReportProgress
) -> tuple[_Values, list[_Values]]:
    """The evaluation and the sets that were made or found for it, as plain values."""
    from app.features.predictions.evaluation import evaluation_to_values, write_evaluation
    from app.features.predictions.evaluation_run import evaluate_sources

    with open_store() as store:
        done = evaluate_sources(
            store, dataset, request, actor=get_current_actor(), progress=progress
        )
        if out is not None:
            write_evaluation(store, done.evaluation, out)
    return evaluation_to_values(done.evaluation), [vars(item) for item in done.sets]


def _evaluate_on_server(
    server: ServerPlace,
    dataset: str,
    request: SourcesEvaluationRequest,
    out: Path | None,
    progress: ReportProgress,
) -> tuple[_Values, list[_Values]]:
    """As ``_evaluate_locally``, by a server."""
    with connect_to_server(server) as client:
        values, sets = remote.evaluate_on_server(client, dataset, request, progress)
        if out is not None:
            remote.download_evaluation(client, values, out)
    return values, sets


def _print_evaluation(values: _Values) -> None:
    from app.features.predictions.evaluation import parse_tables

    for table in parse_tables(values["tables"]):
        say("")
        _print_table(table)
    pins = values["pins"]
    version = pins["version_name"] or f"the dataset as it is ({pins['state'][:12]})"
    say("")
    say(
        f"evaluation {values['id']}: {version}, policy {pins['policy_hash']}, "
        f"solver {pins['solver_version']}, software {pins['software_version']}"
    )


def _print_table(table: Table) -> None:
    """A table with its denominators; intervals of 95 % stand in brackets."""
    say(f"{table.title}. {table.note}")
    heads = [f"{item.label} [{item.unit}]" if item.unit else item.label for item in table.columns]
    lines = [["", *heads]]
    lines += [[row.label, *map(_format_number, row.cells)] for row in table.rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        cells = (text.ljust(width) for text, width in zip(line, widths, strict=True))
        say("  " + "  ".join(cells).rstrip())


def _format_number(cell: Cell) -> str:
    counts = f"{cell.count}" if cell.count == cell.of else f"{cell.count} of {cell.of}"
    if cell.value is None:
        return f"- (n {counts})"
    spread = "" if cell.low is None else f" [{cell.low:.3g}, {cell.high:.3g}]"
    return f"{cell.value:.3g}{spread} (n {counts})"


def _prediction_set_to_values(found: _Values) -> _Values:
    """What is printed of a set, with what could not be read of it."""
    return {
        "id": found["id"],
        "name": found["name"],
        "unknown": found["unknown"],
        # Only what a detector of ours found has one.
        "model": None,
        **found["report"],
    }
