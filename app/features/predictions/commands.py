"""Commands on predictions: predictions, accept, detect."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from app.plural import plural
from app.terminal.options import Dataset, Json, Workers, current_actor, read_settings
from app.terminal.server import opened_store
from app.terminal.terminal import (
    print_error,
    print_json,
    print_rows,
    print_values,
    say,
    show_progress,
)

commands = typer.Typer()

Query = Annotated[
    str, typer.Option("--query", help="Which groups, in the query language of the queue.")
]


@commands.command("predictions")
def list_(dataset: Dataset, json_: Json = False) -> None:
    """List the sets of predictions of a dataset, newest first."""
    from app.features.predictions.service import list_predictions

    with opened_store() as store:
        found = list_predictions(store, dataset)
    print_rows(
        found,
        json_,
        vars,
        lambda item: (
            f"{item.name:24} {item.format:8} {item.created[:19]} "
            f"{item.boxes:8} boxes in {item.frames} frames, {item.cameras} cameras"
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

    with opened_store() as store, show_progress("Accepting") as progress:
        chosen = find_predictions(store, dataset, predictions)
        request = AcceptRequest(chosen.id, query, None, min_score, replace)
        if dry_run:
            plan = plan_accept(store, dataset, request)
            values = {"views": len(plan.changes), "groups": plan.groups, "refused": plan.refused}
        else:
            report = run_accept(store, dataset, request, actor=current_actor(), progress=progress)
            values = vars(report)
    print_values(values, json_)


@commands.command()
def detect(
    dataset: Dataset,
    model: Annotated[Path, typer.Option("--model", help="MODEL.onnx, as Ultralytics exports it.")],
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
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Let a detector look for balls; what it finds stays a prediction until somebody accepts it."""
    from app.features.predictions.detect import DetectRequest, OnnxModel
    from app.features.predictions.detect import run_detector as run_detect

    settings = read_settings()
    opened = OnnxModel.open(
        model, category=category, side=side, threads=workers or settings.workers
    )
    with opened_store() as store, show_progress("Detecting") as progress:
        request = DetectRequest(name or model.stem, query, missing, min_score)
        found = run_detect(
            store, dataset, opened, request, actor=current_actor(), progress=progress
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


def print_set(found: Mapping[str, Any]) -> None:
    """What was read into a set, and what could not be read."""
    say(
        f"{found['source']}: {plural(found['boxes'], 'box', 'boxes')} in {plural(found['frames'], 'frame')}, "
        f"{plural(found['cameras'], 'camera')}, {plural(found['unknown'], 'unknown frame')} "
        f"(predictions {found['name']})"
    )
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
