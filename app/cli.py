"""The command line: the second door, and the place where everything is put together.

A command parses, calls one function of a floor below, prints a table or JSON and returns an exit
code: 0 done, 1 it could not be done, 2 it was asked for in a wrong way. Progress and complaints
go to stderr. Heavy modules are imported inside the commands, so that ``--help`` is quick.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.dataset_commands import commands as dataset_commands
from app.datasets.format_names import ExportFormat, ImportFormat
from app.errors import ReviewError
from app.evaluation_commands import commands as evaluation_commands
from app.line_commands import commands as line_commands
from app.options import (
    Json,
    Workers,
    read_settings,
    require_local,
    typed_source,
)
from app.policy_commands import commands as policy_commands
from app.policy_commands import read_policy_option
from app.pool import process_pool
from app.terminal import (
    complain,
    log_to_stderr,
    print_export,
    print_import,
    print_json,
    print_values,
    say,
    show_progress,
)
from app.version_commands import commands as version_commands

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from app.config import Settings
    from app.store.session import Store

app = typer.Typer(
    name="touchline",
    help="Turn multi-view soccer frames into a trusted 3D ball dataset.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(line_commands)
app.add_typer(dataset_commands, name="datasets")
app.add_typer(policy_commands, name="policy")
app.add_typer(version_commands)
app.add_typer(evaluation_commands)


class Calibration(StrEnum):
    """Which calibration counts where there are both."""

    GIVEN = "given"
    LINES = "lines"


class Boxes(StrEnum):
    """Which ball box an export writes."""

    OPTIMIZED = "optimized"
    ANNOTATED = "annotated"
    EXACT = "exact"


class Images(StrEnum):
    """What an export does with frames."""

    NONE = "none"
    COPY = "copy"
    LINK = "link"


SAMPLE = "sample"
"""Name of the sample dataset, and of its folder in the home."""
SAMPLE_GROUPS, SAMPLE_SEED = 60, 20_260_101
Existing = Annotated[Path, typer.Argument(exists=True, help="A folder or a file.")]
Dataset = Annotated[str, typer.Option("--dataset", help="Name of the dataset.")]


@app.command()
def serve(
    host: Annotated[str | None, typer.Option(help="Address to listen on.")] = None,
    port: Annotated[int | None, typer.Option(min=0, max=65535, help="0: any free one.")] = None,
    with_sample: Annotated[
        bool, typer.Option("--sample", help="Make the dataset sample first, where it is missing.")
    ] = False,
) -> None:
    """Serve the browser application and the REST interface."""
    settings = read_settings(host=host, port=port)
    require_local(settings)
    log_to_stderr()
    from app.api.application import create_app
    from app.api.server import listen, run
    from app.store.home import server_lock
    from app.store.migrate import migrate as run_migrations

    with server_lock(settings):
        run_migrations(settings)
        if with_sample and not _is_solved(settings, SAMPLE):
            _write_sample(settings.home / SAMPLE)
            _fill(settings, SAMPLE, settings.home / SAMPLE, None)
        with listen(settings.host, settings.port) as (socket, address):
            # One processor is left for the requests.
            workers = max(1, settings.workers - 1)
            application = create_app(settings, pool=lambda: process_pool(workers))
            say(f"Touchline is at {address}")
            run(application, socket)


@app.command("import")
def import_(
    format_: Annotated[ImportFormat, typer.Argument(metavar="FORMAT")],
    path: Existing,
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
        str | None, typer.Option("--size", metavar="WxH", help="Default 960x540; ISSIA 1920x1080.")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would happen, and keep nothing.")
    ] = False,
    json_: Json = False,
) -> None:
    """Read files into a dataset; doing it again changes nothing.

    FORMAT is soccernet-v3, soccernet-v3d, issia, issia-3d, sn-calibration, cameras, gamestate,
    coco, parquet or touchline; docs/formats.md says what each of them holds.
    """
    source = typed_source(
        format_,
        path,
        lines=lines,
        calibration=calibration.value,
        frame_offset=frame_offset,
        flip=flip,
        size=size,
    )
    from app.review.sources import import_source

    settings = read_settings()
    with _store(settings) as store, show_progress("Importing") as progress:
        imported = import_source(store, dataset, source, settings, progress, dry_run=dry_run)
    print_import(imported.values(), json_)
    if not imported.something:
        complain(*imported.nothing_read())
        raise typer.Exit(1)


@app.command()
def solve(
    dataset: Dataset,
    policy: Annotated[
        str | None,
        typer.Option(
            metavar="paper|strict|FILE.yaml", help="Judge the dataset by this policy from now on."
        ),
    ] = None,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Compute what is missing or out of date; can be interrupted at any time."""
    from app.review.policies import change_policy
    from app.review.recompute import solve_dataset

    chosen = None if policy is None else read_policy_option(policy)
    settings = read_settings()
    with (
        _store(settings) as store,
        _executor(workers or settings.workers) as executor,
        show_progress("Solving") as progress,
    ):
        if chosen is not None:
            change_policy(store, dataset, chosen, if_match=None, actor="local")
        report = solve_dataset(store, dataset, executor, progress)
    print_values(vars(report), json_)


@app.command()
def findings(dataset: Dataset, json_: Json = False) -> None:
    """List what a person should look at."""
    from app.api.findings import finding_values

    with _store(read_settings()) as store:
        values = list(finding_values(store, dataset))
    if json_:
        print_json(values)
        return
    for value in values:
        place = " ".join(value[key] for key in ("group", "view") if value.get(key))
        say(f"{value['kind']:20} {place}: {value['sentence']}")


