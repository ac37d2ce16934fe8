"""The command line: the second door, and the place where everything is put together.

A command (``app.commands``) parses, calls one function of a floor below, prints a table or JSON
and returns an exit code: 0 done, 1 it could not be done, 2 it was asked for in a wrong way.
Progress and complaints go to stderr. Heavy modules are imported inside the commands, so that
``--help`` is quick.
"""

from __future__ import annotations

import sys

import typer

from app.commands import (
    backup,
    datasets,
    doctor,
    evaluation,
    files,
    lines,
    noise,
    policy,
    predictions,
    rig,
    sample,
    service,
    solving,
    versions,
)
from app.commands.terminal import complain
from app.errors import ReviewError

app = typer.Typer(
    name="touchline",
    help="Turn multi-view soccer frames into a trusted 3D ball dataset.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
PARTS = (
    service,
    sample,
    files,
    solving,
    rig,
    lines,
    noise,
    versions,
    evaluation,
    predictions,
    doctor,
    backup,
)
for part in PARTS:
    app.add_typer(part.commands)
app.add_typer(datasets.commands, name="datasets")
app.add_typer(policy.commands, name="policy")


def main() -> None:
    """Entry point: what a caller can cause is one sentence on stderr and exit code 1."""
    try:
        app()
    except ReviewError as error:
        complain(error.message, error.hint)
        sys.exit(1)
