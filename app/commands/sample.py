"""Commands that make datasets with known truth: the sample, and the practice groups."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.opened import executor_of, opened_store
from app.commands.options import Json, Workers, acting, read_settings
from app.commands.terminal import print_values, show_progress
from app.private_file import keep_private

if TYPE_CHECKING:
    from app.config import Settings

commands = typer.Typer()

SAMPLE = "sample"
"""Name of the sample dataset, and of its folder in the home."""
SAMPLE_GROUPS, SAMPLE_SEED = 60, 20_260_101


@commands.command()
def sample(
    out: Annotated[
        Path | None, typer.Argument(help="Folder; with --dataset, by default one in the home.")
    ] = None,
    groups: Annotated[int, typer.Option(min=1, help="How many groups.")] = SAMPLE_GROUPS,
    labels_only: Annotated[
        bool, typer.Option("--labels-only", help="Write labels without frames.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed; another one gives other groups.")] = (
        SAMPLE_SEED
    ),
    no_faults: Annotated[bool, typer.Option("--no-faults", help="Plant no faults.")] = False,
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
    if out is None:
        keep_private()
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


@commands.command()
def practice(
    again: Annotated[
        bool, typer.Option("--again", help="Forget what was answered and begin afresh.")
    ] = False,
    json_: Json = False,
) -> None:
    """Make eight practice groups with known answers, as the dataset practice; done once."""
    from app.review.practice.practice import make_practice_dataset

    keep_private()
    settings = read_settings()
    with opened_store(settings) as store, show_progress("Making the practice groups") as progress:
        made = make_practice_dataset(store, settings, progress, again=again, actor=acting())
    print_values(made, json_)


def ensure_sample(settings: Settings) -> None:
    """Make the dataset ``sample`` where it is missing or not complete."""
    if not _is_solved(settings, SAMPLE):
        _write_sample(settings.home / SAMPLE)
        _fill(settings, SAMPLE, settings.home / SAMPLE, None)


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
    from app.review.datasets.dataset import list_datasets

    with opened_store(settings) as store:
        found = next((item for item in list_datasets(store) if item.name == dataset), None)
    groups, solved = (found.groups, found.solved) if found else (0, 0)
    return {"dataset": dataset, "groups": groups, "solved": solved}


def _fill(settings: Settings, dataset: str, folder: Path, workers: int | None) -> None:
    """Import a folder in SoccerNet-v3 layout, and solve it."""
    from app.review.editing.recompute import solve_dataset
    from app.review.importing.sources import Source, import_source

    source = Source("soccernet-v3", folder.resolve())
    with opened_store(settings) as store:
        with show_progress("Importing") as progress:
            import_source(store, dataset, source, settings, progress)
        with executor_of(settings, workers) as executor, show_progress("Solving") as progress:
            solve_dataset(store, dataset, executor, progress)
