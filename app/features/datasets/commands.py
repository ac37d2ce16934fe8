"""Commands on datasets: list them, and delete one with everything that belongs to it."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from app.terminal.options import Json, get_current_actor
from app.terminal.remote import DATASET, fetch_datasets
from app.terminal.server import ask_server, open_store
from app.terminal.terminal import print_json, print_values, say

commands = typer.Typer(help="What datasets there are.", no_args_is_help=True)


@commands.command("list")
def list_(json_: Json = False) -> None:
    """List every dataset with its progress."""
    values = ask_server(fetch_datasets)
    if values is None:
        values = _read_local_datasets()
    if json_:
        print_json(values)
        return
    for value in values:
        say(
            f"{value['name']:30} {value['groups']:7} groups {value['solved']:7} solved "
            f"{value['accepted']:7} accepted   {value['policy']}"
        )


def _read_local_datasets() -> list[dict[str, Any]]:
    from app.features.datasets.service import list_datasets

    with open_store() as store:
        datasets = list_datasets(store)
    return [
        {**{name: getattr(item, name) for name in DATASET}, "policy": item.policy.name}
        for item in datasets
    ]


@commands.command()
def delete(
    name: Annotated[str, typer.Argument(help="Name of the dataset.")],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask for confirmation.")] = False,
    json_: Json = False,
) -> None:
    """Delete a dataset with everything that belongs to it; cannot be undone.

    Groups, annotations, verdicts, solutions, versions, predictions and evaluations go; the files
    that it was imported from, exports and the log stay.
    """
    from app.features.datasets.service import delete_dataset, read_contents

    with open_store() as store:
        contents = read_contents(store, name)
        typed = contents.name if yes else _prompt_for_dataset_name(contents.name, contents.counts)
        contents = delete_dataset(store, contents.id, confirm=typed, actor=get_current_actor())
    print_values({"deleted": contents.name, **contents.counts}, json_)


def _prompt_for_dataset_name(name: str, counts: dict[str, int]) -> str:
    """The name, typed once more by somebody who has read what goes."""
    there = ", ".join(f"{count} {word}" for word, count in counts.items() if count) or "nothing"
    say_what = f'"{name}" holds {there.replace("_", " ")}. Type its name to delete it for good'
    return str(typer.prompt(say_what, err=True))
