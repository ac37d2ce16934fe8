"""Commands that make datasets with known truth: the sample, and the practice groups."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from app.durable import set_private_umask
from app.sample import GROUPS, RECORDING_SECONDS, SEED, SHORTEST_RECORDING, SampleOrder
from app.terminal.options import Json, Workers, get_current_actor, read_settings
from app.terminal.server import open_store
from app.terminal.terminal import print_values, show_progress

commands = typer.Typer()


@commands.command()
def sample(
    out: Annotated[
        Path | None, typer.Argument(help="Folder; with --dataset, by default one in the home.")
    ] = None,
    groups: Annotated[int, typer.Option(min=1, help="How many groups.")] = GROUPS,
    labels_only: Annotated[
        bool, typer.Option("--labels-only", help="Write labels without frames.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed; another one gives other groups.")] = SEED,
    no_faults: Annotated[bool, typer.Option("--no-faults", help="Plant no faults.")] = False,
    dataset: Annotated[
        str | None,
        typer.Option(help="Import and solve it, too, under this name; done once, nothing more."),
    ] = None,
    workers: Workers = None,
    json_: Json = False,
) -> None:
    """Write a synthetic dataset with known truth in SoccerNet-v3 layout."""
    from app.features.practice.service import SAMPLE, make_sample_dataset
    from app.workers.executors import open_executor

    if out is None and dataset is None:
        raise typer.BadParameter("name a folder to write to, or a dataset to fill")
    order = SampleOrder(groups, seed, labels_only, faults=not no_faults)
    if dataset is None:
        from app.sample.write import write_sample

        assert out is not None
        with show_progress("Drawing the sample") as progress:
            report = write_sample(out, **vars(order), progress=progress, workers=workers)
        print_values(vars(report), json_)
        return
    if out is None:
        set_private_umask()
    settings = read_settings()
    folder, pool = out or settings.home / SAMPLE, partial(open_executor, settings, workers)
    with (
        open_store(settings, may_create=True) as store,
        show_progress("Making the sample") as progress,
    ):
        made = make_sample_dataset(
            store,
            dataset,
            folder,
            order,
            pool,
            progress,
            workers=workers,
            actor=get_current_actor(),
        )
    written = vars(made.written) if made.written else {}
    values = {"dataset": made.dataset, "groups": made.groups, "solved": made.solved}
    print_values({**written, **values, "written": made.written is not None}, json_)


@commands.command("sample-recording")
def sample_recording(
    out: Annotated[Path, typer.Argument(help="The video to write, such as film.mp4.")],
    seconds: Annotated[
        float, typer.Option(min=SHORTEST_RECORDING, max=7200, help="How long it is.")
    ] = RECORDING_SECONDS,
    seed: Annotated[int, typer.Option(min=0, help="Seed; another one gives other play.")] = SEED,
    json_: Json = False,
) -> None:
    """Draw a recording of a match, with shots, replays and the ball known, in OUT and a JSON beside it."""
    from app.sample.recording import write_recording

    with show_progress("Drawing the recording") as progress:
        report = write_recording(out, seconds, seed, progress=progress)
    print_values(vars(report), json_)


@commands.command()
def practice(
    again: Annotated[
        bool, typer.Option("--again", help="Forget what was answered and begin afresh.")
    ] = False,
    json_: Json = False,
) -> None:
    """Make eight practice groups with known answers, as the dataset practice; done once."""
    from app.features.practice.service import make_practice_dataset

    set_private_umask()
    settings = read_settings()
    with (
        open_store(settings, may_create=True) as store,
        show_progress("Making the practice groups") as progress,
    ):
        made = make_practice_dataset(
            store, settings, progress, again=again, actor=get_current_actor()
        )
    print_values(made, json_)