@app.command()
def export(
    out: Annotated[Path, typer.Argument(help="A folder, or a zip by its ending.")],
    dataset: Dataset,
    format_: Annotated[ExportFormat, typer.Option("--format", help="Which format to write.")],
    everything: Annotated[
        bool, typer.Option("--all", help="Every group, failed and rejected too.")
    ] = False,
    boxes: Annotated[Boxes, typer.Option(help="Which ball box is written.")] = Boxes.OPTIMIZED,
    images: Annotated[Images, typer.Option(help="What happens to frames.")] = Images.NONE,
    version: Annotated[
        str | None, typer.Option(help="A frozen version (name, id or hash): always the same bytes.")
    ] = None,
    json_: Json = False,
) -> None:
    """Write accepted groups, all of them, or a frozen version, with a manifest."""
    from app.review.export import export as run_export

    with _store(read_settings()) as store, show_progress("Exporting") as progress:
        report = run_export(
            store,
            dataset,
            format_,
            out,
            everything=everything,
            boxes=boxes.value,
            images=images.value,
            version=version,
            progress=progress,
        )
    print_export({**vars(report), "out": str(report.out)}, json_)


@app.command()
def sample(
    out: Annotated[
        Path | None, typer.Argument(help="Folder; with --dataset, by default one in the home.")
    ] = None,
    groups: Annotated[int, typer.Option(min=1, help="How many groups.")] = SAMPLE_GROUPS,
    labels_only: Annotated[bool, typer.Option("--labels-only", help="No frames.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Another number, another dataset.")] = (
        SAMPLE_SEED
    ),
    no_faults: Annotated[bool, typer.Option("--no-faults", help="Nothing planted.")] = False,
    dataset: Annotated[
        str | None,
        typer.Option(help="Import and solve it, too, under this name; done once, nothing more."),
    ] = None,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Write a synthetic dataset with known truth in SoccerNet-v3 layout."""
    settings = read_settings()
    if out is None and dataset is None:
        raise typer.BadParameter("name a folder to write to, or a dataset to fill")
    if dataset is not None and _is_solved(settings, dataset):
        print_values({**_progress_of(settings, dataset), "written": False}, json_)
        return
    folder = out or settings.home / SAMPLE
    report = _write_sample(
        folder,
        groups=groups,
        seed=seed,
        labels_only=labels_only,
        faults=not no_faults,
        workers=workers,
    )
    if dataset is not None:
        _fill(settings, dataset, folder, workers)
        report = {**report, **_progress_of(settings, dataset), "written": True}
    print_values(report, json_)


@app.command()
def practice(
    again: Annotated[
        bool, typer.Option("--again", help="Forget what was answered and begin afresh.")
    ] = False,
    json_: Json = False,
) -> None:
    """Make eight practice groups with known answers, as the dataset practice; done once."""
    from app.review.practice import make_practice_dataset

    settings = read_settings()
    with _store(settings) as store, show_progress("Making the practice groups") as progress:
        made = make_practice_dataset(
            store,
            settings,
            lambda done, total, _: progress(done, total),
            again=again,
            actor="local",
        )
    print_values(made, json_)


@app.command()
def migrate() -> None:
    """Bring the database to this version's schema."""
    from app.store.migrate import migrate as run_migrations

    say(f"schema {run_migrations(read_settings())}")


def main() -> None:
    """Entry point: what a caller can cause is one sentence on stderr and exit code 1."""
    try:
        app()
    except ReviewError as error:
        complain(error.message, error.hint)
        sys.exit(1)


@contextmanager
def _store(settings: Settings) -> Iterator[Store]:
    from app.store.session import Store

    store = Store.open(settings)
    try:
        yield store
    finally:
        store.close()


@contextmanager
def _executor(workers: int) -> Iterator[Executor | None]:
    """Where a dataset is solved; None: in this process."""
    if workers == 1:
        yield None
        return
    with process_pool(workers) as pool:
        yield pool


def _write_sample(folder: Path, **options: Any) -> dict[str, Any]:
    """Write the sample's files; what is not said is as ``write_sample`` has it."""
    from app.sample.write import write_sample

    with show_progress("Drawing the sample") as progress:
        return vars(write_sample(folder, progress=progress, **options))


def _is_solved(settings: Settings, dataset: str) -> bool:
    """Whether a dataset of that name is there, and complete."""
    found = _progress_of(settings, dataset)
    return bool(0 < found["groups"] == found["solved"])


def _progress_of(settings: Settings, dataset: str) -> dict[str, Any]:
    """Name, groups and solved groups of a dataset; one that is not there has none."""
    from app.review.datasets import list_datasets

    with _store(settings) as store:
        found = next((item for item in list_datasets(store) if item.name == dataset), None)
    groups, solved = (found.groups, found.solved) if found else (0, 0)
    return {"dataset": dataset, "groups": groups, "solved": solved}


def _fill(settings: Settings, dataset: str, folder: Path, workers: int | None) -> None:
    """Import a folder in SoccerNet-v3 layout, and solve it."""
    from app.review.recompute import solve_dataset
    from app.review.sources import Source, import_source

    source = Source("soccernet-v3", folder.resolve())
    with _store(settings) as store:
        with show_progress("Importing") as progress:
            import_source(store, dataset, source, settings, progress)
        count = workers or settings.workers
        with _executor(count) as executor, show_progress("Solving") as progress:
            solve_dataset(store, dataset, executor, progress)
