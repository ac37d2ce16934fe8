"""Commands on predictions: evaluate, predictions, accept, detect."""

from __future__ import annotations

from contextlib import closing
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.opened import opened_store
from app.commands.options import Dataset, Json, Workers, parse_size, read_settings
from app.commands.terminal import Progress, complain, print_json, print_values, say, show_progress
from app.finite import json_text

if TYPE_CHECKING:
    from app.evaluation.table import Cell, Table
    from app.review.evaluating.predictions import PredictionFiles
    from app.store.evaluations import StoredEvaluation
    from app.store.predictions import PredictionSet
    from app.store.session import Store

commands = typer.Typer()

Category = Annotated[
    int | None, typer.Option(min=0, help="The class that is the ball, where there are several.")
]
PixelSize = Annotated[
    str | None,
    typer.Option("--size", metavar="WxH", help="Of the images that boxes in pixels refer to."),
]


class PredictionFormat(StrEnum):
    """How predictions are written."""

    AUTO = "auto"
    COCO = "coco"
    YOLO = "yolo"
    CSV = "csv"


class TruthBoxes(StrEnum):
    """Which box of the dataset is the truth."""

    OPTIMIZED = "optimized"
    ANNOTATED = "annotated"
    EXACT = "exact"


class LiveGroups(StrEnum):
    """Which groups take part where there is no version."""

    PASSING = "passing"
    ACCEPTED = "accepted"
    ALL = "all"


@commands.command()
def evaluate(
    dataset: Dataset,
    predictions: Annotated[
        str | None,
        typer.Argument(help="File, folder or zip of ball boxes, or the name of a set."),
    ] = None,
    format_: Annotated[
        PredictionFormat, typer.Option("--format", help="auto goes by the files' endings.")
    ] = PredictionFormat.AUTO,
    images: Annotated[
        Path | None,
        typer.Option(exists=True, help="COCO: the document that image numbers refer to."),
    ] = None,
    cameras: Annotated[
        Path | None,
        typer.Option(exists=True, help="Predicted cameras: folder or zip of SoccerNet JSON."),
    ] = None,
    careful: Annotated[
        str | None,
        typer.Option(
            help="Careful boxes, one a frame, which the dataset's are measured with: a file, "
            "folder or zip, or the name of a set. Only the --careful options apply to them."
        ),
    ] = None,
    careful_format: Annotated[
        PredictionFormat, typer.Option(help="As --format, of the careful boxes.")
    ] = PredictionFormat.AUTO,
    careful_size: Annotated[
        str | None, typer.Option(metavar="WxH", help="As --size, of the careful boxes.")
    ] = None,
    careful_category: Annotated[
        int | None, typer.Option(min=0, help="As --category, of the careful boxes.")
    ] = None,
    version: Annotated[
        str | None, typer.Option(help="Name, id or hash of a version; default: as it is now.")
    ] = None,
    groups: Annotated[
        LiveGroups, typer.Option(help="Without a version: which groups take part.")
    ] = LiveGroups.PASSING,
    split: Annotated[str | None, typer.Option(help="Frames of this split alone.")] = None,
    boxes: Annotated[TruthBoxes, typer.Option(help="Which box is the truth.")] = (
        TruthBoxes.OPTIMIZED
    ),
    min_score: Annotated[
        float, typer.Option(min=0, max=1, help="Below, none takes part in localisation.")
    ] = 0.0,
    category: Category = None,
    size: PixelSize = None,
    cameras_size: Annotated[
        str | None, typer.Option(metavar="WxH", help="Of the images of predicted cameras.")
    ] = None,
    name: Annotated[str, typer.Option(help="Of the evaluation.")] = "",
    out: Annotated[
        Path | None, typer.Option(help="Folder for tables and figures (CSV, JSON, PNG).")
    ] = None,
    json_: Json = False,
) -> None:
    """Measure predictions against a dataset: AP, MAE, P_2m, boxes, cameras, sensitivity.

    What was read is kept in the dataset as predictions, and the result as an evaluation.
    """
    if predictions is None and careful is None and cameras is None:
        raise typer.BadParameter("name predictions, --cameras or --careful")
    made_for = None if cameras_size is None else parse_size(cameras_size)
    pixels = None if size is None else parse_size(size)
    drawn_on = None if careful_size is None else parse_size(careful_size)
    from app.review.evaluating.evaluation import EvaluationRequest, run_evaluation
    from app.review.versions.version import find_version

    with opened_store() as store, show_progress("Evaluating") as progress:
        chosen = None if version is None else find_version(store, dataset, version).id
        found = drawn = None
        if predictions is not None or cameras is not None:
            own = {"category": category, "size": pixels, "images": images,
                   "cameras": cameras, "cameras_size": made_for}  # fmt: skip
            found = _set(store, dataset, predictions, format_.value, own)
        if careful is not None:
            other = {"category": careful_category, "size": drawn_on}
            drawn = _set(store, dataset, careful, careful_format.value, other)
        request = EvaluationRequest(
            name=name,
            predictions=None if found is None else found.id,
            careful=None if drawn is None else drawn.id,
            version=chosen,
            groups=groups.value,
            split=split,
            boxes=boxes.value,
            min_score=min_score,
        )
        result = run_evaluation(store, dataset, request, actor="local", progress=_bar(progress))
        if out is not None:
            _write(store, result, out)
    if json_:
        print_json({**evaluation_values(result), "sets": [_unread(s) for s in (found, drawn) if s]})
        return
    for item in (found, drawn):
        if item is not None:
            _say_set(item)
    _say_tables(result)


