"""Commands on policies: show the one that judges a dataset, and set another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.terminal import remote
from app.terminal.options import POLICY_OR_FILE, Dataset, Json, get_current_actor, read_text
from app.terminal.server import ask_server, open_store
from app.terminal.terminal import print_json, print_values, say

if TYPE_CHECKING:
    from app.soccer.policy import Policy

commands = typer.Typer(help="The thresholds that judge a dataset.", no_args_is_help=True)


@commands.command()
def show(
    dataset: Dataset,
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="Write it there, not to stdout.")
    ] = None,
    json_: Json = False,
) -> None:
    """Print the policy of a dataset as YAML, ready for `policy set`."""
    text, values = ask_server(
        lambda client: remote.fetch_policy(client, dataset)
    ) or _read_local_policy(dataset)
    if file is not None:
        _write_text(file, text)
    if json_:
        print_json(values)
    elif file is None:
        say(text.rstrip("\n"))


@commands.command("set")
def set_(
    policy: Annotated[
        str, typer.Argument(metavar=POLICY_OR_FILE, help="Its name, or a file with it.")
    ],
    dataset: Dataset,
    json_: Json = False,
) -> None:
    """Judge a dataset by another policy; `solve` computes what that leaves out of date.

    A server computes it by itself.
    """
    from app.features.policies.service import change_policy
    from app.features.solutions.service import list_stale_groups

    chosen = read_policy_option(policy)
    job = ask_server(lambda client: remote.set_policy(client, dataset, chosen))
    if job is not None:
        print_values(remote.describe_policy_change(job), json_)
        return
    with open_store() as store:
        state = change_policy(store, dataset, chosen, if_match=None, actor=get_current_actor())
        stale = len(list_stale_groups(store, state.dataset_id))
    values = {
        **_policy_identity_values(state.dataset, state.policy),
        "version": state.version,
        "to_solve": stale,
    }
    print_values(values, json_)


def _read_local_policy(dataset: str) -> tuple[str, dict[str, Any]]:
    """The policy of a dataset in a home, as YAML and as values."""
    from app.features.policies.service import policy_to_values, policy_to_yaml, read_policy

    with open_store() as store:
        state = read_policy(store, dataset)
    history = [
        {"version": item.version, "name": item.policy.name, "hash": item.policy.hash}
        | {"at": item.at, "actor": item.actor}
        for item in state.history
    ]
    values = {"values": policy_to_values(state.policy), "history": history}
    head = {**_policy_identity_values(state.dataset, state.policy), "version": state.version}
    return policy_to_yaml(state.policy), {**head, **values}


def read_policy_option(text: str) -> Policy:
    """The policy that an option names: a shipped one by its name, or a YAML file.

    Raises:
        typer.BadParameter: It is neither.
        InputError: The file holds no policy.
    """
    from app.errors import InputError
    from app.features.policies.service import MAX_CHARACTERS, policy_from_yaml, unknown_policy_error
    from app.soccer.policy import POLICIES

    if text in POLICIES:
        return POLICIES[text]
    path = Path(text)
    if not path.is_file():
        raise typer.BadParameter(unknown_policy_error(text, "it is not a YAML file").message)
    yaml = read_text(path, MAX_CHARACTERS)
    try:
        return policy_from_yaml(yaml)
    except InputError as error:
        raise InputError(f"{path}: {error.message}", hint=error.hint) from error


def _policy_identity_values(dataset: str, policy: Policy) -> dict[str, str]:
    return {"dataset": dataset, "name": policy.name, "hash": policy.hash}


def _write_text(path: Path, text: str) -> None:
    from app.errors import StorageError

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StorageError(f"{path} cannot be written ({error.strerror})") from error