@commands.command("predictions")
def list_(dataset: Dataset, json_: Json = False) -> None:
    """List the sets of predictions of a dataset, newest first."""
    from app.review.evaluating.predictions import list_predictions

    with opened_store() as store:
        found = list_predictions(store, dataset)
    if json_:
        print_json([vars(item) for item in found])
        return
    for item in found:
        counts = f"{item.boxes:8} boxes in {item.frames} frames, {item.cameras} cameras"
        say(f"{item.name:24} {item.format:8} {item.created[:19]} {counts}")


@commands.command()
def accept(
    dataset: Dataset,
    predictions: Annotated[str, typer.Argument(help="Name of a set of predictions.")],
    query: Annotated[str, typer.Option("--query", help="Groups, as in the queue.")] = "",
    min_score: Annotated[float, typer.Option(min=0, max=1)] = 0.0,
    replace: Annotated[
        bool, typer.Option("--replace", help="Also where a view has another ball.")
    ] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Count, and change nothing.")] = False,
    json_: Json = False,
) -> None:
    """Make annotations of predictions: an edit each, which can be undone.

    The surest prediction of each view is taken, where it has no ball yet.
    """
    from app.review.evaluating.accept import AcceptRequest, plan_accept
    from app.review.evaluating.accept import accept as run_accept

    with opened_store() as store, show_progress("Accepting") as progress:
        request = AcceptRequest(
            _named(store, dataset, predictions).id, query, None, min_score, replace
        )
        if dry_run:
            plan = plan_accept(store, dataset, request)
            values = {"views": len(plan.changes), "groups": plan.groups, "refused": plan.refused}
        else:
            report = run_accept(store, dataset, request, actor="local", progress=_bar(progress))
            values = vars(report)
    print_values(values, json_)


@commands.command()
def detect(
    dataset: Dataset,
    model: Annotated[Path, typer.Option("--model", help="MODEL.onnx, as Ultralytics exports it.")],
    name: Annotated[
        str | None, typer.Option(help="Of the set of predictions; default: that of the model.")
    ] = None,
    query: Annotated[str, typer.Option("--query", help="Groups, as in the queue.")] = "",
    missing: Annotated[bool, typer.Option("--missing", help="Only views without a ball.")] = False,
    min_score: Annotated[float, typer.Option(min=0, max=1, help="Below, none is kept.")] = 0.05,
    category: Category = None,
    side: Annotated[
        int | None, typer.Option(min=32, max=4096, help="Of the input, where the model leaves it.")
    ] = None,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Let a detector look for balls; what it finds stays a prediction until somebody accepts it."""
    from app.review.evaluating.detect import DetectRequest
    from app.review.evaluating.detect import detect as run_detect
    from app.review.evaluating.onnx_model import OnnxModel

    settings = read_settings()
    opened = OnnxModel.open(
        model, category=category, side=side, threads=workers or settings.workers
    )
    with opened_store() as store, show_progress("Detecting") as progress:
        request = DetectRequest(name or model.stem, query, missing, min_score)
        found = run_detect(store, dataset, opened, request, actor="local", progress=_bar(progress))
    if json_:
        print_json(vars(found))
        return
    say(f"{found.boxes} boxes in {found.frames} of {found.report['looked_at']} frames")
    _say_problems(found)
    say(
        f"They stay predictions; touchline accept --dataset {dataset} {found.name} takes them over."
    )


def evaluation_values(found: StoredEvaluation) -> dict[str, Any]:
    """An evaluation as plain values."""
    return {**vars(found), "figures": list(found.figures)}


def guess_format(path: Path) -> str:
    """The format of predictions by the endings of the files."""
    from app.datasets.archive import open_tree
    from app.datasets.report import Report

    tree = open_tree(path, Report())
    if tree is None:
        return "coco"
    with closing(tree):
        endings = {Path(item).suffix.lower() for item in tree.names()}
    for ending, format_ in ((".csv", "csv"), (".json", "coco"), (".txt", "yolo")):
        if ending in endings:
            return format_
    return "coco"


def _set(
    store: Store, dataset: str, source: str | None, format_: str, options: dict[str, Any]
) -> PredictionSet:
    """The set of a file, read now, or one of that name that is there."""
    from app.errors import NotFoundError
    from app.review.evaluating.predictions import PredictionFiles, add_predictions

    cameras: Path | None = options.get("cameras")
    path = None if source is None else Path(source)
    if path is not None and not path.exists():
        if cameras is not None:
            raise NotFoundError(f"there is no file {path}")
        return _named(store, dataset, str(source))
    if path is not None and format_ == "auto":
        format_ = guess_format(path)
    files: PredictionFiles = PredictionFiles(path, format_, **options)
    stem = (path or cameras or Path("predictions")).stem
    return add_predictions(store, dataset, _tidy(stem), files, actor="local", reuse=True)


def _named(store: Store, dataset: str, name: str) -> PredictionSet:
    from app.errors import NotFoundError
    from app.review.evaluating.predictions import list_predictions

    known = list_predictions(store, dataset)
    found = next((item for item in known if name in (item.name, str(item.id))), None)
    if found is None:
        names = ", ".join(item.name for item in known[:10])
        raise NotFoundError(
            f'there is no file and no set of predictions "{name}"',
            hint=f"Sets: {names}." if names else None,
        )
    return found


def _tidy(stem: str) -> str:
    """A file's name as the name of a set."""
    kept = "".join(letter if letter.isascii() and letter.isalnum() else "-" for letter in stem)
    return kept.strip("-")[:80] or "predictions"


def _write(store: Store, found: StoredEvaluation, out: Path) -> None:
    """Everything of an evaluation into a folder."""

    from app.errors import InputError
    from app.evaluation.figure_csv import figure_csv, table_csv
    from app.evaluation.figure_png import figure_png
    from app.review.evaluating.evaluation import FrameQuery, get_figure, list_frames, tables_of
    from app.store.value_codec import dumps, to_json

    try:
        out.mkdir(parents=True, exist_ok=True)
        text = json_text(evaluation_values(found), indent=2)
        (out / "evaluation.json").write_text(text + "\n", encoding="utf-8")
        for table in tables_of(found):
            (out / f"{table.name}.csv").write_text(table_csv(table), encoding="utf-8")
        for name in found.figures:
            figure = get_figure(store, found.id, name)
            (out / f"{name}.csv").write_text(figure_csv(figure), encoding="utf-8")
            (out / f"{name}.json").write_text(dumps(to_json(figure)) + "\n", encoding="utf-8")
            (out / f"{name}.png").write_bytes(figure_png(figure))
        with (out / "frames.jsonl").open("w", encoding="utf-8") as file:
            place: int | None = 0
            while place is not None:
                page = list_frames(store, found.id, FrameQuery(), 500, place)
                file.writelines(json_text(vars(frame), ascii_=True) + "\n" for frame in page.items)
                place = page.next
    except OSError as error:
        raise InputError(f"{out} cannot hold the evaluation ({error.strerror})") from error


def _say_tables(found: StoredEvaluation) -> None:
    from app.review.evaluating.evaluation import tables_of

    for table in tables_of(found):
        say("")
        _say_table(table)
    version = found.pins["version_name"] or f"the dataset as it is ({found.pins['state'][:12]})"
    say("")
    say(
        f"evaluation {found.id}: {version}, policy {found.pins['policy_hash']}, "
        f"solver {found.pins['solver_version']}, software {found.pins['software_version']}"
    )


def _say_table(table: Table) -> None:
    """A table with its denominators; intervals of 95 % stand in brackets."""
    say(f"{table.title}. {table.note}")
    heads = [f"{item.label} [{item.unit}]" if item.unit else item.label for item in table.columns]
    lines = [["", *heads]]
    lines += [[row.label, *map(_number, row.cells)] for row in table.rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        cells = (text.ljust(width) for text, width in zip(line, widths, strict=True))
        say("  " + "  ".join(cells).rstrip())


def _number(cell: Cell) -> str:
    counts = f"{cell.count}" if cell.count == cell.of else f"{cell.count} of {cell.of}"
    if cell.value is None:
        return f"- (n {counts})"
    spread = "" if cell.low is None else f" [{cell.low:.3g}, {cell.high:.3g}]"
    return f"{cell.value:.3g}{spread} (n {counts})"


def _say_set(found: PredictionSet) -> None:
    say(
        f"{found.source}: {found.boxes} boxes in {found.frames} frames, {found.cameras} cameras, "
        f"{found.unknown} unknown frames (predictions {found.name})"
    )
    if found.report.get("without_score"):
        say(f"  {found.report['without_score']} boxes have no score and count as sure")
    for item in found.report.get("unknown_frames", [])[:5]:
        complain(f"  {item['frame']} {item['problem']}")
    _say_problems(found)


def _say_problems(found: PredictionSet) -> None:
    problems = found.report["problems"]
    for item in problems[:5]:
        place = ", ".join(str(item[part]) for part in ("file", "record", "field") if item[part])
        complain(f"  {place}: {item['problem']}")
    rest = len(problems) - 5 + found.report["more_problems"]
    if rest > 0:
        complain(f"  and {rest} more problems")


def _unread(found: PredictionSet) -> dict[str, Any]:
    return {"id": found.id, "name": found.name, "unknown": found.unknown, **found.report}


def _bar(progress: Progress) -> Progress:
    """A progress bar has no room for sentences."""
    return lambda done, total=None, _sentence="": progress(done, total)
